"""When to retry after a failure; the caller passes the time, so nothing here waits."""

FIRST_DELAY_NS = 100_000_000
LONGEST_DELAY_NS = 1_000_000_000
"""A device that returns is open again within this time."""


class BackOff:
    """Delays between attempts: doubled after each consecutive failure, up to a limit."""

    def __init__(self, first_ns: int = FIRST_DELAY_NS, longest_ns: int = LONGEST_DELAY_NS) -> None:
        self._first_ns = self._delay_ns = first_ns
        self._longest_ns = longest_ns
        self._next_ns: int | None = None

    def is_due(self, t_ns: int) -> bool:
        """Whether an attempt may be made at the monotonic time `t_ns`."""
        return self._next_ns is None or t_ns >= self._next_ns

    def failed(self, t_ns: int) -> None:
        """Notes that an attempt, or the thing that it opened, failed at `t_ns`."""
        self._next_ns = t_ns + self._delay_ns
        self._delay_ns = min(2 * self._delay_ns, self._longest_ns)

    def succeeded(self) -> None:
        """Resets the delay: the next failure counts as the first."""
        self._delay_ns = self._first_ns
