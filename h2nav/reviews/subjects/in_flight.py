"""The kinds of the checks in flight, as a review shows them."""

from h2nav.integrity.findings import Finding, Kind
from h2nav.integrity.kinds import MEANINGS
from h2nav.reviews.declared import Declared, FlightEvidence, ReviewSubject, Trait
from h2nav.reviews.subjects.health import SENSOR_DEAD

KINDS = (
    Declared(
        Kind.ACCELEROMETER_BIAS_STEP,
        MEANINGS[Kind.ACCELEROMETER_BIAS_STEP],
        phrase="an accelerometer's bias jumped",
        void=(Kind.VIBRATION, Kind.VIBRATION_LEVEL),
        section="bias",
        traits=Trait.UPSET,
        shown_by=(
            "residual of the receiver's acceleration after the force, over 4 s before and after, "
            "the attitude propagated by the gyro alone"
        ),
        limit=(
            "0.5 m/s^2, and three deviations of receiver, gyro and vibration; a fixed share of "
            "the vehicle's acceleration; not if another IMU jumps alike; with a single IMU only "
            "as evidence of `gps_velocity`. The vertical is seen only if the receiver measures it"
        ),
    ),
    Declared(
        Kind.ACCELEROMETER_FROZEN,
        MEANINGS[Kind.ACCELEROMETER_FROZEN],
        phrase="an accelerometer froze",
        section="timing",
    ),
    Declared(
        Kind.ATTITUDE_GRAVITY,
        MEANINGS[Kind.ATTITUDE_GRAVITY],
        section="innovations",
        follows=(
            Kind.GYRO_BIAS,
            Kind.ACCELEROMETER_SCALE,
            Kind.GYRO_FROZEN,
            Kind.IMU_TOO_SLOW,
        ),
        traits=Trait.ABOUT_US | Trait.UPSET,
    ),
    Declared(
        Kind.ATTITUDE_VELOCITY,
        MEANINGS[Kind.ATTITUDE_VELOCITY],
        section="innovations",
        follows=(
            Kind.GNSS_SPOOFED,
            Kind.GYRO_BIAS,
            Kind.ACCELEROMETER_SCALE,
            Kind.GYRO_FROZEN,
            Kind.IMU_TOO_SLOW,
            Kind.VIBRATION,
        ),
        traits=Trait.ABOUT_US | Trait.UPSET,
    ),
    Declared(
        Kind.AUTOPILOT_HEADING,
        MEANINGS[Kind.AUTOPILOT_HEADING],
        phrase="the autopilot's heading was wrong",
        section="difference",
        follows=(
            Kind.GNSS_SPOOFED,
            Kind.GYRO_BIAS,
            Kind.COMPASS_DEAD,
            Kind.GYRO_FROZEN,
            Kind.IMU_TOO_SLOW,
            Kind.COMPASS_STEP,
        ),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by="as `autopilot_tilt`",
    ),
    Declared(
        Kind.AUTOPILOT_TILT,
        MEANINGS[Kind.AUTOPILOT_TILT],
        phrase="the autopilot's roll or pitch was wrong",
        section="difference",
        follows=(
            Kind.GNSS_SPOOFED,
            Kind.GYRO_BIAS,
            Kind.GYRO_FROZEN,
            Kind.IMU_TOO_SLOW,
        ),
        traits=Trait.ABOUT_ESTIMATOR | Trait.UPSET,
        shown_by="difference to the best attitude; not where the witness has reported it in flight",
        limit="15 s",
    ),
    Declared(
        Kind.AXIS_STUCK,
        MEANINGS[Kind.AXIS_STUCK],
        phrase="an axis of an IMU was stuck",
        section="vibration",
    ),
    Declared(
        Kind.CLIPPED_SAMPLES,
        MEANINGS[Kind.CLIPPED_SAMPLES],
        phrase="the accelerometer clipped",
        section="vibration",
        follows=(Kind.VIBRATION,),
        shown_by="samples beyond 15.5 g while armed",
        limit="100 samples",
    ),
    Declared(
        Kind.CLIPPING,
        MEANINGS[Kind.CLIPPING],
        phrase="the accelerometer clipped",
        section="vibration",
        follows=(Kind.VIBRATION,),
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.COMPASS_FIELD,
        MEANINGS[Kind.COMPASS_FIELD],
        phrase="the compass was disturbed",
        section="compass",
        follows=(
            Kind.COMPASS_DEAD,
            Kind.IMU_TOO_SLOW,
            Kind.COMPASS_SCALE,
            Kind.COMPASS_HARD_IRON,
            Kind.COMPASS_MOTORS,
            Kind.VIBRATION,
            Kind.COMPASS_STEP,
        ),
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.COMPASS_FROZEN,
        MEANINGS[Kind.COMPASS_FROZEN],
        phrase="the compass froze",
        section="compass",
        follows=(Kind.COMPASS_DEAD,),
    ),
    Declared(Kind.COMPASSES_DIFFER, MEANINGS[Kind.COMPASSES_DIFFER]),
    Declared(
        Kind.GNSS_JAMMED,
        MEANINGS[Kind.GNSS_JAMMED],
        phrase="satellite navigation was jammed",
        section="gps",
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.GNSS_SPOOFED,
        MEANINGS[Kind.GNSS_SPOOFED],
        phrase="satellite navigation was spoofed",
        section="gps",
        traits=Trait.UPSET,
    ),
    Declared(
        Kind.GPS_VELOCITY,
        MEANINGS[Kind.GPS_VELOCITY],
        phrase="the GPS velocity was wrong",
        section="gps",
        follows=(
            Kind.GNSS_JAMMED,
            Kind.GNSS_SPOOFED,
            Kind.ACCELEROMETER_SCALE,
            Kind.IMU_TOO_SLOW,
            Kind.VIBRATION,
        ),
        traits=Trait.UPSET,
        shown_by=(
            "the same over 1, 3 and 10 s; not if it fits within the receiver's noise over 10 s "
            "once heading and a little tilt are free (`receiver_fit.py`); a note where the "
            "comparison of all causes in flight did not find the velocity to be false"
        ),
        limit=(
            "three times noise, tilt, accelerometer's bias, timing, vibration, and a course that "
            "the receiver holds below 1 m/s, together"
        ),
    ),
    Declared(
        Kind.GYRO_BIAS_STEP,
        MEANINGS[Kind.GYRO_BIAS_STEP],
        phrase="a gyro's bias jumped",
        void=(Kind.VIBRATION, Kind.VIBRATION_LEVEL),
        section="bias",
        shown_by="as `gyro_bias`",
    ),
    Declared(
        Kind.GYRO_FIELD,
        MEANINGS[Kind.GYRO_FIELD],
        section="innovations",
        follows=(
            Kind.GYRO_BIAS,
            Kind.GYRO_FROZEN,
            Kind.IMU_TOO_SLOW,
        ),
        traits=Trait.ABOUT_US | Trait.UPSET,
    ),
    Declared(
        Kind.GYRO_FROZEN,
        MEANINGS[Kind.GYRO_FROZEN],
        phrase="a gyro froze",
        section="timing",
        follows=(SENSOR_DEAD,),
    ),
    Declared(
        Kind.IMU_FROZEN,
        MEANINGS[Kind.IMU_FROZEN],
        phrase="an IMU froze",
        section="timing",
        follows=(SENSOR_DEAD,),
    ),
    Declared(
        Kind.VELOCITY_LOST,
        MEANINGS[Kind.VELOCITY_LOST],
        section="gps",
        follows=(Kind.GPS_LOST, Kind.GNSS_JAMMED),
        traits=Trait.ABOUT_RECORDING,
    ),
    Declared(
        Kind.VIBRATION,
        MEANINGS[Kind.VIBRATION],
        section="vibration",
        traits=Trait.UPSET,
        shown_by=(
            "differences of neighbouring force samples, which keep their size at any rate, "
            "against the same flight; with VIBE and clips where logged"
        ),
        limit=(
            "5 m/s^2; three times the level before and 1.5 m/s^2, for 5 s; 2.5 times and 3 m/s^2 "
            "on one axis; twice and 2.5 m/s^2 in most samples, for 2 s, far above all before"
        ),
    ),
)


def look(evidence: FlightEvidence) -> list[Finding]:
    """None of its own: the checks in flight have looked."""
    return []


SUBJECT = ReviewSubject("checks in flight", KINDS, (), look, is_told=False)
