"""Splits bytes into checked MAVLink 1 and 2 frames; pure, no clock, no I/O.

The rules of this file:

1. A frame is returned if and only if its id is in the dialect and its checksum matches. A frame of
   an unknown id cannot be checked, so it is never returned.
2. After any failure the search resumes at the byte after the failed start marker, so no damage
   costs an intact frame.
3. A start marker with an incomplete frame does not hold back a good frame inside the bytes that it
   claims: the frame that completes first wins. In two cases the deframer waits instead: messages
   whose payload may legitimately carry whole frames (`MessageLayout.carries_bytes`: file transfer,
   tunnel, log data) at their known length, so that frames in a downloaded log are never taken for
   live ones; and the signature of a frame whose checksum matched.
4. The result depends on the bytes alone, not on how they are split into pieces. Fewer than
   `LONGEST_FRAME` bytes are kept between calls.
5. Every byte is part of a frame or counted in `DeframerCounters.skipped_bytes`; every failed start
   marker is counted under one reason.

Why not pymavlink's parser: docs/design/001-deframer.md.
"""

import re
from struct import Struct
from typing import NamedTuple

from fastcrc import crc16

from h2nav.wire.dialect import LAYOUTS

SIGNED_FLAG = 0x01
SIGNATURE_SIZE = 13  # link id, 48-bit time stamp, 48-bit hash
CHECKSUM_SIZE = 2
LONGEST_FRAME = 280  # MAVLink 2: header 10, payload 255, checksum 2, signature 13

_MARKER_1, _MARKER_2 = 0xFE, 0xFD
HEADER_1_SIZE, HEADER_2_SIZE = 6, 10
_UNPACK_HEADER_1 = Struct("<xBBBBB").unpack_from  # length, seq, sysid, compid, id
# length, incompat flags, seq, sysid, compid, id in the lower 24 bits. Reads one byte beyond the
# header, which even an empty frame has (its checksum).
_UNPACK_HEADER_2 = Struct("<xBBxBBBI").unpack_from
# The possible third bytes of message ids (0: no id is above 65,535).
_ID_ENDS = frozenset(msg_id >> 16 for msg_id in LAYOUTS)
_ID_END_CLASS = b"[" + b"".join(re.escape(bytes([end])) for end in sorted(_ID_ENDS)) + b"]"
_OTHER_END_CLASS = _ID_END_CLASS.replace(b"[", b"[^", 1)
# Crafted garbage must cost little Python: a MAVLink 2 marker matches only where its flags and the
# end of its id are known or still missing, a MAVLink 1 marker only before at most four more of its
# kind (message 254 is shorter).
_FIND_START = re.compile(
    rb"\xfe(?!\xfe{5})|\xfd(?:.[\x00\x01](?:.{6}" + _ID_END_CLASS + rb"|.{0,6}\Z)|.?\Z)", re.DOTALL
).search
_FIND_UNKNOWN_IDS = re.compile(rb"\xfd(?=.[\x00\x01].{6}" + _OTHER_END_CLASS + rb")", re.DOTALL)
_ID_END_AT = 9

_checksum = crc16.mcrf4xx
_new = tuple.__new__


class Frame(NamedTuple):
    """A whole frame of a known id with a matching checksum."""

    msg_id: int  # message id
    sysid: int  # sender's system id
    compid: int  # sender's component id
    seq: int  # sender's sequence number, 0..255
    payload: bytes  # as received; MAVLink 2 truncates trailing zero bytes
    version: int  # 1 or 2, the MAVLink version of the frame
    signed: bool  # a signature is attached (the last 13 bytes of `raw`); not verified here
    raw: bytes  # all bytes of the frame, from the start marker on


# A good frame inside a buffer: time (ns) of its completion, message id, (system id, component id),
# its beginning, beginning and end of its payload.
PlacedFrame = tuple[int, int, tuple[int, int], int, int, int]


class DeframerCounters(NamedTuple):
    """Statistics of the bytes since the deframer was created.

    Attributes:
        bytes_in: bytes fed.
        frames: frames returned.
        frames_v1: those of MAVLink 1.
        frames_signed: those with a signature.
        frames_longer: those longer than the dialect defines: the sender has a newer dialect, and
            the surplus is an unknown extension field.
        bad_crc: start markers with a plausible header whose checksum did not match, or inside
            which another good frame began.
        unknown_id: start markers with an id outside the dialect.
        bad_length: MAVLink 1 start markers with an impossible length for their message.
        unknown_flags: MAVLink 2 start markers with incompatibility flags other than "signed".
        truncated: start markers whose frame was incomplete when the stream ended (`flush`).
        skipped_bytes: bytes outside the returned frames: noise, text, damaged frames.
    """

    bytes_in: int = 0
    frames: int = 0
    frames_v1: int = 0
    frames_signed: int = 0
    frames_longer: int = 0
    bad_crc: int = 0
    unknown_id: int = 0
    bad_length: int = 0
    unknown_flags: int = 0
    truncated: int = 0
    skipped_bytes: int = 0


# Why there is no frame at a start marker. Plain integers: noise is checked at every marker.
_INCOMPLETE = 0
_AWAITED = 1  # incomplete, and nothing after it may be returned before it is decided
_BAD_CRC = 2
_UNKNOWN_ID = 3
_BAD_LENGTH = 4
_UNKNOWN_FLAGS = 5
_NO_MARKER = 6
_REASONS = {
    _BAD_CRC: "bad_crc",
    _UNKNOWN_ID: "unknown_id",
    _BAD_LENGTH: "bad_length",
    _UNKNOWN_FLAGS: "unknown_flags",
}

# Read once for the per-frame path; a tuple per id is cheaper than attributes of the layout.
_KNOWN: dict[int, tuple[bytes, int, int, bool]] = {
    msg_id: (bytes([layout.crc_extra]), layout.size, layout.base_size, layout.carries_bytes)
    for msg_id, layout in LAYOUTS.items()
}


class Deframer:
    """Splits one link's byte stream into frames.

    One deframer per link, for every kind of link: datagrams are fed as they come (a transparent
    serial-to-UDP bridge may split a frame), and the next good frame overtakes the rest of a frame
    whose end was lost.
    """

    def __init__(self) -> None:
        self._pending = b""  # begins at the first undecided start marker
        self._pending_counted = 0  # its leading bytes that an earlier frame has accounted for
        self._counts = dict.fromkeys(DeframerCounters._fields, 0)

    @property
    def counters(self) -> DeframerCounters:
        """The counters so far, as an immutable record."""
        return DeframerCounters(**self._counts)

    @property
    def pending_bytes(self) -> int:
        """Number of bytes kept because they may begin an incomplete frame."""
        return len(self._pending)

    @property
    def undecided_bytes(self) -> int | None:
        """Number of kept bytes that are undecided; None where a returned frame ends among them."""
        return None if self._pending_counted else len(self._pending)

    def give_back(self) -> None:
        """Forgets the undecided bytes as though they had not been fed."""
        self._counts["bytes_in"] -= len(self._pending)
        self._pending = b""

    def pass_over(self, size: int, frames: int, frames_v1: int, signed: int, longer: int) -> None:
        """Counts whole frames that a caller has checked by the same rules.

        Args:
            size: their bytes; nothing is pending now, and nothing would be after them.
            frames: their number.
            frames_v1: those of MAVLink 1.
            signed: those with a signature.
            longer: those longer than the dialect defines.
        """
        counts = self._counts
        counts["bytes_in"] += size
        counts["frames"] += frames
        counts["frames_v1"] += frames_v1
        counts["frames_signed"] += signed
        counts["frames_longer"] += longer

    def feed(self, data: bytes) -> list[Frame]:
        """Takes the next bytes of the stream.

        Args:
            data: any number of bytes, split anywhere.

        Returns:
            The frames that these bytes complete, in order.
        """
        size = len(data)
        self._counts["bytes_in"] += size
        if not self._pending and size:
            found = _frame_at(data, 0, size)
            if not isinstance(found, int) and _is_plain(found, size):
                self._counts["frames"] += 1
                return [found]
        return self._scan(self._pending + data if self._pending else data, ended=False)

    def flush(self) -> list[Frame]:
        """Ends the stream (end of file, link down, silent peer).

        Returns:
            Good frames that an incomplete one held back. Nothing is pending afterwards.
        """
        return self._scan(self._pending, ended=True)

    def _scan(self, buffer: bytes, ended: bool) -> list[Frame]:
        """Finds the frames of `buffer`; keeps the undecided bytes, none if `ended`."""
        frames: list[Frame] = []
        rejects: list[tuple[int, int]] = []  # failed start markers since the last frame
        size = len(buffer)
        at = 0
        decided = self._pending_counted  # all before this is counted
        held = size  # the first start marker that still waits for bytes
        while at < size:
            found = _frame_at(buffer, at, size)
            if not isinstance(found, int):
                if at > decided:
                    self._count_skipped(buffer, decided, at, rejects, ended)
                if rejects:
                    rejects.clear()
                    held = size
                msg_id, _, _, _, payload, version, signed, raw = found
                at += len(raw)
                decided = max(decided, at)
                if version == 1 or signed or len(payload) > _KNOWN[msg_id][1]:
                    self._count_unusual(found)
                frames.append(found)
                if signed or raw[-1] >= _MARKER_2:
                    # The frame may have lost bytes here and borrowed them from the next one: the
                    # checksum does not cover the signature, and the next marker may equal the lost
                    # last byte.
                    at -= SIGNATURE_SIZE if signed else 1
                continue
            rejects.append((at, found))
            if found <= _AWAITED:
                held = min(held, at)
                if found == _AWAITED and not ended:
                    break
            match = _FIND_START(buffer, at + 1)
            at = match.start() if match else size
        self._counts["frames"] += len(frames)
        keep_from = size if ended else held
        if keep_from > decided:
            self._count_skipped(buffer, decided, keep_from, rejects, ended)
        self._pending = buffer[keep_from:]
        self._pending_counted = max(decided - keep_from, 0)
        return frames

    def _count_unusual(self, frame: Frame) -> None:
        """Counts a frame other than plain MAVLink 2."""
        counts = self._counts
        counts["frames_v1"] += frame.version == 1
        counts["frames_signed"] += frame.signed
        counts["frames_longer"] += len(frame.payload) > _KNOWN[frame.msg_id][1]

    def _count_skipped(
        self,
        buffer: bytes,
        start: int,
        stop: int,
        rejects: list[tuple[int, int]],
        ended: bool,
    ) -> None:
        """Counts the bytes from `start` to `stop`, which hold no frame, and each marker in them."""
        counts = self._counts
        counts["skipped_bytes"] += stop - start
        # The search skips three kinds of marker silently: all those missing from `rejects`.
        unknown_ids = len(_FIND_UNKNOWN_IDS.findall(buffer, start, stop + _ID_END_AT))
        counts["unknown_id"] += unknown_ids
        counts["unknown_flags"] += buffer.count(_MARKER_2, start, stop) - unknown_ids
        counts["bad_length"] += buffer.count(_MARKER_1, start, stop)
        incomplete = "truncated" if ended else "bad_crc"
        for at, verdict in rejects:
            if start <= at < stop and verdict != _NO_MARKER:
                counts[_silent_reason(buffer, at)] -= 1
                counts[_REASONS.get(verdict, incomplete)] += 1


def frame_at(data: bytes, at: int) -> Frame:
    """The good frame that begins at `at`."""
    found = _frame_at(data, at, len(data))
    assert isinstance(found, Frame)
    return found


def begins_with_frame(data: bytes) -> bool:
    """Whether a whole good frame begins at the first byte; costs at most one checksum."""
    return bool(data) and not isinstance(_frame_at(data, 0, len(data)), int)


def _is_plain(frame: Frame, size: int) -> bool:
    """Whether the frame is `size` bytes of MAVLink 2, none of which needs another look."""
    msg_id, _, _, _, payload, version, signed, raw = frame
    is_whole = len(raw) == size and raw[-1] < _MARKER_2
    return is_whole and version == 2 and not signed and len(payload) <= _KNOWN[msg_id][1]


def _silent_reason(buffer: bytes, at: int) -> str:
    """The reason under which a silently skipped marker is counted."""
    if buffer[at] == _MARKER_1:
        return "bad_length"
    return "unknown_id" if _FIND_UNKNOWN_IDS.match(buffer, at) else "unknown_flags"


def _frame_at(buffer: bytes, at: int, size: int) -> Frame | int:
    """The frame whose start marker is at `at`, or why there is none; `size` is len(buffer)."""
    if buffer[at] != _MARKER_2:
        return _frame_v1_at(buffer, at, size)
    if size - at < HEADER_2_SIZE + CHECKSUM_SIZE:
        return _incomplete_v2(buffer, at, size)
    length, flags, seq, sysid, compid, msg_id = _UNPACK_HEADER_2(buffer, at)
    if flags > SIGNED_FLAG:
        return _UNKNOWN_FLAGS
    known = _KNOWN.get(msg_id & 0xFFFFFF)
    if known is None:
        return _UNKNOWN_ID
    payload_at = at + HEADER_2_SIZE
    checksum_at = payload_at + length
    end = checksum_at + CHECKSUM_SIZE
    if end > size:
        return _AWAITED if known[3] and length <= known[1] else _INCOMPLETE
    checksum = _checksum(known[0], _checksum(buffer[at + 1 : checksum_at]))
    if checksum != buffer[checksum_at] | buffer[checksum_at + 1] << 8:
        return _BAD_CRC
    if flags:
        end += SIGNATURE_SIZE
        if end > size:
            return _AWAITED
    payload = buffer[payload_at:checksum_at]
    signed = flags == SIGNED_FLAG
    # A third of the cost of Frame(...).
    return _new(Frame, (msg_id & 0xFFFFFF, sysid, compid, seq, payload, 2, signed, buffer[at:end]))


def _incomplete_v2(buffer: bytes, at: int, size: int) -> int:
    """The verdict on a MAVLink 2 start marker with less than an empty frame after it."""
    if size - at > 2 and buffer[at + 2] > SIGNED_FLAG:
        return _UNKNOWN_FLAGS
    if size - at >= HEADER_2_SIZE:
        known = _KNOWN.get(int.from_bytes(buffer[at + 7 : at + 10], "little"))
        if known is None:
            return _UNKNOWN_ID
    return _INCOMPLETE


def _frame_v1_at(buffer: bytes, at: int, size: int) -> Frame | int:
    """The MAVLink 1 frame whose start marker is at `at`, or why there is none."""
    if buffer[at] != _MARKER_1:
        return _NO_MARKER
    if size - at < HEADER_1_SIZE:
        return _INCOMPLETE
    length, seq, sysid, compid, msg_id = _UNPACK_HEADER_1(buffer, at)
    known = _KNOWN.get(msg_id)
    if known is None:
        return _UNKNOWN_ID
    crc_extra, full_size, base_size, carries_bytes = known
    if not base_size <= length <= full_size:
        return _BAD_LENGTH
    payload_at = at + HEADER_1_SIZE
    checksum_at = payload_at + length
    end = checksum_at + CHECKSUM_SIZE
    if end > size:
        return _AWAITED if carries_bytes else _INCOMPLETE
    checksum = _checksum(crc_extra, _checksum(buffer[at + 1 : checksum_at]))
    if checksum != buffer[checksum_at] | buffer[checksum_at + 1] << 8:
        return _BAD_CRC
    payload = buffer[payload_at:checksum_at]
    return Frame(msg_id, sysid, compid, seq, payload, 1, False, buffer[at:end])
