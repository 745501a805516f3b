"""Kinds of findings, and what those of the checks in flight mean.

The kinds of the daemon are closed: programs may rely on them, and a finding of another kind fails
mypy. What only a whole flight shows is declared beside its subject (`h2nav.reviews.subjects`).
"""

from enum import StrEnum
from typing import NamedTuple

from h2nav.integrity import words
from h2nav.integrity.severity import Severity


class SensorKind(StrEnum):
    """Subjects of a finding."""

    IMU = "imu"
    GYRO = "gyro"
    COMPASS = "compass"
    GPS = "gps"
    BAROMETER = "barometer"
    BATTERY = "battery"
    MOTOR = "motor"
    VEHICLE = "vehicle"
    AUTOPILOT = "autopilot"
    AHRS2 = "ahrs2"
    ESTIMATOR = "estimator"
    LOG = "log"


class Kind(StrEnum):
    """The kinds of the daemon, and those of whole flights that programs know by these names.

    The value is the name in JSON, logs and events, and does not change.
    """

    ACCELEROMETER_APART = "accelerometer_apart"
    ACCELEROMETER_BIAS = "accelerometer_bias"
    ACCELEROMETER_BIAS_STEP = "accelerometer_bias_step"
    ACCELEROMETER_FROZEN = "accelerometer_frozen"
    ACCELEROMETER_SCALE = "accelerometer_scale"
    ATTITUDE_GRAVITY = "attitude_gravity"
    ATTITUDE_RESET = "attitude_reset"
    ATTITUDE_VELOCITY = "attitude_velocity"
    AUTOPILOT_CRASH_CHECK = "autopilot_crash_check"
    AUTOPILOT_HEADING = "autopilot_heading"
    AUTOPILOT_TILT = "autopilot_tilt"
    AXIS_STUCK = "axis_stuck"
    BARO = "baro"
    BATTERY = "battery"
    CLIPPED_SAMPLES = "clipped_samples"
    CLIPPING = "clipping"
    CLOCK_DRIFT = "clock_drift"
    CLOCK_JUMP = "clock_jump"
    COMPASS_DEAD = "compass_dead"
    COMPASS_FIELD = "compass_field"
    COMPASS_FROZEN = "compass_frozen"
    COMPASS_HARD_IRON = "compass_hard_iron"
    COMPASS_MOTORS = "compass_motors"
    COMPASS_SCALE = "compass_scale"
    COMPASS_SOFT_IRON = "compass_soft_iron"
    COMPASS_STEP = "compass_step"
    COMPASSES_DIFFER = "compasses_differ"
    CORES_DIFFER = "cores_differ"
    CRASH = "crash"
    ESTIMATOR_SWITCH = "estimator_switch"
    GNSS_JAMMED = "gnss_jammed"
    GNSS_SPOOFED = "gnss_spoofed"
    GPS_ACCURACY = "gps_accuracy"
    GPS_FROZEN = "gps_frozen"
    GPS_JUMP = "gps_jump"
    GPS_LAG = "gps_lag"
    GPS_LOST = "gps_lost"
    GPS_SATELLITES = "gps_satellites"
    GPS_VELOCITY = "gps_velocity"
    GYRO_APART = "gyro_apart"
    GYRO_BIAS = "gyro_bias"
    GYRO_BIAS_STEP = "gyro_bias_step"
    GYRO_FIELD = "gyro_field"
    GYRO_FROZEN = "gyro_frozen"
    GYRO_SCALE = "gyro_scale"
    HARD_LANDING = "hard_landing"
    IMU_FROZEN = "imu_frozen"
    IMU_GAPS = "imu_gaps"
    IMU_SLOW = "imu_slow"
    IMU_TOO_SLOW = "imu_too_slow"
    IMU_TWICE = "imu_twice"
    LATE_BURSTS = "late_bursts"
    LOG_PAUSED = "log_paused"
    LOSS_OF_CONTROL = "loss_of_control"
    MOTOR_FAILED = "motor_failed"
    MOTOR_IMBALANCE = "motor_imbalance"
    MOTOR_SATURATED = "motor_saturated"
    SAID_AIDING = "said_aiding"
    SAID_COMPASS = "said_compass"
    SAID_CRASH = "said_crash"
    SAID_EKF_FAILED = "said_ekf_failed"
    SAID_FAILSAFE = "said_failsafe"
    SAID_GPS_GLITCH = "said_gps_glitch"
    SAID_SENSOR = "said_sensor"
    SAID_VIBRATION = "said_vibration"
    SAID_YAW_RESET = "said_yaw_reset"
    VELOCITY_LOST = "velocity_lost"
    VIBRATION = "vibration"
    VIBRATION_LEVEL = "vibration_level"
    VIBRATION_LINE = "vibration_line"


class FlightKind(str):
    """A kind that only a whole flight shows; the value is its name, as with `Kind`."""

    __slots__ = ()

    @property
    def value(self) -> str:
        """The name in JSON."""
        return str(self)


AnyKind = Kind | FlightKind


class Meaning(NamedTuple):
    """The meaning of a kind."""

    sensors: tuple[SensorKind, ...]  # possible subjects
    worst: Severity  # its worst severity
    # of the size; several, separated by `` | ``, if each finding names its own; empty for a
    # mere number
    unit: str
    means: str  # its meaning for a pilot, without unexplained terms
    check: str  # what to check next


_ERROR, _WARNING = Severity.ERROR, Severity.WARNING
_IMU, _COMPASS, _GPS = (SensorKind.IMU,), (SensorKind.COMPASS,), (SensorKind.GPS,)
_OTHERS = (SensorKind.AUTOPILOT, SensorKind.AHRS2)

# Of the kinds of the checks in flight.
MEANINGS: dict[Kind, Meaning] = {
    Kind.ACCELEROMETER_BIAS_STEP: Meaning(
        _IMU,
        _WARNING,
        "m/s^2",
        "The accelerometer began to show a force that the vehicle's motion does not have.",
        "Its mounting and temperature; a step that comes again is a failing sensor.",
    ),
    Kind.ACCELEROMETER_FROZEN: Meaning(_IMU, _ERROR, "s", words.FROZEN, words.SENSOR),
    Kind.ATTITUDE_GRAVITY: Meaning(
        _IMU,
        _ERROR,
        "deg",
        "By this attitude the vehicle would have accelerated farther than it can.",
        "Gyro and accelerometer at this time.",
    ),
    Kind.ATTITUDE_VELOCITY: Meaning(
        _GPS,
        _ERROR,
        "deg",
        "The accelerations that the attitude implies are not those that the GPS receiver measured: "
        "either the attitude was wrong, or the GPS velocity.",
        "Gyro, accelerometer and GPS at this time; which one is wrong shows in the pictures.",
    ),
    Kind.AUTOPILOT_HEADING: Meaning(
        _OTHERS,
        _WARNING,
        "deg",
        "The autopilot's heading and ours were farther apart than both can be uncertain.",
        "The autopilot's compasses; the evidence says whom the GPS velocity supports.",
    ),
    Kind.AUTOPILOT_TILT: Meaning(
        _OTHERS,
        _WARNING,
        "deg",
        "The autopilot's roll or pitch and ours were farther apart than both can be uncertain.",
        "The autopilot's accelerometers and vibration; the evidence says whom GPS supports.",
    ),
    Kind.AXIS_STUCK: Meaning(
        _IMU, _ERROR, "s", "One axis repeated itself while others moved.", words.SENSOR
    ),
    Kind.CLIPPED_SAMPLES: Meaning(_IMU, _WARNING, "", words.CLIPPED, words.VIBRATION),
    Kind.CLIPPING: Meaning(_IMU, _ERROR, "%", words.CLIPPED, words.VIBRATION),
    Kind.COMPASS_FIELD: Meaning(
        _COMPASS,
        _ERROR,
        "deg",
        f"{words.COMPASS_WRONG} If it turns about the vertical, a wrong yaw rate may have done it.",
        words.MAGNET,
    ),
    Kind.COMPASS_FROZEN: Meaning(_IMU, _WARNING, "s", words.FROZEN, words.SENSOR),
    Kind.COMPASSES_DIFFER: Meaning(
        _COMPASS,
        _ERROR,
        "deg",
        "Two compasses of the vehicle point to different norths: one of them is turned, or iron is "
        "near it.",
        "Each compass's orientation (ArduPilot: COMPASS_ORIENT) and calibration; do not take off "
        "while nothing shows which one is right.",
    ),
    Kind.GNSS_JAMMED: Meaning(
        _GPS,
        _WARNING,
        "",
        "The receiver reported that something drowned the signals of the satellites.",
        "Transmitters on board (video, telemetry, LTE) and their distance to the antenna; then the "
        "place.",
    ),
    Kind.GNSS_SPOOFED: Meaning(
        _GPS,
        _WARNING,
        "m | s | ",  # of a way, or of a jump of time; by a receiver's word the size is its state
        "Position and velocity of the receiver moved as the vehicle did not: the signals were not "
        "those of the satellites.",
        "The place and time of the flight; fly by attitude and height alone while it lasts.",
    ),
    Kind.GPS_VELOCITY: Meaning(
        _GPS,
        _WARNING,
        "m/s | ",  # in flight the size is how much more probable a false velocity is
        "The receiver's velocity is not the vehicle's motion by its IMU.",
        words.RECEIVER,
    ),
    Kind.GYRO_BIAS_STEP: Meaning(_IMU, _WARNING, "deg/s", "The gyro's zero jumped.", words.BIAS),
    Kind.GYRO_FIELD: Meaning(
        (SensorKind.GYRO,),
        _ERROR,
        "deg",
        "The gyro said that the earth's field and gravity turned, which they do not: a wrong gyro.",
        words.SENSOR,
    ),
    Kind.GYRO_FROZEN: Meaning(_IMU, _ERROR, "s", words.FROZEN, words.SENSOR),
    Kind.IMU_FROZEN: Meaning(_IMU, _ERROR, "s", words.FROZEN, words.SENSOR),
    Kind.VELOCITY_LOST: Meaning(
        (SensorKind.GPS, SensorKind.AUTOPILOT),
        _WARNING,
        "s",
        "Nothing measured how the vehicle moved: in long manoeuvres its attitude is less sure.",
        words.RECEIVER,
    ),
    Kind.VIBRATION: Meaning(_IMU, _WARNING, "m/s2", words.SHAKEN, words.VIBRATION),
}
