"""What was integrated up to a time of the past, for fixes that are late."""

from collections import deque

# Between two rows of a past.
SPACING_US = 10_000

Row = tuple[float, ...]


def gained_until(past: deque[Row], t_us: float) -> Row:
    """What was gained up to a time: between two rows interpolated, beyond an end that end's.

    Args:
        past: rows of time, us, and what was gained until then, the newest last; one at least.
        t_us: the time.
    """
    later = past[-1]
    for row in reversed(past):
        if row[0] <= t_us:
            if row is later:
                break
            share = (t_us - row[0]) / (later[0] - row[0])
            return tuple(a + share * (b - a) for a, b in zip(row[1:], later[1:], strict=True))
        later = row
    return later[1:]
