"""Times of samples and heartbeats, to detect silence and our own stalls.

Times are those of processing, not of arrival: a message in a backlog is present. A program that was
stopped has received nothing meanwhile, which says nothing about others.
"""

from h2nav.maths.units import SECOND_NS

LOST_NS = 5 * SECOND_NS
# A program that stops using samples for this long, though its autopilot is present, hangs.
HANGING_NS = 5 * SECOND_NS
# After our own stall, messages of others may be delayed for this long.
AFTER_STALL_NS = SECOND_NS
# Streams have to be requested before they can be missed.
START_NS = 3 * SECOND_NS // 2


class Pulse:
    """Remembers the latest times."""

    def __init__(self) -> None:
        self.sample_ns: int | None = None  # when a sample was last used; None before the first
        self.sample_gap_ns: int | None = None  # time between the last two; None before the second
        self._heartbeat_ns: int | None = None
        self._bound_ns: int | None = None
        self._stall: tuple[int, int] | None = None

    def bound(self, now_ns: int) -> None:
        """Notes that an autopilot was bound."""
        self._bound_ns = now_ns

    def heartbeat(self, now_ns: int) -> None:
        """Notes a heartbeat of the bound autopilot."""
        self._heartbeat_ns = now_ns

    def sample(self, now_ns: int, *, is_fresh: bool) -> None:
        """Notes a sample that was used; a fresh one shows that no backlog is left."""
        self.sample_gap_ns = None if self.sample_ns is None else now_ns - self.sample_ns
        self.sample_ns = now_ns
        if is_fresh:
            self._stall = None

    def stalled(self, now_ns: int, length_ns: int) -> None:
        """Notes a stall of our own."""
        self._stall = (now_ns, length_ns)

    def is_heard(self, t_ns: int) -> bool:
        """Whether heartbeats of the bound autopilot arrive."""
        return self._heartbeat_ns is not None and t_ns - self._heartbeat_ns <= LOST_NS

    def is_starting(self, t_ns: int) -> bool:
        """Whether the binding is too recent for samples to be missed."""
        return self._bound_ns is not None and t_ns - self._bound_ns < START_NS

    def is_progressing(self, t_ns: int) -> bool:
        """False if samples were used, the autopilot is present, and no sample is used any more."""
        used_ns, bound_ns = self.sample_ns, self._bound_ns
        if used_ns is None or not self.is_heard(t_ns):
            return True
        is_of_former = bound_ns is not None and used_ns < bound_ns
        return is_of_former or t_ns - used_ns < HANGING_NS

    def stall_ns(self, t_ns: int) -> int:
        """Length of our own stall while it still affects what has arrived, otherwise 0."""
        stall = self._stall
        if stall is None or self.sample_ns is None or t_ns - stall[0] > AFTER_STALL_NS:
            return 0
        return stall[1]
