"""Integrals at past times, for fixes that are late."""

import bisect
import math
from collections import deque

# Interval of two rows of a past.
SPACING_US = 10_000

Row = tuple[float, ...]


def around(past: deque[Row], t_us: float) -> tuple[Row, Row, float]:
    """The rows before and after a time, and the share of the interval between them, 0 to 1.

    Beyond an end both rows are that of the end.

    Args:
        past: rows of time, us, and integrals until then, the newest last; at least one.
        t_us: the time.
    """
    # A row of this time sorts before one with infinite integrals.
    place = bisect.bisect_right(past, (t_us, math.inf))
    if place in (0, len(past)):
        row = past[-1] if place else past[0]
        return row, row, 0.0
    row, later = past[place - 1], past[place]
    return row, later, (t_us - row[0]) / (later[0] - row[0])
