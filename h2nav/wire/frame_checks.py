"""The rules of `h2nav.wire.deframer` applied to many places at once."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from fastcrc import crc16
from numpy.typing import NDArray

from h2nav.wire.arrivals import Integers
from h2nav.wire.byte_views import MARKER_1, MARKER_2, values_at
from h2nav.wire.deframer import (
    CHECKSUM_SIZE,
    HEADER_1_SIZE,
    HEADER_2_SIZE,
    SIGNATURE_SIZE,
    SIGNED_FLAG,
)
from h2nav.wire.dialect import LAYOUTS

SHORTEST_2 = HEADER_2_SIZE + CHECKSUM_SIZE
"""Bytes of an empty frame of MAVLink 2."""
_SHORTEST_1 = HEADER_1_SIZE + CHECKSUM_SIZE
# Checksums are computed for this many frames of one size at a time, which fit into a near cache.
_TOGETHER = 4096
_IDS = max(LAYOUTS) + 2  # the last one stands for all larger, unknown ids

_KNOWN = np.zeros(_IDS, dtype=bool)
_EXTRA = np.zeros(_IDS, dtype=np.uint8)
_BASE_SIZE = np.zeros(_IDS, dtype=np.int64)
_FULL_SIZE = np.zeros(_IDS, dtype=np.int64)
for _layout in LAYOUTS.values():
    _KNOWN[_layout.msg_id] = True
    _EXTRA[_layout.msg_id] = _layout.crc_extra
    _BASE_SIZE[_layout.msg_id] = _layout.base_size
    _FULL_SIZE[_layout.msg_id] = _layout.size

_BYTES = [bytes([value]) for value in range(256)]
# The checksum after one more byte is `state >> 8 ^ _BYTE_STEP[(state ^ byte) & 0xFF]`, after two
# more, as a little-endian number, `_PAIR_STEP[state ^ pair]`.
_BYTE_STEP = np.array([crc16.mcrf4xx(byte, 0) for byte in _BYTES], dtype=np.uint16)
_PAIR = np.arange(1 << 16, dtype=np.uint16)
_FIRST_STEP = _PAIR >> 8 ^ _BYTE_STEP[_PAIR & 0xFF]
_PAIR_STEP = _FIRST_STEP >> 8 ^ _BYTE_STEP[_FIRST_STEP & 0xFF]
# The checksum begins after the start marker with 0xFFFF; this is its value before the marker.
_BEFORE = {
    marker: int(np.argmax((_PAIR >> 8 ^ _BYTE_STEP[(_PAIR ^ marker) & 0xFF]) == 0xFFFF))
    for marker in (MARKER_1, MARKER_2)
}


class Headers(NamedTuple):
    """The contents of the headers at many places."""

    at: Integers  # (N,) where they begin
    ends: Integers  # (N,) where the frames end
    is_v2: NDArray[np.bool_]  # (N,) MAVLink 2, else 1
    signed: NDArray[np.bool_]  # (N,) a signature ends the frame
    msg_ids: Integers  # (N,) message id
    lengths: Integers  # (N,) bytes of the payload

    def those(self, chosen: NDArray[np.bool_] | Integers) -> "Headers":
        """A selection of them."""
        return Headers(
            self.at[chosen],
            self.ends[chosen],
            self.is_v2[chosen],
            self.signed[chosen],
            self.msg_ids[chosen],
            self.lengths[chosen],
        )

    @property
    def are_longer(self) -> NDArray[np.bool_]:
        """(N,) longer than the dialect defines."""
        return self.lengths > _FULL_SIZE[self.msg_ids]

    @property
    def payload_at(self) -> Integers:
        """(N,) where the payloads begin."""
        return self.at + np.where(self.is_v2, HEADER_2_SIZE, HEADER_1_SIZE)


def headers_at(data: bytes, at: Integers) -> Headers:
    """Reads headers.

    Args:
        at: (N,) places.

    Returns:
        The headers with a known id, known flags, a possible length, and room for the frame.
    """
    at = at[at <= len(data) - SHORTEST_2]
    octets = np.frombuffer(data, dtype=np.uint8)
    marker, lengths, flags = octets[at], octets[at + 1].astype(np.int64), octets[at + 2]
    is_v2 = marker == MARKER_2
    ids_2 = values_at(data, at + HEADER_2_SIZE - 4, "<u4").astype(np.int64) >> 8
    msg_ids = np.minimum(np.where(is_v2, ids_2, octets[at + HEADER_1_SIZE - 1]), _IDS - 1)
    signed = is_v2 & (flags == SIGNED_FLAG)
    ends = at + np.where(is_v2, SHORTEST_2 + SIGNATURE_SIZE * signed, _SHORTEST_1) + lengths
    fits_1 = (marker == MARKER_1) & (_BASE_SIZE[msg_ids] <= lengths)
    fits_1 &= lengths <= _FULL_SIZE[msg_ids]
    fits = np.where(is_v2, flags <= SIGNED_FLAG, fits_1) & _KNOWN[msg_ids] & (ends <= len(data))
    return Headers(at, ends, is_v2, signed, msg_ids, lengths).those(fits)


def have_right_checksums(data: bytes, headers: Headers) -> NDArray[np.bool_]:
    """(N,) whether the checksum of each frame matches."""
    right = np.zeros(len(headers.at), dtype=bool)
    covered = headers.payload_at + headers.lengths - headers.at
    order = np.argsort(covered, kind="stable")
    edges = [0, *(np.flatnonzero(np.diff(covered[order])) + 1).tolist(), len(order)]
    for start, stop in pairwise(edges):
        for first in range(start, stop, _TOGETHER):
            rows = order[first : min(first + _TOGETHER, stop)]
            right[rows] = _of_one_size(data, int(covered[rows[0]]), headers.those(rows))
    return right


def _of_one_size(data: bytes, covered: int, headers: Headers) -> NDArray[np.bool_]:
    """The same for frames with `covered` bytes before their checksum."""
    whole = values_at(data, headers.at, f"V{covered + CHECKSUM_SIZE}").view(np.uint8)
    whole = whole.reshape(len(headers.at), covered + CHECKSUM_SIZE)
    pairs = np.ascontiguousarray(whole[:, : covered - covered % 2]).view("<u2").T
    state = np.where(headers.is_v2, _BEFORE[MARKER_2], _BEFORE[MARKER_1]).astype(np.uint16)
    for pair in np.ascontiguousarray(pairs):
        state = _PAIR_STEP[state ^ pair]
    rest = [whole[:, covered - 1]] * (covered % 2)
    for octet in (*rest, _EXTRA[headers.msg_ids]):
        state = state >> 8 ^ _BYTE_STEP[(state ^ octet) & 0xFF]
    right: NDArray[np.bool_] = state == (whole[:, -2] | whole[:, -1].astype(np.uint16) << 8)
    return right


def is_plain_end(data: bytes, ends: Integers, followers: Integers) -> NDArray[np.bool_]:
    """(N,) whether the last byte of a frame cannot be taken for another start marker.

    Args:
        ends: (N,) where good frames end.
        followers: (N,) where the next good frames begin, whose bytes follow in the stream.
    """
    octets = np.frombuffer(data, dtype=np.uint8)
    last = octets[ends - 1]
    # With the next frame as its header, a MAVLink 2 marker has unknown flags ...
    plain: NDArray[np.bool_] = (last != MARKER_2) | (octets[followers + 1] > SIGNED_FLAG)
    # ... and a MAVLink 1 marker a length that no message of its id has.
    length, msg_id = octets[followers], octets[followers + HEADER_1_SIZE - 2]
    possible = _KNOWN[msg_id] & (_BASE_SIZE[msg_id] <= length) & (length <= _FULL_SIZE[msg_id])
    plain &= (last != MARKER_1) | ~possible
    return plain
