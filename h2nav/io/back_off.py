"""When to try again after a failure; time comes in, so nothing here waits."""

FIRST_DELAY_NS = 100_000_000
LONGEST_DELAY_NS = 1_000_000_000
"""A device that comes back is open again within this time."""


class BackOff:
    """Delays between attempts: 0.1 s, doubled at each failure in a row, at most 1 s."""

    def __init__(self) -> None:
        self._delay_ns = FIRST_DELAY_NS
        self._next_ns: int | None = None

    def is_due(self, t_ns: int) -> bool:
        """Whether an attempt may be made at the monotonic time `t_ns`."""
        return self._next_ns is None or t_ns >= self._next_ns

    def failed(self, t_ns: int) -> None:
        """An attempt, or what it had opened, has failed at `t_ns`."""
        self._next_ns = t_ns + self._delay_ns
        self._delay_ns = min(2 * self._delay_ns, LONGEST_DELAY_NS)

    def succeeded(self) -> None:
        """The thing has proved to work: the next failure is the first again."""
        self._delay_ns = FIRST_DELAY_NS
