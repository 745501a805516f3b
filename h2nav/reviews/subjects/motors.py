"""Motors: failed, uneven, at their limit."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import (
    HEIGHT_LEADS_S,
    LEADS_S,
    Brought,
    Declared,
    FlightEvidence,
    ReviewSubject,
    Trait,
)
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.motors import detect_motors
from h2nav.reviews.subjects import needs
from h2nav.reviews.subjects.struck import STRUCK

KINDS = (
    Declared(
        Kind.MOTOR_FAILED,
        Meaning(
            (SensorKind.MOTOR,),
            Severity.CRITICAL,
            "us",
            "A motor gave no thrust although thrust was demanded, or full thrust unasked.",
            words.MOTOR,
        ),
        # A propeller that struck something.
        brought=(Brought(STRUCK, LEADS_S),),
        traits=Trait.EACH,
        shown_by=(
            "an output that is reassigned in flight; ArduPilot's thrust loss check; one motor at "
            "full demand, the others low, while the vehicle turns and the force falls, without a "
            "blow from the side; one motor braked alone while the vehicle turns and the force "
            "rises above what the outputs ask for"
        ),
        limit=(
            "98.5 % against 50 % for 0.3 s, 60 deg/s, 0.85 g; braked to half of its usual output "
            "for 0.5 s, 60 deg/s, 1.2 times the usual force and 1.15 times what is asked"
        ),
    ),
    Declared(
        Kind.MOTOR_IMBALANCE,
        Meaning(
            (SensorKind.MOTOR,),
            Severity.WARNING,
            "us",
            "One motor had to work harder than the others to hold the vehicle level.",
            words.MOTOR,
        ),
        # The autopilot holds what its gyro says level.
        void=(Kind.GYRO_BIAS,),
        traits=Trait.INDEPENDENT,
        shown_by=(
            "outputs in flight, less the part explained by lateral force, rates and their changes "
            "(wind, manoeuvres); off the ground, in each third of the flight; a note where "
            "another motor works less by as much, or of three motors: a load off the centre"
        ),
        limit=(
            "40 us above the mean of the others, shown with 95 % where each 5 s count as one "
            "observation, 30 us above the next, and the others about even"
        ),
    ),
    Declared(
        Kind.MOTOR_SATURATED,
        Meaning(
            (SensorKind.MOTOR,),
            Severity.ERROR,
            "%",
            "A motor was at its limit, so that the autopilot could not ask more of it.",
            "Weight against thrust, the battery, and damage on the motor that was at its limit.",
        ),
        brought=(
            Brought(Kind.BATTERY, LEADS_S),
            Brought(HEIGHT_LOST, HEIGHT_LEADS_S),
            Brought(STRUCK, LEADS_S),
        ),
        follows=(Kind.GYRO_BIAS,),
        traits=Trait.UPSET,
        shown_by="outputs off the ground against the range that the parameters give",
        limit="1 s, or 0.5 s shortly before a crash",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `motors`."""
    bins = evidence.of(parts.bins)
    if bins is None:
        return []
    return detect_motors(
        bins,
        evidence.of(parts.recorded),
        evidence.of(parts.crashes),
        evidence.of(parts.lifted),
    )


SUBJECT = ReviewSubject("motors", KINDS, (*needs.ALWAYS, needs.motors, needs.flight), look)
