"""Telemetry logs (`.tlog`): entries of big-endian UNIX microseconds and a raw MAVLink frame.

An entry carries no checksum of its time, and its length follows from the frame's header. So an
entry counts as sound when another entry, or the end of the file, follows it at the expected place.
After damage the bytes up to the next sound entry are passed on with the last good time: the
deframer finds the intact frames among them.
"""

import sys
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import MICROSECOND_NS
from h2nav.wire.arrivals import BATCH_BYTES, Arrivals, Integers
from h2nav.wire.byte_views import MARKER_2, marker_places, values_at
from h2nav.wire.deframer import LONGEST_FRAME, SIGNATURE_SIZE, SIGNED_FLAG

TIME_SIZE = 8
_NEED = 2 * (TIME_SIZE + LONGEST_FRAME)  # two whole entries
_MIN_SEEN = TIME_SIZE + 3  # of an entry that can be recognised
# A clock that leaps further was set: a companion without a battery begins in the year 2000, or
# where it was switched off. So was one that leaps by more than the other while a sender's own
# clock goes on; in a pause of the link both advance.
_MAX_LEAP_US = 86_400_000_000
_MAX_STEP_US = 60_000_000
_COMPARED = 64  # entries before and after a leap among which two of one sender and kind are sought
# Messages whose payload begins with their sender's time since its boot, as uint64 in us or as
# uint32 in ms: bytes of it.
_STAMP_SIZES = {
    mavlink.MAVLINK_MSG_ID_RAW_IMU: 8,
    mavlink.MAVLINK_MSG_ID_HIGHRES_IMU: 8,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU: 4,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU2: 4,
    mavlink.MAVLINK_MSG_ID_SCALED_IMU3: 4,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: 4,
    mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: 4,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 4,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: 4,
}
_EARLIEST_US, _LATEST_US = 946_684_800_000_000, 4_102_444_800_000_000  # years 2000 to 2100


class TlogReader:
    """Reads entries front to back with bounded memory.

    Attributes:
        position: bytes returned so far.
        damaged_bytes: bytes outside sound entries.
        corrected_times: times replaced because they did not fit between their neighbours'.
        clock_steps_back: how often the recorder's clock was set back; time stands still there.
        clock_steps_forward: how often it was set forward; time stands still there.
    """

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._buffer = b""
        self._at = 0
        self._ended = False
        self._last_us = 0
        self._shift_us = 0
        self._stamps_us: dict[bytes, int] = {}  # the newest of each sender and kind just seen
        self.position = 0
        self.damaged_bytes = 0
        self.corrected_times = self.clock_steps_back = self.clock_steps_forward = 0

    def batches(self) -> Iterator[Arrivals]:
        """Yields all entries in order, those of one block of the file at a time.

        An arrival is the frame of a sound entry, or the bytes found instead. Its time is the
        recorder's UNIX time.
        """
        while self._fill():
            start = self._at
            arrivals = self._block()
            self.position += self._at - start
            yield arrivals

    def _fill(self) -> bool:
        """Keeps two whole entries in the buffer; False at the end of the file."""
        if self._is_short() and not self._ended:
            more = self._stream.read(BATCH_BYTES)
            self._ended = len(more) < BATCH_BYTES
            self._buffer = self._buffer[self._at :] + more
            self._at = 0
        return self._at < len(self._buffer)

    def _is_short(self) -> bool:
        return len(self._buffer) - self._at < _NEED

    def _block(self) -> Arrivals:
        """The decided part of the buffer; the rest needs more bytes."""
        seen = _Seen(self._buffer, self._ended)
        starts: list[Integers] = []
        ends: list[Integers] = []
        times: list[Integers] = []
        while self._at < len(self._buffer) and (self._ended or not self._is_short()):
            run = seen.run(self._at, self._last_us and self._last_us - self._shift_us)
            if run.stop > run.start:
                starts.append(seen.at[run] + TIME_SIZE)
                ends.append(seen.ends[run])
                times.append(seen.times_us[run] + self._shift_us)
                self._at, self._last_us = int(ends[-1][-1]), int(times[-1][-1])
                last = slice(max(run.start, run.stop - _COMPARED), run.stop)
                self._stamps_us = self._stamps(seen, last) or self._stamps_us
            else:
                start, end, unix_us = self._entry(seen)
                starts.append(np.array([start]))
                ends.append(np.array([end]))
                times.append(np.array([unix_us]))
                self._at = end
        t_ns = np.concatenate(times) * MICROSECOND_NS
        return Arrivals(self._buffer, np.concatenate(starts), np.concatenate(ends), t_ns, True)

    def _entry(self, seen: "_Seen") -> tuple[int, int, int]:
        """The next entry or damaged stretch: beginning and end of its bytes, and its time, us."""
        at = self._at
        end = seen.end_of_sound(at)
        if end:
            return at + TIME_SIZE, end, self._time(seen, end)
        known = len(self._buffer) if self._ended else len(self._buffer) - _NEED // 2
        end = min(seen.next_sound(at), max(known, at + 1))
        self.damaged_bytes += end - at
        return at, end, self._last_us

    def _time(self, seen: "_Seen", follower: int) -> int:
        """The entry's time on a scale that never runs backwards."""
        unix_us = _raw_time(self._buffer, self._at) + self._shift_us
        if self._last_us == 0:
            self._last_us = unix_us
            return unix_us
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
        elif self._was_set(seen, unix_us - self._last_us):
            self.clock_steps_forward += 1
            self._shift_us += self._last_us - unix_us
            unix_us = self._last_us
        self._last_us = unix_us
        return unix_us

    def _stamps(self, seen: "_Seen", places: slice) -> dict[bytes, int]:
        """The newest time of each sender and kind among some entries, us since its boot."""
        found = (_stamp(self._buffer, at) for at in seen.at[places].tolist())
        return dict(each for each in found if each is not None)

    def _was_set(self, seen: "_Seen", leap_us: int) -> bool:
        """Whether the clock was set, where the time of the next entry leaps forward."""
        if leap_us <= _MAX_STEP_US or leap_us > _MAX_LEAP_US:
            return leap_us > _MAX_LEAP_US
        here = seen.place(self._at)
        after_us = self._stamps(seen, slice(here, here + _COMPARED))
        advanced_us = [
            us - self._stamps_us[one] for one, us in after_us.items() if one in self._stamps_us
        ]
        return any(0 <= us < leap_us // 2 for us in advanced_us)


class _Seen:
    """Everything that looks like an entry in a block of a file, and its successors.

    Args:
        ended: the file ends with it.
    """

    def __init__(self, buffer: bytes, ended: bool) -> None:
        data = np.frombuffer(buffer, dtype=np.uint8)
        at = marker_places(data[TIME_SIZE:])
        at = at[at <= len(data) - _MIN_SEEN]
        times_us = values_at(buffer, at, ">u8")
        marker, length, flags = (data[at + TIME_SIZE + place] for place in range(3))
        is_v2 = marker == MARKER_2
        likely = (times_us >= _EARLIEST_US) & (times_us <= _LATEST_US)
        likely &= ~is_v2 | (flags <= SIGNED_FLAG)
        sizes = np.where(is_v2, 12 + SIGNATURE_SIZE * flags.astype(np.int64), 8) + length
        self.at = at[likely]  # (N,) beginning of each
        self.ends = self.at + TIME_SIZE + sizes[likely]  # (N,) expected beginning of the next one
        self.times_us = times_us[likely].astype(np.int64)  # (N,) their times as stored
        follower = np.minimum(np.searchsorted(self.at, self.ends), len(self.at) - 1)
        sound = (self.at[follower] == self.ends) | (ended & (self.ends == len(data)))
        self._sound_at, self._sound_ends = self.at[sound], self.ends[sound]
        step_us = np.diff(self.times_us)
        goes_on = (self.ends[:-1] == self.at[1:]) & (step_us >= 0) & (step_us <= _MAX_STEP_US)
        self._breaks = np.append(np.flatnonzero(~goes_on), max(len(self.at) - 1, 0))
        # Beyond this an entry cannot be judged yet.
        last = len(data) if ended else len(data) - _NEED
        self._judged = int(np.searchsorted(self.at, last, "right"))

    def run(self, at: int, last_us: int) -> slice:
        """The entries from `at` on that follow each other in place and time.

        Args:
            last_us: stored time of the previous one; 0 if there is none.
        """
        first = self.place(at)
        if first == len(self.at) or self.at[first] != at:
            return slice(0, 0)
        step_us = int(self.times_us[first]) - last_us
        if step_us < 0 or (last_us and step_us > _MAX_STEP_US):
            return slice(0, 0)
        end = int(self._breaks[np.searchsorted(self._breaks, first)])
        return slice(first, min(end, self._judged))

    def place(self, at: int) -> int:
        """Of the entry at `at`, or the first one behind it."""
        return int(np.searchsorted(self.at, at))

    def end_of_sound(self, at: int) -> int:
        """The end of the entry at `at`; 0 if no sound entry begins there."""
        place = int(np.searchsorted(self._sound_at, at))
        is_sound = place < len(self._sound_at) and self._sound_at[place] == at
        return int(self._sound_ends[place]) if is_sound else 0

    def next_sound(self, at: int) -> int:
        """The beginning of the first sound entry after `at`; beyond the buffer if there is none."""
        place = int(np.searchsorted(self._sound_at, at, "right"))
        return int(self._sound_at[place]) if place < len(self._sound_at) else sys.maxsize


def _stamp(buffer: bytes, at: int) -> tuple[bytes, int] | None:
    """Sender and kind of the frame of an entry, and its time, us since boot; None without one."""
    frame = at + TIME_SIZE
    sender, payload = (5, 10) if buffer[frame] == MARKER_2 else (3, 6)
    key = buffer[frame + sender : frame + payload]
    size = _STAMP_SIZES.get(int.from_bytes(key[2:], "little"), 0)
    stamp = buffer[frame + payload : frame + payload + size]
    if not stamp or len(stamp) < size or buffer[frame + 1] < size:
        return None
    return key, int.from_bytes(stamp, "little") * (1 if size == 8 else 1000)


def looks_like_tlog(start: bytes) -> bool:
    """Whether a file with this beginning holds time stamps between its frames.

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
    """Length of the entry at `at`, bytes; 0 if no entry can begin there or be recognised."""
    frame = at + TIME_SIZE
    if frame + 3 > len(buffer) or not _EARLIEST_US <= _raw_time(buffer, at) <= _LATEST_US:
        return 0
    marker, length, flags = buffer[frame], buffer[frame + 1], buffer[frame + 2]
    if marker == 0xFE:
        return TIME_SIZE + 8 + length
    if marker == 0xFD and flags <= SIGNED_FLAG:
        return TIME_SIZE + 12 + length + (SIGNATURE_SIZE if flags & SIGNED_FLAG else 0)
    return 0
