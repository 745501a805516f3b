"""Crashes, hard landings, and false crash checks of the autopilot."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
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
    Trait,
)
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.impacts import detect_crash_checks, detect_impacts
from h2nav.reviews.subjects import needs
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED
from h2nav.reviews.subjects.pilot import FLOWN_INTO_GROUND
from h2nav.reviews.subjects.struck import STRUCK

KINDS = (
    Declared(
        Kind.CRASH,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.CRITICAL,
            "m/s^2",
            "The vehicle hit something, or tipped over.",
            "What stands before it in time: control, motors, battery, sensors.",
        ),
        section="attitude",
        brought=(
            Brought(MOTORS_STOPPED, LEADS_S),
            Brought(STRUCK, LEADS_S),
            *(Brought(kind, LEADS_S) for kind in (Kind.MOTOR_FAILED, *FAILED_SENSORS)),
            Brought(Kind.MOTOR_SATURATED, MOTOR_LEADS_S),
            Brought(Kind.SAID_EKF_FAILED, BLIND_LEADS_S),
            Brought(Kind.BATTERY, LEADS_S),
            Brought(HEIGHT_LOST, HEIGHT_LEADS_S),
            Brought(FLOWN_INTO_GROUND, LEADS_S),
        ),
        traits=Trait.INDEPENDENT,
        shown_by=(
            "force and rate alone, in every armed span: after a blow, a steady force off the "
            "vertical axis; or a blow, a vehicle turned over, and no flight after it; or a "
            "descent that ends at once; below 30 samples a second without the blow, if it turned "
            "over and lies; what two sources show to climb or sink within 4 s does not lie"
        ),
        limit=(
            "30 deg (other than multirotors: 45 deg and at rest) after 2 g; 5 g and 2.5 times its "
            "vibration, in means of 20 ms; 70 deg within 2 s before"
        ),
    ),
    Declared(
        Kind.HARD_LANDING,
        Meaning(
            (SensorKind.VEHICLE,),
            Severity.WARNING,
            "m/s^2",
            "The vehicle hit the ground hard, upright.",
            "How fast it came down and why: throttle, battery, motors at their limit; then the "
            "frame.",
        ),
        phrase=lambda one: f"it {one.text} at {one.from_s:.0f} s",
        section="attitude",
        traits=Trait.INDEPENDENT,
        shown_by=(
            "as `crash`; or a descent that ends at once by two sources, after which the motors "
            "stop, or it keeps still"
        ),
        limit="without the blow: 4 m/s",
    ),
    Declared(
        Kind.AUTOPILOT_CRASH_CHECK,
        Meaning(
            (SensorKind.AUTOPILOT,),
            Severity.WARNING,
            "",
            "The autopilot says that the vehicle crashed; by its sensors it did not.",
            "Nothing on the vehicle; motors that run while it cannot move set this off.",
        ),
        phrase="the autopilot's crash check was false",
        follows=(Kind.GYRO_BIAS,),
        shown_by="its report, without a blow or a vehicle on its side within 15 s",
        limit="one",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `impacts`."""
    bins, blows = evidence.of(parts.bins), evidence.of(parts.blows)
    if bins is None:
        return []
    context = evidence.of(parts.recorded)
    # A vehicle that drives or swims lands nowhere: a bump leaves it upright, too.
    lands = not needs.lands(evidence)
    landed = [one for one in blows if one.is_crash or lands]
    return [
        *detect_impacts(landed),
        *detect_crash_checks(bins, context, blows),
    ]


SUBJECT = ReviewSubject(
    "crash and landing", KINDS, (*needs.ALWAYS, needs.armed, needs.impact), look
)
