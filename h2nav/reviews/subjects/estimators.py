"""The autopilot's estimators."""

from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.estimators import detect_estimators
from h2nav.reviews.subjects import needs

KINDS = (
    Declared(
        Kind.ESTIMATOR_SWITCH,
        Meaning(
            (SensorKind.AUTOPILOT,),
            Severity.WARNING,
            "",
            "The autopilot changed to another of its estimators or IMUs in flight.",
            "What it left: the IMU or compass of that number.",
        ),
        phrase="the autopilot changed its estimator",
        section="difference",
        follows=(Kind.GYRO_BIAS, Kind.GYRO_FROZEN, Kind.VIBRATION, Kind.CLIPPING),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by="the autopilot's records or texts while armed",
        limit="5 deg of tilt, 15 deg of heading, 5 s",
    ),
    Declared(
        Kind.CORES_DIFFER,
        Meaning(
            (SensorKind.ESTIMATOR,),
            Severity.WARNING,
            "deg",
            "Estimators of the same autopilot contradict each other.",
            "The IMU and the compass that each of them uses.",
        ),
        phrase="the autopilot's estimators disagreed",
        section="difference",
        follows=(Kind.GYRO_BIAS, Kind.GYRO_FROZEN, Kind.VIBRATION, Kind.CLIPPING),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by="as `estimator_switch`",
    ),
    Declared(
        Kind.ATTITUDE_RESET,
        Meaning(
            (SensorKind.AUTOPILOT,),
            Severity.NOTICE,
            "deg",
            "The autopilot's attitude jumped although the vehicle did not turn.",
            "What it was reset by: compass, GPS, or a change of estimators at that time.",
        ),
        section="difference",
        follows=(
            Kind.GYRO_BIAS,
            Kind.COMPASS_DEAD,
            Kind.GYRO_FROZEN,
            Kind.COMPASS_STEP,
            Kind.VIBRATION,
            Kind.CLIPPING,
        ),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by=(
            "a turn from one attitude to the next that the gyro did not measure and that persists"
        ),
        limit="4 deg and the effect of timing",
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `estimators`."""
    track = evidence.of(parts.witness) or evidence.of(parts.soundest)
    return detect_estimators(
        evidence.of(parts.unharmed),
        track,
        evidence.of(parts.best),
        evidence.flight.findings,
        parts.at_rest(evidence, track),
    )


SUBJECT = ReviewSubject(
    "the autopilot's estimators", KINDS, (needs.times, needs.attitudes, needs.armed), look
)
