"""Tests the vertical force against the receiver's height: a scale, or a bias, along the vertical.

Velocities over ground say nothing of it, and no tilt makes it. The climb of two spans some seconds
apart, each the change of height divided by its time, is compared with what the force between them
adds. VerticalForce jump where satellites change, but no jump stays in a span.
"""

import math
from bisect import bisect_left

from h2nav.integrity.findings import Alarm, Kind, Sensor, Severity
from h2nav.integrity.strapdown import Strapdown
from h2nav.integrity.velocity_windows import GATE, change_of_velocity

# Length of a span, and from the beginning of the first one to the end of the last one.
SPAN_US = 2_000_000
LENGTH_US = 10_000_000
SPACING_US = 1_000_000
# VerticalForce used for the ends of a span lie within this of them.
NEAR_US = 600_000
# Height between fixes of a receiver, m; an accelerometer after its calibration, and the size of a
# fault by its data sheet (60 mg and 5 % of scale), m/s^2.
HEIGHT_SIGMA_M = 0.7
FORCE_SIGMA_M_S2 = 0.2
LEAST_M_S2 = 0.6
# A jump of the height stays within a span for its length; what is longer is none.
RAISED_US = 2 * SPAN_US
CLEARED_US = 3_000_000


class VerticalForce:
    """The heights of the last seconds beside a strapdown."""

    def __init__(self, strapdown: Strapdown) -> None:
        self._strapdown = strapdown
        self.restart()

    def restart(self) -> None:
        """Restarts with the strapdown."""
        self._heights: list[tuple[int, float]] = []
        self._looked_us = 0
        self._since_us: int | None = None  # when it began to fail
        self._failed_us = 0
        self._raised = False
        self._off_m_s2 = 0.0

    def take(self, t_us: int, height_m: float) -> None:
        """Takes a height of the receiver, above anything that stands still."""
        heights = self._heights
        if heights and t_us <= heights[-1][0]:
            return
        heights.append((t_us, height_m))
        while heights[0][0] < t_us - LENGTH_US - NEAR_US:
            del heights[0]
        if t_us - self._looked_us >= SPACING_US:
            self._looked_us = t_us
            self._look(t_us)

    def _look(self, t_us: int) -> None:
        off_m_s2 = self._difference(t_us)
        if off_m_s2 is None:
            return
        dt_s = 1e-6 * (LENGTH_US - SPAN_US)
        by_height = 2.0 * HEIGHT_SIGMA_M / (1e-6 * SPAN_US) / dt_s
        sigma = math.hypot(by_height, FORCE_SIGMA_M_S2)
        if abs(off_m_s2) > max(GATE * sigma, LEAST_M_S2):
            self._since_us = t_us if self._since_us is None else self._since_us
            self._failed_us, self._off_m_s2 = t_us, off_m_s2
            self._raised |= t_us - self._since_us >= RAISED_US
        elif t_us - self._failed_us > (CLEARED_US if self._raised else 0):
            self._since_us, self._raised = None, False

    def _difference(self, t_us: int) -> float | None:
        """Mean vertical force beyond the motion, m/s^2, down; None if something is missing."""
        first, last = self._climb(t_us - LENGTH_US), self._climb(t_us - SPAN_US)
        at = self._strapdown.at
        times = [t_us - LENGTH_US + k * SPAN_US // 2 for k in (0, 1, 2, 8, 9, 10)]
        moments = [at(time_us) for time_us in times]
        start = moments[0]
        if first is None or last is None or start is None:
            return None
        downs = [change_of_velocity(start, one)[2] for one in moments if one is not None]
        if len(downs) < len(moments):
            return None
        a, b, c, x, y, z = downs
        felt = (x + 4.0 * y + z - a - 4.0 * b - c) / 6.0
        return (felt + last - first) / (1e-6 * (LENGTH_US - SPAN_US))

    def _climb(self, from_us: int) -> float | None:
        """Mean climb over the span that begins at a time, m/s."""
        ends = [self._near(from_us), self._near(from_us + SPAN_US)]
        if ends[0] is None or ends[1] is None:
            return None
        (begun_us, low_m), (ended_us, high_m) = ends[0], ends[1]
        return 1e6 * (high_m - low_m) / (ended_us - begun_us)

    def _near(self, t_us: int) -> tuple[int, float] | None:
        index = bisect_left(self._heights, (t_us,))
        near = self._heights[max(index - 1, 0) : index + 1]
        best = min(near, key=lambda one: abs(one[0] - t_us), default=None)
        return best if best is not None and abs(best[0] - t_us) < NEAR_US else None

    def alarm(self, imu: Sensor, t_us: int) -> Alarm | None:
        """The alarm while the vertical force is wrong."""
        if not self._raised or self._since_us is None:
            return None
        size = abs(self._off_m_s2)
        return Alarm(
            Kind.ACCELEROMETER_BIAS_STEP,
            imu,
            Severity.WARNING,
            size,
            "m/s^2",
            f"accelerometer is off by {size:.1f} m/s^2",
            f"by the receiver's height it shows {size:.1f} m/s^2 too "
            f"{'little' if self._off_m_s2 > 0.0 else 'much'} along the vertical",
            since_s=1e-6 * (t_us - self._since_us),
            is_decided=True,
        )
