"""Compasses against the earth's field."""

from collections.abc import Iterator

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.compass import detect_compass, strangeness
from h2nav.reviews.dead_compass import detect_dead
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait, numbered
from h2nav.reviews.subjects import needs
from h2nav.reviews.tracks import CompassFit, FieldTrack


def _stepped(one: Finding) -> str:
    if len(one.sensor.numbers) < 2:
        return "a magnetic disturbance came or went"
    return (
        f"{numbered('compass', one.sensor.numbers)} changed together at {one.from_s:.0f} s, while "
        "the attitude by gyro and velocity stayed"
    )


KINDS = (
    Declared(
        Kind.COMPASS_DEAD,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.ERROR,
            "s",
            "The compass measured nothing: no heading is possible with it.",
            words.SENSOR,
        ),
        phrase=lambda one: f"{numbered('compass', one.sensor.numbers)} measured nothing",
        section="compass",
        traits=Trait.INDEPENDENT | Trait.EACH,
        shown_by="rows that never change, from first to last; it is not examined further",
        limit="50 rows, 5 s; with a field other than zero, while a gyro turns by 5 deg",
    ),
    Declared(
        Kind.COMPASS_HARD_IRON,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.WARNING,
            "mG",
            "A field that is fixed to the vehicle adds to the earth's.",
            words.MAGNET,
        ),
        phrase="the compass was not calibrated",
        section="compass",
        void=(Kind.COMPASS_MOTORS,),
        shown_by=(
            "strength and vertical part of the field alone, over at least a third of a circle of "
            "headings: a heading that was wrong from the start does not matter"
        ),
        limit="10 deg of heading; 15 % of scale; five deviations of the fit",
    ),
    Declared(
        Kind.COMPASS_SOFT_IRON,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.WARNING,
            "%",
            "Iron near the compass bends the field.",
            words.MAGNET,
        ),
        phrase="the compass was not calibrated",
        section="compass",
        void=(Kind.COMPASS_MOTORS,),
        shown_by="as `compass_hard_iron`",
    ),
    Declared(
        Kind.COMPASS_SCALE,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.WARNING,
            "%",
            "The compass measures a field of the wrong strength.",
            "Calibrate it again.",
        ),
        phrase="the compass was not calibrated",
        section="compass",
        void=(Kind.COMPASS_MOTORS,),
        shown_by="as `compass_hard_iron`",
    ),
    Declared(
        Kind.COMPASS_STEP,
        Meaning(
            (SensorKind.COMPASS,),
            Severity.WARNING,
            "mG",
            "A field that is fixed to the vehicle came or went.",
            words.MAGNET,
        ),
        phrase=_stepped,
        section="compass",
        traits=Trait.UPSET,
        shown_by="steps of the field fixed to the body",
        limit=(
            "12 % of the earth's field within 2 s; a note with the throttle, or if strength and "
            "dip stay and it turned by less than three deviations of our heading"
        ),
    ),
)

# A compass that is blamed is off from the earth's field by this share of the worst one at least.
WORSE = 0.8
# A field that differs about the vertical alone is the earth's, within this share of its size: a
# wrong heading of ours, or a turned compass.
EARTHLY = 0.15

Looked = tuple[FieldTrack | None, CompassFit | None, list[Finding]]


def compasses(evidence: FlightEvidence) -> tuple[Looked, ...]:
    """Each compass: its field over time, its fit, and what they say."""
    context, flight = evidence.of(parts.in_order), evidence.flight
    is_px4 = "PX4" in f"{flight.autopilot} {context.firmware}"
    return tuple(
        detect_compass(
            track,
            evidence.of(parts.best),
            flight.earth,
            context,
            is_raw=is_px4 and "SCALED" in track.source,
        )
        for track in evidence.of(parts.field_tracks)
    )


def judged(evidence: FlightEvidence) -> tuple[Finding, ...]:
    """Findings in flight that name a compass, undecided where strength and dip do not show it.

    Strength and dip of the whole time of the finding show it, which the check could not wait for.
    """
    fields = {field.compass + 1: field for field, _, _ in evidence.of(compasses) if field}
    found = [*_turned(evidence, fields)]
    for one in evidence.flight.findings:
        number = one.sensor.number
        if one.kind is not Kind.COMPASSES_DIFFER or number not in fields or len(fields) < 2:
            continue
        apart = {other: strangeness(field, one) for other, field in fields.items()}
        if apart[number] < WORSE * max(apart.values()):
            sensor = one.sensor._replace(number=None, others=tuple(sorted(fields)))
            words = f"compasses differ by {one.size:.0f} deg"
            shown = ", ".join(f"{other}: {share:.0%}" for other, share in sorted(apart.items()))
            evidence_ = f"which one is wrong is open: strength and dip are off by ({shown})"
            found.append(one._replace(sensor=sensor, text=words, evidence=evidence_))
    return tuple(found)


def _turned(evidence: FlightEvidence, fields: dict[int, FieldTrack]) -> Iterator[Finding]:
    """Fields in flight that are the earth's but for their direction about the vertical, as notes.

    So are those of a place that is unknown, where no field is known to be the earth's.
    """
    if not fields and len(evidence.flight.earth.t_s):
        return  # a dead compass shows none
    for one in evidence.flight.findings:
        if one.kind is Kind.COMPASS_FIELD:
            apart = [strangeness(field, one) for field in fields.values()]
            if not any(share > EARTHLY for share in apart):
                yield one._replace(severity=Severity.NOTICE)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `dead_compass` and `compass`."""
    found = detect_dead(evidence.of(parts.dead_rows))
    fits = (one for _, _, own in evidence.of(compasses) for one in own)
    return [*found, *(one for one in fits if one.kind is not Kind.COMPASS_MOTORS)]


SUBJECT = ReviewSubject("compasses", KINDS, (needs.times, needs.compass), look)
