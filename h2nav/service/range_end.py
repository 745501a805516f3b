"""Detects samples at the end of the sensor's range, which no message reports.

Gyros have ranges of 250, 500, 1000 and 2000 deg/s, accelerometers of 8, 16 and 32 g, and a message
does not name them. A saturated sensor repeats one extreme value while the motion is beyond it. So
an axis is at its end when its value is exactly the same in three samples in a row, is its largest
so far, lies where a range ends, and another axis of the sensor has moved meanwhile. From then on
that value is known as an end, until it is exceeded.

A motion within the range does not do that: to stay within one count of 1 mrad/s for 20 ms at
250 deg/s it would have to be steady to 0.05 rad/s^2, exactly there, and while the vehicle turns
about another axis.
"""

from h2nav.attitude.samples import ImuSample, Vec3
from h2nav.maths.units import DEG, GRAVITY_M_S2

GYRO_RANGES_RAD_S = tuple(range_deg_s * DEG for range_deg_s in (250.0, 500.0, 1000.0, 2000.0))
FORCE_RANGES_M_S2 = tuple(range_g * GRAVITY_M_S2 for range_g in (8.0, 16.0, 32.0))
# The end is shifted from the nominal range, because the autopilot subtracts the bias and corrects
# the scale: by at most 10 deg/s and 0.1 g, and 3 %.
GYRO_OFFSET_RAD_S = 10.0 * DEG
FORCE_OFFSET_M_S2 = 0.1 * GRAVITY_M_S2
SCALE_ERROR = 0.03
REPETITIONS = 3


class _Axis:
    """One axis: its latest value, its largest, and the end of its range once known."""

    def __init__(self, ranges: tuple[float, ...], offset: float) -> None:
        self._ranges = ranges
        self._offset = offset
        self._value = 0.0
        self._repeated = 0
        self._others: tuple[float, float] = (0.0, 0.0)
        self._have_moved = False
        self._largest = 0.0
        self._end: float | None = None

    def forget(self) -> None:
        """Notes a value that is not at an end."""
        self._value, self._repeated = 0.0, 0

    def is_at_end(self, value: float, others: tuple[float, float]) -> bool:
        """Takes a large value; returns whether this axis is at the end of its range."""
        size = abs(value)
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


class _Axes:
    """The three axes of one sensor."""

    def __init__(self, ranges: tuple[float, ...], offset: float) -> None:
        # Usual values: no range ends below.
        self.usual = ranges[0] * (1.0 - SCALE_ERROR) - offset
        self._axes = [_Axis(ranges, offset) for _ in range(3)]

    def any_at_end(self, values: Vec3) -> bool:
        """Takes a sample; returns whether one of the axes is at the end of its range."""
        x, y, z = values
        usual, found = self.usual, False
        # Each axis has to see every sample.
        for axis, value, others in zip(self._axes, values, ((y, z), (z, x), (x, y)), strict=True):
            if abs(value) < usual:
                axis.forget()
            else:
                found |= axis.is_at_end(value, others)
        return found


class RangeEnds:
    """Monitors the three axes of gyro and accelerometer of one stream of samples."""

    def __init__(self) -> None:
        self._gyro = _Axes(GYRO_RANGES_RAD_S, GYRO_OFFSET_RAD_S)
        self._force = _Axes(FORCE_RANGES_M_S2, FORCE_OFFSET_M_S2)
        self._usual = self._gyro.usual, self._force.usual
        self._were_usual = True

    def holds(self, sample: ImuSample) -> bool:
        """Takes a sample; returns whether one of its axes is at the end of its range."""
        _, (p, q, r), (x, y, z), _, _ = sample
        rate, force = self._usual
        is_usual = -rate < p < rate and -rate < q < rate and -rate < r < rate
        if is_usual and -force < x < force and -force < y < force and -force < z < force:
            # Usual values are forgotten at once: that nothing has changed is known then.
            if not self._were_usual:
                self._gyro.any_at_end(sample.w_b)
                self._force.any_at_end(sample.f_b)
                self._were_usual = True
            return False
        self._were_usual = False
        return self._gyro.any_at_end(sample.w_b) | self._force.any_at_end(sample.f_b)
