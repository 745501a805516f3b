"""What a recording says beside the events that the service takes: whole series, as arrays.

All times `t_s` are seconds since the beginning of the recording, on the clock by which its events
come: the arrival at who recorded, or, in a log that the autopilot wrote itself, the autopilot's
own. Angles and frames are those of the service: body forward-right-down, north-east-down, Hamilton
quaternions body to NED.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Severity

# float64, but for what sensors measured: that is kept with no more digits than the log has of it.
Array = NDArray[np.floating[Any]]


class Span(NamedTuple):
    """A part of the flight.

    Attributes:
        from_s: its beginning.
        to_s: its end.
        name: such as ``LOITER`` or ``armed``.
    """

    from_s: float
    to_s: float
    name: str


class Said(NamedTuple):
    """A text of the autopilot.

    Attributes:
        t_s: when.
        severity: of it.
        text: what it said.
    """

    t_s: float
    severity: Severity
    text: str


class ImuTrack(NamedTuple):
    """All samples of one IMU, as they were recorded.

    Who sums or integrates them does it in float64.

    Attributes:
        imu: its number, from 0.
        source: the message that they come from.
        t_s: (N,) when they came.
        stamp_us: (N,) the autopilot's time of each, in which gaps and drifts show.
        w_b: (N, 3) angular rate, rad/s.
        f_b: (N, 3) specific force, m/s^2.
        m_b_ut: (N, 3) field of the compass of the same number, microtesla; NaN where a sample has
            no new one.
    """

    imu: int
    source: str
    t_s: Array
    stamp_us: NDArray[np.int64]
    w_b: Array
    f_b: Array
    m_b_ut: Array


class CompassTrack(NamedTuple):
    """All values of one compass that an autopilot's own log has, in the axes of its board.

    Attributes:
        compass: its number, from 0, in the autopilot's order of preference.
        device_id: as the parameters name it; 0 where the log does not say.
        t_s: (N,) when they came.
        m_b_ut: (N, 3) microtesla, with the autopilot's calibration.
        offset_ut: (N, 3) that is in it; NaN where the log does not say.
        motor_ut: (N, 3) that was added for the motors; NaN where the log does not say.
    """

    compass: int
    device_id: int
    t_s: Array
    m_b_ut: Array
    offset_ut: Array
    motor_ut: Array


class Burst(NamedTuple):
    """Samples at the sensor's own rate, which were recorded for a spectrum.

    Attributes:
        imu: number of the IMU, from 0.
        sensor: ``gyro`` (rad/s) or ``accelerometer`` (m/s^2).
        t_s: when it began.
        rate_hz: of the samples.
        values: (N, 3) body frame.
    """

    imu: int
    sensor: str
    t_s: float
    rate_hz: float
    values: Array


class AttitudeTrack(NamedTuple):
    """The attitude as one estimator says it.

    Attributes:
        name: such as ``EKF3``, ``EKF3 core 1``, ``DCM``, ``EKF2`` or ``truth``.
        t_s: (N,) when.
        q_nb: (N, 4) body to NED.
    """

    name: str
    t_s: Array
    q_nb: Array


class GpsTrack(NamedTuple):
    """All fixes of one receiver; NaN where something is unknown.

    Attributes:
        receiver: its number, from 0.
        t_s: (N,) when they came.
        has_fix: (N,) whether it is a 3D fix.
        latitude_deg: (N,) WGS84.
        longitude_deg: (N,) WGS84.
        altitude_m: (N,) above mean sea level.
        v_n: (N, 3) NED, m/s.
        sigma_m_s: (N,) accuracy of the velocity as the receiver states it.
        satellites: (N,) used.
    """

    receiver: int
    t_s: Array
    has_fix: NDArray[np.bool_]
    latitude_deg: Array
    longitude_deg: Array
    altitude_m: Array
    v_n: Array
    sigma_m_s: Array
    satellites: Array


class Series(NamedTuple):
    """Anything else over time.

    Attributes:
        t_s: (N,) when.
        values: (N,) or (N, k).
    """

    t_s: Array
    values: Array


class Motors(NamedTuple):
    """Outputs to the motors of a multirotor; NaN where one is switched off.

    Attributes:
        numbers: of the motors as the autopilot counts them, from 1.
        t_s: (N,) when.
        pwm_us: (N, k) one column per motor, microseconds of pulse width; outputs without one are
            scaled to 1000 to 2000.
        least_us: the width at which they stand still.
        most_us: the largest width that the autopilot ever sends.
    """

    numbers: tuple[int, ...]
    t_s: Array
    pwm_us: Array
    least_us: float
    most_us: float

    def share(self) -> Array:
        """(N, k) 0 to 1 of their range."""
        span_us = max(self.most_us - self.least_us, 1.0)
        found: Array = np.clip((self.pwm_us - self.least_us) / span_us, 0.0, 1.0)
        return found


class Battery(NamedTuple):
    """One battery; NaN where something is unknown.

    Attributes:
        number: from 0.
        t_s: (N,) when.
        voltage_v: (N,).
        current_a: (N,).
        remaining: (N,) 0 to 1, as the autopilot estimates it.
    """

    number: int
    t_s: Array
    voltage_v: Array
    current_a: Array
    remaining: Array


class VibrationTrack(NamedTuple):
    """Vibration as the autopilot measures it, at the sensor's own rate.

    Attributes:
        imu: number of the IMU, from 0.
        t_s: (N,) when.
        level: (N, k) m/s^2: ArduPilot's VIBE of each body axis, or PX4's one metric of all.
        clipped: (N,) samples at the end of the range since boot; it falls where it starts again.
    """

    imu: int
    t_s: Array
    level: Array
    clipped: Array


class Esc(NamedTuple):
    """Telemetry of one motor's controller; NaN where something is unknown.

    Attributes:
        number: from 1.
        t_s: (N,) when.
        rpm: (N,) revolutions a minute.
        current_a: (N,).
        temperature_degc: (N,).
    """

    number: int
    t_s: Array
    rpm: Array
    current_a: Array
    temperature_degc: Array


class CompassRows(NamedTuple):
    """What one compass logged, whether it can be a field or not.

    Attributes:
        compass: number, from 0.
        from_s: first row.
        to_s: last row.
        rows: how many there are.
        changes: how often a row differs from the one before.
        is_zero: all of them are nothing.
        is_used: the autopilot is set to use it.
    """

    compass: int
    from_s: float
    to_s: float
    rows: int
    changes: int
    is_zero: bool
    is_used: bool


class Fault(NamedTuple):
    """Something that the autopilot reports by number: ArduPilot's ERR, PX4's failsafe flags.

    Attributes:
        t_s: when.
        subsystem: out of `SUBSYSTEMS`.
        code: of the subsystem; 0 = over.
        text: for people.
    """

    t_s: float
    subsystem: str
    code: int
    text: str


class Occurrence(NamedTuple):
    """An event that the autopilot logs by number, such as arming, take-off or landing.

    Attributes:
        t_s: when.
        number: ArduPilot's LogEvent.
        text: for people.
    """

    t_s: float
    number: int
    text: str


class ChangedSetting(NamedTuple):
    """A parameter that was changed during the recording.

    Attributes:
        t_s: when.
        name: of the parameter.
        before: its value until then.
        after: its value from then on.
    """

    t_s: float
    name: str
    before: float
    after: float


SUBSYSTEMS = (
    "battery",
    "barometer",
    "compass",
    "crash_check",
    "ekf",
    "failsafe",
    "fence",
    "flight_mode",
    "gps",
    "ground_station",
    "imu",
    "motor",
    "other",
    "radio",
    "terrain",
    "thrust_loss",
    "vibration",
)
"""What a `Fault` can concern."""


class Context(NamedTuple):
    """Everything of a recording that the review shows or looks at beside the service's findings.

    Attributes:
        firmware: of the autopilot, such as ``ArduCopter V4.0.4``; empty where it is not said.
        vehicle: what it is, for people, such as ``quadrotor``.
        vehicle_type: MAV_TYPE; 0 where nobody says.
        start_unix_s: date of `t_s` = 0; None where nothing tells it.
        duration_s: of the recording.
        imus: one per IMU.
        compasses: one per compass; empty where the messages of the IMUs are all there is.
        bursts: for spectra.
        attitudes: the autopilot's estimators; the first one is the one that it flew by.
        truth: the attitude of a simulator; None elsewhere.
        gps: one per receiver.
        modes: flight modes, in order.
        armed: while it was armed.
        primary: which estimator core or lane was in use; empty where it is not said.
        said: texts of the autopilot.
        parameters: of the autopilot, the last value of each.
        throttle: 0 to 1; None where it was not recorded.
        current_a: of the battery; None where it was not recorded.
        demand: (N, 3) roll, pitch and heading that the controller was asked for, rad; NaN where
            nothing was asked.
        demanded_rates: (N, 3) body rates that it was asked for, rad/s.
        motors: outputs; None where they were not recorded, or nobody knows which are motors.
        height_m: above where it started, as the autopilot estimates it.
        height_demand_m: what the controller was asked for.
        climb_m_s: positive up, as the autopilot estimates it.
        baro_height_m: of the barometer alone.
        batteries: one per battery.
        board_v: supply of the autopilot.
        vibrations: one per IMU.
        escs: one per motor whose controller reports.
        compass_rows: of each compass, how much its rows change.
        faults: in order.
        occurrences: in order.
        airborne: (N,) 1 while it has left the ground, as the autopilot decides.
        changes: parameters that were changed, in order.
        wind_n_m_s: (N, 2) north and east, where the air moves to, as the autopilot's estimator
            says; None where it does not.
        missing: what the recording lacks for a better review, one phrase each.
        notes: what was damaged or skipped: reason -> count.
    """

    firmware: str = ""
    vehicle: str = ""
    vehicle_type: int = 0
    start_unix_s: float | None = None
    duration_s: float = 0.0
    imus: tuple[ImuTrack, ...] = ()
    compasses: tuple[CompassTrack, ...] = ()
    bursts: tuple[Burst, ...] = ()
    attitudes: tuple[AttitudeTrack, ...] = ()
    truth: AttitudeTrack | None = None
    gps: tuple[GpsTrack, ...] = ()
    modes: tuple[Span, ...] = ()
    armed: tuple[Span, ...] = ()
    primary: tuple[Span, ...] = ()
    said: tuple[Said, ...] = ()
    parameters: dict[str, float] = {}  # noqa: RUF012 - never changed
    throttle: Series | None = None
    current_a: Series | None = None
    wind_n_m_s: Series | None = None
    demand: Series | None = None
    demanded_rates: Series | None = None
    motors: Motors | None = None
    height_m: Series | None = None
    height_demand_m: Series | None = None
    climb_m_s: Series | None = None
    baro_height_m: Series | None = None
    batteries: tuple[Battery, ...] = ()
    board_v: Series | None = None
    vibrations: tuple[VibrationTrack, ...] = ()
    escs: tuple[Esc, ...] = ()
    compass_rows: tuple[CompassRows, ...] = ()
    faults: tuple[Fault, ...] = ()
    occurrences: tuple[Occurrence, ...] = ()
    airborne: Series | None = None
    changes: tuple[ChangedSetting, ...] = ()
    missing: tuple[str, ...] = ()
    notes: dict[str, int] = {}  # noqa: RUF012 - never changed
