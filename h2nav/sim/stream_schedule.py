"""Schedules the streams on a line that may be too slow for all of them."""

import heapq
from collections.abc import Iterable

from h2nav.maths.units import SECOND_NS
from h2nav.sim.streams import Stream

# A sender's buffer: streams are deferred while this much is queued, as ArduPilot does.
_LINE_BUFFER_NS = 20_000_000


class StreamSchedule:
    """Intervals and due times of the streams of one link.

    Args:
        line_bytes_per_s: capacity of the line; None = unlimited.
    """

    def __init__(self, streams: Iterable[Stream], line_bytes_per_s: float | None = None) -> None:
        self._streams: dict[int, Stream] = {}
        self.offer(streams)
        self._intervals_ns: dict[int, int] = {}
        self._due: list[tuple[int, int, int]] = []
        self._current: dict[int, int] = {}
        self._order = 0
        self._ns_per_byte = SECOND_NS / line_bytes_per_s if line_bytes_per_s else 0.0
        self._line_free_ns = 0.0
        self.put_off = 0

    def offer(self, streams: Iterable[Stream]) -> None:
        """Replaces the available streams; none may be running."""
        self._streams = {stream.message_id: stream for stream in streams}

    @property
    def next_deadline_ns(self) -> int | None:
        """When the next stream is due; None while none is running."""
        # Entries replaced by a newer interval are skipped.
        while self._due and self._current.get(self._due[0][2]) != self._due[0][1]:
            heapq.heappop(self._due)
        return self._due[0][0] if self._due else None

    def stream(self, message_id: int) -> Stream | None:
        """The stream of a message, None if this autopilot lacks it."""
        return self._streams.get(message_id)

    def interval_ns(self, message_id: int) -> int:
        """The current interval of a stream; 0 = not running."""
        return self._intervals_ns.get(message_id, 0)

    def of_group(self, group: int) -> list[int]:
        """Message ids of a MAV_DATA_STREAM group; group 0 is all groups."""
        return [
            message_id
            for message_id, stream in self._streams.items()
            if stream.group is not None and group in (0, stream.group)
        ]

    def running(self) -> list[int]:
        """Message ids of the running streams."""
        return list(self._intervals_ns)

    def start_defaults(self, t_ns: int) -> None:
        """Starts the streams that are sent without a request."""
        for message_id, stream in self._streams.items():
            if stream.default_hz > 0.0:
                self.set_interval(t_ns, message_id, round(SECOND_NS / stream.default_hz))

    def set_interval(self, t_ns: int, message_id: int, interval_ns: int) -> None:
        """Sets a stream's interval from `t_ns` on; 0 stops it."""
        self._intervals_ns.pop(message_id, None)
        self._current.pop(message_id, None)
        if interval_ns > 0:
            self._intervals_ns[message_id] = interval_ns
            self._push(t_ns + interval_ns, message_id)

    def stop_all(self) -> None:
        """Stops all streams."""
        self._intervals_ns.clear()
        self._current.clear()
        self._due.clear()

    def skip_to(self, t_ns: int) -> None:
        """Skips what was due before `t_ns`."""
        for message_id, interval_ns in list(self._intervals_ns.items()):
            self.set_interval(t_ns, message_id, interval_ns)

    def has_room(self, t_ns: int) -> bool:
        """Whether the line accepts another message at `t_ns`."""
        return self._line_free_ns - t_ns <= _LINE_BUFFER_NS

    def occupy(self, t_ns: int, size_bytes: int) -> None:
        """Puts a message of this size on the line."""
        self._line_free_ns = max(self._line_free_ns, t_ns) + size_bytes * self._ns_per_byte

    def pop_due(self, t_ns: int) -> Stream | None:
        """Returns the due stream (see `next_deadline_ns`) and schedules its next turn.

        Returns:
            None if the line is full at `t_ns`. Deferred streams queue for the line, so that all of
            them slow down alike.
        """
        message_id = heapq.heappop(self._due)[2]
        if not self.has_room(t_ns):
            self.put_off += 1
            self._push(round(self._line_free_ns) - _LINE_BUFFER_NS + 1, message_id)
            return None
        self._push(t_ns + self._intervals_ns[message_id], message_id)
        return self._streams[message_id]

    def _push(self, due_ns: int, message_id: int) -> None:
        self._order += 1
        self._current[message_id] = self._order
        heapq.heappush(self._due, (due_ns, self._order, message_id))
