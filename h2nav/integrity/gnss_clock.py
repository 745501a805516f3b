"""A receiver's time against the autopilot's clock.

Whoever imitates satellites without their time makes a receiver's time jump. A receiver that loses
its fix keeps its own time to milliseconds, and autopilots' clocks run evenly.
"""

# Times differ by this for other reasons: leap seconds that a receiver learns late (18 s since
# 2017), fixes that are logged late.
JUMP_S = 20.0
# An autopilot's clock may be as wrong as this: one of 2014 ran fast by 8.3 %.
DRIFT_SHARE = 0.1
# A time counts as known, and one that has jumped as jumped, after this.
KNOWN_S = 30.0
JUMPED_S = 3.0


class ClockWatch:
    """One receiver; times of fixes only.

    Attributes:
        jump_s: by how much its time has jumped; 0 while it has not.
        since_us: since when, on the autopilot's clock.
    """

    def __init__(self) -> None:
        self.jump_s = 0.0
        self.since_us = 0
        self._begun_us = 0  # since when the time is known
        self._known: tuple[int, float] | None = None  # on both clocks, of the latest that was right
        self._other: tuple[int, float] | None = None  # of the latest that was not

    def take(self, t_us: int, unix_s: float) -> None:
        """Takes the time of a fix.

        Args:
            t_us: on the autopilot's clock.
            unix_s: the receiver's, UNIX time.
        """
        if self._known is None or t_us < self._known[0]:
            self._begin(t_us, unix_s)
            return
        jump_s, limit_s = _apart(self._known, t_us, unix_s)
        if abs(jump_s) <= limit_s:
            self._known, self._other, self.jump_s = (t_us, unix_s), None, 0.0
            return
        if self._known[0] - self._begun_us < 1e6 * KNOWN_S:
            self._begin(t_us, unix_s)
            return
        other, self._other = self._other, (t_us, unix_s)
        if other is not None:
            again_s, limit_s = _apart(other, t_us, unix_s)
            if abs(again_s) <= limit_s:
                if t_us - self.since_us >= 1e6 * JUMPED_S:
                    self.jump_s = jump_s
                return
        self.since_us, self.jump_s = t_us, 0.0

    def forget_old(self, stale_us: int) -> None:
        """Takes no jump for present that no time has shown since then."""
        if self._other is not None and self._other[0] <= stale_us:
            self.jump_s = 0.0

    def _begin(self, t_us: int, unix_s: float) -> None:
        self._begun_us, self._known, self._other, self.jump_s = t_us, (t_us, unix_s), None, 0.0


def _apart(before: tuple[int, float], t_us: int, unix_s: float) -> tuple[float, float]:
    """By how much the receiver's time went on more than the other clock, and the limit, s."""
    passed_s = 1e-6 * (t_us - before[0])
    return unix_s - before[1] - passed_s, JUMP_S + DRIFT_SHARE * passed_s
