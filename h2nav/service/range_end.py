"""Finds samples at the end of the sensor's range, which no message tells.

Gyros have ranges of 250, 500, 1000 and 2000 deg/s, accelerometers of 8, 16 and 32 g, and a message
does not say which. A sensor at its end gives one and the same extreme value as long as the motion
is beyond it. So an axis stands at an end when its value is exactly the same in three samples one
after another, is the largest that it has ever had, lies where a range ends, and another axis of the
sensor has moved meanwhile. From then on that value is known as an end, until it is exceeded.

A motion within the range does not do that: to stay within one count of 1 mrad/s for 20 ms at 250
deg/s it would have to be steady to 0.05 rad/s^2, exactly there, and while the vehicle turns about
another axis as well.
"""

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import DEG, GRAVITY_M_S2

GYRO_RANGES_RAD_S = tuple(range_deg_s * DEG for range_deg_s in (250.0, 500.0, 1000.0, 2000.0))
FORCE_RANGES_M_S2 = tuple(range_g * GRAVITY_M_S2 for range_g in (8.0, 16.0, 32.0))
# An end is not where the range says, because the autopilot subtracts the bias and corrects the
# scale: at most 10 deg/s and 0.1 g, and 3 %.
GYRO_OFFSET_RAD_S = 10.0 * DEG
FORCE_OFFSET_M_S2 = 0.1 * GRAVITY_M_S2
SCALE_ERROR = 0.03
REPETITIONS = 3


class _Axis:
    """One axis: its latest value, its largest, and the end of its range once that is known."""

    def __init__(self, ranges: tuple[float, ...], offset: float) -> None:
        self._ranges = ranges
        self._offset = offset
        self._value = 0.0
        self._repeated = 0
        self._others: tuple[float, float] = (0.0, 0.0)
        self._have_moved = False
        self._largest = 0.0
        self._end: float | None = None

    def is_at_end(self, value: float, others: tuple[float, float]) -> bool:
        """Takes a sample; whether this axis stands at the end of its range."""
        size = abs(value)
        if size < self._ranges[0] * (1.0 - SCALE_ERROR) - self._offset:
            self._repeated = 0  # where sensors spend their lives
            self._value = value
            return False
        if self._end is not None and size > self._end:
            self._end = None
        if value == self._value:
            self._repeated += 1
            self._have_moved |= others != self._others
        else:
            self._value, self._repeated = value, 1
            self._have_moved = False
        self._others = others
        self._largest = max(self._largest, size)
        sticks = self._repeated >= REPETITIONS and self._have_moved and size == self._largest
        if sticks and self._is_an_end(size):
            self._end = size
        return self._end is not None and size == self._end

    def _is_an_end(self, size: float) -> bool:
        return any(abs(size - end) <= self._offset + SCALE_ERROR * end for end in self._ranges)


class RangeEnds:
    """Watches the three axes of gyro and accelerometer of one stream of samples."""

    def __init__(self) -> None:
        self._gyro = [_Axis(GYRO_RANGES_RAD_S, GYRO_OFFSET_RAD_S) for _ in range(3)]
        self._force = [_Axis(FORCE_RANGES_M_S2, FORCE_OFFSET_M_S2) for _ in range(3)]

    def holds(self, sample: ImuSample) -> bool:
        """Takes a sample; whether one of its axes stands at the end of its range."""
        return _any_at_end(self._gyro, sample.w_b) | _any_at_end(self._force, sample.f_b)


def _any_at_end(axes: list[_Axis], values: Vec3) -> bool:
    x, y, z = values
    # Each axis has to see every sample.
    at_end = axes[0].is_at_end(x, (y, z))
    at_end |= axes[1].is_at_end(y, (z, x))
    return axes[2].is_at_end(z, (x, y)) | at_end
