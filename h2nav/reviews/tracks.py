"""The data behind the findings of a whole flight, as arrays of bounded length for pictures.

Times `t_s` are those of `h2nav.recordings.context`. NaN means unknown.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array


class Peak(NamedTuple):
    """A line of a spectrum."""

    frequency_hz: float  # its centre
    width_hz: float  # between the points of half its power
    rms: float  # of the line over all three axes, in the spectrum's unit
    harmonic: int  # its number among the harmonics, 1 = the fundamental; 0 = of no family


class Spectrum(NamedTuple):
    """Vibration of one sensor while the motors turned: the mean spectrum and its change."""

    imu: int  # number of the IMU, from 0
    sensor: str  # ``gyro`` or ``accelerometer``
    unit: str  # of the values: ``rad/s`` or ``m/s^2``
    rate_hz: float  # of the samples; frequencies above its half appear mirrored below
    is_burst: bool  # from bursts at the sensor's own rate; otherwise from the samples as recorded
    frequency_hz: Array  # (F,) at most 256
    density: Array  # (F, 3) amplitude per root of bandwidth, unit / sqrt(Hz), body axes
    peaks: tuple[Peak, ...]  # prominent lines, strongest first
    t_s: Array  # (T,) centres of the spectrogram's columns, at most 300
    levels: NDArray[np.float32]  # (T, F) the same density over all axes; float32


class Vibrations(NamedTuple):
    """Vibration of one accelerometer as ArduPilot's VIBE messages define it."""

    imu: int  # number of the IMU, from 0
    t_s: Array  # (N,) at most 2000
    level: Array  # (N, 3) m/s^2, body axes
    limit: float  # above which estimators suffer, m/s^2
    clipped: int  # samples at the end of the range, over the whole recording


class FieldTrack(NamedTuple):
    """The field of one compass and the World Magnetic Model; at most 2000 points."""

    compass: int  # number, from 0
    t_s: Array  # (N,)
    norm_ut: Array  # (N,) measured
    dip_rad: Array  # (N,) measured, by the best attitude's vertical
    # (N,) error of the field's direction about the vertical by the best attitude, positive
    # clockwise from above
    heading_rad: Array
    model_norm_ut: Array  # (N,) of the model
    model_dip_rad: Array  # (N,) of the model


class CompassFit(NamedTuple):
    """Residuals between one compass and the earth's field, and their explanation."""

    compass: int  # number, from 0
    heading_rad: Array  # (S,) centres of the sectors of the vehicle's heading, 0 to 2 pi
    residual_ut: Array  # (S,) rms of measured minus expected field per sector
    fitted_ut: Array  # (S,) the same after the fit below
    heading_error_rad: Array  # (S,) resulting mean heading error
    # hard iron, body frame: measured = scale * true + offset; NaN if not determined
    offset_b_ut: Array
    scale: float  # of the norm; NaN if not determined
    throttle: Array  # (K,) centres of the bins of throttle; empty where it was not recorded
    motor_ut: Array  # (K,) rms of the field's change with throttle, microtesla
    motor_b_ut: Array  # (3,) change of the field from no throttle to full, body frame


class Bias(NamedTuple):
    """Bias of one gyro and one accelerometer; at most 2000 points."""

    imu: int  # number of the IMU, from 0
    t_s: Array  # (N,)
    gyro_b: Array  # (N, 3) rad/s, body frame
    gyro_limit: float  # of a data sheet, rad/s
    force_t_s: Array  # (M,) times at rest
    force_norm: Array  # (M,) norm of the specific force at rest, m/s^2


class TimingTrack(NamedTuple):
    """Samples of one IMU over time; at most 1000 columns."""

    imu: int  # number of the IMU, from 0
    source: str  # their message
    t_s: Array  # (N,) centres of columns
    rate_hz: Array  # (N,) samples per second
    longest_s: Array  # (N,) longest time between two samples
    # (N,) largest delay of arrivals against the autopilot's stamps; NaN if both clocks are
    # the same
    lateness_s: Array


class Receiver(NamedTuple):
    """Velocity of one receiver and inertial motion over short windows; at most 2000 points."""

    receiver: int  # number, from 0
    t_s: Array  # (N,) ends of the windows
    # (N, 3) change of velocity over the window, receiver minus inertial, NED, m/s
    difference_n: Array
    position_m: Array  # (N,) distance between the change of position and the integrated velocity
    sigma_m_s: Array  # (N,) accuracy stated by the receiver
    satellites: Array  # (N,)
    lag_s: float  # of the receiver's velocity against the IMU; NaN where not determined
