"""Summarises the service's own records: states, refusals, findings, differences to the autopilot.

The records are not trusted: a record in another form is skipped, and no log makes the summary
exceed its limits.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import orjson

from h2nav.integrity.severity import Severity
from h2nav.maths.units import SECOND_NS

MAX_STATES = 1000
MAX_REASONS = 500
MAX_FINDINGS = 1000
MAX_SOURCES = 20


class StateSpan(NamedTuple):
    """A period in one state."""

    state: str  # of `HealthRecord`
    reason: str  # why the state was not active, with the figures at its beginning; empty if active
    from_s: float  # since the start of the log
    to_s: float  # the start of the next state, or the last record


class LoggedDifference(NamedTuple):
    """The largest differences to one attitude of the autopilot."""

    source: str  # of the attitude, as in `ComparisonRecord`
    compared: int  # number of comparisons
    tilt_deg: float  # largest angle between the verticals
    tilt_at_s: float  # its time since the start of the log
    tilt_verdict: str  # the tilt that the GPS velocity supported then
    heading_deg: float  # largest difference of headings, autopilot minus h2nav, signed
    heading_at_s: float  # its time
    heading_verdict: str  # the heading that the GPS velocity supported then


class LogAccount(NamedTuple):
    """The whole summary."""

    states: list[StateSpan]  # in order; at most `MAX_STATES`
    refusals: dict[str, int]  # reason -> number of samples or messages
    # the newest ``/finding`` record of each, sorted by beginning; times are seconds since the
    # start of the run, severities are names. ``ended`` says whether the finding was closed
    # when the log ended.
    findings: list[dict[str, Any]]
    differences: list[LoggedDifference]  # one per source, by its name


class Account:
    """Collects the records of a log, passed in order; times in UNIX ns."""

    def __init__(self) -> None:
        self._takers = {
            "/health": self._take_health,
            "/rejected": self._take_rejection,
            "/finding": self._take_finding,
            "/comparison": self._take_comparison,
        }
        self._states: list[tuple[str, str, int, int]] = []
        self._refusals: dict[str, int] = {}
        self._findings: dict[tuple[str, ...], dict[str, Any]] = {}
        self._cause = "", ""
        self._differences: dict[str, tuple[LoggedDifference, int, int]] = {}

    @property
    def topics(self) -> frozenset[str]:
        """The topics that `take` evaluates."""
        return frozenset(self._takers)

    def take(self, topic: str, log_ns: int, data: bytes) -> None:
        """Adds a JSON message of one of the `topics`."""
        try:
            values = orjson.loads(data)
        except orjson.JSONDecodeError:
            return
        if isinstance(values, dict):
            self._takers[topic](log_ns, values)

    def result(self, start_ns: int) -> LogAccount:
        """Returns the summary; `start_ns` is the beginning of the log."""

        def since_start(t_ns: int) -> float:
            return (t_ns - start_ns) / SECOND_NS

        states = [
            StateSpan(state, reason, since_start(from_ns), since_start(to_ns))
            for state, reason, from_ns, to_ns in self._states
        ]
        differences = [
            found._replace(tilt_at_s=since_start(tilt_ns), heading_at_s=since_start(heading_ns))
            for _, (found, tilt_ns, heading_ns) in sorted(self._differences.items())
        ]
        findings = sorted(self._findings.values(), key=lambda finding: float(finding["from_s"]))
        return LogAccount(states, self._refusals, findings, differences)

    def _take_health(self, log_ns: int, values: Mapping[str, Any]) -> None:
        state, reason = _text(values.get("state")), _text(values.get("reason"))
        # The oldest logs have no cause: their periods are those of the state.
        cause = _text(values.get("cause"))
        if self._states:
            self._states[-1] = (*self._states[-1][:3], log_ns)
            if (state, cause) == self._cause:
                return
        self._cause = state, cause
        if state and len(self._states) < MAX_STATES:
            self._states.append((state, reason, log_ns, log_ns))

    def _take_rejection(self, _: int, values: Mapping[str, Any]) -> None:
        reason, total = _text(values.get("reason")), values.get("total")
        if not isinstance(total, int) or isinstance(total, bool):
            return
        if reason in self._refusals or len(self._refusals) < MAX_REASONS:
            self._refusals[reason] = max(total, self._refusals.get(reason, 0))

    def _take_finding(self, _: int, values: dict[str, Any]) -> None:
        from_s = _number(values.get("from_s"))
        if math.isnan(from_s):
            return
        key: tuple[str, ...] = (_text(values.get("id")),)
        if not key[0]:
            key = _text(values.get("kind")), _text(values.get("source")), repr(from_s)
        known = self._findings.get(key)
        if known is not None or len(self._findings) < MAX_FINDINGS:
            severity = Severity.of(values.get("severity"))
            # Logs of findings without an id have one record at the beginning and one at the end.
            toggled = known is not None and not known["ended"]
            is_open = values.get("is_open")
            self._findings[key] = {
                **values,
                "severity": "unknown" if severity is None else severity.word,
                "ended": not is_open if isinstance(is_open, bool) else toggled,
            }

    def _take_comparison(self, log_ns: int, values: Mapping[str, Any]) -> None:
        source = _text(values.get("source"))
        tilt, heading = _number(values.get("tilt_deg")), _number(values.get("heading_deg"))
        known = self._differences.get(source)
        if known is None:
            if len(self._differences) == MAX_SOURCES:
                return
            known = (
                LoggedDifference(source, 0, math.nan, 0.0, "", math.nan, 0.0, ""),
                log_ns,
                log_ns,
            )
        found, tilt_ns, heading_ns = known
        found = found._replace(compared=found.compared + 1)
        if tilt > found.tilt_deg or math.isnan(found.tilt_deg):
            found = found._replace(tilt_deg=tilt, tilt_verdict=_text(values.get("tilt_verdict")))
            tilt_ns = log_ns
        if abs(heading) > abs(found.heading_deg) or math.isnan(found.heading_deg):
            verdict = _text(values.get("heading_verdict"))
            found = found._replace(heading_deg=heading, heading_verdict=verdict)
            heading_ns = log_ns
        self._differences[source] = (found, tilt_ns, heading_ns)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else ""


def _number(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else math.nan
