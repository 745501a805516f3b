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


class Context(NamedTuple):
    """Everything of a recording that the review shows or looks at beside the service's findings.

    Attributes:
        firmware: of the autopilot, such as ``ArduCopter V4.0.4``; empty where it is not said.
        vehicle: what it is, for people, such as ``quadrotor``.
        start_unix_s: date of `t_s` = 0; None where nothing tells it.
        duration_s: of the recording.
        imus: one per IMU.
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
        wind_n_m_s: (N, 2) north and east, where the air moves to, as the autopilot's estimator
            says; None where it does not.
        missing: what the recording lacks for a better review, one phrase each.
        notes: what was damaged or skipped: reason -> count.
    """

    firmware: str = ""
    vehicle: str = ""
    start_unix_s: float | None = None
    duration_s: float = 0.0
    imus: tuple[ImuTrack, ...] = ()
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
    missing: tuple[str, ...] = ()
    notes: dict[str, int] = {}  # noqa: RUF012 - never changed
