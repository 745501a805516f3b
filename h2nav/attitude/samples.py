"""Immutable inputs and outputs of an attitude filter.

Frames: ``b`` body (forward, right, down), ``n`` local NED with true north. SI and radians unless a
suffix says otherwise. ``q_nb`` is Hamilton, scalar first, and takes body coordinates to NED.

Each record that a filter is told besides samples says how it looks where time runs backward, apart
from its own time (`backward`).
"""

import math
from enum import IntFlag
from typing import NamedTuple

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class ImuSample(NamedTuple):
    """One inertial sample in the body frame."""

    t_us: int  # autopilot time of the sample, unwrapped, never decreasing inside one epoch
    w_b: Vec3  # angular rate, rad/s, gyro bias included
    f_b: Vec3  # specific force, m/s^2; (0, 0, -9.8) at rest and level, (0, 0, 0) without one
    m_b_ut: Vec3 | None = None  # magnetic field, microtesla; None without a new field
    # a sensor is at the end of its range, or stuck: the values do not measure the motion, and
    # nothing may be estimated from them
    clipped: bool = False


class EarthField(NamedTuple):
    """Magnetic field of the earth at the vehicle."""

    norm_ut: float  # total intensity, microtesla
    dip_rad: float  # inclination, positive down
    declination_rad: float  # magnetic north from true north, positive east

    def backward(self) -> "EarthField":
        """The same."""
        return self


class VehicleState(NamedTuple):
    """The autopilot's report of the vehicle, as far as filters use it."""

    # disarmed or landed. None = unknown (a recording without an autopilot): the filter
    # decides by its class.
    on_ground: bool | None = None
    airspeed_m_s: float | None = None  # true airspeed along the nose; None when unknown or stale
    is_backward: bool = False  # time runs backward (a smoother's second run), and the nose trails
    is_armed: bool = False  # its motors may turn it, even on the ground

    def backward(self) -> "VehicleState":
        """The nose trails."""
        return self._replace(is_backward=True)


# A velocity that is less certain holds no filter.
MAX_FIX_SIGMA_M_S = 3.0


class VelocityFix(NamedTuple):
    """A velocity over ground from outside the inertial sensors."""

    t_us: int  # time of validity on the clock of `ImuSample.t_us`
    v_n: Vec3  # velocity in NED, m/s; a vertical component that is not measured is NaN
    sigma_m_s: float  # one-sigma accuracy per axis stated by the source
    independent: bool = True  # False when the velocity comes from the autopilot's own estimator
    removed_s: float = 0.0  # delay that was found, and is no longer in its time
    removed_sigma_s: float = 0.0  # deviation of the delay that was found; 0: not known
    altitude_m: float = math.nan  # of the same place, above mean sea level; NaN if not measured
    is_denied: bool = False  # the places of the same receiver move otherwise

    def backward(self) -> "VelocityFix":
        """The opposite velocity."""
        north, east, down = self.v_n
        return self._replace(v_n=(-north, -east, -down))


class SensorDelays(NamedTuple):
    """Delays of results from the sensors, relative to the time stamps of their messages."""

    # of an attitude integrated from the rates: the age of rates and forces, minus half a
    # period of the samples, because a filter takes a rate as the mean over the step before
    # its sample. Negative: it is early.
    gyro_s: float = 0.0
    field_s: float = 0.0  # age of the field when its first sample arrives

    def backward(self) -> "SensorDelays":
        """The same."""
        return self


class SensorErrors(NamedTuple):
    """Sensor errors estimated by a filter, besides the gyro's bias, which estimates contain."""

    gyro_variance: Vec3  # of the gyro's bias, (rad/s)^2, body
    force_bias_b: Vec3 = (0.0, 0.0, 0.0)  # of the accelerometer, m/s^2 (measured = true + bias)
    # of that about x and y, (m/s^2)^2; 0: not estimated
    force_variance: tuple[float, float] = (0.0, 0.0)
    field_latency_s: float = 0.0  # delay of the magnetometer's samples relative to the gyro's
    fix_latency_s: float = 0.0  # delay of velocity fixes beyond their stamps
    fix_latency_variance: float = 0.0  # of that, s^2
    rate_density: float = 0.0  # of the rate's noise in its samples, squared, rad^2/s
    force_density: float = 0.0  # likewise of the force, squared, m^2/s^3
    # size of the field's offset in body axes (hard iron) with one deviation, of the field's norm
    field_offset_share: float = 0.0


class SensorCorrection(NamedTuple):
    """The errors of a sensor proved wrong, and the attitude without them; all from what is known.

    Deviations are those left, one sigma.
    """

    rate_b: Vec3  # of the gyro's bias, rad/s, body
    force_b: Vec3  # of the accelerometer's, m/s^2, body
    turn_n: Vec3  # from the attitude to that without the errors, rotation vector in NED, rad
    rate_sigma_b: Vec3  # of the gyro's bias, rad/s
    force_sigma_b: tuple[float, float]  # of the accelerometer's about x and y, m/s^2
    tilt_sigma_rad: float  # of the attitude's tilt
    heading_sigma_rad: float  # of its heading


class SensorDoubt(NamedTuple):
    """Sensors found wrong, and by how much: a filter estimates them anew."""

    # of the gyro's bias as the filter knows it, one sigma, rad/s, body
    rate_b: Vec3 = (0.0, 0.0, 0.0)
    # of the accelerometer's about x and y, one sigma, m/s^2
    force_b: tuple[float, float] = (0.0, 0.0)
    tilt_rad: float = 0.0  # of the tilt that a sensor proved wrong has caused
    heading_rad: float = 0.0  # of the heading, likewise
    # what a sensor proved wrong is off by, which its samples no longer contain
    correction: SensorCorrection | None = None


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


class _TrustOfBits(dict[int, Trust]):
    def __missing__(self, bits: int) -> Trust:
        made = self[bits] = Trust(bits)
        return made


# Making an IntFlag costs more than the rest of an estimate, making all of them 60 ms at the start.
TRUST_OF = _TrustOfBits()


class AttitudeEstimate(NamedTuple):
    """One estimate, made from and for one `ImuSample`."""

    t_us: int  # time of the sample
    q_nb: Quat  # attitude, body to NED
    w_b: Vec3  # angular rate corrected for bias, rad/s
    bias_b: Vec3  # gyro bias, rad/s (measured = true + bias)
    innovation_n: Vec3  # rotation (rad, NED) between the estimate and this sample's measurements
    sigma_tilt_rad: float  # predicted one-sigma tilt error; NaN if unknown
    trust: Trust  # the basis of the estimate
    sigma_heading_rad: float = math.nan  # predicted one-sigma heading error; NaN if unknown
