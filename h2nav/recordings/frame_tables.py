"""All frames of a message id of a recording at once: their fields as one structured array.

For the analysis of whole flights; `h2nav.wire.codec` decodes single messages.
"""

from collections.abc import Collection
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.link_recording import Recording
from h2nav.wire.arrivals import Integers
from h2nav.wire.byte_views import values_at
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.frame_scan import FoundFrames, FrameScan

_TYPES = {
    "char": "S1",
    "uint8_t": "u1",
    "int8_t": "i1",
    "uint16_t": "<u2",
    "int16_t": "<i2",
    "uint32_t": "<u4",
    "int32_t": "<i4",
    "uint64_t": "<u8",
    "int64_t": "<i8",
    "float": "<f4",
    "double": "<f8",
}


class FrameTable(NamedTuple):
    """The good frames of one message id, in order of arrival."""

    # (N,) time of arrival on the clock of `Recording.received`, never decreasing
    t_ns: NDArray[np.int64]
    senders: NDArray[np.uint8]  # (N, 2) system and component id
    # (N,) structured, see `fields_type`: `fields["xacc"]` is a column in the units of the
    # dialect. Truncated zeros of MAVLink 2 are restored; missing extension fields are zero.
    fields: NDArray[Any]


@cache
def fields_type(msg_id: int) -> "np.dtype[np.void]":
    """The fields of a message under the dialect's names, in the order of the wire, packed.

    Arrays are subarrays; texts are bytes (``S50``) that end at their first NUL.
    """
    columns: list[tuple[str, str, tuple[int, ...]]] = []
    for field in LAYOUTS[msg_id].wire_fields:
        if field.type_name == "char":
            columns.append((field.name, f"S{max(field.length, 1)}", ()))
        else:
            columns.append(
                (field.name, _TYPES[field.type_name], (field.length,) * bool(field.length))
            )
    return np.dtype(columns)


class TableMaker:
    """Collects the frames of some ids while a recording is read.

    Args:
        ids: of messages of the dialect.
    """

    def __init__(self, ids: Collection[int]) -> None:
        self._parts: dict[int, list[FrameTable]] = {msg_id: [] for msg_id in ids}

    def add(self, found: FoundFrames) -> None:
        """Adds the next frames."""
        senders = found.senders()
        for msg_id, parts in self._parts.items():
            rows = np.flatnonzero(found.headers.msg_ids == msg_id)
            if len(rows):
                parts.append(
                    FrameTable(
                        found.t_ns[found.arrivals[rows]],
                        np.stack((senders[rows] >> 8, senders[rows] & 0xFF), 1).astype(np.uint8),
                        fields_of(found, msg_id, rows),
                    )
                )

    def tables(self) -> dict[int, FrameTable]:
        """One table per id, empty if none came."""
        return {msg_id: _joined(msg_id, parts) for msg_id, parts in self._parts.items()}


def tables(recording: Recording, ids: Collection[int]) -> dict[int, FrameTable]:
    """Reads a recording front to back.

    Args:
        recording: any; its `notes` and `progress` reflect this pass afterwards.
        ids: of messages of the dialect.

    Returns:
        One table per id of `ids`, empty if none came.
    """
    maker = TableMaker(ids)
    scan = FrameScan()
    for arrivals in recording.batches():
        maker.add(scan.frames_of(arrivals))
    return maker.tables()


def fields_of(found: FoundFrames, msg_id: int, rows: Integers) -> NDArray[Any]:
    """(N,) the fields of some frames of one message, see `fields_type`.

    Payloads get back the zeros that MAVLink 2 truncated, and lose bytes unknown to the dialect.
    """
    size = LAYOUTS[msg_id].size
    at, lengths = found.headers.payload_at[rows], found.headers.lengths[rows]
    # The bytes after the last frame of the buffer do not matter.
    payloads = values_at(found.data + bytes(size), at, f"V{size}").view(np.uint8)
    payloads = payloads.reshape(len(rows), size)
    payloads[np.arange(size) >= lengths[:, np.newaxis]] = 0
    return payloads.reshape(-1).view(fields_type(msg_id))


def _joined(msg_id: int, parts: list[FrameTable]) -> FrameTable:
    nothing = FrameTable(
        np.empty(0, dtype=np.int64),
        np.empty((0, 2), dtype=np.uint8),
        np.empty(0, dtype=fields_type(msg_id)),
    )
    t_ns, senders, fields = zip(nothing, *parts, strict=True)
    return FrameTable(*map(np.concatenate, (t_ns, senders, fields)))
