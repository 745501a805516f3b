"""The autopilot's clock and its samples against the host's: exchanges of TIMESYNC, and lateness."""

from h2nav.maths.units import SECOND_NS
from h2nav.service import records
from h2nav.service.effects import Effect, Record
from h2nav.service.lateness import Lateness
from h2nav.service.time_sync import TimeSync
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.vehicle import TimeSyncMessage

CALM_NS = 5 * SECOND_NS


class Clocks:
    """Relates the clocks of one autopilot after the other.

    Attributes:
        time_sync: the offset of the two.
        lateness: of the samples.
    """

    def __init__(self) -> None:
        self.time_sync = TimeSync()
        self.lateness = Lateness()
        self._asked_ns = 0

    def restart(self) -> None:
        """Restarts with the autopilot's clock."""
        self.lateness.restart()
        self.time_sync.restart()

    def next_question(self, t_ns: int, target: Address) -> OutMessage | None:
        """The next question for the autopilot's time; None while the relation is calm and known."""
        is_calm = self.time_sync.is_calm and not self.lateness.is_doubted
        if is_calm and t_ns < self._asked_ns + CALM_NS:
            return None
        self._asked_ns = t_ns
        return outbound.time_sync(0, self.time_sync.request(t_ns), target)

    def on_answer(self, t_ns: int, answer: TimeSyncMessage) -> list[Effect]:
        """Takes the autopilot's answer to one of our questions."""
        exchange = self.time_sync.answer(t_ns, answer.tc1_ns, answer.ts1_ns)
        if exchange is None:
            return []
        self.lateness.compared(exchange)
        if not exchange.is_quick:
            return []
        record = records.TimeSyncRecord(
            offset_us=exchange.offset_ns * 1e-3,
            skew_ppm=self.time_sync.skew * 1e6,
            round_trip_us=exchange.round_trip_ns * 1e-3,
            host_us=exchange.host_ns // 1000,
        )
        return [Record("/time_sync", record)]
