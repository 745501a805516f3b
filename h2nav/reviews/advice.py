"""The section of pictures that shows each kind of finding; `integrity.kinds` has the meaning."""

from h2nav.integrity.findings import Kind

# Kinds without a section are shown on the time line.
SECTIONS = {
    "timing": (
        Kind.ACCELEROMETER_FROZEN,
        Kind.CLOCK_DRIFT,
        Kind.CLOCK_JUMP,
        Kind.GYRO_FROZEN,
        Kind.IMU_FROZEN,
        Kind.IMU_GAPS,
        Kind.IMU_SLOW,
        Kind.IMU_TOO_SLOW,
        Kind.IMU_TWICE,
        Kind.LATE_BURSTS,
        Kind.LOG_PAUSED,
    ),
    "vibration": (
        Kind.AXIS_STUCK,
        Kind.CLIPPED_SAMPLES,
        Kind.CLIPPING,
        Kind.VIBRATION,
        Kind.VIBRATION_LEVEL,
    ),
    "compass": (
        Kind.COMPASS_DEAD,
        Kind.COMPASS_FIELD,
        Kind.COMPASS_FROZEN,
        Kind.COMPASS_HARD_IRON,
        Kind.COMPASS_MOTORS,
        Kind.COMPASS_SCALE,
        Kind.COMPASS_SOFT_IRON,
        Kind.COMPASS_STEP,
    ),
    "innovations": (
        Kind.ATTITUDE_GRAVITY,
        Kind.ATTITUDE_VELOCITY,
        Kind.GYRO_FIELD,
    ),
    "gps": (
        Kind.GPS_ACCURACY,
        Kind.GPS_FROZEN,
        Kind.GPS_JUMP,
        Kind.GPS_LAG,
        Kind.GPS_LOST,
        Kind.GPS_SATELLITES,
        Kind.GPS_VELOCITY,
        Kind.VELOCITY_LOST,
    ),
    "bias": (
        Kind.ACCELEROMETER_APART,
        Kind.ACCELEROMETER_BIAS,
        Kind.ACCELEROMETER_BIAS_STEP,
        Kind.ACCELEROMETER_SCALE,
        Kind.GYRO_APART,
        Kind.GYRO_BIAS,
        Kind.GYRO_BIAS_STEP,
        Kind.GYRO_SCALE,
    ),
    "difference": (
        Kind.ATTITUDE_RESET,
        Kind.AUTOPILOT_HEADING,
        Kind.AUTOPILOT_TILT,
        Kind.CORES_DIFFER,
        Kind.ESTIMATOR_SWITCH,
    ),
    "attitude": (
        Kind.CRASH,
        Kind.LOSS_OF_CONTROL,
        Kind.HARD_LANDING,
    ),
    "spectra": (Kind.VIBRATION_LINE,),
}
_PLACES = {kind: section for section, kinds in SECTIONS.items() for kind in kinds}


def place(kind: Kind) -> str:
    """Name of the section."""
    return _PLACES.get(kind, "timeline")
