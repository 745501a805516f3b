"""The autopilot's clock against the host's, from TIMESYNC exchanges with the least delay.

An exchange costs a round trip; half of it is the uncertainty of its offset, so only exchanges with
a round trip near the least recent one are used.
"""

from collections import deque
from typing import NamedTuple

WINDOW = 16
BELIEVED_RTT_FACTOR = 1.5
BELIEVED_RTT_FLOOR_NS = 200_000
JUMP_NS = 50_000_000
# A larger deviation from the expected offset shows a clock of another speed (a simulator's).
DRIFT_NS = 10_000_000
LOCK_EXCHANGES = 4
MAX_PENDING = 8
MAX_SKEW = 1e-3


class Exchange(NamedTuple):
    """One completed TIMESYNC exchange."""

    asked_ns: int  # host time of the request
    answered_ns: int  # host time of the reply
    autopilot_ns: int  # the autopilot's time in between
    is_quick: bool = True  # its round trip is near the least recent one

    @property
    def round_trip_ns(self) -> int:
        """Time until the reply."""
        return self.answered_ns - self.asked_ns

    @property
    def host_ns(self) -> int:
        """Host time at the middle of the round trip."""
        return self.asked_ns + self.round_trip_ns // 2

    @property
    def offset_ns(self) -> int:
        """Autopilot time minus host time, with half of the round trip as uncertainty."""
        return self.autopilot_ns - self.host_ns


class TimeSync:
    """Estimates offset and skew; forgets everything when the offset jumps (reboot)."""

    def __init__(self) -> None:
        self._pending: deque[int] = deque(maxlen=MAX_PENDING)
        self._believed: deque[Exchange] = deque(maxlen=WINDOW)
        self._recent_rtt_ns: deque[int] = deque(maxlen=WINDOW)
        self._is_drifting = False

    def request(self, t_ns: int) -> int:
        """Notes a request made now; returns the `ts1` to send."""
        self._pending.append(t_ns)
        return t_ns

    def answer(self, t_ns: int, tc1: int, ts1: int) -> Exchange | None:
        """Takes a TIMESYNC reply; returns the exchange if it was ours.

        Only a quick one counts for offset and skew.
        """
        if ts1 not in self._pending:
            return None
        self._pending.remove(ts1)
        round_trip_ns = t_ns - ts1
        self._recent_rtt_ns.append(round_trip_ns)
        least_ns = min(self._recent_rtt_ns)
        limit_ns = max(BELIEVED_RTT_FACTOR * least_ns, least_ns + BELIEVED_RTT_FLOOR_NS)
        exchange = Exchange(ts1, t_ns, tc1, round_trip_ns <= limit_ns)
        if exchange.is_quick:
            self._believe(exchange)
        return exchange

    def _believe(self, exchange: Exchange) -> None:
        if self._believed:
            deviation_ns = abs(exchange.offset_ns - self._offset_at(exchange.host_ns))
            self._is_drifting = deviation_ns > DRIFT_NS
            if deviation_ns > JUMP_NS:
                self._believed.clear()
        self._believed.append(exchange)

    def restart(self) -> None:
        """Forgets the relation (the autopilot rebooted)."""
        self._pending.clear()
        self._believed.clear()
        self._recent_rtt_ns.clear()

    @property
    def is_locked(self) -> bool:
        """Whether enough exchanges have been used to reply to others and to convert times."""
        return len(self._believed) >= LOCK_EXCHANGES

    @property
    def is_calm(self) -> bool:
        """Whether it is locked, and the next exchange will add nothing for a while."""
        return self.is_locked and not self._is_drifting

    @property
    def skew(self) -> float:
        """Relative rate of the autopilot's clock minus one."""
        if len(self._believed) < LOCK_EXCHANGES:
            return 0.0
        first, last = self._believed[0], self._believed[-1]
        elapsed_ns = last.host_ns - first.host_ns
        if elapsed_ns < 5_000_000_000:
            return 0.0
        skew = (last.offset_ns - first.offset_ns) / elapsed_ns
        return min(max(skew, -MAX_SKEW), MAX_SKEW)

    def offset_ns(self, t_ns: int) -> int | None:
        """Autopilot time minus host time at host time `t_ns`; None until locked."""
        return self._offset_at(t_ns) if self.is_locked else None

    def _offset_at(self, t_ns: int) -> int:
        best = min(self._believed, key=lambda exchange: exchange.round_trip_ns)
        return best.offset_ns + round(self.skew * (t_ns - best.host_ns))
