"""When samples and heartbeats were last looked at: who is present, and were we held up?

Times are those of looking, not of arrival: what has waited in a backlog is there. A program that
was stopped has heard nothing meanwhile, and that says nothing about others.
"""

from h2nav.service.limits import SECOND_NS

LOST_NS = 5 * SECOND_NS
# A program that has used samples and uses none for so long, though its autopilot is there, hangs.
HANGING_NS = 5 * SECOND_NS
# So long after a stop of ours what others say may still be under way.
AFTER_STALL_NS = SECOND_NS
# Streams have to be asked for before they can be missed.
START_NS = 3 * SECOND_NS // 2


class Pulse:
    """Remembers when what was last seen.

    Attributes:
        sample_ns: when a sample was last used; None before the first.
        sample_gap_ns: time between the last two; None before the second.
    """

    def __init__(self) -> None:
        self.sample_ns: int | None = None
        self.sample_gap_ns: int | None = None
        self._heartbeat_ns: int | None = None
        self._bound_ns: int | None = None
        self._stall: tuple[int, int] | None = None

    def bound(self, now_ns: int) -> None:
        """An autopilot is listened to from now on."""
        self._bound_ns = now_ns

    def heartbeat(self, now_ns: int) -> None:
        """A heartbeat of the bound autopilot."""
        self._heartbeat_ns = now_ns

    def sample(self, now_ns: int, *, is_fresh: bool) -> None:
        """A sample was used; a fresh one shows that no backlog is left."""
        self.sample_gap_ns = None if self.sample_ns is None else now_ns - self.sample_ns
        self.sample_ns = now_ns
        if is_fresh:
            self._stall = None

    def stalled(self, now_ns: int, length_ns: int) -> None:
        """We were held up for so long."""
        self._stall = (now_ns, length_ns)

    def is_heard(self, t_ns: int) -> bool:
        """Heartbeats of the bound autopilot come."""
        return self._heartbeat_ns is not None and t_ns - self._heartbeat_ns <= LOST_NS

    def is_starting(self, t_ns: int) -> bool:
        """Binding is so recent that no sample can be missed yet."""
        return self._bound_ns is not None and t_ns - self._bound_ns < START_NS

    def is_progressing(self, t_ns: int) -> bool:
        """False where samples were used, the autopilot is heard, and yet no sample is used."""
        if self.sample_ns is None or not self.is_heard(t_ns):
            return True
        return t_ns - self.sample_ns < HANGING_NS

    def stall_ns(self, t_ns: int) -> int:
        """How long we were held up, while this still affects what is heard; else 0."""
        stall = self._stall
        if stall is None or self.sample_ns is None or t_ns - stall[0] > AFTER_STALL_NS:
            return 0
        return stall[1]
