"""Host time at a time of the autopilot, from exchanges of TIMESYNC.

Each exchange is an interval: the autopilot read its clock between our request and its answer,
however long that took. The relation goes on at the rate of the latest exchanges, and is moved only
as far as an interval demands: a quick exchange corrects it closely, a slow one shows no more than a
clock that has left its line.
"""

from collections import deque

from h2nav.service.time_sync import Exchange

WINDOW = 16
# Crystals agree by 100 millionths; a clock within ten times this of the host's is one.
STEADY_RATE = 1e-3
MIN_EXCHANGES = 4
# A rate measured within this is one, also after another.
CERTAIN = 0.02
MIN_PACE, MAX_PACE = 0.5, 2.0
# An older exchange does not show the rate of a clock that has had another one.
CURRENT_NS = 5_000_000_000


class HostTime:
    """The relation of the two clocks."""

    def __init__(self) -> None:
        self._exchanges: deque[Exchange] = deque(maxlen=WINDOW)
        self._pace = 1.0  # host time per time of the autopilot
        self._autopilot_ns = self._host_ns = 0
        self._is_crystal = True  # nothing has shown another rate

    @property
    def is_steady(self) -> bool:
        """Whether several exchanges agree with the rate of a crystal."""
        return self._is_crystal and len(self._exchanges) >= MIN_EXCHANGES

    @property
    def is_known(self) -> bool:
        """Whether there was any exchange."""
        return bool(self._exchanges)

    def holds(self, t_ns: int) -> bool:
        """Whether the relation is known at a host time: by a steady clock, or a recent exchange."""
        if not self._exchanges:
            return False
        return self.is_steady or t_ns - self._exchanges[-1].answered_ns <= CURRENT_NS

    def take(self, exchange: Exchange) -> None:
        """Takes an exchange later than all before."""
        expected_ns = self.host_ns(exchange.autopilot_ns) if self.is_known else exchange.host_ns
        self._autopilot_ns = exchange.autopilot_ns
        self._host_ns = min(max(expected_ns, exchange.asked_ns), exchange.answered_ns)
        self._exchanges.append(exchange)
        self._measure_pace()

    def host_ns(self, autopilot_ns: int) -> int:
        """Host time at a time of the autopilot; the same number before the first exchange."""
        return self._host_ns + round((autopilot_ns - self._autopilot_ns) * self._pace)

    def autopilot_ns(self, host_ns: int) -> int:
        """Time of the autopilot at a host time."""
        return self._autopilot_ns + round((host_ns - self._host_ns) / self._pace)

    def _measure_pace(self) -> None:
        """From the quickest exchanges of the older and of the newer half."""
        every = list(self._exchanges)
        halves = every[: len(every) // 2], every[len(every) // 2 :]
        if not halves[0]:
            return
        first, last = (min(half, key=lambda one: one.round_trip_ns) for half in halves)
        elapsed_ns = last.autopilot_ns - first.autopilot_ns
        if elapsed_ns <= 0:
            return
        uncertainty = 0.5 * (first.round_trip_ns + last.round_trip_ns) / elapsed_ns
        pace = (last.host_ns - first.host_ns) / elapsed_ns
        if abs(pace - self._pace) > uncertainty + STEADY_RATE:
            self._is_crystal = False
        self._pace = min(max(self._pace, pace - uncertainty), pace + uncertainty)
        self._pace = min(max(self._pace, MIN_PACE), MAX_PACE)
        if self._is_crystal or (
            uncertainty < CERTAIN and abs(pace - 1.0) < STEADY_RATE + uncertainty
        ):
            self._pace, self._is_crystal = 1.0, True
