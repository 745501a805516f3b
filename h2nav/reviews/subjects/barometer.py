"""The barometer."""

import math

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.recordings.context import Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import LEADS_S, Brought, Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.heights import HEIGHT_LOST, detect_heights, heights
from h2nav.reviews.subjects import needs, receiver
from h2nav.reviews.supply import detect_barometer

KINDS = (
    Declared(
        Kind.BARO,
        Meaning(
            (SensorKind.BAROMETER,),
            Severity.ERROR,
            "m",
            "The barometer's height is not the height of the vehicle.",
            "Foam over the barometer, its wiring and bus, and the propellers' wash.",
        ),
        phrase=lambda one: one.text if one.size else "the barometer failed",
        traits=Trait.UPSET,
        shown_by="the autopilot's reports; leaps; a step, or a drift, that the receiver's altitude "
        "and vertical velocity (without a receiver: the estimator) do not show",
        limit=(
            "30 m at once; a step of 8 m against two, 25 m against the estimator alone; a drift "
            "of 25 m for 10 s, or of 10 m within 40 s; each beyond the dynamic pressure, v^2 / 2 g"
        ),
    ),
    Declared(
        HEIGHT_LOST,
        Meaning(
            (SensorKind.ESTIMATOR,),
            Severity.WARNING,
            "m",
            "The autopilot's own height was far from what barometer and GPS measured.",
            "Vibration and clipping first: they turn the accelerometer's integral into a climb.",
        ),
        phrase=lambda one: f"{one.text} from {one.from_s:.0f} s on",
        follows=(Kind.ACCELEROMETER_SCALE,),
        brought=tuple(
            Brought(kind, LEADS_S)
            for kind in (
                Kind.VIBRATION,
                Kind.CLIPPING,
                Kind.CLIPPED_SAMPLES,
                Kind.VIBRATION_LEVEL,
                Kind.BARO,
            )
        ),
        shown_by=(
            "its height against the barometer's, while the receiver's altitude agrees with that"
        ),
        limit="5 m for 1 s",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `supply` and `heights`."""
    found = detect_barometer(evidence.of(parts.recorded))
    context = evidence.of(parts.unharmed)
    known = heights(context, evidence.of(parts.vertical), _doubted(evidence))
    if known is None:
        return found
    shown = detect_heights(known, context, evidence.of(parts.lifted))
    # What the heights show says more than a report of it.
    return [*shown, *(one for one in found if one.kind not in {each.kind for each in shown})]


def _doubted(evidence: FlightEvidence) -> tuple[Span, ...]:
    """Since the first receiver contradicted itself or the IMU: an offset leaves no trace."""
    if not evidence.of(parts.receivers):
        return ()
    wrong_s = [
        one.from_s
        for one in evidence.of(receiver.look)
        if one.kind in (Kind.GPS_VELOCITY, Kind.GPS_JUMP)
        and one.severity <= Severity.WARNING
        and one.sensor.number is None
    ]
    return (Span(min(wrong_s), math.inf, "doubted"),) if wrong_s else ()


SUBJECT = ReviewSubject("barometer", KINDS, (needs.times, needs.barometer, needs.armed), look)
