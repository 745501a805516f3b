"""Finds an axis that repeats its value while the vehicle moves: a sensor that is stuck.

At rest an integer axis repeats its value rightly (ArduPilot's mrad/s read 0 for minutes), so an
axis is called stuck only when the other two axes of its sensor vary clearly meanwhile; and near
zero, where truncation makes a dead zone, only when they vary wildly.
"""

import math
from enum import Enum

from h2nav.attitude.samples import ImuSample, Vec3

STUCK_US = 1_000_000
# How far the other two axes must have gone meanwhile, both together.
GYRO_SPAN_RAD_S = 0.3
FORCE_SPAN_M_S2 = 1.0
# Values below this may be the dead zone of truncated integers.
GYRO_DEAD_ZONE_RAD_S = 0.02
FORCE_DEAD_ZONE_M_S2 = 0.1
DEAD_ZONE_FACTOR = 20.0
_AXES = "xyz"


class Sensor(Enum):
    """Which sensor; the value is its name for people."""

    GYRO = "gyro"
    ACCELEROMETER = "accelerometer"


class _Run:
    """One axis that repeats its value.

    Args:
        since_us: when the value came first.
        one: value of another axis then.
        two: value of the third one.
    """

    def __init__(self, since_us: int, one: float, two: float) -> None:
        self.since_us = since_us
        self._low_one = self._high_one = one
        self._low_two = self._high_two = two

    def add(self, one: float, two: float) -> float:
        """Takes the others of a sample; how far both have gone since the beginning."""
        if one < self._low_one:
            self._low_one = one
        elif one > self._high_one:
            self._high_one = one
        if two < self._low_two:
            self._low_two = two
        elif two > self._high_two:
            self._high_two = two
        return self._high_one - self._low_one + self._high_two - self._low_two


class _Axes:
    """The three axes of one sensor: which repeat their values, and what the others do meanwhile."""

    def __init__(self, span: float, dead_zone: float) -> None:
        self._span = span
        self._dead_zone = dead_zone
        self._before: Vec3 = (math.nan, math.nan, math.nan)
        self._before_us = 0
        self._runs: list[_Run | None] = [None, None, None]
        self._any_runs = False

    def stuck_axis(self, t_us: int, values: Vec3) -> int | None:
        """Takes a sample; the number of the axis that is stuck, if one is."""
        before, before_us = self._before, self._before_us
        self._before, self._before_us = values, t_us
        x, y, z = values
        if x != before[0] and y != before[1] and z != before[2]:  # nearly always, of floats
            if self._any_runs:
                self._runs, self._any_runs = [None, None, None], False
            return None
        found = None
        for axis in range(3):
            if values[axis] != before[axis]:
                self._runs[axis] = None
                continue
            one, two = (axis + 1) % 3, (axis + 2) % 3
            run = self._runs[axis]
            if run is None:
                run = self._runs[axis] = _Run(before_us, before[one], before[two])
            moved = run.add(values[one], values[two])
            span = self._span
            if abs(values[axis]) < self._dead_zone:
                span *= DEAD_ZONE_FACTOR
            if moved > span and t_us - run.since_us >= STUCK_US:
                found = axis
        self._any_runs = True
        return found


class StuckAxes:
    """Watches gyro and accelerometer of one stream of samples."""

    def __init__(self) -> None:
        self._gyro = _Axes(GYRO_SPAN_RAD_S, GYRO_DEAD_ZONE_RAD_S)
        self._force = _Axes(FORCE_SPAN_M_S2, FORCE_DEAD_ZONE_M_S2)
        self.complaint = ""

    def stuck_sensor(self, sample: ImuSample) -> Sensor | None:
        """Takes a sample; the sensor of which an axis is stuck. `complaint` then names it."""
        gyro = self._gyro.stuck_axis(sample.t_us, sample.w_b)
        force = self._force.stuck_axis(sample.t_us, sample.f_b)
        if gyro is None and force is None:
            self.complaint = ""
            return None
        sensor, axis = (Sensor.GYRO, gyro) if gyro is not None else (Sensor.ACCELEROMETER, force)
        assert axis is not None
        self.complaint = f"{sensor.value} {_AXES[axis]} is stuck"
        return sensor
