"""All frames of a message id of a recording at once: their fields as one structured array.

For whoever looks at a whole flight. One message at a time is decoded by `h2nav.io.codec`.
"""

from collections.abc import Collection
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.io.deframer import Deframer
from h2nav.io.dialect import LAYOUTS
from h2nav.io.recordings import Recording

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
    """The good frames of one message id, in the order in which they came.

    Attributes:
        t_ns: (N,) time of arrival on the clock of `Recording.received`, never decreasing.
        senders: (N, 2) system and component id.
        fields: (N,) structured, see `fields_type`: `fields["xacc"]` is a column in the units of the
            dialect. What MAVLink 2 cut off, and extension fields that were not sent, are zero.
    """

    t_ns: NDArray[np.int64]
    senders: NDArray[np.uint8]
    fields: NDArray[Any]


@cache
def fields_type(msg_id: int) -> "np.dtype[np.void]":
    """The fields of a message under the dialect's names, in the order of the wire, packed.

    Arrays are subarrays; texts are bytes (``S50``), whose end is their first NUL.
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


def tables(recording: Recording, ids: Collection[int]) -> dict[int, FrameTable]:
    """Reads a recording front to back.

    Args:
        recording: any; its `notes` and `progress` are those of this pass afterwards.
        ids: of messages of the dialect.

    Returns:
        One table per id of `ids`, without rows where none came.
    """
    wanted = frozenset(ids)
    found: dict[int, list[tuple[int, int, int, bytes]]] = {msg_id: [] for msg_id in wanted}
    deframer = Deframer()
    for t_ns, data in recording.received():
        for frame in deframer.feed(data):
            if frame.msg_id in wanted:
                row = t_ns, frame.sysid, frame.compid, frame.payload
                found[frame.msg_id].append(row)
    return {msg_id: _table(msg_id, rows) for msg_id, rows in found.items()}


def _table(msg_id: int, rows: list[tuple[int, int, int, bytes]]) -> FrameTable:
    size = LAYOUTS[msg_id].size
    payloads = b"".join(payload[:size].ljust(size, b"\0") for _, _, _, payload in rows)
    return FrameTable(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1:3] for row in rows], dtype=np.uint8).reshape(-1, 2),
        np.frombuffer(payloads, dtype=fields_type(msg_id)),
    )
