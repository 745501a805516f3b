"""What a finding means for a pilot, what to check, and which pictures show it."""

from typing import NamedTuple


class Advice(NamedTuple):
    """Of one kind of finding.

    Attributes:
        means: what it says; no term that is not explained.
        check: what to look at next.
        place: name of the section of pictures that shows it.
    """

    means: str
    check: str
    place: str


_FROZEN = "The sensor repeated itself while the vehicle moved: it had stopped measuring."
_SENSOR = "The sensor's wiring, bus and supply; if it comes back, replace the sensor."
_MAGNET = (
    "Magnets, motors and wires with high current near the compass; move the compass away "
    "from them, calibrate it again, or rely on another one."
)
_VIBRATION = (
    "Propellers (balance, damage), motor bearings, loose parts, and how the autopilot is mounted."
)
_RECEIVER = "The antenna's view of the sky and its distance to cameras, transmitters and USB 3."
_BIAS = "Calibrate the sensor again, with temperature if it can be; if it stays so, replace it."
_LINK = "The recording's rate and the processor's load; what was lost cannot be judged."
_COMPASS_WRONG = (
    "What the compass measured is not the earth's field at this place (World Magnetic Model), "
    "so a heading by this compass is wrong."
)
_SAID = "The autopilot's documentation of this message, and the pictures at that time."

ADVICE = {
    "gyro_frozen": Advice(_FROZEN, _SENSOR, "timing"),
    "accelerometer_frozen": Advice(_FROZEN, _SENSOR, "timing"),
    "imu_frozen": Advice(_FROZEN, _SENSOR, "timing"),
    "axis_stuck": Advice("One axis repeated itself while others moved.", _SENSOR, "vibration"),
    "vibration": Advice(
        "Shaking this strong makes the autopilot's accelerometer hard to use.",
        _VIBRATION,
        "vibration",
    ),
    "clipping": Advice(
        "Samples at the end of the sensor's range: the true values were larger.",
        _VIBRATION,
        "vibration",
    ),
    "compass_frozen": Advice(_FROZEN, _SENSOR, "compass"),
    "compass_field": Advice(_COMPASS_WRONG, _MAGNET, "compass"),
    "attitude_velocity": Advice(
        "The accelerations that the attitude implies are not those that the GPS receiver measured: "
        "either the attitude was wrong, or the GPS velocity.",
        "Gyro, accelerometer and GPS at this time; which one is wrong shows in the pictures.",
        "innovations",
    ),
    "velocity_lost": Advice(
        "Nothing measured how the vehicle moved: in long manoeuvres its attitude is less sure.",
        _RECEIVER,
        "gps",
    ),
    "attitude_gravity": Advice(
        "By this attitude the vehicle would have accelerated farther than it can.",
        "Gyro and accelerometer at this time.",
        "innovations",
    ),
    "gyro_field": Advice(
        "The gyro said that the earth's field turned, which it does not: a wrong gyro. About the "
        "vertical a field of something near the compass may also have done it.",
        _SENSOR,
        "innovations",
    ),
    "accelerometer_bias_step": Advice(
        "The accelerometer began to show a force that the vehicle's motion does not have.",
        "Its mounting and temperature; a step that comes again is a failing sensor.",
        "bias",
    ),
    "autopilot_tilt": Advice(
        "The autopilot's roll or pitch and ours were farther apart than both can be uncertain.",
        "The autopilot's accelerometers and vibration; the evidence says whom GPS supports.",
        "difference",
    ),
    "autopilot_heading": Advice(
        "The autopilot's heading and ours were farther apart than both can be uncertain.",
        "The autopilot's compasses; the evidence says whom the GPS velocity supports.",
        "difference",
    ),
    "estimator_switch": Advice(
        "The autopilot changed to another of its estimators or IMUs in flight.",
        "What it left: the IMU or compass of that number.",
        "difference",
    ),
    "attitude_reset": Advice(
        "The autopilot's attitude jumped although the vehicle did not turn.",
        "What it was reset by: compass, GPS, or a change of estimators at that time.",
        "difference",
    ),
    "cores_differ": Advice(
        "Estimators of the same autopilot contradict each other.",
        "The IMU and the compass that each of them uses.",
        "difference",
    ),
    "toppled": Advice("The vehicle did not end as it stood.", "The vehicle.", "attitude"),
    "compass_hard_iron": Advice(
        "A field that is fixed to the vehicle adds to the earth's.", _MAGNET, "compass"
    ),
    "compass_step": Advice(
        "A field that is fixed to the vehicle came or went.", _MAGNET, "compass"
    ),
    "compass_soft_iron": Advice("Iron near the compass bends the field.", _MAGNET, "compass"),
    "compass_scale": Advice(
        "The compass measures a field of the wrong strength.", "Calibrate it again.", "compass"
    ),
    "compass_motors": Advice(
        "The motors' current makes a field at the compass.",
        "Move the compass or the wires, twist the wires, or compensate (ArduPilot: COMPASS_MOT).",
        "compass",
    ),
    "gyro_bias": Advice("The gyro turns while it stands still.", _BIAS, "bias"),
    "gyro_bias_step": Advice("The gyro's zero jumped.", _BIAS, "bias"),
    "gyro_scale": Advice(
        "The gyro shows more of each turn than there is, or less.", _SENSOR, "bias"
    ),
    "accelerometer_bias": Advice("At rest it does not measure gravity.", _BIAS, "bias"),
    "gyro_apart": Advice("One gyro disagrees with its neighbours.", _SENSOR, "bias"),
    "accelerometer_apart": Advice(
        "One accelerometer disagrees with its neighbours.", _SENSOR, "bias"
    ),
    "vibration_level": Advice(
        "Shaking this strong makes the autopilot's accelerometer hard to use.",
        _VIBRATION,
        "vibration",
    ),
    "vibration_line": Advice(
        "The frame shakes at one frequency, mostly that of motors or propellers.",
        _VIBRATION + " A notch filter at this frequency keeps it out of the control loops.",
        "spectra",
    ),
    "clipped_samples": Advice(
        "Samples at the end of the sensor's range: the true values were larger.",
        _VIBRATION,
        "vibration",
    ),
    "imu_gaps": Advice("Samples are missing.", _LINK, "timing"),
    "log_paused": Advice(
        "The autopilot logged nothing at all for a while, as most do while they are disarmed.",
        "Nothing; to record all the time, have the autopilot log while it is disarmed.",
        "timing",
    ),
    "imu_slow": Advice("Fewer samples than a good estimate needs.", _LINK, "timing"),
    "imu_twice": Advice("Samples were recorded twice.", _LINK, "timing"),
    "late_bursts": Advice("Samples came late and in bursts.", _LINK, "timing"),
    "clock_jump": Advice(
        "The stamps of the samples leapt, the samples did not: something set the clock.",
        "What sets the autopilot's time, and the stamps of its messages.",
        "timing",
    ),
    "clock_drift": Advice("The clocks of recorder and autopilot run apart.", _LINK, "timing"),
    "gps_lag": Advice(
        "The receiver's velocity lags behind the motion.",
        "The delay that the autopilot is told (ArduPilot: GPS_DELAY_MS; PX4: EKF2_GPS_DELAY).",
        "gps",
    ),
    "gps_velocity": Advice(
        "The receiver's velocity is not the vehicle's motion by its IMU.", _RECEIVER, "gps"
    ),
    "gps_frozen": Advice(
        "The receiver repeats one velocity: it reports, and measures nothing.", _RECEIVER, "gps"
    ),
    "gps_jump": Advice(
        "The position jumped where its velocity says that nothing moved so far.", _RECEIVER, "gps"
    ),
    "gps_lost": Advice("There was no fix.", _RECEIVER, "gps"),
    "gps_satellites": Advice("Few satellites were in use.", _RECEIVER, "gps"),
    "gps_accuracy": Advice("The receiver itself says that it is inaccurate.", _RECEIVER, "gps"),
}
_UNKNOWN = Advice("", "", "timeline")


def advice(kind: str) -> Advice:
    """Of a kind of finding; without words for one that is not known here."""
    if kind.startswith("said_"):
        return Advice("", _SAID, "timeline")
    return ADVICE.get(kind, _UNKNOWN)
