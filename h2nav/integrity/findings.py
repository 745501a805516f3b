"""Findings: what is wrong, from when to when, how large it is, and what shows it.

A check says what is wrong at present (`Alarm`); the ledger makes findings of it, with a beginning
and an end. The daemon reports them live, a replay lists them: there is no second implementation.
"""

from collections.abc import Iterable
from enum import IntEnum
from typing import NamedTuple

# A cause that comes back within this time goes on.
PAUSE_S = 10.0
# Of a whole run; the later ones are counted and not kept.
MOST_FINDINGS = 500


class Severity(IntEnum):
    """MAV_SEVERITY, as far as it is used here."""

    CRITICAL = 2
    ERROR = 3
    WARNING = 4
    NOTICE = 5
    INFO = 6


class Alarm(NamedTuple):
    """Something that is wrong now; its check has already waited until it lasted.

    Attributes:
        kind: stable name, such as ``gyro_frozen``.
        source: what is concerned, such as ``IMU 1``, ``GPS`` or ``autopilot``.
        severity: of it.
        size: how wrong, in `unit`.
        unit: of the size; empty for a mere number.
        text: for people, one line of at most 42 characters where it can be so short.
        evidence: what shows it.
        degrades: the attitude that we send cannot be trusted meanwhile.
        since_s: for how long it has been so, s.
    """

    kind: str
    source: str
    severity: Severity
    size: float
    unit: str
    text: str
    evidence: str
    degrades: bool = False
    since_s: float = 0.0

    @property
    def told(self) -> str:
        """The text, with the number of the IMU where one is concerned."""
        return f"{self.source}: {self.text}" if self.source.startswith("IMU ") else self.text


class Change(NamedTuple):
    """What has changed since the update before.

    Attributes:
        begun: what was not wrong before.
        news: findings that have just begun or ended.
    """

    begun: list[Alarm]
    news: list["Finding"]


class Finding(NamedTuple):
    """An alarm with its beginning and its end.

    Attributes:
        kind: see `Alarm`.
        source: see `Alarm`.
        severity: the worst that it was.
        from_s: when it began, s after the start of the run.
        to_s: when it was last so.
        size: the largest, in `unit`.
        unit: see `Alarm`.
        text: see `Alarm`, at its largest.
        evidence: see `Alarm`, at its largest.
    """

    kind: str
    source: str
    severity: Severity
    from_s: float
    to_s: float
    size: float
    unit: str
    text: str
    evidence: str


class Findings:
    """Makes findings of alarms.

    Attributes:
        omitted: findings that were not kept, because there were too many.
    """

    def __init__(self) -> None:
        self._found: list[Finding] = []
        self._latest: dict[tuple[str, str], int] = {}
        self._open: tuple[Alarm, ...] = ()
        self.omitted = 0

    @property
    def all(self) -> tuple[Finding, ...]:
        """Every finding so far, in the order in which they began."""
        return tuple(self._found)

    @property
    def open(self) -> tuple[Alarm, ...]:
        """What is wrong at present."""
        return self._open

    def update(self, t_s: float, alarms: Iterable[Alarm]) -> Change:
        """Takes everything that is wrong now.

        Args:
            t_s: time since the start of the run.
            alarms: at most one of each kind and source.
        """
        before = {_key(alarm) for alarm in self._open}
        self._open = tuple(alarms)
        now = {_key(alarm) for alarm in self._open}
        begun = [alarm for alarm in self._open if self._note(t_s, alarm)]
        changed = [self._latest[key] for key in before ^ now if key in self._latest]
        return Change(begun, [self._found[place] for place in sorted(changed)])

    def _note(self, t_s: float, alarm: Alarm) -> bool:
        key = _key(alarm)
        place = self._latest.get(key)
        if place is not None and t_s - self._found[place].to_s <= PAUSE_S:
            self._found[place] = _extended(self._found[place], t_s, alarm)
            return False
        if len(self._found) == MOST_FINDINGS:
            self.omitted += 1
            return False
        self._latest[key] = len(self._found)
        kind, source, severity, size, unit, text, evidence, _, since_s = alarm
        self._found.append(
            Finding(kind, source, severity, t_s - since_s, t_s, size, unit, text, evidence)
        )
        return True


def _key(alarm: Alarm) -> tuple[str, str]:
    return alarm.kind, alarm.source


def _extended(finding: Finding, t_s: float, alarm: Alarm) -> Finding:
    severity = min(finding.severity, alarm.severity)
    if alarm.size <= finding.size:
        return finding._replace(to_s=t_s, severity=severity)
    return finding._replace(
        to_s=t_s,
        severity=severity,
        size=alarm.size,
        text=alarm.text,
        evidence=alarm.evidence,
    )


def as_mapping(finding: Finding) -> dict[str, object]:
    """For JSON: times to the millisecond, the severity by its name."""
    rounded = finding._replace(
        from_s=round(finding.from_s, 3), to_s=round(finding.to_s, 3), size=round(finding.size, 3)
    )
    return {**rounded._asdict(), "severity": finding.severity.name.lower()}
