"""How long a condition has held."""

# It ends when it has not been seen for this long.
PAUSE_US = 1_000_000
# After a time without looks nothing is known.
STALE_US = 2_000_000


class Spell:
    """Duration of a condition, interruptions of `PAUSE_US` included."""

    def __init__(self) -> None:
        self._since_us: int | None = None
        self.seen_us = 0

    def look(self, t_us: int, *, is_so: bool) -> int | None:
        """The duration, us; None if the condition does not hold."""
        if is_so:
            if self._since_us is None or t_us - self.seen_us > STALE_US:
                self._since_us = t_us
            self.seen_us = t_us
        elif t_us - self.seen_us > PAUSE_US:
            self._since_us = None
        return None if self._since_us is None else t_us - self._since_us
