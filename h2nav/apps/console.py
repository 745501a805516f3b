"""What the daemon shows: a live line on a terminal, else journal-style lines or JSON events."""

import os
import sys
from pathlib import Path
from typing import Any, TextIO

from h2nav.apps.json_output import json_text
from h2nav.apps.voice import Voice
from h2nav.integrity.findings import Severity
from h2nav.io.deframer import Frame
from h2nav.service.records import EstimateRecord, HealthRecord

REFRESH_NS = 200_000_000
EVENT_NS = 1_000_000_000
ERASE_LINE = "\r\x1b[K"
USUAL_COLUMNS = 80


class Console:
    """Looks on at the pipeline and shows what happens.

    Nobody has to be there to read it: a terminal or pipe that goes away, or that nobody reads,
    costs the output, not the flight.

    Args:
        events_as_json: write status events to standard output, one JSON document a line.
        stream: where people read; standard error by default.
    """

    message_ids: frozenset[int] = frozenset()

    def __init__(self, events_as_json: bool = False, stream: TextIO | None = None) -> None:
        self._stream = sys.stderr if stream is None else stream
        self._events = Voice(sys.stdout) if events_as_json else None
        self._lines = Voice(self._stream)
        self._is_terminal = self._stream.isatty()
        self._is_journal = _is_journal(self._stream)
        self._latest: EstimateRecord | None = None
        self._shown_ns = 0
        self._event_ns = 0
        self._line = ""

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not shown."""

    def estimate(self, t_ns: int, record: EstimateRecord) -> None:
        """Remembers it for the live line."""
        self._latest = record

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Shows a line; the live line moves below it."""
        self._event("notice", {"severity": severity.name.lower(), "text": text})
        prefix = f"<{int(severity)}>" if self._is_journal else f"{severity.name.lower()}: "
        above = ERASE_LINE if self._line else ""
        self._lines.say(f"{above}{prefix}{text}\n{self._line}")

    def status(self, t_ns: int, health: HealthRecord) -> None:
        """Refreshes the live line a few times a second; as JSON, writes an event each second."""
        if self._events is not None and t_ns - self._event_ns >= EVENT_NS:
            self._event_ns = t_ns
            self._event("status", health._asdict())
        if self._is_terminal and t_ns - self._shown_ns >= REFRESH_NS:
            self._shown_ns = t_ns
            # A line that wraps could not be erased.
            self._line = self._status_line(health)[: _columns(self._stream) - 1]
            self._lines.say(ERASE_LINE + self._line)

    def closing(self, health: HealthRecord, log: Path | None) -> None:
        """The last event of a run, and what became of it; the last live line stays."""
        if self._line:
            self._lines.say("\n")
            self._line = ""
        self._lines.say(
            f"{health.samples_used} samples used, {health.samples_rejected} refused, "
            f"{health.estimates_sent} attitudes sent; {f'log: {log}' if log else 'no log'}\n"
        )
        self._event("stopped", {**health._asdict(), "log": None if log is None else str(log)})

    def _event(self, name: str, values: dict[str, Any]) -> None:
        if self._events is not None:
            self._events.say(json_text({"event": name, **values}) + "\n")

    def _status_line(self, health: HealthRecord) -> str:
        parts = [health.state]
        if health.reason:
            parts.append(f"({health.reason})")
        latest = self._latest
        if latest is not None:
            parts.append(
                f"roll {latest.roll_deg:+7.2f}  pitch {latest.pitch_deg:+7.2f}  "
                f"yaw {latest.yaw_deg:+7.2f} deg"
            )
        if health.autopilot_tilt_deg is not None and health.autopilot_heading_deg is not None:
            tilt_deg, heading_deg = health.autopilot_tilt_deg, health.autopilot_heading_deg
            parts.append(f"EKF: tilt {tilt_deg:.1f} heading {heading_deg:+.1f} deg")
        if health.imu_message:
            # 0 = not measured yet
            rate = f" {health.imu_rate_hz:.0f} Hz" if health.imu_rate_hz else ""
            parts.append(f"{health.imu_message}{rate}")
        parts.append(f"used {health.samples_used}  refused {health.samples_rejected}")
        return "  ".join(parts)


def _columns(stream: TextIO) -> int:
    try:
        known = os.get_terminal_size(stream.fileno()).columns
    except OSError:  # the terminal has gone
        known = 0
    # 0 where a terminal does not know its size
    return known or USUAL_COLUMNS


def _is_journal(stream: TextIO) -> bool:
    """Whether the stream is the one that systemd has connected to its journal.

    The variable alone says little: every program that is started from a service inherits it.
    """
    try:
        status = os.fstat(stream.fileno())
    except OSError:
        return False
    return os.environ.get("JOURNAL_STREAM") == f"{status.st_dev}:{status.st_ino}"
