"""Findings: faults with their times, sizes and evidence.

A check reports what is wrong at present (`Alarm`); the ledger turns alarms into findings with a
beginning and an end. The daemon reports them live, a replay lists them: there is no second
implementation. Everything else renders this record and decides nothing.
"""

from collections.abc import Iterable
from enum import StrEnum
from typing import Any, NamedTuple

from h2nav.integrity.kinds import AnyKind, Kind, SensorKind
from h2nav.integrity.severity import Severity

__all__ = ["Alarm", "Finding", "Findings", "Kind", "Phase", "Sensor", "SensorKind", "Severity"]

# A fault that returns within this time continues.
PAUSE_S = 10.0
# A level that stands at its limit crosses it again and again: one condition. It ends when the level
# has been within the limit for this long, and is the same one when it returns within the pause.
LEVELS = frozenset({Kind.VIBRATION, Kind.CLIPPING, Kind.CLIPPED_SAMPLES})
LINGER_S = 10.0
LEVEL_PAUSE_S = 300.0
# Per run; further ones are not kept. What comes and goes for days leaves the last places to errors.
MAX_FINDINGS, MAX_LESSER_FINDINGS = 500, 450
# A finding is reported again when it grows, and periodically for late clients.
UPDATE_S = 5.0
REPEAT_S = 60.0
GROWTH = 1.25
# Alarms are asked for five times a second; one that was absent for longer had ended.
GAP_S = 1.0
MOSTLY = 0.9

_NAMES = {SensorKind.IMU: "IMU", SensorKind.GPS: "GPS", SensorKind.AHRS2: "AHRS2"}


class Sensor(NamedTuple):
    """The subject of a finding."""

    kind: SensorKind  # of the sensor
    # from 1 if there are several; None if there is one, or if it is unknown which
    number: int | None = None
    # more of the same kind. With a number, they show the same; without one, it is one of
    # these.
    others: tuple[int, ...] = ()

    @property
    def name(self) -> str:
        """For people: ``GPS``, ``IMU 1``, ``IMU 1, IMU 2`` or ``IMU 1 or IMU 2``."""
        kind = _NAMES.get(self.kind, self.kind.value)
        if self.number is None and not self.others:
            return kind
        join = " or " if self.number is None else ", "
        return join.join(f"{kind} {number}" for number in self.numbers)

    @property
    def listed(self) -> str:
        """The numbers for people: ``1, 2``."""
        return ", ".join(map(str, self.numbers))

    @property
    def numbers(self) -> tuple[int, ...]:
        """All numbers named."""
        return self.others if self.number is None else (self.number, *self.others)


class Alarm(NamedTuple):
    """A present fault; its check has already waited until it lasted."""

    kind: Kind  # of the fault
    sensor: Sensor  # its subject
    severity: Severity  # of the fault
    size: float  # of the fault, in `unit`
    unit: str  # of the size; empty for a mere number
    text: str  # for people, one line of at most 42 characters if possible
    evidence: str  # the figures that show it
    degrades: bool = False  # the attitude that is sent cannot be trusted meanwhile
    since_s: float = 0.0  # its duration, s
    is_decided: bool = False  # the evidence shows the subject
    part: str = ""  # of the sensor, such as ``gyro z``; empty for the whole
    backs_us: bool | None = None  # see `Finding`
    clears_velocity: bool = False  # see `Finding`

    @property
    def notice(self) -> str:
        """The text, with the number of the IMU if there is one."""
        is_numbered = self.sensor.kind is SensorKind.IMU and self.sensor.number is not None
        return f"{self.sensor.name}: {self.text}" if is_numbered else self.text

    @property
    def cause(self) -> str:
        """Identifies the alarm while the figures in the text change."""
        return f"{self.kind} {self.sensor.name} {self.part}".rstrip()


class Finding(NamedTuple):
    """An alarm with its beginning and end, or a finding of the whole flight."""

    kind: AnyKind  # see `Alarm`
    sensor: Sensor  # see `Alarm`
    severity: Severity  # the worst so far
    from_s: float  # its beginning, s after the start of the run
    to_s: float  # when it last held
    size: float  # the largest, in `unit`
    unit: str  # see `Alarm`
    text: str  # see `Alarm`, of the most decided and largest state
    evidence: str  # see `Alarm`, of the same time
    id: str = ""  # stable within a run; empty before it has been given
    is_open: bool = False  # it has not ended
    cause: str | None = None  # `id` of the finding that it follows from; None if none
    # where two attitudes differ, whether a third witness confirms ours; None if none decides
    backs_us: bool | None = None
    # all causes of a contradiction were compared, and the velocity was not found to be false
    clears_velocity: bool = False

    @property
    def source(self) -> str:
        """The subject, for people."""
        return self.sensor.name


class Phase(StrEnum):
    """Why a finding is reported."""

    BEGIN = "begin"
    UPDATE = "update"  # it grew, its evidence is better, or it is repeated
    END = "end"


class Change(NamedTuple):
    """Changes since the previous update."""

    begun: list[Alarm]  # alarms that are new
    news: list[tuple[Phase, Finding]]  # findings to report, in the order of their beginning
    worse: list[Alarm]  # alarms that are more severe than their findings were


class _Entry:
    """A finding in the ledger.

    Attributes:
        finding: its present state.
    """

    __slots__ = (
        "_evidence",
        "_held_s",
        "_is_renewed",
        "_reported_s",
        "_reported_size",
        "_shown",
        "finding",
    )

    def __init__(self, t_s: float, alarm: Alarm, identity: str) -> None:
        self.finding = Finding(
            kind=alarm.kind,
            sensor=alarm.sensor,
            severity=alarm.severity,
            from_s=t_s - alarm.since_s,
            to_s=t_s,
            size=alarm.size,
            unit=alarm.unit,
            text=alarm.text,
            evidence=alarm.evidence,
            id=identity,
            is_open=True,
            backs_us=alarm.backs_us,
            clears_velocity=alarm.clears_velocity,
        )
        self._held_s, self._evidence = alarm.since_s, alarm.evidence
        self._shown = alarm.is_decided, alarm.size  # of the present text and evidence
        self._reported_s, self._reported_size, self._is_renewed = t_s, alarm.size, False

    def extend(self, t_s: float, alarm: Alarm) -> None:
        """Continues the finding, or reopens it."""
        found = self.finding
        passed_s = t_s - found.to_s
        self._held_s += passed_s if passed_s < GAP_S else 0.0
        severity, size = min(found.severity, alarm.severity), max(found.size, alarm.size)
        self._is_renewed |= severity < found.severity
        self.finding = found._replace(to_s=t_s, severity=severity, size=size, is_open=True)
        # A decision stays, however the size develops.
        shown = alarm.is_decided, alarm.size
        if shown > self._shown:
            self._is_renewed |= shown[0] > self._shown[0]
            self._shown, self._evidence = shown, alarm.evidence
            self.finding = self.finding._replace(
                text=alarm.text,
                backs_us=alarm.backs_us,
                clears_velocity=alarm.clears_velocity,
            )
        self.finding = self.finding._replace(evidence=self._evidence + self._share)

    @property
    def _share(self) -> str:
        """Of a level, the share of the time in which it was beyond its limit, for people."""
        found = self.finding
        share = self._held_s / max(found.to_s - found.from_s, GAP_S)
        return f"; {share:.0%} of this time" if found.kind in LEVELS and share < MOSTLY else ""

    def close(self) -> None:
        """Closes the finding."""
        self.finding = self.finding._replace(is_open=False)

    def is_due(self, t_s: float) -> bool:
        """Whether an open finding is to be reported again."""
        has_grown = self._is_renewed or self.finding.size > GROWTH * self._reported_size
        return t_s - self._reported_s >= (UPDATE_S if has_grown else REPEAT_S)

    def report(self, t_s: float) -> Finding:
        """The finding as reported now."""
        self._reported_s, self._reported_size, self._is_renewed = t_s, self.finding.size, False
        return self.finding


class Findings:
    """The ledger that turns alarms into findings.

    Attributes:
        alarms: present alarms.
    """

    def __init__(self) -> None:
        self._entries: list[_Entry] = []
        self._latest: dict[tuple[Kind, Sensor], list[int]] = {}  # at most one of each opinion
        self._open: frozenset[int] = frozenset()
        self._counts: dict[str, int] = {}
        self.alarms: tuple[Alarm, ...] = ()

    @property
    def all(self) -> tuple[Finding, ...]:
        """Every finding so far, in the order of their beginning."""
        return tuple(entry.finding for entry in self._entries)

    @property
    def open(self) -> tuple[Finding, ...]:
        """The open findings."""
        return tuple(self._entries[place].finding for place in sorted(self._open))

    def update(self, t_s: float, alarms: Iterable[Alarm]) -> Change:
        """Takes all present alarms.

        Args:
            alarms: at most one of each kind and sensor.
        """
        self.alarms = tuple(alarms)
        before = self._open
        begun, worse, places = [], [], set()
        for alarm in self.alarms:
            known = self._known(t_s, alarm)
            if known is not None and alarm.severity < self._entries[known].finding.severity:
                worse.append(alarm)
            place = self._place(t_s, alarm, known)
            if place is None:
                continue
            places.add(place)
            if known is None:
                begun.append(alarm)
        places |= {place for place in before - places if self._lingers(t_s, place)}
        self._open = frozenset(places)
        news = [
            (phase, self._entries[place].report(t_s))
            for place in sorted(before | self._open)
            if (phase := self._phase(t_s, place, before)) is not None
        ]
        return Change(begun, news, worse)

    def _phase(self, t_s: float, place: int, before: frozenset[int]) -> Phase | None:
        """The report due for a finding that is, or was, open."""
        entry = self._entries[place]
        if place not in self._open:
            entry.close()
            return Phase.END
        if place not in before:
            return Phase.BEGIN
        return Phase.UPDATE if entry.is_due(t_s) else None

    def _lingers(self, t_s: float, place: int) -> bool:
        """Whether an open finding without an alarm is not over yet."""
        finding = self._entries[place].finding
        return finding.kind in LEVELS and t_s - finding.to_s <= LINGER_S

    def _known(self, t_s: float, alarm: Alarm) -> int | None:
        """Index of the finding that an alarm continues; None if it begins one.

        That the other attitude is wrong does not continue that ours was.
        """
        pause_s = LEVEL_PAUSE_S if alarm.kind in LEVELS else PAUSE_S
        for place in self._latest.get((alarm.kind, alarm.sensor), ()):
            found = self._entries[place].finding
            if t_s - found.to_s <= pause_s and not _oppose(alarm, found):
                return place
        return None

    def _place(self, t_s: float, alarm: Alarm, known: int | None) -> int | None:
        """Index of an alarm's finding, continued or begun; None if there are too many."""
        if known is not None:
            self._entries[known].extend(t_s, alarm)
            return known
        is_error = alarm.severity <= Severity.ERROR
        if len(self._entries) >= (MAX_FINDINGS if is_error else MAX_LESSER_FINDINGS):
            return None
        place, key = len(self._entries), (alarm.kind, alarm.sensor)
        opposed = [
            one for one in self._latest.get(key, ()) if _oppose(alarm, self._entries[one].finding)
        ]
        self._latest[key] = [place, *opposed]
        identity = next_id(alarm.kind, alarm.sensor, self._counts)
        self._entries.append(_Entry(t_s, alarm, identity))
        return place


def _oppose(alarm: Alarm, found: Finding) -> bool:
    """Whether one backs our attitude and the other one that of the autopilot."""
    return {alarm.backs_us, found.backs_us} == {True, False}


def next_id(kind: AnyKind, sensor: Sensor, counts: dict[str, int]) -> str:
    """A new id, such as ``gyro_frozen.imu1.2`` for the second one of this kind and sensor.

    Args:
        counts: number of each so far; incremented.
    """
    stem = f"{kind}.{sensor.kind}{'_'.join(map(str, sensor.numbers))}"
    counts[stem] = counts.get(stem, 0) + 1
    return f"{stem}.{counts[stem]}"


def as_mapping(finding: Finding) -> dict[str, Any]:
    """The finding for JSON: times to the millisecond, the severity's word; see `finding_schema`."""
    return {
        "id": finding.id,
        "kind": finding.kind.value,
        "source": finding.sensor.name,
        "sensor": {
            "kind": finding.sensor.kind.value,
            "number": finding.sensor.number,
            "others": list(finding.sensor.others),
        },
        "severity": finding.severity.word,
        "from_s": round(finding.from_s, 3),
        "to_s": round(finding.to_s, 3),
        "is_open": finding.is_open,
        "size": round(finding.size, 3),
        "unit": finding.unit,
        "text": finding.text,
        "evidence": finding.evidence,
        "cause": finding.cause,
    }
