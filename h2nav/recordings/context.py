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
# In `Context.missing`: `Context.armed` is then the whole recording.
NO_ARMING = "no word of when the motors were armed"


class Span(NamedTuple):
    """A period of the flight."""

    from_s: float  # its beginning
    to_s: float  # its end
    name: str  # such as ``LOITER`` or ``armed``


class Said(NamedTuple):
    """A text message of the autopilot."""

    t_s: float  # its time
    severity: Severity  # of the message
    text: str  # the message
    is_made: bool = False  # made from an error's numbers, which the autopilot gave no words


class ImuTrack(NamedTuple):
    """All samples of one IMU, as recorded.

    Sums and integrals over them need float64.
    """

    imu: int  # its number, from 0
    source: str  # their message
    t_s: Array  # (N,) times of arrival
    stamp_us: NDArray[np.int64]  # (N,) the autopilot's time stamps, which show gaps and drift
    w_b: Array  # (N, 3) angular rate, rad/s
    f_b: Array  # (N, 3) specific force, m/s^2
    # (N, 3) field of the compass of the same number, microtesla; NaN where a sample has no
    # new one
    m_b_ut: Array
    # of accelerometer and gyro, as in the parameters; 0 if unknown
    device_ids: tuple[int, int] = (0, 0)
    # False: old logs without times, which follow from the places in the file; nothing can be said
    # of gaps, and an attitude of our own would be too uncertain
    is_timed: bool = True


class CompassTrack(NamedTuple):
    """All values of one compass in an autopilot's own log, in the axes of its board."""

    compass: int  # its number, from 0, in the autopilot's order of preference
    device_id: int  # as in the parameters; 0 if not logged
    t_s: Array  # (N,) times of arrival
    m_b_ut: Array  # (N, 3) microtesla, with the autopilot's calibration applied
    offset_ut: Array  # (N, 3) offset contained in it; NaN if not logged
    motor_ut: Array  # (N, 3) motor compensation contained in it; NaN if not logged


class Burst(NamedTuple):
    """Samples at the sensor's own rate, recorded for a spectrum."""

    imu: int  # number of the IMU, from 0
    sensor: str  # ``gyro`` (rad/s) or ``accelerometer`` (m/s^2)
    t_s: float  # time of the first sample
    rate_hz: float  # of the samples
    values: Array  # (N, 3) body frame


class AttitudeTrack(NamedTuple):
    """The attitude of one estimator."""

    name: str  # such as ``EKF3``, ``EKF3 core 1``, ``DCM``, ``EKF2`` or ``truth``
    t_s: Array  # (N,) times
    q_nb: Array  # (N, 4) body to NED


class GpsTrack(NamedTuple):
    """All fixes of one receiver; NaN where unknown."""

    receiver: int  # its number, from 0
    t_s: Array  # (N,) times of arrival
    has_fix: NDArray[np.bool_]  # (N,) whether it is a 3D fix
    latitude_deg: Array  # (N,) WGS84
    longitude_deg: Array  # (N,) WGS84
    altitude_m: Array  # (N,) above mean sea level
    v_n: Array  # (N, 3) NED, m/s
    sigma_m_s: Array  # (N,) accuracy of the velocity stated by the receiver
    satellites: Array  # (N,) used
    # (N,) what it says of its signals: GPS_JAMMING_STATE and GPS_SPOOFING_STATE; None if nothing
    jamming: NDArray[np.int64] | None = None
    spoofing: NDArray[np.int64] | None = None
    # (K, 3) the power at its antenna: noise, gain, narrow lines; None if it measures nothing
    power: "Series | None" = None
    clock: "Series | None" = None  # (K,) the time that it tells at fixes, UNIX seconds

    def part(self, rows: slice | NDArray[np.bool_]) -> "GpsTrack":
        """Some of the fixes."""
        columns = self._asdict()
        del columns["receiver"], columns["power"], columns["clock"]  # both have times of their own
        return self._replace(**{n: c[rows] for n, c in columns.items() if c is not None})


class Series(NamedTuple):
    """Any other quantity over time."""

    t_s: Array  # (N,) times
    values: Array  # (N,) or (N, k)

    @classmethod
    def finite(cls, t_s: Array, values: Array, largest: float = np.inf) -> "Series":
        """Without the times at which a value is not finite or larger than a bound, either sign."""
        good = np.isfinite(values) & (np.abs(np.nan_to_num(values)) <= largest)
        kept = good.reshape(len(good), -1).all(axis=1)
        return cls(t_s[kept], values[kept])


class OutputBank(NamedTuple):
    """The outputs of one bank, whatever they drive; NaN where there is none."""

    number: int  # of the bank, from 0
    t_s: Array  # (N,) times
    values: Array  # (N, k) pulse widths in microseconds, or what the bank's driver puts out


class Motors(NamedTuple):
    """Outputs to the motors of a multirotor; NaN where one is switched off."""

    numbers: tuple[int, ...]  # the autopilot's numbers of the motors, from 1
    t_s: Array  # (N,) times
    # (N, k) one column per motor, pulse width in microseconds; outputs without a pulse width
    # are scaled to 1000 to 2000
    pwm_us: Array
    least_us: float  # the width of a motor at rest
    most_us: float  # the autopilot's largest width

    def share(self) -> Array:
        """(N, k) share of the range, 0 to 1."""
        span_us = max(self.most_us - self.least_us, 1.0)
        found: Array = np.clip((self.pwm_us - self.least_us) / span_us, 0.0, 1.0)
        return found


class Battery(NamedTuple):
    """One battery; NaN where unknown."""

    number: int  # from 0
    t_s: Array  # (N,) times
    voltage_v: Array  # (N,)
    current_a: Array  # (N,)
    remaining: Array  # (N,) 0 to 1, the autopilot's estimate


class VibrationTrack(NamedTuple):
    """Vibration measured by the autopilot at the sensor's own rate."""

    imu: int  # number of the IMU, from 0
    t_s: Array  # (N,) times
    level: Array  # (N, k) m/s^2: ArduPilot's VIBE per body axis, or PX4's single metric
    clipped: Array  # (N,) samples at the end of the range since boot; it drops at a reboot


class Esc(NamedTuple):
    """Telemetry of one motor's controller; NaN where unknown."""

    number: int  # from 1
    t_s: Array  # (N,) times
    rpm: Array  # (N,) revolutions a minute
    current_a: Array  # (N,)
    temperature_degc: Array  # (N,)


class TemperatureTrack(NamedTuple):
    """The temperature of one IMU."""

    imu: int  # its number, from 0
    t_s: Array  # (N,) times
    temperature_degc: Array  # (N,)


class Sticks(NamedTuple):
    """The pilot's sticks, as shares of their travel; NaN where unknown."""

    t_s: Array  # (N,) times
    roll: Array  # (N,) -1 to 1, positive to the right
    pitch: Array  # (N,) -1 to 1, positive: nose up
    yaw: Array  # (N,) -1 to 1, positive to the right
    throttle: Array  # (N,) 0 to 1


class HeightTrack(NamedTuple):
    """Height by one source, each above a level of its own; NaN where unknown."""

    # ``barometer``, ``estimator`` (the one in use), ``EKF2`` or ``EKF3`` (one of its cores),
    # ``rangefinder`` (down, above what is there) or ``GPS``
    kind: str
    number: int  # among those of its kind, from 0
    t_s: Array  # (N,) times
    height_m: Array  # (N,) positive up
    climb_m_s: Array  # (N,) its own vertical speed, positive up


class SensorHealth(NamedTuple):
    """What the autopilot itself says of one sensor; NaN where it says nothing."""

    kind: str  # ``gyro``, ``accelerometer``, ``compass``, ``barometer``, ``GPS`` or ``IMU``
    number: int  # among those of its kind, from 0
    t_s: Array  # (N,) times
    healthy: Array  # (N,) 1 = it is healthy, 0 = it is not, or gave no value in time
    errors: Array  # (N,) errors in reading it since boot


class CompassRows(NamedTuple):
    """Statistics of the logged rows of one compass, plausible or not."""

    compass: int  # number, from 0
    from_s: float  # first row
    to_s: float  # last row
    rows: int  # number of rows
    changes: int  # number of rows that differ from the previous one
    is_zero: bool  # every row is zero
    is_used: bool  # the autopilot is configured to use it


class ReportedFault(NamedTuple):
    """A fault reported by number: ArduPilot's ERR, PX4's failsafe flags."""

    t_s: float  # its time
    subsystem: str  # one of `SUBSYSTEMS`
    code: int  # of the subsystem; 0 = resolved
    text: str  # for people


class Occurrence(NamedTuple):
    """An event logged by number, such as arming, take-off or landing."""

    t_s: float  # its time
    number: int  # ArduPilot's LogEvent
    text: str  # for people


class ChangedSetting(NamedTuple):
    """A parameter changed during the recording."""

    t_s: float  # time of the change
    name: str  # of the parameter
    before: float  # its value until then
    after: float  # its value from then on


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
    """Everything that the review uses of a recording besides the service's findings."""

    firmware: str = ""  # of the autopilot, such as ``ArduCopter V4.0.4``; empty if unknown
    vehicle: str = ""  # its kind for people, such as ``quadrotor``
    vehicle_type: int = 0  # MAV_TYPE; 0 if unknown
    # of the autopilot's processor; empty if unknown. Of ArduPilot three words of its id as in its
    # texts, of PX4 its sys_uuid: the same in its log and in telemetry
    uid: str = ""
    board: str = ""  # of the autopilot, such as ``CubeOrange`` or ``PX4_FMU_V5``
    system_id: int = 0  # of MAVLink; 0 if unknown
    start_unix_s: float | None = None  # date of `t_s` = 0; None if unknown
    duration_s: float = 0.0  # of the recording
    imus: tuple[ImuTrack, ...] = ()  # one per IMU
    # one per compass; empty if only the messages of the IMUs were recorded
    compasses: tuple[CompassTrack, ...] = ()
    bursts: tuple[Burst, ...] = ()  # for spectra
    # the autopilot's estimators; the first one was used for control
    attitudes: tuple[AttitudeTrack, ...] = ()
    truth: AttitudeTrack | None = None  # the attitude of a simulator; None elsewhere
    gps: tuple[GpsTrack, ...] = ()  # one per receiver
    modes: tuple[Span, ...] = ()  # flight modes, in order
    armed: tuple[Span, ...] = ()  # while it was armed
    primary: tuple[Span, ...] = ()  # the estimator core or lane in use; empty if unknown
    said: tuple[Said, ...] = ()  # text messages of the autopilot
    # of the autopilot, the last value of each
    parameters: dict[str, float] = {}  # noqa: RUF012 - never changed
    throttle: Series | None = None  # 0 to 1; None if not recorded
    current_a: Series | None = None  # of the battery; None if not recorded
    # (N, 2) velocity of the air, north and east, the autopilot's estimate; None if not
    # estimated
    wind_n_m_s: Series | None = None
    # (N, 3) demanded roll, pitch and heading, rad; NaN without a demand
    demand: Series | None = None
    demanded_rates: Series | None = None  # (N, 3) demanded body rates, rad/s
    # outputs; None if not recorded, or if the motors among them are unknown
    motors: Motors | None = None
    height_m: Series | None = None  # above the start, the autopilot's estimate
    height_demand_m: Series | None = None  # demanded height
    climb_m_s: Series | None = None  # positive up, the autopilot's estimate
    baro_height_m: Series | None = None  # of the barometer alone
    batteries: tuple[Battery, ...] = ()  # one per battery
    board_v: Series | None = None  # supply of the autopilot
    vibrations: tuple[VibrationTrack, ...] = ()  # one per IMU
    temperatures: tuple[TemperatureTrack, ...] = ()  # one per IMU that tells it
    escs: tuple[Esc, ...] = ()  # one per motor whose controller reports
    compass_rows: tuple[CompassRows, ...] = ()  # statistics of the rows of each compass
    faults: tuple[ReportedFault, ...] = ()  # in order
    occurrences: tuple[Occurrence, ...] = ()  # in order
    # (N,) 1 while it is off the ground, by the autopilot's own decision
    airborne: Series | None = None
    changes: tuple[ChangedSetting, ...] = ()  # parameters that were changed, in order
    outputs: tuple[OutputBank, ...] = ()  # all servo outputs, one per bank
    sticks: Sticks | None = None  # None if not recorded, or if their channels are unknown
    heights: tuple[HeightTrack, ...] = ()  # by every source of height
    health: tuple[SensorHealth, ...] = ()  # the autopilot's own word on its sensors
    # estimator whose attitude was used for control, where the log says it row by row; empty if not
    flown_by: tuple[Span, ...] = ()
    # while nothing at all was recorded: the link or the logger was silent, no sensor
    silent: tuple[Span, ...] = ()
    # share of the autopilot's frames that the link lost, by their numbers; None if not telemetry
    link_loss_share: float | None = None
    # other quantities of the column tables by name; None if not recorded
    measured: dict[str, Series | None] = {}  # noqa: RUF012 - never changed
    # where quantities come from: name of the field -> message and column
    origins: dict[str, str] = {}  # noqa: RUF012 - never changed
    missing: tuple[str, ...] = ()  # what the recording lacks for a better review, one phrase each
    # what was damaged or skipped: reason -> count
    notes: dict[str, int] = {}  # noqa: RUF012 - never changed
