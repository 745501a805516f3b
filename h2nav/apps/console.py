"""The daemon's output: a live panel on a terminal, otherwise journal-style lines or JSON events."""

import os
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TextIO

from h2nav.apps.json_output import json_text
from h2nav.apps.panel import Sight, autopilot_attitude, euler_deg, panel_lines
from h2nav.apps.terminal_footer import TerminalFooter
from h2nav.apps.voice import Voice
from h2nav.attitude.samples import AttitudeEstimate, Quat
from h2nav.host.host_clock import UnixClock
from h2nav.integrity.findings import Finding, Phase, Severity, as_mapping
from h2nav.service.records import EstimateRecord, HealthRecord, StatusRecord, estimate_record
from h2nav.wire.deframer import Frame

REFRESH_NS = 200_000_000
EVENT_NS = 1_000_000_000
# An older estimate is not shown as the present attitude.
STALE_NS = 500_000_000


class Console:
    """Observes the pipeline and displays it.

    A terminal or pipe that is closed or not read loses output and never blocks the daemon.

    Args:
        events_as_json: write status events to standard output, one JSON document a line.
        stream: for people; standard error by default.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, events_as_json: bool = False, stream: TextIO | None = None) -> None:
        stream = sys.stderr if stream is None else stream
        self._sinks: list[Callable[[str], object]] = []
        if events_as_json:
            self.show_events(Voice(sys.stdout).say)
        self._lines = Voice(stream)
        self._footer = TerminalFooter(stream, self._lines) if _can_be_drawn_on(stream) else None
        self._is_journal = _is_journal(stream)
        self._clock = UnixClock()
        self._latest: AttitudeEstimate | None = None
        self._latest_ns = 0
        self._shown_ns = 0
        self._event_ns = 0
        self._about: dict[str, Any] = {}

    def show_events(self, say: Callable[[str], object]) -> None:
        """Also passes events to `say`, one JSON document per line."""
        self._sinks.append(say)

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Ignores frames."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Stores the estimate for panel and events."""
        self._latest, self._latest_ns = estimate, t_ns

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Shows a line above the panel."""
        self._event("notice", t_ns, {"severity": severity.word, "text": text})
        prefix = f"<{int(severity)}>" if self._is_journal else f"{severity.word}: "
        self._say(f"{prefix}{text}")

    def finding(self, t_ns: int, phase: Phase, finding: Finding) -> None:
        """Writes an event; people read the notice of its beginning."""
        self._event("finding", t_ns, {"phase": phase.value, **as_mapping(finding)})

    def flight(self, t_ns: int, about: dict[str, Any]) -> None:
        """Writes an event about the review of a flight."""
        self._event("flight", t_ns, about)

    def started(self, t_ns: int, about: dict[str, Any]) -> None:
        """Writes the first event of a run: program, configuration, link."""
        self._about = about
        self._event("started", t_ns, about)

    def catch_up(self, t_ns: int, sight: Sight, findings: Iterable[Finding]) -> list[str]:
        """Returns what a new client has missed: program, status, open findings.

        Args:
            sight: the current display; its status also carries the panel's lines.
        """
        status = {**_status(sight), "panel": panel_lines(sight, self._fresh(t_ns))}
        return [
            self._line("started", t_ns, self._about),
            self._line("status", t_ns, status),
            *(
                self._line("finding", t_ns, {"phase": Phase.UPDATE.value, **as_mapping(finding)})
                for finding in findings
            ),
        ]

    def status(self, t_ns: int, look: Callable[[int], Sight]) -> None:
        """Redraws the panel a few times a second; as JSON, writes an event each second.

        Args:
            look: returns the display at a time; called only if it is shown.
        """
        is_event = bool(self._sinks) and t_ns - self._event_ns >= EVENT_NS
        is_drawn = self._footer is not None and t_ns - self._shown_ns >= REFRESH_NS
        if not is_event and not is_drawn:
            return
        sight = look(t_ns)
        if is_event:
            self._event_ns = t_ns
            self._event("status", t_ns, _status(sight))
        if is_drawn and self._footer is not None:
            self._shown_ns = t_ns
            self._footer.draw(panel_lines(sight, self._fresh(t_ns)))

    def closing(self, t_ns: int, health: HealthRecord, log: Path | None) -> None:
        """Writes the last event and the summary of a run, and removes the panel."""
        if self._footer is not None:
            self._footer.remove()
        self._say(
            f"{health.samples_used} samples used, {health.samples_rejected} refused, "
            f"{health.estimates_sent} attitudes sent; {f'log: {log}' if log else 'no log'}"
        )
        values = {**health._asdict(), "log": None if log is None else str(log)}
        self._event("stopped", t_ns, values)

    def _say(self, line: str) -> None:
        if self._footer is not None:
            self._footer.above(line)
        else:
            self._lines.say(f"{line}\n")

    def _fresh(self, t_ns: int) -> EstimateRecord | None:
        """The newest estimate, unless it is stale."""
        if self._latest is None or t_ns - self._latest_ns > STALE_NS:
            return None
        return estimate_record(self._latest)

    def _event(self, name: str, t_ns: int, values: dict[str, Any]) -> None:
        if not self._sinks:
            return
        line = self._line(name, t_ns, values)
        for say in self._sinks:
            say(line)

    def _line(self, name: str, t_ns: int, values: dict[str, Any]) -> str:
        unix_s = round(self._clock.unix_ns(t_ns) * 1e-9, 3)
        event = {
            "event": name,
            "unix_s": unix_s,
            **values,
            "attitude": _attitude(self._fresh(t_ns)),
        }
        return json_text(event) + "\n"


def _attitude(record: EstimateRecord | None) -> dict[str, Any] | None:
    """The attitude of h2nav in the form of an event."""
    if record is None:
        return None
    q_nb = (record.q_w, record.q_x, record.q_y, record.q_z)
    return {
        "t_us": record.t_us,
        **_angles(q_nb),
        "sigma_tilt_deg": record.sigma_tilt_deg,
        "sigma_heading_deg": record.sigma_heading_deg,
    }


def _status(sight: Sight) -> dict[str, Any]:
    return {**sight.health._asdict(), **_compared(sight.status)}


def _compared(status: StatusRecord) -> dict[str, Any]:
    """The part of an event besides health: the other attitude and the alarms."""
    theirs = autopilot_attitude(status)
    origin = {"source": status.autopilot_source, "age_ms": status.autopilot_age_ms}
    return {
        "age_ms": status.age_ms,
        "autopilot_attitude": None if theirs is None else {**origin, **_angles(theirs)},
        "autopilot_sigma_tilt_deg": status.sigma_tilt_deg,
        "autopilot_sigma_heading_deg": status.sigma_heading_deg,
        "velocity_ratio": status.velocity_ratio,
        "force_ratio": status.force_ratio,
        "field_ratio": status.field_ratio,
        "turn_ratio": status.turn_ratio,
        "alarms": status.alarms.splitlines(),
        "open_findings": status.open_findings.split(),
    }


def _angles(q_nb: Quat) -> dict[str, Any]:
    roll_deg, pitch_deg, yaw_deg = euler_deg(q_nb)
    return {"roll_deg": roll_deg, "pitch_deg": pitch_deg, "yaw_deg": yaw_deg, "q_nb": q_nb}


def _can_be_drawn_on(stream: TextIO) -> bool:
    """Whether it is a terminal with a movable cursor."""
    return stream.isatty() and os.environ.get("TERM") != "dumb"


def _is_journal(stream: TextIO) -> bool:
    """Whether systemd has connected the stream to its journal.

    The variable alone does not suffice: every program started from a service inherits it.
    """
    try:
        status = os.fstat(stream.fileno())
    except OSError:
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"
