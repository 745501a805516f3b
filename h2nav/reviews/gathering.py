"""Gathers the findings of a review, from flight and analysis, each once, with ids."""

from collections.abc import Iterable, Mapping, Sequence

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity, next_id
from h2nav.integrity.kinds import AnyKind
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.declared import Trait
from h2nav.reviews.flight import Flight
from h2nav.reviews.subjects import KINDS

# Findings of sensors of one kind within this time, and of similar size, are merged.
SAME_TIME_S, SAME_SHARE = 2.0, 0.25
# What the checks in flight say, and what the whole log shows better.
EXPLAINED_BY: Mapping[AnyKind, Sequence[AnyKind]] = {
    Kind.VELOCITY_LOST: (Kind.GPS_LOST, Kind.GPS_FROZEN),
    Kind.GPS_FROZEN: (Kind.GPS_FROZEN,),
    Kind.GPS_VELOCITY: (Kind.GPS_FROZEN,),
}


def all_findings(flight: Flight, analysis: Analysis) -> tuple[Finding, ...]:
    """All findings, worst first; of a receiver's silence the one that says why."""
    live = [
        analysis.judged.get(one.id, one)
        for one in flight.findings
        if not any(
            other.kind in EXPLAINED_BY.get(one.kind, ()) and _overlap(one, other)
            for other in analysis.findings
        )
    ]
    both = _valid(_continued([*live, *dict.fromkeys(analysis.findings)]))
    found = identified(merged(both))
    return tuple(sorted(found, key=lambda one: (one.severity, one.from_s, one.kind)))


def _valid(findings: list[Finding]) -> list[Finding]:
    """Those whose evidence no other finding takes away."""
    serious = [one for one in findings if one.severity <= Severity.WARNING]
    return [
        one
        for one in findings
        if not any(
            other.kind in KINDS[one.kind].void and _lasts(other, one) and _concerns(other, one)
            for other in serious
        )
    ]


def _lasts(other: Finding, one: Finding) -> bool:
    return Trait.INDEPENDENT in KINDS[other.kind].traits or _overlap(one, other)


def _concerns(other: Finding, one: Finding) -> bool:
    """Whether both are about the same sensor, or about sensors that are not numbered alike."""
    kinds = {SensorKind.IMU, SensorKind.GYRO, SensorKind.COMPASS}
    numbers = set(one.sensor.numbers), set(other.sensor.numbers)
    is_numbered = {one.sensor.kind, other.sensor.kind} <= kinds and all(numbers)
    return not is_numbered or bool(numbers[0] & numbers[1])


def _continued(findings: list[Finding]) -> list[Finding]:
    """The checks in flight see a vibration late: it is the one that the whole flight shows."""
    found: list[Finding] = []
    for one in sorted(findings, key=lambda one: one.from_s):
        place = next((i for i, other in enumerate(found) if _continues(one, other)), None)
        if place is None:
            found.append(one)
            continue
        first = found[place]
        found[place] = first._replace(
            severity=min(first.severity, one.severity),
            to_s=max(first.to_s, one.to_s),
            evidence=f"{first.evidence}; {one.text}: {one.evidence}",
        )
    return found


def _continues(one: Finding, other: Finding) -> bool:
    is_same = one.kind is other.kind is Kind.VIBRATION and one.sensor == other.sensor
    return is_same and _overlap(one, other)


def merged(findings: Iterable[Finding]) -> list[Finding]:
    """Merges findings that several sensors of one kind show alike at the same time.

    Differing evidence is kept.
    """
    found: list[Finding] = []
    shown: list[list[Finding]] = []  # what each is made of
    for one in findings:
        place = next((i for i, other in enumerate(found) if _is_same(other, one)), None)
        if place is None:
            found.append(one)
            shown.append([one])
        else:
            found[place] = _joined(found[place], one)
            shown[place].append(one)
    return [
        one._replace(evidence=_evidence(*parts)) for one, parts in zip(found, shown, strict=True)
    ]


def identified(findings: Iterable[Finding]) -> list[Finding]:
    """Gives ids to findings without one."""
    some, counts = list(findings), dict[str, int]()
    used = {one.id for one in some}
    for place, one in enumerate(some):
        identity = one.id
        while not identity:
            new = next_id(one.kind, one.sensor, counts)
            identity = "" if new in used else new
        some[place] = one._replace(id=identity)
    return some


def _joined(one: Finding, other: Finding) -> Finding:
    largest = max(one, other, key=lambda each: each.size)
    number, others = one.sensor.number, (*one.sensor.others, *other.sensor.numbers)
    sensor = one.sensor._replace(number=number, others=tuple(sorted(others)))
    return largest._replace(
        id=one.id,
        sensor=sensor,
        from_s=min(one.from_s, other.from_s),
        to_s=max(one.to_s, other.to_s),
    )


def _evidence(first: Finding, *others: Finding) -> str:
    """What several show, the same only once."""
    if not others:
        return first.evidence
    alike = [one.evidence == first.evidence for one in others]
    parts = [first.evidence if all(alike) else f"{first.sensor.name}: {first.evidence}"]
    parts += [
        f"{one.sensor.name} alike" if is_alike else f"{one.sensor.name}: {one.evidence}"
        for one, is_alike in zip(others, alike, strict=True)
    ]
    return "; ".join(parts)


def _overlap(one: Finding, other: Finding) -> bool:
    return one.from_s <= other.to_s and other.from_s <= one.to_s


def _is_same(one: Finding, other: Finding) -> bool:
    """Whether both are of one kind and time, from different sensors of the same kind."""
    if (one.kind, one.severity, one.unit) != (other.kind, other.severity, other.unit):
        return False
    numbers = one.sensor.number, other.sensor.number
    is_other = None not in numbers and other.sensor.number not in one.sensor.numbers
    if one.sensor.kind is not other.sensor.kind or not is_other:
        return False
    is_then = max(abs(one.from_s - other.from_s), abs(one.to_s - other.to_s)) <= SAME_TIME_S
    return is_then and abs(one.size - other.size) <= SAME_SHARE * abs(one.size)
