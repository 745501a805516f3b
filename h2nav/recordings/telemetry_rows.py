"""Rows of recorded telemetry by message, like those of autopilots' own logs."""

from collections.abc import Iterable, Iterator, Mapping
from functools import cache

import numpy as np

from h2nav.recordings.columns import Format
from h2nav.recordings.frame_tables import FrameTable, fields_type
from h2nav.recordings.log_rows import MAX_INSTANCES, Rows
from h2nav.recordings.row_tables import Table
from h2nav.wire.dialect import LAYOUTS

_IDS = {layout.name: layout.msg_id for layout in LAYOUTS.values()}
# Messages with the number of an instance, and the messages of further instances.
NUMBER = {
    "BATTERY_STATUS": "id",
    "DISTANCE_SENSOR": "id",
    "HIGHRES_IMU": "id",
    "SERVO_OUTPUT_RAW": "port",
}
FURTHER = {"SCALED_PRESSURE": ("SCALED_PRESSURE2", "SCALED_PRESSURE3")}


def message_ids(names: Iterable[str]) -> frozenset[int]:
    """The ids of messages, and of those of their further instances."""
    return frozenset(_IDS[one] for name in names for one in (name, *FURTHER.get(name, ())))


class TelemetryRows:
    """The messages of one sender.

    Args:
        tables: message id -> its frames.
        start_ns: arrival of the first bytes of the recording.
    """

    format = Format.TELEMETRY

    def __init__(self, tables: Mapping[int, FrameTable], start_ns: int) -> None:
        self._tables = tables
        self._start_ns = start_ns

    def find(self, name: str, *columns: str) -> Rows | None:
        """All rows of a message; None if there are none with these columns."""
        message_id = _IDS[name]
        found = self._tables.get(message_id)
        if found is None or not len(found.t_ns):
            return None
        table = Table(name, found.t_ns, found.fields.view(_flat_type(message_id)))
        if not all(column in table for column in columns):
            return None
        t_s = np.asarray((found.t_ns - self._start_ns) * 1e-9)
        return Rows(0, table, found.t_ns // 1000, t_s)

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """Yields one per instance: of one message with numbers, or of messages with a number."""
        rows = self.find(name, *columns)
        if rows is not None and name in NUMBER:
            numbers = rows.table.integers(NUMBER[name])
            for value in np.unique(numbers)[:MAX_INSTANCES].tolist():
                yield rows.where(numbers == value)._replace(number=value)
        elif rows is not None:
            yield rows
        for number, further in enumerate(FURTHER.get(name, ()), 1):
            more = self.find(further, *columns)
            if more is not None:
                yield more._replace(number=number)


@cache
def _flat_type(message_id: int) -> "np.dtype[np.void]":
    """The fields with one column for each element of an array, such as ``q[0]``."""
    whole = fields_type(message_id)
    names, types, offsets = [], [], []
    for name in whole.names or ():
        kind, offset = whole.fields[name][:2]  # type: ignore[index]
        for number in range(kind.shape[0] if kind.shape else 1):
            names.append(f"{name}[{number}]" if kind.shape else name)
            types.append(kind.base)
            offsets.append(offset + number * kind.base.itemsize)
    return np.dtype(
        {"names": names, "formats": types, "offsets": offsets, "itemsize": whole.itemsize}
    )
