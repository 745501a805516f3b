"""Immutable inputs and outputs of an attitude filter.

Frames: ``b`` body (forward, right, down), ``n`` local NED with true north. SI and radians unless a
suffix says otherwise. ``q_nb`` is Hamilton, scalar first, and takes body coordinates to NED.
"""

import math
from enum import IntFlag
from typing import NamedTuple

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class ImuSample(NamedTuple):
    """One inertial sample in the body frame.

    Attributes:
        t_us: autopilot time of the sample, unwrapped, never decreasing inside one epoch.
        w_b: angular rate, rad/s, gyro bias included.
        f_b: specific force, m/s^2; (0, 0, -9.8) at rest and level, (0, 0, 0) without one.
        m_b_ut: magnetic field, microtesla; None without a new field.
        clipped: a sensor is at the end of its range, or stuck: the values do not measure the
            motion, and nothing may be estimated from them.
    """

    t_us: int
    w_b: Vec3
    f_b: Vec3
    m_b_ut: Vec3 | None = None
    clipped: bool = False


class EarthField(NamedTuple):
    """Magnetic field of the earth at the vehicle.

    Attributes:
        norm_ut: total intensity, microtesla.
        dip_rad: inclination, positive down.
        declination_rad: magnetic north from true north, positive east.
    """

    norm_ut: float
    dip_rad: float
    declination_rad: float


class VehicleState(NamedTuple):
    """The autopilot's report of the vehicle, as far as filters use it.

    Attributes:
        on_ground: disarmed or landed. None = unknown (a recording without an autopilot): the
            filter decides by its class.
        airspeed_m_s: true airspeed along the nose; None when unknown or stale.
        is_backward: time runs backward (a smoother's second run), and the nose trails.
        is_armed: its motors may turn it, even on the ground.
    """

    on_ground: bool | None = None
    airspeed_m_s: float | None = None
    is_backward: bool = False
    is_armed: bool = False


class VelocityFix(NamedTuple):
    """A velocity over ground from outside the inertial sensors.

    Attributes:
        t_us: time of validity on the clock of `ImuSample.t_us`.
        v_n: velocity in NED, m/s; a vertical component that is not measured is NaN.
        sigma_m_s: one-sigma accuracy per axis stated by the source.
        independent: False when the velocity comes from the autopilot's own estimator.
    """

    t_us: int
    v_n: Vec3
    sigma_m_s: float
    independent: bool = True


class SensorDelays(NamedTuple):
    """Delays of results from the sensors, relative to the time stamps of their messages.

    Attributes:
        gyro_s: of an attitude integrated from the rates: the age of rates and forces, minus half a
            period of the samples, because a filter takes a rate as the mean over the step before
            its sample. Negative: it is early.
        field_s: age of the field when its first sample arrives.
    """

    gyro_s: float = 0.0
    field_s: float = 0.0


class SensorErrors(NamedTuple):
    """Sensor errors estimated by a filter, besides the gyro's bias, which estimates contain.

    Attributes:
        gyro_variance: of the gyro's bias, (rad/s)^2, body.
        force_bias_b: of the accelerometer, m/s^2 (measured = true + bias).
        force_variance: of that about x and y, (m/s^2)^2; 0: not estimated.
        field_latency_s: delay of the magnetometer's samples relative to the gyro's.
        fix_latency_s: delay of velocity fixes beyond their stamps.
        fix_latency_variance: of that, s^2.
        rate_density: of the rate's noise in its samples, squared, rad^2/s.
        force_density: likewise of the force, squared, m^2/s^3.
    """

    gyro_variance: Vec3
    force_bias_b: Vec3 = (0.0, 0.0, 0.0)
    force_variance: tuple[float, float] = (0.0, 0.0)
    field_latency_s: float = 0.0
    fix_latency_s: float = 0.0
    fix_latency_variance: float = 0.0
    rate_density: float = 0.0
    force_density: float = 0.0


class SensorDoubt(NamedTuple):
    """Sensors found wrong, and by how much: a filter estimates them anew.

    Attributes:
        rate_b: of the gyro's bias as the filter knows it, one sigma, rad/s, body.
        force_b: of the accelerometer's about x and y, one sigma, m/s^2.
        tilt_rad: of the tilt that a sensor proved wrong has caused.
        heading_rad: of the heading, likewise.
    """

    rate_b: Vec3 = (0.0, 0.0, 0.0)
    force_b: tuple[float, float] = (0.0, 0.0)
    tilt_rad: float = 0.0
    heading_rad: float = 0.0


class Trust(IntFlag):
    """The basis of an estimate; logged with every estimate."""

    ALIGNED = 1  # a start-up alignment has been made
    CONVERGED = 2  # the start-up transient is over
    FORCE_USED = 4  # this sample's specific force corrected the tilt
    FIELD_USED = 8  # this sample's (or the latest) magnetic field corrected the heading
    YAW_REFERENCED = 16  # heading is tied to north; without it yaw only drifts with the gyro
    REST = 32  # rest was detected and used for the gyro bias
    VELOCITY_USED = 64  # an outside velocity is being fused
    RESTARTED = 128  # this sample re-aligned the filter
    SATURATED = 256  # this sample or an internal value stood at a limit


class AttitudeEstimate(NamedTuple):
    """One estimate, made from and for one `ImuSample`.

    Attributes:
        t_us: time of the sample.
        q_nb: attitude, body to NED.
        w_b: angular rate corrected for bias, rad/s.
        bias_b: gyro bias, rad/s (measured = true + bias).
        innovation_n: rotation (rad, NED) between the estimate and this sample's measurements.
        sigma_tilt_rad: predicted one-sigma tilt error; NaN if unknown.
        trust: the basis of the estimate.
        sigma_heading_rad: predicted one-sigma heading error; NaN if unknown.
    """

    t_us: int
    q_nb: Quat
    w_b: Vec3
    bias_b: Vec3
    innovation_n: Vec3
    sigma_tilt_rad: float
    trust: Trust
    sigma_heading_rad: float = math.nan
