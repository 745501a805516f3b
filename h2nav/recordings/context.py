"""The contents of a recording besides the events of the service: whole series, as arrays.

All times `t_s` are seconds since the beginning of the recording, on the clock of its events: the
arrival at the recorder or, in an autopilot's own log, the autopilot's clock. Angles and frames are
those of the service: body forward-right-down, north-east-down, Hamilton quaternions body to NED.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Severity

# float64, except for sensor values, which keep the precision of the log.
Array = NDArray[np.floating[Any]]


class Span(NamedTuple):
    """A period of the flight.

    Attributes:
        from_s: its beginning.
        to_s: its end.
        name: such as ``LOITER`` or ``armed``.
    """

    from_s: float
    to_s: float
    name: str


class Said(NamedTuple):
    """A text message of the autopilot.

    Attributes:
        t_s: its time.
        severity: of the message.
        text: the message.
        is_made: made from an error's numbers, which the autopilot gave no words.
    """

    t_s: float
    severity: Severity
    text: str
    is_made: bool = False


class ImuTrack(NamedTuple):
    """All samples of one IMU, as recorded.

    Sums and integrals over them need float64.

    Attributes:
        imu: its number, from 0.
        source: their message.
        t_s: (N,) times of arrival.
        stamp_us: (N,) the autopilot's time stamps, which show gaps and drift.
        w_b: (N, 3) angular rate, rad/s.
        f_b: (N, 3) specific force, m/s^2.
        m_b_ut: (N, 3) field of the compass of the same number, microtesla; NaN where a sample has
            no new one.
        device_ids: of accelerometer and gyro, as in the parameters; 0 if unknown.
    """

    imu: int
    source: str
    t_s: Array
    stamp_us: NDArray[np.int64]
    w_b: Array
    f_b: Array
    m_b_ut: Array
    device_ids: tuple[int, int] = (0, 0)


class CompassTrack(NamedTuple):
    """All values of one compass in an autopilot's own log, in the axes of its board.

    Attributes:
        compass: its number, from 0, in the autopilot's order of preference.
        device_id: as in the parameters; 0 if not logged.
        t_s: (N,) times of arrival.
        m_b_ut: (N, 3) microtesla, with the autopilot's calibration applied.
        offset_ut: (N, 3) offset contained in it; NaN if not logged.
        motor_ut: (N, 3) motor compensation contained in it; NaN if not logged.
    """

    compass: int
    device_id: int
    t_s: Array
    m_b_ut: Array
    offset_ut: Array
    motor_ut: Array


class Burst(NamedTuple):
    """Samples at the sensor's own rate, recorded for a spectrum.

    Attributes:
        imu: number of the IMU, from 0.
        sensor: ``gyro`` (rad/s) or ``accelerometer`` (m/s^2).
        t_s: time of the first sample.
        rate_hz: of the samples.
        values: (N, 3) body frame.
    """

    imu: int
    sensor: str
    t_s: float
    rate_hz: float
    values: Array


class AttitudeTrack(NamedTuple):
    """The attitude of one estimator.

    Attributes:
        name: such as ``EKF3``, ``EKF3 core 1``, ``DCM``, ``EKF2`` or ``truth``.
        t_s: (N,) times.
        q_nb: (N, 4) body to NED.
    """

    name: str
    t_s: Array
    q_nb: Array


class GpsTrack(NamedTuple):
    """All fixes of one receiver; NaN where unknown.

    Attributes:
        receiver: its number, from 0.
        t_s: (N,) times of arrival.
        has_fix: (N,) whether it is a 3D fix.
        latitude_deg: (N,) WGS84.
        longitude_deg: (N,) WGS84.
        altitude_m: (N,) above mean sea level.
        v_n: (N, 3) NED, m/s.
        sigma_m_s: (N,) accuracy of the velocity stated by the receiver.
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
    """Any other quantity over time.

    Attributes:
        t_s: (N,) times.
        values: (N,) or (N, k).
    """

    t_s: Array
    values: Array

    @classmethod
    def finite(cls, t_s: Array, values: Array, largest: float = np.inf) -> "Series":
        """Without the times at which a value is not finite or larger than a bound, either sign."""
        good = np.isfinite(values) & (np.abs(np.nan_to_num(values)) <= largest)
        kept = good.reshape(len(good), -1).all(axis=1)
        return cls(t_s[kept], values[kept])


class Motors(NamedTuple):
    """Outputs to the motors of a multirotor; NaN where one is switched off.

    Attributes:
        numbers: the autopilot's numbers of the motors, from 1.
        t_s: (N,) times.
        pwm_us: (N, k) one column per motor, pulse width in microseconds; outputs without a pulse
            width are scaled to 1000 to 2000.
        least_us: the width of a motor at rest.
        most_us: the autopilot's largest width.
    """

    numbers: tuple[int, ...]
    t_s: Array
    pwm_us: Array
    least_us: float
    most_us: float

    def share(self) -> Array:
        """(N, k) share of the range, 0 to 1."""
        span_us = max(self.most_us - self.least_us, 1.0)
        found: Array = np.clip((self.pwm_us - self.least_us) / span_us, 0.0, 1.0)
        return found


class Battery(NamedTuple):
    """One battery; NaN where unknown.

    Attributes:
        number: from 0.
        t_s: (N,) times.
        voltage_v: (N,).
        current_a: (N,).
        remaining: (N,) 0 to 1, the autopilot's estimate.
    """

    number: int
    t_s: Array
    voltage_v: Array
    current_a: Array
    remaining: Array


class VibrationTrack(NamedTuple):
    """Vibration measured by the autopilot at the sensor's own rate.

    Attributes:
        imu: number of the IMU, from 0.
        t_s: (N,) times.
        level: (N, k) m/s^2: ArduPilot's VIBE per body axis, or PX4's single metric.
        clipped: (N,) samples at the end of the range since boot; it drops at a reboot.
    """

    imu: int
    t_s: Array
    level: Array
    clipped: Array


class Esc(NamedTuple):
    """Telemetry of one motor's controller; NaN where unknown.

    Attributes:
        number: from 1.
        t_s: (N,) times.
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
    """Statistics of the logged rows of one compass, plausible or not.

    Attributes:
        compass: number, from 0.
        from_s: first row.
        to_s: last row.
        rows: number of rows.
        changes: number of rows that differ from the previous one.
        is_zero: every row is zero.
        is_used: the autopilot is configured to use it.
    """

    compass: int
    from_s: float
    to_s: float
    rows: int
    changes: int
    is_zero: bool
    is_used: bool


class ReportedFault(NamedTuple):
    """A fault reported by number: ArduPilot's ERR, PX4's failsafe flags.

    Attributes:
        t_s: its time.
        subsystem: one of `SUBSYSTEMS`.
        code: of the subsystem; 0 = resolved.
        text: for people.
    """

    t_s: float
    subsystem: str
    code: int
    text: str


class Occurrence(NamedTuple):
    """An event logged by number, such as arming, take-off or landing.

    Attributes:
        t_s: its time.
        number: ArduPilot's LogEvent.
        text: for people.
    """

    t_s: float
    number: int
    text: str


class ChangedSetting(NamedTuple):
    """A parameter changed during the recording.

    Attributes:
        t_s: time of the change.
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
"""The subsystems of a `ReportedFault`."""


class Context(NamedTuple):
    """Everything that the review uses of a recording besides the service's findings.

    Attributes:
        firmware: of the autopilot, such as ``ArduCopter V4.0.4``; empty if unknown.
        vehicle: its kind for people, such as ``quadrotor``.
        vehicle_type: MAV_TYPE; 0 if unknown.
        start_unix_s: date of `t_s` = 0; None if unknown.
        duration_s: of the recording.
        imus: one per IMU.
        compasses: one per compass; empty if only the messages of the IMUs were recorded.
        bursts: for spectra.
        attitudes: the autopilot's estimators; the first one was used for control.
        truth: the attitude of a simulator; None elsewhere.
        gps: one per receiver.
        modes: flight modes, in order.
        armed: while it was armed.
        primary: the estimator core or lane in use; empty if unknown.
        said: text messages of the autopilot.
        parameters: of the autopilot, the last value of each.
        throttle: 0 to 1; None if not recorded.
        current_a: of the battery; None if not recorded.
        demand: (N, 3) demanded roll, pitch and heading, rad; NaN without a demand.
        demanded_rates: (N, 3) demanded body rates, rad/s.
        motors: outputs; None if not recorded, or if the motors among them are unknown.
        height_m: above the start, the autopilot's estimate.
        height_demand_m: demanded height.
        climb_m_s: positive up, the autopilot's estimate.
        baro_height_m: of the barometer alone.
        batteries: one per battery.
        board_v: supply of the autopilot.
        vibrations: one per IMU.
        escs: one per motor whose controller reports.
        compass_rows: statistics of the rows of each compass.
        faults: in order.
        occurrences: in order.
        airborne: (N,) 1 while it is off the ground, by the autopilot's own decision.
        changes: parameters that were changed, in order.
        wind_n_m_s: (N, 2) velocity of the air, north and east, the autopilot's estimate; None if
            not estimated.
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
    faults: tuple[ReportedFault, ...] = ()
    occurrences: tuple[Occurrence, ...] = ()
    airborne: Series | None = None
    changes: tuple[ChangedSetting, ...] = ()
    missing: tuple[str, ...] = ()
    notes: dict[str, int] = {}  # noqa: RUF012 - never changed
