"""Attitudes of h2nav over the last two seconds, to propagate earlier attitudes to the present.

An autopilot sends its attitude a few times a second. Two horizons side by side must refer to the
same time: a vehicle turns by several degrees in between.
"""

from collections import deque

from h2nav.attitude.samples import Quat
from h2nav.maths.quaternion import conjugate, multiply, normalize

LENGTH_NS = 2_000_000_000
LONGEST_GAP_NS = 300_000_000
# At the rate of the estimates.
MAX_TRACK_POINTS = 2048


class LiveTrack:
    """Attitudes with their times of arrival."""

    def __init__(self) -> None:
        self._points: deque[tuple[int, Quat]] = deque(maxlen=MAX_TRACK_POINTS)

    def add(self, t_ns: int, q_nb: Quat) -> None:
        """Adds the newest attitude."""
        self._points.append((t_ns, q_nb))
        while t_ns - self._points[0][0] > LENGTH_NS:
            self._points.popleft()

    def carried(self, t_ns: int, q_nb: Quat) -> Quat | None:
        """Propagates another attitude to the present with the rotation of ours.

        Args:
            t_ns: time of the other attitude.
            q_nb: the other attitude, body to NED.

        Returns:
            The other attitude at the time of our newest; None without ours at `t_ns`.
        """
        then = self._at(t_ns)
        if then is None:
            return None
        return normalize(multiply(multiply(q_nb, conjugate(then)), self._points[-1][1]))

    def _at(self, t_ns: int) -> Quat | None:
        after: tuple[int, Quat] | None = None
        for point in reversed(self._points):
            if point[0] <= t_ns:
                return _between(point, after or point, t_ns)
            after = point
        return None


def _between(before: tuple[int, Quat], after: tuple[int, Quat], t_ns: int) -> Quat | None:
    """The attitude between two that differ little."""
    gap_ns = after[0] - before[0]
    if gap_ns > LONGEST_GAP_NS:
        return None
    share = (t_ns - before[0]) / gap_ns if gap_ns else 0.0
    p, q = before[1], after[1]
    if sum(a * b for a, b in zip(p, q, strict=True)) < 0.0:
        q = (-q[0], -q[1], -q[2], -q[3])
    w, x, y, z = ((1.0 - share) * a + share * b for a, b in zip(p, q, strict=True))
    return normalize((w, x, y, z))
