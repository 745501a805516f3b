"""Every kind of finding: its meaning, what to check, its unit, its subject.

The list is closed: programs may rely on it, and a finding of another kind fails mypy.
"""

from enum import StrEnum
from typing import NamedTuple

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
    """The kinds; the value is the name in JSON, logs and events, and does not change."""

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


class Meaning(NamedTuple):
    """The meaning of a kind."""

    sensors: tuple[SensorKind, ...]  # possible subjects
    worst: Severity  # its worst severity
    # of the size; several, separated by `` | ``, if each finding names its own; empty for a
    # mere number
    unit: str
    means: str  # its meaning for a pilot, without unexplained terms
    check: str  # what to check next


_FROZEN = "The sensor repeated itself while the vehicle moved: it had stopped measuring."
_SENSOR = "The sensor's wiring, bus and supply; if it comes back, replace the sensor."
_MAGNET = (
    "Magnets, motors and wires with high current near the compass; move the compass away "
    "from them, calibrate it again, or rely on another one."
)
_SHAKEN = "Shaking this strong makes the autopilot's accelerometer hard to use."
_VIBRATION = (
    "Propellers (balance, damage), motor bearings, loose parts, and how the autopilot is mounted."
)
_CLIPPED = "Samples at the end of the sensor's range: the true values were larger."
_RECEIVER = "The antenna's view of the sky and its distance to cameras, transmitters and USB 3."
_BIAS = "Calibrate the sensor again, with temperature if it can be; if it stays so, replace it."
_LINK = "The recording's rate and the processor's load; what was lost cannot be judged."
_COMPASS_WRONG = (
    "What the compass measured is not the earth's field at this place (World Magnetic Model), "
    "so a heading by this compass is wrong."
)
_SAID = "The autopilot's documentation of this message, and the pictures at that time."
_MOTOR = "Propeller, motor, bearing, speed controller and their wires, by hand and by a test bench."

_ERROR, _WARNING, _NOTICE, _INFO = (
    Severity.ERROR,
    Severity.WARNING,
    Severity.NOTICE,
    Severity.INFO,
)
_IMU, _COMPASS, _GPS = (SensorKind.IMU,), (SensorKind.COMPASS,), (SensorKind.GPS,)
_AUTOPILOT, _MOTORS = (SensorKind.AUTOPILOT,), (SensorKind.MOTOR,)
_OTHERS = (SensorKind.AUTOPILOT, SensorKind.AHRS2)
_VEHICLE = (SensorKind.VEHICLE,)

MEANINGS: dict[Kind, Meaning] = {
    Kind.ACCELEROMETER_APART: Meaning(
        _IMU, _WARNING, "m/s^2", "One accelerometer disagrees with its neighbours.", _SENSOR
    ),
    Kind.ACCELEROMETER_BIAS: Meaning(
        _IMU, _WARNING, "m/s^2", "At rest it does not measure gravity.", _BIAS
    ),
    Kind.ACCELEROMETER_BIAS_STEP: Meaning(
        _IMU,
        _WARNING,
        "m/s^2",
        "The accelerometer began to show a force that the vehicle's motion does not have.",
        "Its mounting and temperature; a step that comes again is a failing sensor.",
    ),
    Kind.ACCELEROMETER_FROZEN: Meaning(_IMU, _ERROR, "s", _FROZEN, _SENSOR),
    Kind.ACCELEROMETER_SCALE: Meaning(
        _IMU, _ERROR, "mg", "At rest it does not measure gravity.", _BIAS
    ),
    Kind.ATTITUDE_GRAVITY: Meaning(
        _IMU,
        _ERROR,
        "deg",
        "By this attitude the vehicle would have accelerated farther than it can.",
        "Gyro and accelerometer at this time.",
    ),
    Kind.ATTITUDE_RESET: Meaning(
        _AUTOPILOT,
        _NOTICE,
        "deg",
        "The autopilot's attitude jumped although the vehicle did not turn.",
        "What it was reset by: compass, GPS, or a change of estimators at that time.",
    ),
    Kind.ATTITUDE_VELOCITY: Meaning(
        _GPS,
        _ERROR,
        "deg",
        "The accelerations that the attitude implies are not those that the GPS receiver measured: "
        "either the attitude was wrong, or the GPS velocity.",
        "Gyro, accelerometer and GPS at this time; which one is wrong shows in the pictures.",
    ),
    Kind.AUTOPILOT_CRASH_CHECK: Meaning(
        _AUTOPILOT,
        _WARNING,
        "",
        "The autopilot says that the vehicle crashed; by its sensors it did not.",
        "Nothing on the vehicle; motors that run while it cannot move set this off.",
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
        _IMU, _ERROR, "s", "One axis repeated itself while others moved.", _SENSOR
    ),
    Kind.BARO: Meaning(
        (SensorKind.BAROMETER,),
        _ERROR,
        "m",
        "The barometer's height is not the height of the vehicle.",
        "Foam over the barometer, its wiring and bus, and the propellers' wash.",
    ),
    Kind.BATTERY: Meaning(
        (SensorKind.BATTERY,),
        _ERROR,
        "V",
        "The battery could not hold its voltage, or the autopilot said that it is low.",
        "The battery's age and charge, its plugs and wires, and the calibration of the sensor.",
    ),
    Kind.CLIPPED_SAMPLES: Meaning(_IMU, _WARNING, "", _CLIPPED, _VIBRATION),
    Kind.CLIPPING: Meaning(_IMU, _ERROR, "%", _CLIPPED, _VIBRATION),
    Kind.CLOCK_DRIFT: Meaning(
        _IMU, _NOTICE, "ppm", "The clocks of recorder and autopilot run apart.", _LINK
    ),
    Kind.CLOCK_JUMP: Meaning(
        _IMU,
        _WARNING,
        "s",
        "The stamps of the samples leapt, the samples did not: something set the clock.",
        "What sets the autopilot's time, and the stamps of its messages.",
    ),
    Kind.COMPASS_DEAD: Meaning(
        _COMPASS,
        _ERROR,
        "s",
        "The compass measured nothing: no heading is possible with it.",
        _SENSOR,
    ),
    Kind.COMPASS_FIELD: Meaning(
        _COMPASS,
        _ERROR,
        "deg",
        f"{_COMPASS_WRONG} If it turns about the vertical, a wrong yaw rate may have done it.",
        _MAGNET,
    ),
    Kind.COMPASS_FROZEN: Meaning(_IMU, _WARNING, "s", _FROZEN, _SENSOR),
    Kind.COMPASS_HARD_IRON: Meaning(
        _COMPASS,
        _WARNING,
        "mG",
        "A field that is fixed to the vehicle adds to the earth's.",
        _MAGNET,
    ),
    Kind.COMPASS_MOTORS: Meaning(
        _COMPASS,
        _WARNING,
        "mG",
        "The motors' current makes a field at the compass.",
        "Move the compass or the wires, twist the wires, or compensate (ArduPilot: COMPASS_MOT).",
    ),
    Kind.COMPASS_SCALE: Meaning(
        _COMPASS,
        _WARNING,
        "%",
        "The compass measures a field of the wrong strength.",
        "Calibrate it again.",
    ),
    Kind.COMPASS_SOFT_IRON: Meaning(
        _COMPASS, _WARNING, "%", "Iron near the compass bends the field.", _MAGNET
    ),
    Kind.COMPASS_STEP: Meaning(
        _COMPASS, _WARNING, "mG", "A field that is fixed to the vehicle came or went.", _MAGNET
    ),
    Kind.COMPASSES_DIFFER: Meaning(
        _COMPASS,
        _ERROR,
        "deg",
        "Two compasses of the vehicle point to different norths: one of them is turned, or iron is "
        "near it.",
        "Each compass's orientation (ArduPilot: COMPASS_ORIENT) and calibration; do not take off "
        "while nothing shows which one is right.",
    ),
    Kind.CORES_DIFFER: Meaning(
        (SensorKind.ESTIMATOR,),
        _WARNING,
        "deg",
        "Estimators of the same autopilot contradict each other.",
        "The IMU and the compass that each of them uses.",
    ),
    Kind.CRASH: Meaning(
        _VEHICLE,
        Severity.CRITICAL,
        "m/s^2",
        "The vehicle hit something, or tipped over.",
        "What stands before it in time: control, motors, battery, sensors.",
    ),
    Kind.ESTIMATOR_SWITCH: Meaning(
        _AUTOPILOT,
        _WARNING,
        "",
        "The autopilot changed to another of its estimators or IMUs in flight.",
        "What it left: the IMU or compass of that number.",
    ),
    Kind.GPS_ACCURACY: Meaning(
        _GPS, _NOTICE, "m/s", "The receiver itself says that it is inaccurate.", _RECEIVER
    ),
    Kind.GPS_FROZEN: Meaning(
        _GPS,
        _WARNING,
        "s",
        "The receiver repeats one velocity: it reports, and measures nothing.",
        _RECEIVER,
    ),
    Kind.GPS_JUMP: Meaning(
        _GPS,
        _WARNING,
        "m",
        "The position jumped where its velocity says that nothing moved so far.",
        _RECEIVER,
    ),
    Kind.GPS_LAG: Meaning(
        _GPS,
        _WARNING,
        "ms",
        "The receiver's velocity lags behind the motion.",
        "The delay that the autopilot is told (ArduPilot: GPS_DELAY_MS; PX4: EKF2_GPS_DELAY).",
    ),
    Kind.GPS_LOST: Meaning(_GPS, _WARNING, "s", "There was no fix.", _RECEIVER),
    Kind.GPS_SATELLITES: Meaning(_GPS, _NOTICE, "", "Few satellites were in use.", _RECEIVER),
    Kind.GPS_VELOCITY: Meaning(
        _GPS,
        _WARNING,
        "m/s | ",  # in flight the size is how much more probable a false velocity is
        "The receiver's velocity is not the vehicle's motion by its IMU.",
        _RECEIVER,
    ),
    Kind.GYRO_APART: Meaning(
        _IMU, _WARNING, "deg/s", "One gyro disagrees with its neighbours.", _SENSOR
    ),
    Kind.GYRO_BIAS: Meaning(_IMU, _ERROR, "deg/s", "The gyro turns while it stands still.", _BIAS),
    Kind.GYRO_BIAS_STEP: Meaning(_IMU, _WARNING, "deg/s", "The gyro's zero jumped.", _BIAS),
    Kind.GYRO_FIELD: Meaning(
        (SensorKind.GYRO,),
        _ERROR,
        "deg",
        "The gyro said that the earth's field and gravity turned, which they do not: a wrong gyro.",
        _SENSOR,
    ),
    Kind.GYRO_FROZEN: Meaning(_IMU, _ERROR, "s", _FROZEN, _SENSOR),
    Kind.GYRO_SCALE: Meaning(
        _IMU, _WARNING, "%", "The gyro shows more of each turn than there is, or less.", _SENSOR
    ),
    Kind.HARD_LANDING: Meaning(
        _VEHICLE,
        _WARNING,
        "m/s^2",
        "The vehicle hit the ground hard, upright.",
        "How fast it came down and why: throttle, battery, motors at their limit; then the frame.",
    ),
    Kind.IMU_FROZEN: Meaning(_IMU, _ERROR, "s", _FROZEN, _SENSOR),
    Kind.IMU_GAPS: Meaning(_IMU, _WARNING, "s", "Samples are missing.", _LINK),
    Kind.IMU_SLOW: Meaning(_IMU, _NOTICE, "Hz", "Fewer samples than a good estimate needs.", _LINK),
    Kind.IMU_TOO_SLOW: Meaning(
        _IMU,
        _WARNING,
        "Hz",
        "Samples this seldom hide how the vehicle moved between them; no attitude is made of them.",
        "What the autopilot logs of its IMU (ArduPilot: LOG_BITMASK; PX4: SDLOG_PROFILE).",
    ),
    Kind.IMU_TWICE: Meaning(_IMU, _NOTICE, "%", "Samples were recorded twice.", _LINK),
    Kind.LATE_BURSTS: Meaning(_IMU, _NOTICE, "s", "Samples came late and in bursts.", _LINK),
    Kind.LOG_PAUSED: Meaning(
        (SensorKind.LOG,),
        _INFO,
        "s",
        "The autopilot logged nothing at all for a while, as most do while they are disarmed.",
        "Nothing; to record all the time, have the autopilot log while it is disarmed.",
    ),
    Kind.LOSS_OF_CONTROL: Meaning(
        _VEHICLE,
        Severity.CRITICAL,
        "deg",
        "The attitude left its demand, and the motors could not bring it back.",
        "What came first: a motor at its limit, a sensor, the estimator, or the demand itself.",
    ),
    Kind.MOTOR_FAILED: Meaning(
        _MOTORS,
        Severity.CRITICAL,
        "us",
        "A motor gave no thrust although thrust was demanded.",
        _MOTOR,
    ),
    Kind.MOTOR_IMBALANCE: Meaning(
        _MOTORS,
        _WARNING,
        "us",
        "One motor had to work harder than the others to hold the vehicle level.",
        _MOTOR,
    ),
    Kind.MOTOR_SATURATED: Meaning(
        _MOTORS,
        _ERROR,
        "%",
        "A motor was at its limit, so that the autopilot could not ask more of it.",
        "Weight against thrust, the battery, and damage on the motor that was at its limit.",
    ),
    **{
        kind: Meaning(_AUTOPILOT, _WARNING, "", "", _SAID)
        for kind in (
            Kind.SAID_AIDING,
            Kind.SAID_COMPASS,
            Kind.SAID_CRASH,
            Kind.SAID_EKF_FAILED,
            Kind.SAID_FAILSAFE,
            Kind.SAID_GPS_GLITCH,
            Kind.SAID_SENSOR,
            Kind.SAID_VIBRATION,
            Kind.SAID_YAW_RESET,
        )
    },
    Kind.VELOCITY_LOST: Meaning(
        (SensorKind.GPS, SensorKind.AUTOPILOT),
        _WARNING,
        "s",
        "Nothing measured how the vehicle moved: in long manoeuvres its attitude is less sure.",
        _RECEIVER,
    ),
    Kind.VIBRATION: Meaning(_IMU, _WARNING, "m/s2", _SHAKEN, _VIBRATION),
    Kind.VIBRATION_LEVEL: Meaning(_IMU, _WARNING, "m/s^2", _SHAKEN, _VIBRATION),
    Kind.VIBRATION_LINE: Meaning(
        _IMU,
        _INFO,
        "rad/s | m/s^2",
        "The frame shakes at one frequency, mostly that of motors or propellers.",
        _VIBRATION + " A notch filter at this frequency keeps it out of the control loops.",
    ),
}
