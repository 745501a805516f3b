"""Requests missing streams from the autopilot, and trusts only measured rates.

The autopilot may send everything unasked (PX4) or nothing (ArduPilot), may refuse, may lose all
streams at a reboot, may have them overridden by a ground station (REQUEST_DATA_STREAM), and
acknowledges rates that the link cannot carry. So: listen first; send one SET_MESSAGE_INTERVAL at a
time, because its COMMAND_ACK does not name the message; measure; repeat with growing pauses, at
most `MAX_PER_MINUTE` times; send nothing while the autopilot is silent. REQUEST_DATA_STREAM is
used where the command is not acknowledged or unknown.

The service calls `heard` at each heartbeat of the autopilot, `said` at its texts, `arrived` at each
other message, `acknowledged` at its replies, `measure` and `next_request` ten times a second,
`restart` when its time restarts; and it reports the `notices`.
"""

import math
import re
from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Notice
from h2nav.service.rate_meter import LONGEST_SPAN_NS, RateMeter
from h2nav.service.requested_stream import (
    SHORTEST_LOOK_NS,
    RequestedStream,
    StreamPhase,
    Trouble,
    WantedStream,
)
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.readers import message_name

ACK_WAIT_NS = SECOND_NS
SILENT_NS = 2_500_000_000
MINUTE_NS = 60 * SECOND_NS
REPEAT_NS = 10 * MINUTE_NS
MAX_PER_MINUTE = 30
UNANSWERED_BEFORE_FALLBACK = 3
# After an optional stream was given up, it may affect others for this long.
SPARED_NS = 20_000_000_000
# A needed stream with a short dip recovers by itself: its measure covers 2 s.
SHORT_FOR_NS = 5_000_000_000

# MAV_DATA_STREAM group that carries a message, for autopilots without SET_MESSAGE_INTERVAL.
DATA_STREAMS = {
    mavlink.MAVLINK_MSG_ID_RAW_IMU: mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: mavlink.MAV_DATA_STREAM_RAW_SENSORS,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: mavlink.MAV_DATA_STREAM_POSITION,
    mavlink.MAVLINK_MSG_ID_VFR_HUD: mavlink.MAV_DATA_STREAM_EXTRA2,
}
ANSWERED_WELL = (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
# ArduPilot explains its refusal by one of these texts; PX4 only refuses messages.
UNKNOWN_MESSAGE = re.compile(r"No ap_message for mavlink id \((\d+)\)")
LIMITS = {mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: "SCHED_LOOP_RATE"}


class StreamRequests:
    """The negotiation of streams with one autopilot.

    Args:
        wanted: the wanted streams, the most important first.
        autopilot: MAV_AUTOPILOT of its heartbeat.
        asks: requests are sent; not so where another program does, and in a replay.
    """

    def __init__(
        self,
        wanted: tuple[WantedStream, ...],
        autopilot: int = mavlink.MAV_AUTOPILOT_GENERIC,
        asks: bool = True,
    ) -> None:
        self._streams = [RequestedStream(one) for one in wanted]
        self._autopilot = autopilot
        self._asks = asks
        self._meter = RateMeter()
        self.counts = self._meter.counts  # of the autopilot's messages, by their ids
        self._heard_ns: int | None = None
        self._asked_ns: deque[int] = deque(maxlen=MAX_PER_MINUTE)
        self._unknown_ids: set[int] = set()
        self._reported_ns: dict[tuple[int, Trouble, float], int] = {}
        self._notices: list[Notice] = []
        self._held_hz: dict[int, float] = {}
        self._noted_ns = 0
        self._waiting: RequestedStream | None = None
        self._refused_waiting = False
        self._unanswered = 0
        self._listening_since_ns: int | None = None
        self._most_hz = math.inf
        self._spared_until_ns = 0
        self._complete_ns = 0

    def restart(self) -> None:
        """Starts from the beginning: all streams may be gone (reboot, new link)."""
        self._waiting = None
        self._refused_waiting = False
        self._unanswered = 0
        self._listening_since_ns = None
        self._most_hz = math.inf
        self._held_hz.clear()
        self._meter.restart()
        for stream in self._streams:
            stream.restart()

    # --- what comes ---------------------------------------------------------------------------

    def heard(self, t_ns: int) -> None:
        """Notes a heartbeat of the autopilot; the first one after a silence restarts everything."""
        if self._is_silent(t_ns):
            self.restart()
        self._heard_ns = t_ns

    def said(self, text: str) -> None:
        """Takes a STATUSTEXT of the autopilot, which may explain a refusal."""
        match = UNKNOWN_MESSAGE.search(text)
        if match is not None:
            asked_for = {f"{i}": i for stream in self._streams for i in stream.candidates}
            if match[1] in asked_for:
                self._unknown_ids.add(asked_for[match[1]])

    def acknowledged(self, t_ns: int, result: int) -> None:
        """Takes the COMMAND_ACK of our SET_MESSAGE_INTERVAL."""
        stream = self._waiting
        if stream is None or self._refused_waiting:
            return
        self._unanswered = 0
        if stream.phase is StreamPhase.GIVEN_UP:
            self._waiting = None
            return
        if result == mavlink.MAV_RESULT_TEMPORARILY_REJECTED:
            self._waiting = None
            stream.unanswered(t_ns, at_once=False)
        elif result == mavlink.MAV_RESULT_UNSUPPORTED:
            self._waiting = None
            self._unanswered = UNANSWERED_BEFORE_FALLBACK
            # Without a group it can only be asked for the same way again.
            stream.unanswered(t_ns, at_once=stream.message_id in DATA_STREAMS)
        elif result in ANSWERED_WELL:
            self._waiting = None
            self._granted(t_ns, stream)
        else:
            # The reason follows in a text: decided with the next request.
            self._refused_waiting = True

    def measure(self, t_ns: int) -> None:
        """Measures the arrivals; called ten times a second."""
        if self._is_silent(t_ns) or not self._meter.sample(t_ns):
            return
        if self._listening_since_ns is None:
            self._listening_since_ns = t_ns
        if not self._asks:
            self._note_held(t_ns)
            return
        listened_ns = t_ns - self._listening_since_ns
        if listened_ns >= SHORTEST_LOOK_NS and not any(map(self._comes, self._streams)):
            # An autopilot without streams: there is nothing to wait for.
            for stream in self._streams:
                stream.want_now(t_ns)
        for stream in self._streams:
            trouble = stream.review(t_ns, self._meter)
            if trouble is not None and stream.wanted.is_optional:
                if trouble is not Trouble.CUT or not stream.is_enough(self._needed[0].rate_hz):
                    stream.give_up(t_ns)
            elif trouble is not None and self._unanswered == 0 and t_ns >= self._spared_until_ns:
                self._report(t_ns, stream, trouble)
        self._spare_the_needed(t_ns)

    def _spare_the_needed(self, t_ns: int) -> None:
        """Gives up an optional stream, which may be why a needed one does not come."""
        asked = [s for s in self._streams if s.wanted.is_optional and not s.is_untouched]
        if asked:
            self._spared_until_ns = t_ns + SPARED_NS
        needed = self._needed
        if needed[0].phase is StreamPhase.HELD and not any(stream.is_short for stream in needed):
            self._complete_ns = t_ns
        elif t_ns - self._complete_ns >= SHORT_FOR_NS:
            for stream in asked:
                stream.give_up(t_ns)

    def give_up(self, t_ns: int, message_id: int) -> None:
        """Gives up an optional stream that has turned out to be useless."""
        for stream in self._streams:
            if stream.wanted.is_optional and stream.message_id == message_id:
                stream.give_up(t_ns)

    # --- what is asked ------------------------------------------------------------------------

    def next_request(self, t_ns: int, target: Address) -> OutMessage | None:
        """Returns the next request, at most one.

        Args:
            target: system and component id of the autopilot.
        """
        if self._is_silent(t_ns) or self._is_waiting(t_ns):
            return None
        if len(self._asked_ns) == MAX_PER_MINUTE and t_ns - self._asked_ns[0] < MINUTE_NS:
            return None
        for stream in self._streams:
            if stream.is_to_be_left:
                self._asked_ns.append(t_ns)
                stream.left(t_ns)
                self._waiting = stream
                return outbound.set_message_interval(target, stream.message_id, 0.0)
            if stream.is_due(t_ns) and self._may_ask(stream):
                self._asked_ns.append(t_ns)
                return self._ask(t_ns, stream, target)
        return None

    # --- what is known ------------------------------------------------------------------------

    def measured_hz(self, message_id: int) -> float | None:
        """The rate of any message over the last two seconds; None before it is known."""
        return self._meter.hz(message_id)

    def granted_hz(self, message_id: int) -> float | None:
        """The rate at which a message (or its alternative) may be expected.

        The negotiated rate. Without requests it is the best rate held so far, and None before it is
        known.
        """
        for stream in self._streams:
            if message_id in stream.candidates and self._asks:
                return stream.rate_hz
            if message_id in stream.candidates and message_id in self._held_hz:
                return min(self._held_hz[message_id], stream.wanted.rate_hz)
        return None

    def is_given_up(self, message_id: int) -> bool:
        """Whether we do without a message that is optional."""
        return any(
            stream.phase is StreamPhase.GIVEN_UP
            for stream in self._streams
            if message_id in stream.candidates
        )

    def is_refused(self, message_id: int) -> bool:
        """Whether the autopilot also refuses all alternatives and lower rates of a message."""
        return any(
            stream.phase is StreamPhase.REFUSED
            for stream in self._streams
            if message_id in stream.candidates
        )

    def notices(self) -> list[Notice]:
        """Returns the notices since the last call."""
        notices, self._notices = self._notices, []
        return notices

    # --- the rest -----------------------------------------------------------------------------

    @property
    def _needed(self) -> list[RequestedStream]:
        return [stream for stream in self._streams if not stream.wanted.is_optional]

    def _is_silent(self, t_ns: int) -> bool:
        return self._heard_ns is None or t_ns - self._heard_ns > SILENT_NS

    def _may_ask(self, stream: RequestedStream) -> bool:
        """Optional streams wait for the others; a request for a group would not help them."""
        if not stream.wanted.is_optional:
            return True
        needed = self._needed
        comes = needed[0].phase is StreamPhase.HELD and all(other.is_decided for other in needed)
        return comes and self._unanswered == 0

    def _comes(self, stream: RequestedStream) -> bool:
        """Whether any message of the stream has come."""
        return any(self._meter.since(message_id, 0).messages for message_id in stream.candidates)

    def _is_waiting(self, t_ns: int) -> bool:
        """Whether the latest request is still open; closes it when its time is over."""
        stream = self._waiting
        if stream is None:
            return False
        if self._refused_waiting:
            self._refused_waiting = False
            is_px4 = self._autopilot == mavlink.MAV_AUTOPILOT_PX4
            is_unknown = is_px4 or stream.message_id in self._unknown_ids
            trouble = stream.refused(t_ns, is_unknown)
            if trouble is not None and not stream.wanted.is_optional:
                self._report(t_ns, stream, trouble)
        elif stream.since_ns is not None and t_ns - stream.since_ns < ACK_WAIT_NS:
            return True
        elif stream.phase is not StreamPhase.GIVEN_UP:
            self._unanswered += 1
            stream.unanswered(t_ns, at_once=self._unanswered <= UNANSWERED_BEFORE_FALLBACK)
        self._waiting = None
        return False

    def _ask(self, t_ns: int, stream: RequestedStream, target: Address) -> OutMessage:
        rate_hz = stream.asked(t_ns, self._most_hz)
        group = DATA_STREAMS.get(stream.message_id)
        if self._unanswered >= UNANSWERED_BEFORE_FALLBACK and group is not None:
            stream.granted(t_ns)
            return outbound.request_data_stream(target, group, rate_hz)
        self._waiting = stream
        return outbound.set_message_interval(target, stream.message_id, rate_hz)

    def _granted(self, t_ns: int, stream: RequestedStream) -> None:
        trouble = stream.granted(t_ns)
        if stream.wanted.is_optional:
            if not stream.is_enough(self._needed[0].rate_hz):
                stream.give_up(t_ns)
        elif trouble is Trouble.LOWERED:
            # A limit of one message applies to all of them.
            self._most_hz = min(self._most_hz, stream.rate_hz)
            self._report(t_ns, stream, trouble)

    def _note_held(self, t_ns: int) -> None:
        if t_ns - self._noted_ns < SECOND_NS:
            return
        self._noted_ns = t_ns
        for stream in self._streams:
            for message_id in stream.candidates:
                hz = self._meter.hz(message_id, LONGEST_SPAN_NS)
                if hz is not None:
                    self._held_hz[message_id] = max(hz, self._held_hz.get(message_id, 0.0))

    def _report(self, t_ns: int, stream: RequestedStream, trouble: Trouble) -> None:
        """Notes a trouble, once; a reduced rate, once in ten minutes."""
        rate_hz = stream.rate_hz if trouble is Trouble.LOWERED else 0.0
        key = (stream.message_id, trouble, rate_hz)
        reported_ns = self._reported_ns.get(key)
        repeats = trouble is Trouble.TAKEN
        if reported_ns is None or (repeats and t_ns - reported_ns >= REPEAT_NS):
            self._reported_ns[key] = t_ns
            self._notices.append(Notice(Severity.WARNING, self._text(stream, trouble)))

    def _text(self, stream: RequestedStream, trouble: Trouble) -> str:
        name = message_name(stream.message_id)
        wanted = f"of {stream.wanted.rate_hz:.0f} Hz"
        came = f"{name} {stream.measured_hz:.0f} {wanted}"
        limit = LIMITS.get(self._autopilot, "the autopilot refuses more")
        others = len(stream.candidates) - 1
        return {
            Trouble.LOWERED: f"{name} {stream.rate_hz:.0f} {wanted} ({limit})",
            Trouble.CUT: f"{came}: link full? Asked for {stream.rate_hz:.0f}",
            Trouble.SHORT: f"{came}: link full?",
            Trouble.TAKEN: f"{came}: set by another station?",
            Trouble.ABSENT: f"{name}: granted, yet none comes",
            Trouble.REFUSED: (
                f"{name} and {others} alternatives: refused" if others else f"{name}: refused"
            ),
        }[trouble]
