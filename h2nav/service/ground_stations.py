"""Detects new ground stations, each of which is sent the present faults once."""

from collections import OrderedDict

from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Sender
from h2nav.service.limits import RateLimit

# A station that was away for this long has missed something.
AWAY_NS = 30 * SECOND_NS
MAX_STATIONS = 8
# Bounded, whatever ids senders invent.
NEWCOMERS_PER_S = 0.1
NEWCOMERS_AT_ONCE = 2


class GroundStations:
    """Tracks ground stations by their heartbeats."""

    def __init__(self) -> None:
        self._heard_ns: OrderedDict[Sender, int] = OrderedDict()
        self._limit = RateLimit(NEWCOMERS_PER_S, NEWCOMERS_AT_ONCE)

    def is_newcomer(self, t_ns: int, sender: Sender) -> bool:
        """Whether a heartbeat is from a station that was not there before."""
        heard_ns = self._heard_ns.get(sender)
        self._heard_ns[sender] = t_ns
        self._heard_ns.move_to_end(sender)
        if len(self._heard_ns) > MAX_STATIONS:
            self._heard_ns.popitem(last=False)
        is_new = heard_ns is None or t_ns - heard_ns > AWAY_NS
        return is_new and self._limit.allows(t_ns)
