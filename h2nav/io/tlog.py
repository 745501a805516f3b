"""Telemetry logs (`.tlog`): entries of big-endian UNIX microseconds and a raw MAVLink frame.

An entry carries no checksum of its own time, and its length follows from the frame's header. So an
entry counts as sound when another one, or the end of the file, follows it where it should. After
damage the bytes up to the next sound entry are passed on with the last good time: the deframer
finds the intact frames among them.
"""

from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from h2nav.io.deframer import LONGEST_FRAME, SIGNATURE_SIZE, SIGNED_FLAG

TIME_SIZE = 8
_BLOCK = 1 << 18
_NEED = 2 * (TIME_SIZE + LONGEST_FRAME)  # two whole entries
_EARLIEST_US, _LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000  # years 2000 to 2100


class TlogEntry(NamedTuple):
    """Bytes with their time; one frame, or a damaged stretch.

    Attributes:
        unix_us: never smaller than that of the entry before.
        data: the frame's bytes, or what stood there instead.
    """

    unix_us: int
    data: bytes


class TlogReader:
    """Reads entries front to back with bounded memory.

    Attributes:
        position: bytes given out so far.
        damaged_bytes: bytes that were not part of a sound entry.
        damaged_stretches: how many runs of such bytes there were.
        corrected_times: times that did not fit between their neighbours' and were replaced.
        clock_steps_back: times at which the recorder's clock was set back; it stands still there.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._buffer = b""
        self._at = self._next_size = 0
        self._ended = False
        self._last_us = 0
        self._shift_us = 0
        self.position = 0
        self.damaged_bytes = self.damaged_stretches = 0
        self.corrected_times = self.clock_steps_back = 0

    def entries(self) -> Iterator[TlogEntry]:
        """All entries in the order of the file."""
        while self._fill():
            # What made the last entry sound is the size of this one.
            size = self._next_size or _entry_size(self._buffer, self._at)
            if size and self._is_sound(self._at, size):
                unix_us = self._time(size)
                data = self._buffer[self._at + TIME_SIZE : self._at + size]
            else:
                size = self._damaged_size()
                self._next_size = 0
                self.damaged_bytes += size
                unix_us = self._last_us
                data = self._buffer[self._at : self._at + size]
            self._at += size
            self.position += size
            yield TlogEntry(unix_us, data)

    def _fill(self) -> bool:
        """Keeps two whole entries in the buffer; False at the end of the file."""
        if len(self._buffer) - self._at < _NEED and not self._ended:
            more = self._stream.read(_BLOCK)
            self._ended = len(more) < _BLOCK
            self._buffer = self._buffer[self._at :] + more
            self._at = 0
        return self._at < len(self._buffer)

    def _is_sound(self, at: int, size: int) -> bool:
        follower = at + size
        if follower == len(self._buffer):
            self._next_size = 0
            return self._ended
        self._next_size = _entry_size(self._buffer, follower)
        return self._next_size > 0

    def _time(self, size: int) -> int:
        """The entry's time on a scale that never runs backwards."""
        unix_us = _raw_time(self._buffer, self._at) + self._shift_us
        if self._last_us == 0:
            self._last_us = unix_us
            return unix_us
        follower = self._at + size
        if follower < len(self._buffer):
            next_us = _raw_time(self._buffer, follower) + self._shift_us
            outside = not self._last_us <= unix_us <= next_us
            if outside and next_us >= self._last_us:
                self.corrected_times += 1
                return self._last_us
        if unix_us < self._last_us:
            self.clock_steps_back += 1
            self._shift_us += self._last_us - unix_us
            unix_us = self._last_us
        self._last_us = unix_us
        return unix_us

    def _damaged_size(self) -> int:
        """Bytes up to the next sound entry, or to what the buffer holds for now."""
        self.damaged_stretches += 1
        last = len(self._buffer) if self._ended else len(self._buffer) - _NEED // 2
        for at in range(self._at + 1, last):
            size = _entry_size(self._buffer, at)
            if size and self._is_sound(at, size):
                return at - self._at
        return max(last, self._at + 1) - self._at


def looks_like_tlog(start: bytes) -> bool:
    """Whether a file that begins so holds time stamps between its frames.

    Args:
        start: the first bytes of the file, a few thousand of them.
    """
    for at in range(len(start)):
        size = _entry_size(start, at)
        follower = at + size
        if size and (follower == len(start) or _entry_size(start, follower)):
            return True
    return False


def _raw_time(buffer: bytes, at: int) -> int:
    return int.from_bytes(buffer[at : at + TIME_SIZE], "big")


def _entry_size(buffer: bytes, at: int) -> int:
    """Bytes of the entry that begins at `at`; 0 when none can begin there or be recognised."""
    frame = at + TIME_SIZE
    if frame + 3 > len(buffer) or not _EARLIEST_US <= _raw_time(buffer, at) <= _LATEST_US:
        return 0
    marker, length, flags = buffer[frame], buffer[frame + 1], buffer[frame + 2]
    if marker == 0xFE:
        return TIME_SIZE + 8 + length
    if marker == 0xFD and flags <= SIGNED_FLAG:
        return TIME_SIZE + 12 + length + (SIGNATURE_SIZE if flags & SIGNED_FLAG else 0)
    return 0
