"""All frames of some messages of a recording as columns."""

from collections.abc import Collection
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.io.deframer import Deframer
from h2nav.io.dialect import LAYOUTS, MessageLayout
from h2nav.io.recordings import Recording

_TYPES = {
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
    """The frames of one message, in the order in which they came.

    Attributes:
        t_ns: (N,) times of arrival.
        sysid: (N,) senders' system ids.
        compid: (N,) senders' component ids.
        fields: (N,) records of the dialect's fields under their names.
    """

    t_ns: NDArray[np.int64]
    sysid: NDArray[np.uint8]
    compid: NDArray[np.uint8]
    fields: NDArray[Any]

    def where(self, mask: NDArray[np.bool_]) -> "FrameTable":
        """The frames of which it is true."""
        return FrameTable(self.t_ns[mask], self.sysid[mask], self.compid[mask], self.fields[mask])


def tables(recording: Recording, ids: Collection[int]) -> dict[int, FrameTable]:
    """Message id -> its frames.

    Args:
        recording: to read.
        ids: of the messages that are wanted.
    """
    deframer = Deframer()
    rows: dict[int, list[tuple[int, int, int]]] = {msg_id: [] for msg_id in ids}
    payloads: dict[int, list[bytes]] = {msg_id: [] for msg_id in ids}
    for t_ns, data in recording.received():
        for frame in deframer.feed(data):
            if frame.msg_id in rows:
                rows[frame.msg_id].append((t_ns, frame.sysid, frame.compid))
                payloads[frame.msg_id].append(frame.payload)
    return {msg_id: _table(LAYOUTS[msg_id], rows[msg_id], payloads[msg_id]) for msg_id in ids}


def _table(
    layout: MessageLayout, rows: list[tuple[int, int, int]], payloads: list[bytes]
) -> FrameTable:
    dtype = _dtype(layout)
    size = dtype.itemsize
    whole = b"".join(payload[:size].ljust(size, b"\0") for payload in payloads)
    columns = np.array(rows, dtype=np.int64).reshape(-1, 3)
    return FrameTable(
        columns[:, 0],
        columns[:, 1].astype(np.uint8),
        columns[:, 2].astype(np.uint8),
        np.frombuffer(whole, dtype=dtype),
    )


def _dtype(layout: MessageLayout) -> np.dtype[Any]:
    fields: list[Any] = []
    for field in layout.wire_fields:
        if field.type_name == "char":
            fields.append((field.name, f"S{max(field.length, 1)}"))
        elif field.length:
            fields.append((field.name, _TYPES[field.type_name], (field.length,)))
        else:
            fields.append((field.name, _TYPES[field.type_name]))
    return np.dtype(fields)
