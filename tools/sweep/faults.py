"""Faults of sensors, receivers and estimators, as what they do to the series of a recording.

What the autopilot made of its own sensors stays as it was recorded: a fault bends no attitude and
no path. That is how the sensors of a second IMU, or of a receiver that it did not use, fail.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.maths.units import DEG, GRAVITY_M_S2

Array = NDArray[np.float64]
FOREVER = math.inf


class Samples(NamedTuple):
    """Samples of one IMU.

    Attributes:
        t_s: (N,) since the recording began.
        w_b: (N, 3) rad/s.
        f_b: (N, 3) m/s^2.
        m_b_ut: (N, 3) microtesla; NaN where there is none.
    """

    t_s: Array
    w_b: Array
    f_b: Array
    m_b_ut: Array


class Fixes(NamedTuple):
    """Fixes of a receiver.

    Attributes:
        t_s: (N,) since the recording began.
        v_n: (N, 3) m/s; NaN where it is unknown.
        p_n: (N, 2) north and east of where they were recorded, m: all zero, to be moved.
    """

    t_s: Array
    v_n: Array
    p_n: Array


class Attitude(NamedTuple):
    """The autopilot's attitude.

    Attributes:
        t_s: (N,) since the recording began.
        angles: (N, 3) roll, pitch, yaw, rad.
    """

    t_s: Array
    angles: Array


class Case(NamedTuple):
    """A fault with its time and its size.

    Attributes:
        size: in the unit of the fault.
        from_s: when it begins.
        to_s: when it ends.
        direction: (3,) of length one, drawn at random.
        field_ut: norm of the flight's field.
        seed: of further random numbers.
    """

    size: float
    from_s: float
    to_s: float
    direction: Array
    field_ut: float
    seed: int

    def acts(self, t_s: Array) -> NDArray[np.bool_]:
        """Where it is there."""
        return (t_s >= self.from_s) & (t_s < self.to_s)

    def since(self, t_s: Array) -> Array:
        """For how long it has been there, s; no more once it is over."""
        return np.clip(t_s, self.from_s, min(self.to_s, t_s[-1])) - self.from_s


class Fault(NamedTuple):
    """One kind of fault.

    Attributes:
        name: in the table.
        sizes: of which one is drawn, evenly in its logarithm.
        unit: of the size.
        when: ``boot``, ``armed`` (at rest, before the flight) or ``flight``.
        lasts_s: how long.
        told_as: kinds of findings of which any is right.
        source: what such a finding has to name.
        imu: what it makes of samples of the first IMU.
        fixes: what it makes of the receiver's fixes.
        attitude: what it makes of the autopilot's attitude.
        lost: which samples it takes away, by their times.
        late_s: by how much it shifts their stamps.
    """

    name: str
    sizes: tuple[float, float]
    unit: str
    when: str
    lasts_s: float
    told_as: frozenset[str]
    source: str
    imu: Callable[[Samples, Case], Samples] | None = None
    fixes: Callable[[Fixes, Case], Fixes] | None = None
    attitude: Callable[[Attitude, Case], Attitude] | None = None
    lost: Callable[[Array, Case], NDArray[np.bool_]] | None = None
    late_s: Callable[[Array, Case], Array] | None = None


def _where(case: Case, t_s: Array, changed: Array, values: Array) -> Array:
    return np.where(case.acts(t_s)[:, None], changed, values)


def _frozen(case: Case, t_s: Array, values: Array) -> Array:
    """The values of when it began, again and again."""
    known = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not len(known):
        return values
    first = known[min(int(np.searchsorted(t_s[known], case.from_s)), len(known) - 1)]
    return _where(case, t_s, values[first], values)


# --- compass ------------------------------------------------------------------------------------


def _hard_iron(s: Samples, case: Case) -> Samples:
    magnet = case.size * case.field_ut * case.direction
    return s._replace(m_b_ut=_where(case, s.t_s, s.m_b_ut + magnet, s.m_b_ut))


def _soft_iron(s: Samples, case: Case) -> Samples:
    axis = case.direction
    along = (s.m_b_ut @ axis)[:, None] * axis
    return s._replace(m_b_ut=_where(case, s.t_s, s.m_b_ut + case.size * along, s.m_b_ut))


def _compass_frozen(s: Samples, case: Case) -> Samples:
    held = _frozen(case, s.t_s, s.m_b_ut)
    return s._replace(m_b_ut=np.where(np.isnan(s.m_b_ut), s.m_b_ut, held))


# --- gyro and accelerometer -----------------------------------------------------------------------


def _gyro_bias(s: Samples, case: Case) -> Samples:
    changed = s.w_b + case.size * DEG * case.direction
    return s._replace(w_b=_where(case, s.t_s, changed, s.w_b))


def _gyro_scale(s: Samples, case: Case) -> Samples:
    return s._replace(w_b=_where(case, s.t_s, s.w_b * (1.0 + case.size), s.w_b))


def _gyro_axis(s: Samples, case: Case) -> Samples:
    w_b = s.w_b.copy()
    axis = case.seed % 3
    w_b[:, axis] = _frozen(case, s.t_s, s.w_b)[:, axis]
    return s._replace(w_b=w_b)


def _gyro_frozen(s: Samples, case: Case) -> Samples:
    return s._replace(w_b=_frozen(case, s.t_s, s.w_b))


def _force_bias(s: Samples, case: Case) -> Samples:
    return s._replace(f_b=_where(case, s.t_s, s.f_b + case.size * case.direction, s.f_b))


def _force_scale(s: Samples, case: Case) -> Samples:
    return s._replace(f_b=_where(case, s.t_s, s.f_b * (1.0 + case.size), s.f_b))


def _force_axis(s: Samples, case: Case) -> Samples:
    f_b = s.f_b.copy()
    axis = case.seed % 3
    f_b[:, axis] = _frozen(case, s.t_s, s.f_b)[:, axis]
    return s._replace(f_b=f_b)


def _imu_frozen(s: Samples, case: Case) -> Samples:
    return _gyro_frozen(s, case)._replace(f_b=_frozen(case, s.t_s, s.f_b))


def _vibration(s: Samples, case: Case) -> Samples:
    """White over the samples, as a stream shows what lies above it; `size` is its rms."""
    noise = np.random.default_rng(case.seed).normal(0.0, 1.0, s.f_b.shape) / math.sqrt(3.0)
    changed = s.f_b + case.size * noise
    return s._replace(f_b=_where(case, s.t_s, changed, s.f_b))


def _clipping(s: Samples, case: Case) -> Samples:
    """So strong a vibration that many samples stand at the end of the range."""
    shaken = _vibration(s, case).f_b
    end = 16.0 * GRAVITY_M_S2
    return s._replace(f_b=np.clip(shaken, -end, end))


def _gaps(t_s: Array, case: Case) -> NDArray[np.bool_]:
    """A pause of `size` every 5 s."""
    return case.acts(t_s) & ((t_s - case.from_s) % 5.0 < case.size)


def _stamps_jump(t_s: Array, case: Case) -> Array:
    return np.where(case.acts(t_s), case.size, 0.0)


# --- receiver -------------------------------------------------------------------------------------


def _level(case: Case) -> Array:
    """A direction in the horizontal plane."""
    north, east, _ = case.direction
    angle = math.atan2(east, north)
    return np.array([math.cos(angle), math.sin(angle), 0.0])


def _gps_step(f: Fixes, case: Case) -> Fixes:
    return f._replace(v_n=_where(case, f.t_s, f.v_n + case.size * _level(case), f.v_n))


def _gps_ramp(f: Fixes, case: Case) -> Fixes:
    """A velocity that runs away, and at its end is right at once."""
    ramp = case.size * case.since(f.t_s)[:, None] * _level(case)
    return f._replace(v_n=_where(case, f.t_s, f.v_n + ramp, f.v_n))


def _gps_spoofed(f: Fixes, case: Case) -> Fixes:
    """Velocity and place are led away together."""
    since = case.since(f.t_s)[:, None]
    drawn = _level(case)
    return f._replace(
        v_n=f.v_n + case.size * since * drawn,
        p_n=f.p_n + 0.5 * case.size * since**2 * drawn[:2],
    )


def _gps_frozen(f: Fixes, case: Case) -> Fixes:
    return f._replace(v_n=_frozen(case, f.t_s, f.v_n))


def _gps_place(f: Fixes, case: Case) -> Fixes:
    return f._replace(p_n=_where(case, f.t_s, f.p_n + case.size * _level(case)[:2], f.p_n))


def _gps_late(f: Fixes, case: Case) -> Fixes:
    columns = [np.interp(f.t_s - case.size, f.t_s, column) for column in f.v_n.T]
    return f._replace(v_n=np.stack(columns, axis=1))


# --- the autopilot --------------------------------------------------------------------------------


def _turned(axis: int) -> Callable[[Attitude, Case], Attitude]:
    def change(a: Attitude, case: Case) -> Attitude:
        extra = case.size * DEG * np.eye(3)[axis]
        return a._replace(angles=_where(case, a.t_s, a.angles + extra, a.angles))

    return change


def _drifting(a: Attitude, case: Case) -> Attitude:
    """Its roll runs away over 20 s, and stays."""
    share = np.clip(case.since(a.t_s) / 20.0, 0.0, 1.0)[:, None]
    return a._replace(angles=a.angles + case.size * DEG * share * np.eye(3)[0])


def _kinds(text: str) -> frozenset[str]:
    return frozenset(text.split())


COMPASS = _kinds(
    "compass_field compass_step compass_hard_iron compass_soft_iron compass_scale compasses_differ"
)
GYRO = _kinds("gyro_bias gyro_bias_step gyro_apart gyro_field")
# An accelerometer that is off bends the attitude, which the receiver's velocity shows.
FORCE = _kinds(
    "accelerometer_bias accelerometer_bias_step accelerometer_apart accelerometer_scale"
    " attitude_velocity attitude_gravity gps_velocity"
)
RECEIVER = _kinds("gps_velocity attitude_velocity gnss_spoofed")
DEAD_GYRO = _kinds("gyro_frozen imu_frozen axis_stuck gyro_field")
OWN = "autopilot"

FAULTS = (
    Fault("hard iron from boot", (0.1, 0.6), "of the field", "boot", FOREVER, COMPASS,
          "compass", imu=_hard_iron),
    Fault("hard iron in flight", (0.1, 0.6), "of the field", "flight", FOREVER, COMPASS,
          "compass", imu=_hard_iron),
    Fault("soft iron from boot", (0.15, 0.5), "along one axis", "boot", FOREVER, COMPASS,
          "compass", imu=_soft_iron),
    Fault("compass frozen", (1.0, 1.0), "", "flight", 30.0,
          COMPASS | {"compass_frozen"}, "compass", imu=_compass_frozen),
    Fault("GPS velocity step", (2.0, 10.0), "m/s", "flight", 15.0, RECEIVER, "GPS",
          fixes=_gps_step),
    Fault("GPS velocity ramp", (1.0, 4.0), "m/s^2", "flight", 10.0, RECEIVER, "GPS",
          fixes=_gps_ramp),
    Fault("GPS spoofed slowly", (0.3, 0.8), "m/s^2", "flight", FOREVER, RECEIVER, "GPS",
          fixes=_gps_spoofed),
    Fault("GPS velocity frozen", (1.0, 1.0), "", "flight", 15.0, RECEIVER | {"gps_frozen"},
          "GPS", fixes=_gps_frozen),
    Fault("GPS place jumps", (15.0, 100.0), "m", "flight", 15.0, _kinds("gps_jump"), "GPS",
          fixes=_gps_place),
    Fault("GPS velocity late", (0.5, 1.0), "s", "boot", FOREVER,
          _kinds("gps_lag"), "GPS", fixes=_gps_late),
    Fault("gyro bias, armed at rest", (0.3, 3.0), "deg/s", "armed", FOREVER, GYRO,
          "IMU 1", imu=_gyro_bias),
    Fault("gyro bias in flight", (0.3, 3.0), "deg/s", "flight", FOREVER, GYRO, "IMU 1",
          imu=_gyro_bias),
    Fault("gyro scale", (0.03, 0.15), "too much", "boot", FOREVER, GYRO | {"gyro_scale"},
          "IMU 1", imu=_gyro_scale),
    Fault("accelerometer bias in flight", (0.5, 3.0), "m/s^2", "flight", FOREVER, FORCE,
          "IMU 1", imu=_force_bias),
    Fault("accelerometer scale from boot", (0.03, 0.15), "too much", "boot", FOREVER, FORCE,
          "IMU 1", imu=_force_scale),
    Fault("gyro axis stuck", (1.0, 1.0), "", "flight", 20.0, DEAD_GYRO | GYRO, "IMU 1",
          imu=_gyro_axis),
    Fault("accelerometer axis stuck", (1.0, 1.0), "", "flight", 20.0,
          FORCE | {"axis_stuck", "accelerometer_frozen"}, "IMU 1", imu=_force_axis),
    Fault("gyro frozen", (1.0, 1.0), "", "flight", 20.0, DEAD_GYRO, "IMU 1",
          imu=_gyro_frozen),
    Fault("IMU frozen", (1.0, 1.0), "", "flight", 20.0, DEAD_GYRO, "IMU 1", imu=_imu_frozen),
    Fault("vibration", (35.0, 60.0), "m/s^2", "flight", 20.0,
          _kinds("vibration vibration_level vibration_line"), "IMU 1", imu=_vibration),
    Fault("clipping", (120.0, 200.0), "m/s^2", "flight", 10.0,
          _kinds("clipping clipped_samples vibration"), "IMU 1", imu=_clipping),
    Fault("samples missing", (0.3, 1.0), "s", "flight", FOREVER, _kinds("imu_gaps"), "IMU 1",
          lost=_gaps),
    Fault("clock jumps", (0.5, 5.0), "s", "flight", FOREVER,
          _kinds("imu_gaps clock_drift clock_jump late_bursts"), "IMU 1", late_s=_stamps_jump),
    Fault("autopilot's heading off", (8.0, 30.0), "deg", "flight", 40.0,
          _kinds("autopilot_heading attitude_reset"), OWN, attitude=_turned(2)),
    Fault("autopilot's roll off", (4.0, 15.0), "deg", "flight", 40.0,
          _kinds("autopilot_tilt attitude_reset"), OWN, attitude=_turned(0)),
    Fault("autopilot's roll drifts away", (5.0, 20.0), "deg", "flight", FOREVER,
          _kinds("autopilot_tilt attitude_reset"), OWN, attitude=_drifting),
)  # fmt: skip
"""In the order of the table."""
