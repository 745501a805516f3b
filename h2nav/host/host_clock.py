"""The relation between the host's monotonic clock and its UNIX clock, fixed once per run."""

import time

READINGS = 5


class UnixClock:
    """Converts monotonic arrival times to UNIX times with one constant.

    A log keeps the differences of arrival times exactly only if nothing but a constant is added to
    them; a step of the host's UNIX clock during the run is therefore reported, not followed.
    """

    def __init__(self) -> None:
        self.offset_ns = _offset_now_ns()  # UNIX minus monotonic time when the clock was created

    def unix_ns(self, t_ns: int) -> int:
        """UNIX time of the monotonic time `t_ns`."""
        return t_ns + self.offset_ns

    def step_ns(self) -> int:
        """How far the host's UNIX clock has moved since, by steps and slewing."""
        return _offset_now_ns() - self.offset_ns


def _offset_now_ns() -> int:
    """The reading with the shortest time between two monotonic readings."""
    readings = []
    for _ in range(READINGS):
        before = time.monotonic_ns()
        unix = time.time_ns()
        after = time.monotonic_ns()
        readings.append((after - before, unix - (before + after) // 2))
    return min(readings)[1]
