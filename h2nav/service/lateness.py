"""Lateness of an estimate: the autopilot's clock against the host's, by exchanges and samples.

The delay of a sample is the host's time minus the sample's, on two clocks with an unknown offset;
the least delay seen is that of a sample of usual speed, and any excess of a sample is its lateness.
Clocks drift apart, and a simulator's runs at a rate of its own: every exchange of TIMESYNC bounds
the offset (`HostTime`), and the least delay is kept relative to it. An answer that took a round
trip also bounds the lateness: what the autopilot has sent before it cannot have waited for longer.
Without exchanges the least delay creeps, and a delay that lasts for `FORGIVEN_NS` becomes the usual
one.
"""

from h2nav.service.host_time import HostTime
from h2nav.service.time_sync import Exchange

LATE_NS = 150_000_000
"""An estimate that is later than usual by more than this is not sent."""

DOUBTED_NS = 50_000_000
"""Lateness from which on the clocks are compared more often: the rate may have changed."""

LASTING_NS = 300_000_000
"""Lateness that lasts this long is reported."""

FORGIVEN_NS = 20_000_000_000
# Two crystals differ by at most 100 millionths. A clock that has never been compared, or that has
# shown another rate, may be that of a simulator on a busy computer (PX4's was seen at 0.97 of real
# time).
CREEP_KNOWN = 2e-4
CREEP_UNKNOWN = 0.1


class Lateness:
    """Follows the delay of one stream of samples.

    Attributes:
        late_ns: of the newest sample, beyond the usual; 0 before the first.
        is_late: the newest estimate is too old to be sent.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Restarts with the autopilot's clock."""
        self.late_ns, self.is_late = 0, False
        self._clock = HostTime()
        self._zero_ns = 0  # the samples' time minus that of the exchanges
        self._newest: tuple[int, int] | None = None  # its own time and its arrival, ns
        self._least_ns: int | None = None
        self._late_since_ns: int | None = None

    def compared(self, exchange: Exchange) -> None:
        """Takes a TIMESYNC exchange, whatever its round trip."""
        is_first = not self._clock.is_known
        excess_ns = 0
        if self._newest is not None and self._least_ns is not None:
            sample_ns, arrived_ns = self._newest
            excess_ns = arrived_ns - self._sent_ns(sample_ns) - self._least_ns
        self._clock.take(exchange)
        if self._newest is None or self._least_ns is None:
            return
        if is_first:
            self._align(*self._newest)
            # From now on the least delay stays constant relative to the exchanges.
            self._least_ns = -min(excess_ns, exchange.round_trip_ns)
            return
        delay_ns = arrived_ns - self._sent_ns(sample_ns)
        self._least_ns = max(self._least_ns, delay_ns - exchange.round_trip_ns)

    def seen(self, arrived_ns: int, now_ns: int, sample_us: int) -> None:
        """Takes a sample.

        Args:
            now_ns: host time at which its estimate would be sent.
            sample_us: its own time.
        """
        sample_ns, before, clock = sample_us * 1000, self._newest, self._clock
        if before is None and clock.is_known:
            self._align(sample_ns, arrived_ns)
        sent_ns = clock.host_ns(sample_ns - self._zero_ns)
        delay_ns = arrived_ns - sent_ns
        late_since_ns = self._late_since_ns
        is_lasting = late_since_ns is not None and now_ns - late_since_ns > FORGIVEN_NS
        if is_lasting and not clock.holds(arrived_ns):
            self._least_ns = None
        least_ns = self._least_ns
        if least_ns is not None and before is not None and delay_ns > least_ns:
            creep = CREEP_KNOWN if clock.holds(arrived_ns) else CREEP_UNKNOWN
            crept_ns = round((arrived_ns - before[1]) * creep)
            delay_ns = min(delay_ns, least_ns + max(crept_ns, 0))
        self._least_ns, self._newest = delay_ns, (sample_ns, arrived_ns)
        self.late_ns = now_ns - sent_ns - delay_ns
        self.is_late = self.late_ns > LATE_NS
        if not self.is_late:
            self._late_since_ns = None
        elif late_since_ns is None:
            self._late_since_ns = now_ns

    def _sent_ns(self, sample_ns: int) -> int:
        """Host time of a sample, as far as exchanges tell; its own time without any."""
        return self._clock.host_ns(sample_ns - self._zero_ns)

    def _align(self, sample_ns: int, arrived_ns: int) -> None:
        """Takes the samples' time, which may count from another origin, for that of exchanges."""
        self._zero_ns = sample_ns - self._clock.autopilot_ns(arrived_ns)

    @property
    def is_doubted(self) -> bool:
        """Whether the clocks have to be compared often: a rate is not constant, or seems so."""
        return self.late_ns > DOUBTED_NS or (self._clock.is_known and not self._clock.is_steady)

    def is_lasting(self, t_ns: int) -> bool:
        """Whether the lateness has lasted for a while, or is large."""
        since_ns = self._late_since_ns
        if since_ns is None:
            return False
        return t_ns - since_ns >= LASTING_NS or self.late_ns > 2 * LATE_NS
