"""What was integrated up to a time of the past, for fixes that are late."""

import bisect
import operator
from collections import deque
from collections.abc import Callable

# Between two rows of a past.
SPACING_US = 10_000

Row = tuple[float, ...]
_time: Callable[[Row], float] = operator.itemgetter(0)


def gained_until(past: deque[Row], t_us: float) -> Row:
    """What was gained up to a time: between two rows interpolated, beyond an end that end's.

    Args:
        past: rows of time, us, and what was gained until then, the newest last; one at least.
        t_us: the time.
    """
    place = bisect.bisect_right(past, t_us, key=_time)
    if place in (0, len(past)):
        return past[min(place, len(past) - 1)][1:]
    row, later = past[place - 1], past[place]
    share = (t_us - row[0]) / (later[0] - row[0])
    return tuple([a + share * (b - a) for a, b in zip(row[1:], later[1:], strict=True)])
