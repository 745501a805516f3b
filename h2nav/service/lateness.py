"""Lateness of an estimate: the autopilot's clock against the host's, by the quickest message.

The delay of a sample is the host's time minus the sample's, on two clocks with an unknown offset;
the least delay seen is that of a sample of usual speed, and any excess of a sample is its lateness.
Clocks drift apart, and a simulator's clock may run at another speed altogether: an exchange of
TIMESYNC with a short round trip measures the offset again, and the least delay is kept relative to
it. A message with a short round trip was not delayed: if it looks late, the least delay was wrong
and is estimated again. Without exchanges the least delay creeps, and a delay that lasts for
`FORGIVEN_NS` becomes the usual one.
"""

LATE_NS = 150_000_000
"""An estimate that is later than usual by more than this is not sent."""

LASTING_NS = 300_000_000
"""Lateness that lasts this long is reported."""

FORGIVEN_NS = 20_000_000_000
# A longer round trip says too little about the offset of the clocks.
SHORT_TRIP_NS = 100_000_000
# Two crystals differ by at most 100 millionths. A clock without exchanges may be that of a
# simulator on a busy computer (PX4's was seen at 0.97 of real time).
CREEP_COMPARED = 2e-4
CREEP_UNKNOWN = 0.1


class Lateness:
    """Follows the delay of one stream of samples.

    Attributes:
        late_ns: of the newest sample, beyond the usual; 0 before the first.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts with the autopilot's clock."""
        self.late_ns = 0
        self._clock_ns = 0  # host minus autopilot, of the last exchange
        self._creep = CREEP_UNKNOWN
        self._least_ns: int | None = None
        self._least_at_ns = 0
        self._late_since_ns: int | None = None

    def compared(self, offset_ns: int, round_trip_ns: int) -> None:
        """Takes a TIMESYNC exchange.

        Args:
            offset_ns: autopilot time minus host time.
            round_trip_ns: until the reply.
        """
        if round_trip_ns > SHORT_TRIP_NS:
            return
        if self._least_ns is not None and self._creep == CREEP_UNKNOWN:
            # From now on the least delay stays constant relative to the last exchange.
            self._least_ns += self._clock_ns + offset_ns
        self._clock_ns = -offset_ns
        self._creep = CREEP_COMPARED
        if self.is_late:
            # With such a short round trip nothing was delayed: the usual delay was wrong.
            self._least_ns = None

    def seen(self, arrived_ns: int, now_ns: int, sample_us: int) -> None:
        """Takes a sample.

        Args:
            now_ns: host time at which its estimate would be sent.
            sample_us: its own time.
        """
        sent_ns = sample_us * 1000 + self._clock_ns
        delay_ns = arrived_ns - sent_ns
        late_since_ns = self._late_since_ns
        if late_since_ns is not None and self._is_forgiven(now_ns - late_since_ns):
            self._least_ns = None
        if self._least_ns is not None:
            crept_ns = round((arrived_ns - self._least_at_ns) * self._creep)
            delay_ns = min(delay_ns, self._least_ns + max(crept_ns, 0))
        self._least_ns, self._least_at_ns = delay_ns, arrived_ns
        self.late_ns = now_ns - sent_ns - delay_ns
        if self.late_ns <= LATE_NS:
            self._late_since_ns = None
        elif late_since_ns is None:
            self._late_since_ns = now_ns

    def _is_forgiven(self, lasting_ns: int) -> bool:
        """Whether, without exchanges, a lasting delay is taken as the usual one."""
        return self._creep != CREEP_COMPARED and lasting_ns > FORGIVEN_NS

    @property
    def is_late(self) -> bool:
        """Whether the newest estimate is too old to be sent."""
        return self.late_ns > LATE_NS

    def is_lasting(self, t_ns: int) -> bool:
        """Whether the lateness has lasted for a while, or is large."""
        since_ns = self._late_since_ns
        if since_ns is None:
            return False
        return t_ns - since_ns >= LASTING_NS or self.late_ns > 2 * LATE_NS
