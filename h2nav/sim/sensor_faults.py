"""Faults of the sensors themselves: what they do to one sample of the first IMU."""

import math

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.sim.faults import AXES, FaultSchedule
from h2nav.sim.imu_model import CALM, Disturbance

# Beyond what any message can say, so that integers stand at their ends.
_BEYOND_RANGE = 1e9
_NAMES = {"stuck", "saturate", "nan", "zero-accel", "no-mag"}


class SensorFaults:
    """Applies the scheduled sensor faults to samples, in the order of their times."""

    def __init__(self, schedule: FaultSchedule) -> None:
        self._schedule = schedule
        self._acts = any(name in schedule for name in _NAMES)
        self._disturbs = "hard-iron" in schedule or "vibration" in schedule
        self._stuck: dict[str, float] = {}

    def disturbance(self, t_s: float) -> Disturbance:
        """What the surroundings add at `t_s`."""
        if not self._disturbs:
            return CALM
        iron = self._schedule.number("hard-iron", t_s) or 0.0
        return Disturbance((iron, 0.0, 0.0), self._schedule.number("vibration", t_s) or 0.0)

    def apply(self, t_s: float, sample: ImuSample) -> ImuSample:
        """The sample as the faulty sensor gives it."""
        if not self._acts or sample.m_b_ut is None:
            return sample
        values = [*sample.w_b, *sample.f_b, *sample.m_b_ut]
        if self._schedule.acts("zero-accel", t_s):
            values[3:6] = (0.0, 0.0, 0.0)
        if self._schedule.acts("no-mag", t_s):
            values[6:9] = (0.0, 0.0, 0.0)
        for axis in self._schedule.words("saturate", t_s):
            values[AXES.index(axis)] = math.copysign(_BEYOND_RANGE, values[AXES.index(axis)])
        stuck = self._schedule.words("stuck", t_s)
        self._stuck = {axis: self._stuck.get(axis, values[AXES.index(axis)]) for axis in stuck}
        for axis, value in self._stuck.items():
            values[AXES.index(axis)] = value
        for axis in self._schedule.words("nan", t_s):
            values[AXES.index(axis)] = math.nan
        return sample._replace(
            w_b=_triple(values, 0), f_b=_triple(values, 3), m_b_ut=_triple(values, 6)
        )


def _triple(values: list[float], first: int) -> Vec3:
    return (values[first], values[first + 1], values[first + 2])
