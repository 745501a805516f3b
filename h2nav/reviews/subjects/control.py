"""Loss of control."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.control import detect_control, without_touches
from h2nav.reviews.declared import (
    BLIND_LEADS_S,
    FAILED_SENSORS,
    HEIGHT_LEADS_S,
    LEADS_S,
    MOTOR_LEADS_S,
    Brought,
    Declared,
    FlightEvidence,
    ReviewSubject,
)
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.subjects import needs
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED
from h2nav.reviews.subjects.oscillation import OSCILLATION
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND
from h2nav.reviews.subjects.struck import STRUCK

KINDS = (
    Declared(
        Kind.LOSS_OF_CONTROL,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.CRITICAL,
            "deg",
            "The attitude left its demand, and the motors could not bring it back.",
            "What came first: a motor at its limit, a sensor, the estimator, or the demand itself.",
        ),
        section="attitude",
        follows=(Kind.GYRO_BIAS,),
        brought=(
            Brought(MOTORS_STOPPED, LEADS_S),
            Brought(STRUCK, LEADS_S),
            Brought(Kind.MOTOR_FAILED, MOTOR_LEADS_S),
            *(Brought(kind, LEADS_S) for kind in FAILED_SENSORS),
            Brought(Kind.MOTOR_SATURATED, MOTOR_LEADS_S),
            Brought(Kind.SAID_EKF_FAILED, BLIND_LEADS_S),
            Brought(HEIGHT_LOST, HEIGHT_LEADS_S),
            Brought(FLOWN_INTO_GROUND, LEADS_S),
            Brought(OSCILLATION, LEADS_S),
        ),
        shown_by=(
            "the autopilot's attitude against its demand, both known five times a second, while it "
            "flies and turns; without a demand, the gyro; below 45 samples a second not what lies "
            "as high as it was half a second before the blow: it had touched"
        ),
        limit="20 deg until an impact; 45 deg for 1 s off the ground without one",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `control`."""
    bins = evidence.of(parts.bins)
    if bins is None:
        return []
    context, crashes = evidence.of(parts.recorded), evidence.of(parts.crashes)
    found = detect_control(bins, context, crashes, evidence.of(parts.lifted))
    if evidence.of(parts.rate_hz) >= needs.BLOW_HZ:
        return found
    return without_touches(found, context, crashes)


SUBJECT = ReviewSubject(
    "attitude against its demand", KINDS, (*needs.ALWAYS, needs.demand, needs.armed), look
)
