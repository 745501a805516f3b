"""How late an estimate is: the autopilot's clock against the host's, by the quickest message.

The delay of a sample is the host's time minus the sample's, on two clocks whose difference is
unknown; the least delay seen stands for a sample that came as quickly as usual, and whatever a
sample has more than that is its lateness. Clocks drift apart, and a simulator's clock may run at
another speed altogether: an exchange of TIMESYNC with a short round trip tells the difference of
the clocks anew, and the least delay is kept relative to it. What comes with a short round trip did
not wait: where it looks late, the least delay was a wrong one and is learnt anew. Without any
exchange the least delay creeps, and a delay that stays for `FORGIVEN_NS` becomes the usual one.
"""

LATE_NS = 150_000_000
"""An estimate that is later than usual by more than this is not sent."""

LASTING_NS = 300_000_000
"""Lateness that lasts so long is reported."""

FORGIVEN_NS = 20_000_000_000
# A round trip of more than this says too little about the difference of the clocks.
SHORT_TRIP_NS = 100_000_000
# Two crystals differ by 100 millionths at the most. A clock that nobody compares may be that of a
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
        """The autopilot's clock starts again."""
        self.late_ns = 0
        self._clock_ns = 0  # host minus autopilot, as last compared
        self._creep = CREEP_UNKNOWN
        self._least_ns: int | None = None
        self._least_at_ns = 0
        self._late_since_ns: int | None = None

    def compared(self, offset_ns: int, round_trip_ns: int) -> None:
        """Takes a TIMESYNC exchange.

        Args:
            offset_ns: autopilot time minus host time.
            round_trip_ns: how long the answer took.
        """
        if round_trip_ns > SHORT_TRIP_NS:
            return
        if self._least_ns is not None and self._creep == CREEP_UNKNOWN:
            # From now on the least delay stays as it is, relative to the clocks as compared last.
            self._least_ns += self._clock_ns + offset_ns
        self._clock_ns = -offset_ns
        self._creep = CREEP_COMPARED
        if self.is_late:
            # What came with so short a round trip did not wait: the usual delay was a wrong one.
            self._least_ns = None

    def seen(self, arrived_ns: int, now_ns: int, sample_us: int) -> None:
        """Takes a sample.

        Args:
            arrived_ns: host time of its arrival.
            now_ns: host time at which its estimate would leave.
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
        """Where nobody compares the clocks, a delay that lasts long is taken as the usual one."""
        return self._creep != CREEP_COMPARED and lasting_ns > FORGIVEN_NS

    @property
    def is_late(self) -> bool:
        """The newest estimate is too old to be sent."""
        return self.late_ns > LATE_NS

    def is_lasting(self, t_ns: int) -> bool:
        """The lateness has lasted for a while, or is large."""
        since_ns = self._late_since_ns
        if since_ns is None:
            return False
        return t_ns - since_ns >= LASTING_NS or self.late_ns > 2 * LATE_NS
