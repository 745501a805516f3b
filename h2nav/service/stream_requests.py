"""Asks the autopilot for streams, believes only the rate that is measured, and asks again.

The autopilot may refuse, may lose all streams at a reboot, may have them overridden by a ground
station (REQUEST_DATA_STREAM), and acknowledges rates that the link cannot carry. So: one
SET_MESSAGE_INTERVAL at a time, wait for its ACK, measure, ask again with growing pauses, and fall
back to REQUEST_DATA_STREAM when the command is not answered or not known.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

ACK_WAIT_NS = 1_000_000_000
WINDOW_NS = 2_000_000_000
FIRST_PAUSE_NS = 3_000_000_000
LAST_PAUSE_NS = 60_000_000_000
UNANSWERED_BEFORE_FALLBACK = 3
ENOUGH = 0.8

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


class Wish(NamedTuple):
    """A stream that is wanted.

    Attributes:
        message_id: of the message.
        rate_hz: how often.
        alternatives: message ids to ask for instead, in order, where this one is refused.
    """

    message_id: int
    rate_hz: float
    alternatives: tuple[int, ...] = ()


class _Stream:
    """What is known of one wished stream."""

    def __init__(self, wish: Wish) -> None:
        self.wish = wish
        self.candidates = (wish.message_id, *wish.alternatives)
        self.index = 0
        self.count = 0
        self.measured_hz: float | None = None
        self.is_measured = False  # since it was last asked for
        self.asked_ns: int | None = None
        self.pause_ns = FIRST_PAUSE_NS
        self.refusals = 0

    @property
    def message_id(self) -> int:
        return self.candidates[self.index]

    def is_enough(self) -> bool:
        return self.measured_hz is not None and self.measured_hz >= ENOUGH * self.wish.rate_hz

    def is_due(self, t_ns: int) -> bool:
        return self.asked_ns is None or t_ns - self.asked_ns >= self.pause_ns

    def refuse(self) -> None:
        """Takes the next candidate at once; after the last one begins anew, after a pause."""
        self.refusals += 1
        self.index = (self.index + 1) % len(self.candidates)
        if self.index:
            self.asked_ns = None


class StreamRequests:
    """The conversation about streams with one autopilot.

    Args:
        wishes: what is wanted, the most important first.
    """

    def __init__(self, wishes: tuple[Wish, ...]) -> None:
        self._streams = [_Stream(wish) for wish in wishes]
        self._waiting: _Stream | None = None
        self._waiting_since_ns = 0
        self._unanswered = 0
        self._window_start_ns: int | None = None

    def arrived(self, message_id: int) -> None:
        """Counts a message of the bound autopilot."""
        for stream in self._streams:
            if message_id == stream.message_id:
                stream.count += 1

    def restart(self) -> None:
        """All streams may be gone (reboot, new link): measure and ask from the beginning."""
        self._waiting = None
        self._window_start_ns = None
        self._unanswered = 0
        for index, stream in enumerate(self._streams):
            self._streams[index] = _Stream(stream.wish)

    def acknowledged(self, t_ns: int, result: int) -> None:
        """Takes the COMMAND_ACK for our SET_MESSAGE_INTERVAL."""
        if self._waiting is None:
            return
        stream, self._waiting = self._waiting, None
        self._unanswered = 0
        if result not in ANSWERED_WELL:
            stream.refuse()

    def measure(self, t_ns: int) -> None:
        """Turns the counts of a finished window into rates; call it several times a second."""
        if self._window_start_ns is None:
            self._window_start_ns = t_ns
        elif t_ns - self._window_start_ns >= WINDOW_NS:
            seconds = (t_ns - self._window_start_ns) * 1e-9
            for stream in self._streams:
                stream.measured_hz = stream.count / seconds
                stream.is_measured = True
            self._window_start_ns = t_ns
        else:
            return
        for stream in self._streams:
            stream.count = 0

    def measured_hz(self, message_id: int) -> float | None:
        """Achieved rate of a wished stream over the last window; None before the first."""
        for stream in self._streams:
            if message_id == stream.message_id:
                return stream.measured_hz
        return None

    def shortfalls(self) -> Iterator[tuple[int, float, float]]:
        """Streams that were asked for, yet arrive too slowly: (message id, achieved, asked) Hz."""
        for stream in self._streams:
            measured_hz = stream.measured_hz if stream.is_measured else None
            if stream.asked_ns is not None and measured_hz is not None and not stream.is_enough():
                yield stream.message_id, measured_hz, stream.wish.rate_hz

    def next_request(self, t_ns: int, target: tuple[int, int]) -> Any | None:
        """What to send now, at most one message.

        Args:
            t_ns: host monotonic time.
            target: system and component id of the autopilot.
        """
        if self._waiting is not None:
            if t_ns - self._waiting_since_ns < ACK_WAIT_NS:
                return None
            stream, self._waiting = self._waiting, None
            self._unanswered += 1
            if self._unanswered < UNANSWERED_BEFORE_FALLBACK:
                stream.asked_ns = None  # it was lost (a reboot's silence): ask again at once
        for stream in self._streams:
            if stream.is_enough() or not stream.is_due(t_ns):
                continue
            if stream.asked_ns is not None and not stream.is_measured:
                continue
            others_come = any(other.measured_hz for other in self._streams)
            if stream.asked_ns is not None and stream.measured_hz == 0.0 and others_come:
                stream.refuse()
            return self._ask(t_ns, stream, target)
        return None

    def _ask(self, t_ns: int, stream: _Stream, target: tuple[int, int]) -> Any:
        if stream.asked_ns is not None:
            stream.pause_ns = min(2 * stream.pause_ns, LAST_PAUSE_NS)
        stream.asked_ns = t_ns
        stream.is_measured = False
        self._window_start_ns = None
        if self._unanswered >= UNANSWERED_BEFORE_FALLBACK and stream.message_id in DATA_STREAMS:
            return mavlink.MAVLink_request_data_stream_message(
                *target, DATA_STREAMS[stream.message_id], round(stream.wish.rate_hz), 1
            )
        self._waiting = stream
        self._waiting_since_ns = t_ns
        interval_us = 1e6 / stream.wish.rate_hz
        return mavlink.MAVLink_command_long_message(
            *target,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
            0,
            float(stream.message_id),
            interval_us,
            0.0,
            0.0,
            0.0,
            0.0,
            0.0,
        )
