"""What the autopilot said in flight."""

from h2nav.integrity import words
from h2nav.integrity.findings import Finding, Kind, SensorKind, Severity
from h2nav.integrity.kinds import Meaning
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import LEADS_S, Brought, Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.estimators import RELEASED, detect_texts
from h2nav.reviews.subjects import needs
from h2nav.reviews.subjects.flown_heading import FLOWN_HEADING

# A heading that follows a wrong field soon contradicts the receiver.
BY_FIELD = tuple(
    Brought(kind, LEADS_S) for kind in (FLOWN_HEADING, Kind.COMPASS_MOTORS, Kind.COMPASS_FIELD)
)

KINDS = (
    Declared(
        Kind.SAID_AIDING,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the EKF had no position",
        follows=(Kind.GPS_LOST, Kind.VIBRATION, Kind.CLIPPING),
    ),
    Declared(
        Kind.SAID_COMPASS,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the autopilot did not trust its compass",
        follows=(Kind.COMPASS_DEAD, Kind.COMPASS_STEP, Kind.VIBRATION, Kind.CLIPPING),
    ),
    Declared(
        Kind.SAID_CRASH,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the autopilot reported a crash or a loss of thrust",
        brought=tuple(
            Brought(kind, LEADS_S)
            for kind in (Kind.MOTOR_FAILED, Kind.MOTOR_SATURATED, Kind.BATTERY)
        ),
        follows=(Kind.AUTOPILOT_CRASH_CHECK,),
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.SAID_EKF_FAILED,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the EKF failsafe came",
        follows=(
            Kind.GYRO_BIAS,
            Kind.GYRO_FROZEN,
            Kind.GYRO_BIAS_STEP,
            Kind.GYRO_APART,
            Kind.COMPASS_STEP,
            Kind.GPS_JUMP,
            Kind.GPS_LOST,
            Kind.VIBRATION,
            Kind.CLIPPING,
        ),
        brought=BY_FIELD,
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
    ),
    Declared(
        Kind.SAID_FAILSAFE,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase=lambda one: one.text,
        traits=Trait.UPSET,
    ),
    Declared(
        RELEASED,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase=lambda one: one.text,
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.SAID_GPS_GLITCH,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the GPS glitched",
        follows=(
            Kind.GPS_LOST,
            Kind.GPS_JUMP,
            Kind.COMPASS_STEP,
            Kind.GYRO_BIAS_STEP,
            Kind.VIBRATION,
            Kind.CLIPPING,
        ),
        brought=BY_FIELD,
    ),
    Declared(
        Kind.SAID_SENSOR,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the autopilot reported a sensor or attitude fault",
        follows=(Kind.GYRO_BIAS, Kind.GYRO_FROZEN, Kind.VIBRATION, Kind.CLIPPING),
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.SAID_VIBRATION,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the autopilot reported vibration",
        follows=(Kind.VIBRATION,),
    ),
    Declared(
        Kind.SAID_YAW_RESET,
        Meaning((SensorKind.AUTOPILOT,), Severity.WARNING, "", "", words.SAID),
        phrase="the EKF reset its heading",
        follows=(Kind.COMPASS_STEP, Kind.VIBRATION, Kind.CLIPPING),
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """See `estimators`."""
    return detect_texts(evidence.of(parts.recorded))


SUBJECT = ReviewSubject(
    "texts of the autopilot", KINDS, (needs.times, needs.texts, needs.armed), look
)
