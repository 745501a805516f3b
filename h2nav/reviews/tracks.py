"""The data behind the findings of a whole flight, as arrays of bounded length for pictures.

Times `t_s` are those of `h2nav.recordings.context`. NaN means unknown.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array


class Peak(NamedTuple):
    """A line of a spectrum.

    Attributes:
        frequency_hz: its centre.
        width_hz: between the points of half its power.
        rms: of the line over all three axes, in the spectrum's unit.
        harmonic: its number among the harmonics, 1 = the fundamental; 0 = of no family.
    """

    frequency_hz: float
    width_hz: float
    rms: float
    harmonic: int


class Spectrum(NamedTuple):
    """Vibration of one sensor while the motors turned: the mean spectrum and its change over time.

    Attributes:
        imu: number of the IMU, from 0.
        sensor: ``gyro`` or ``accelerometer``.
        unit: of the values: ``rad/s`` or ``m/s^2``.
        rate_hz: of the samples; frequencies above its half appear mirrored below.
        is_burst: from bursts at the sensor's own rate; otherwise from the samples as recorded.
        frequency_hz: (F,) at most 256.
        density: (F, 3) amplitude per root of bandwidth, unit / sqrt(Hz), body axes.
        peaks: prominent lines, strongest first.
        t_s: (T,) centres of the spectrogram's columns, at most 300.
        levels: (T, F) the same density over all axes; float32.
    """

    imu: int
    sensor: str
    unit: str
    rate_hz: float
    is_burst: bool
    frequency_hz: Array
    density: Array
    peaks: tuple[Peak, ...]
    t_s: Array
    levels: NDArray[np.float32]


class Vibrations(NamedTuple):
    """Vibration of one accelerometer as ArduPilot's VIBE messages define it.

    Attributes:
        imu: number of the IMU, from 0.
        t_s: (N,) at most 2000.
        level: (N, 3) m/s^2, body axes.
        limit: above which estimators suffer, m/s^2.
        clipped: samples at the end of the range, over the whole recording.
    """

    imu: int
    t_s: Array
    level: Array
    limit: float
    clipped: int


class FieldTrack(NamedTuple):
    """The field of one compass and the World Magnetic Model; at most 2000 points.

    Attributes:
        compass: number, from 0.
        t_s: (N,).
        norm_ut: (N,) measured.
        dip_rad: (N,) measured, by the best attitude's vertical.
        heading_rad: (N,) error of the field's direction about the vertical by the best attitude,
            positive clockwise from above.
        model_norm_ut: (N,) of the model.
        model_dip_rad: (N,) of the model.
    """

    compass: int
    t_s: Array
    norm_ut: Array
    dip_rad: Array
    heading_rad: Array
    model_norm_ut: Array
    model_dip_rad: Array


class CompassFit(NamedTuple):
    """Residuals between one compass and the earth's field, and their explanation.

    Attributes:
        compass: number, from 0.
        heading_rad: (S,) centres of the sectors of the vehicle's heading, 0 to 2 pi.
        residual_ut: (S,) rms of measured minus expected field per sector.
        fitted_ut: (S,) the same after the fit below.
        heading_error_rad: (S,) resulting mean heading error.
        offset_b_ut: hard iron, body frame: measured = scale * true + offset; NaN if not determined.
        scale: of the norm; NaN if not determined.
        throttle: (K,) centres of the bins of throttle; empty where it was not recorded.
        motor_ut: (K,) rms of the field's change with throttle, microtesla.
        motor_b_ut: (3,) change of the field from no throttle to full, body frame.
    """

    compass: int
    heading_rad: Array
    residual_ut: Array
    fitted_ut: Array
    heading_error_rad: Array
    offset_b_ut: Array
    scale: float
    throttle: Array
    motor_ut: Array
    motor_b_ut: Array


class Bias(NamedTuple):
    """Bias of one gyro and one accelerometer; at most 2000 points.

    Attributes:
        imu: number of the IMU, from 0.
        t_s: (N,).
        gyro_b: (N, 3) rad/s, body frame.
        gyro_limit: of a data sheet, rad/s.
        force_t_s: (M,) times at rest.
        force_norm: (M,) norm of the specific force at rest, m/s^2.
        force_limit: of its difference to gravity by a data sheet, m/s^2.
    """

    imu: int
    t_s: Array
    gyro_b: Array
    gyro_limit: float
    force_t_s: Array
    force_norm: Array
    force_limit: float


class TimingTrack(NamedTuple):
    """Samples of one IMU over time; at most 1000 columns.

    Attributes:
        imu: number of the IMU, from 0.
        source: their message.
        t_s: (N,) centres of columns.
        rate_hz: (N,) samples per second.
        longest_s: (N,) longest time between two samples.
        lateness_s: (N,) largest delay of arrivals against the autopilot's stamps; NaN if both
            clocks are the same.
    """

    imu: int
    source: str
    t_s: Array
    rate_hz: Array
    longest_s: Array
    lateness_s: Array


class Receiver(NamedTuple):
    """Velocity of one receiver and inertial motion over short windows; at most 2000 points.

    Attributes:
        receiver: number, from 0.
        t_s: (N,) ends of the windows.
        difference_n: (N, 3) change of velocity over the window, receiver minus inertial, NED, m/s.
        position_m: (N,) distance between the change of position and the integrated velocity.
        sigma_m_s: (N,) accuracy stated by the receiver.
        satellites: (N,).
        lag_s: of the receiver's velocity against the IMU; NaN where not determined.
    """

    receiver: int
    t_s: Array
    difference_n: Array
    position_m: Array
    sigma_m_s: Array
    satellites: Array
    lag_s: float
