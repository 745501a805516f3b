"""Finds an axis that repeats its value while the vehicle moves: a sensor that is stuck.

At rest an integer axis repeats its value rightly (ArduPilot's mrad/s read 0 for minutes), so an
axis is called stuck only when the other two axes of its sensor vary clearly meanwhile; and near
zero, where truncation makes a dead zone, only when they vary wildly.
"""

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


class _Axes:
    """The three axes of one sensor: since when each is unchanged, and what the others did since."""

    def __init__(self, span: float, dead_zone: float) -> None:
        self._span = span
        self._dead_zone = dead_zone
        self._values: list[float | None] = [None, None, None]
        self._since_us = [0, 0, 0]
        # Per axis: lowest and highest of the other two, since this axis is unchanged.
        self._low: list[list[float]] = [[], [], []]
        self._high: list[list[float]] = [[], [], []]

    def stuck_axis(self, t_us: int, values: Vec3) -> int | None:
        """Takes a sample; the number of the axis that is stuck, if one is."""
        found = None
        for axis in range(3):
            others = [values[(axis + 1) % 3], values[(axis + 2) % 3]]
            if values[axis] != self._values[axis]:
                self._values[axis] = values[axis]
                self._since_us[axis] = t_us
                self._low[axis], self._high[axis] = others, others.copy()
                continue
            low, high = self._low[axis], self._high[axis]
            for i in (0, 1):
                low[i] = min(low[i], others[i])
                high[i] = max(high[i], others[i])
            span = self._span
            if abs(values[axis]) < self._dead_zone:
                span *= DEAD_ZONE_FACTOR
            moved = high[0] - low[0] + high[1] - low[1] > span
            if moved and t_us - self._since_us[axis] >= STUCK_US:
                found = axis
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
        sensor, axis = (Sensor.GYRO, gyro) if gyro is not None else (Sensor.ACCELEROMETER, force)
        if axis is None:
            self.complaint = ""
            return None
        self.complaint = f"{sensor.value} {_AXES[axis]} is stuck"
        return sensor
