"""Faults of the sensors: their effect on a sample of an IMU or a fix of the receiver."""

import math
from collections.abc import Callable
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.sim.faults import AXES, FaultSchedule
from h2nav.sim.imu_model import CALM, Disturbance

# Beyond the range of any message, so that integers saturate.
_BEYOND_RANGE = 1e9
ZERO: Vec3 = (0.0, 0.0, 0.0)


def _scaled(v: Vec3, factor: float) -> Vec3:
    return (v[0] * factor, v[1] * factor, v[2] * factor)


def _turned(v: Vec3, angle_rad: float) -> Vec3:
    """A vector seen by a sensor that is turned about z."""
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return (c * v[0] + s * v[1], c * v[1] - s * v[0], v[2])


def _limited(v: Vec3, limit: float) -> Vec3:
    x, y, z = (min(max(component, -limit), limit) for component in v)
    return (x, y, z)


# Effect of each fault on a sample, given its argument; active ones are applied in this order.
SAMPLE_FAULTS: dict[str, Callable[[ImuSample, float], ImuSample]] = {
    "gyro-bias": lambda s, x: s._replace(w_b=(s.w_b[0] + x * DEG, s.w_b[1], s.w_b[2])),
    "gyro-scale": lambda s, x: s._replace(w_b=_scaled(s.w_b, x)),
    "gyro-swap": lambda s, _: s._replace(w_b=(s.w_b[1], s.w_b[0], s.w_b[2])),
    "gyro-deg": lambda s, _: s._replace(w_b=_scaled(s.w_b, 1.0 / DEG)),
    "gyro-zero": lambda s, _: s._replace(w_b=ZERO),
    "accel-bias": lambda s, x: s._replace(f_b=(s.f_b[0] + x, s.f_b[1], s.f_b[2])),
    "accel-scale": lambda s, x: s._replace(f_b=_scaled(s.f_b, x)),
    "clipping": lambda s, x: s._replace(f_b=_limited(s.f_b, x * GRAVITY_M_S2)),
    "accel-fixed": lambda s, x: s._replace(f_b=(x, x, x)),
    "zero-accel": lambda s, _: s._replace(f_b=ZERO),
    "compass-reversed": lambda s, _: s._replace(m_b_ut=_scaled(s.m_b_ut or ZERO, -1.0)),
    "compass-turned": lambda s, x: s._replace(m_b_ut=_turned(s.m_b_ut or ZERO, x * DEG)),
    "no-mag": lambda s, _: s._replace(m_b_ut=ZERO),
}
# Effect of each fault on the axis in its argument.
AXIS_FAULTS: dict[str, Callable[[float], float]] = {
    "saturate": lambda value: math.copysign(_BEYOND_RANGE, value),
    "nan": lambda _: math.nan,
}
# The axes that keep their values from the beginning of the fault.
FROZEN_AXES = {
    "imu-frozen": AXES,
    "gyro-frozen": AXES[0:3],
    "accel-frozen": AXES[3:6],
    "compass-frozen": AXES[6:9],
}


class SensorFaults:
    """Applies the scheduled faults of one IMU to its samples, in the order of their times.

    Args:
        schedule: the faults of this IMU; they may change while it flies.
    """

    def __init__(self, schedule: FaultSchedule) -> None:
        self._schedule = schedule
        self._held: dict[str, float] = {}

    def disturbance(self, t_s: float) -> Disturbance:
        """Effects of the surroundings at `t_s`."""
        if not self._schedule:
            return CALM
        iron = self._schedule.number("hard-iron", t_s) or 0.0
        return Disturbance((iron, 0.0, 0.0), self._schedule.number("vibration", t_s) or 0.0)

    def apply(self, t_s: float, sample: ImuSample) -> ImuSample:
        """The sample of the faulty sensor."""
        if not self._schedule:
            self._held.clear()
            return sample
        for name, change in SAMPLE_FAULTS.items():
            for fault in self._schedule.acting(name, t_s):
                sample = change(sample, float(fault.argument or 0.0))
        values = [*sample.w_b, *sample.f_b, *(sample.m_b_ut or ZERO)]
        for name, changed in AXIS_FAULTS.items():
            for axis in self._schedule.words(name, t_s):
                values[AXES.index(axis)] = changed(values[AXES.index(axis)])
        self._held = {
            axis: self._held.get(axis, values[AXES.index(axis)]) for axis in self._frozen(t_s)
        }
        for axis, value in self._held.items():
            values[AXES.index(axis)] = value
        return sample._replace(
            w_b=_triple(values, 0), f_b=_triple(values, 3), m_b_ut=_triple(values, 6)
        )

    def has_gyro_data(self, t_s: float) -> bool:
        """Whether the gyro has new values from the autopilot's point of view."""
        return not self._acts(("imu-frozen", "gyro-frozen"), t_s)

    def has_accel_data(self, t_s: float) -> bool:
        """Whether the accelerometer has new values from the autopilot's point of view."""
        return not self._acts(("imu-frozen", "accel-frozen"), t_s)

    def _acts(self, names: tuple[str, ...], t_s: float) -> bool:
        return any(self._schedule.acts(name, t_s) for name in names)

    def _frozen(self, t_s: float) -> list[str]:
        """The axes frozen at `t_s`."""
        frozen = self._schedule.words("stuck", t_s)
        for name, axes in FROZEN_AXES.items():
            if self._schedule.acts(name, t_s):
                frozen += axes
        return frozen


class GpsReading(NamedTuple):
    """A receiver's measurement."""

    has_fix: bool  # whether it has a fix
    p_n: Vec3  # position, NED, m from the start of the scenario
    v_n: Vec3  # velocity, NED, m/s


def faulty_gps(schedule: FaultSchedule, t_s: float, reading: GpsReading) -> GpsReading:
    """The reading with the receiver's faults at `t_s`, except ``gps-lag``.

    A velocity error also moves the position, as with a spoofed receiver.
    """
    (north_m, east_m, down_m), (north_m_s, east_m_s, down_m_s) = reading.p_n, reading.v_n
    for fault in schedule.acting("gps-step", t_s):
        speed_m_s = float(fault.argument)
        north_m_s += speed_m_s
        north_m += speed_m_s * (t_s - fault.start_s)
    for fault in schedule.acting("gps-ramp", t_s):
        drift_m_s2, since_s = float(fault.argument), t_s - fault.start_s
        north_m_s += drift_m_s2 * since_s
        north_m += 0.5 * drift_m_s2 * since_s**2
    return GpsReading(
        reading.has_fix and not schedule.acts("gps-lost", t_s),
        (north_m, east_m, down_m),
        (north_m_s, east_m_s, down_m_s),
    )


def _triple(values: list[float], first: int) -> Vec3:
    return (values[first], values[first + 1], values[first + 2])
