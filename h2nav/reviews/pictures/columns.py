"""Reduces series of any length to two points per column of time; extremes stay visible."""

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array

# For pictures with detail, and for slow ones: two points in each column.
FINE, COARSE = 3000, 1000
# A gap between samples longer than this many usual ones, and than this, stays a gap.
USUAL_STEPS = 5.0
MIN_BREAK_S = 0.5


def shown_s(duration_s: float) -> float:
    """Length of the time axis: at least a second, for empty recordings."""
    return max(duration_s, 1.0)


class Columns:
    """Equal columns of time: of the whole recording, or of a part of it."""

    def __init__(self, duration_s: float, count: int, from_s: float | None = None) -> None:
        """Args: how long they are together, how many, where a part begins."""
        self.count = count  # of the columns
        self._from_s = from_s
        self._width_s = shown_s(duration_s) / count
        # (2 count,) the times of the points
        self.t_s = (from_s or 0.0) + (np.arange(2 * count) + 0.5) * (0.5 * self._width_s)

    def of(self, t_s: Array, values: Array, turn: float | None = None) -> NDArray[np.float32]:
        """The points of one series.

        Args:
            t_s: (N,) not decreasing.
            values: (N,) NaN where there is none.
            turn: period of the values, such as 360 for degrees; a step over the end of the range
                leaves its column empty, so that no line crosses the picture.

        Returns:
            (2 count,) the smallest and the largest value of each column, in order of occurrence;
            between sparse samples the interpolation; NaN in gaps.
        """
        is_known = np.isfinite(values) & np.isfinite(t_s)
        t_s, values = t_s[is_known], values[is_known]
        if len(t_s) == 0:
            return np.full(2 * self.count, np.nan, np.float32)
        points = self._between(t_s, values, turn)
        if self._from_s is not None:
            t_s = t_s - self._from_s
            is_inside = (t_s >= 0.0) & (t_s <= self.count * self._width_s)
            t_s, values = t_s[is_inside], values[is_inside]
            if len(t_s) == 0:
                return points.astype(np.float32)
        place = np.clip((t_s / self._width_s).astype(np.int64), 0, self.count - 1)
        starts = np.flatnonzero(np.diff(place, prepend=-1))
        ends = np.append(starts[1:], len(t_s)) - 1
        column = place[starts]
        low, high = np.minimum.reduceat(values, starts), np.maximum.reduceat(values, starts)
        rises = values[ends] >= values[starts]
        is_many = ends > starts
        points[2 * column[is_many]] = np.where(rises, low, high)[is_many]
        points[2 * column[is_many] + 1] = np.where(rises, high, low)[is_many]
        # A sample alone in its column replaces the nearer point.
        alone, at = column[~is_many], t_s[starts[~is_many]]
        points[2 * alone + ((at / self._width_s - alone) > 0.5)] = low[~is_many]
        if turn is not None:
            over = place[np.flatnonzero(np.abs(np.diff(values)) > turn / 2) + 1]
            # A gap of one column is narrower than a line, and would be drawn over.
            for beside in range(-3, 4):
                column = np.clip(over + beside, 0, self.count - 1)
                points[2 * column] = points[2 * column + 1] = np.nan
        return points.astype(np.float32)

    def _between(self, t_s: Array, values: Array, turn: float | None) -> Array:
        """The interpolation between samples; NaN in gaps and outside."""
        if len(t_s) == 1:
            return np.full(2 * self.count, np.nan)
        steps = np.diff(t_s)
        longest_s = max(USUAL_STEPS * float(np.median(steps)), MIN_BREAK_S)
        after = np.searchsorted(t_s, self.t_s)
        is_inside = (after > 0) & (after < len(t_s))
        after = np.clip(after, 1, len(t_s) - 1)
        is_whole = is_inside & (steps[after - 1] <= longest_s)
        if turn is not None:
            is_whole &= np.abs(np.diff(values))[after - 1] <= turn / 2
        return np.where(is_whole, np.interp(self.t_s, t_s, values), np.nan)
