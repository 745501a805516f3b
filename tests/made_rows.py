"""Messages of a log as columns of numbers, without a file around them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from h2nav.recordings.columns import Format
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.row_tables import LogTables, Table

PERIOD_US = 100_000


def table(columns: Mapping[str, Any], name: str = "X") -> Table:
    """A table of numpy's types; a single value holds in every row."""
    arrays = {column: np.asarray(values) for column, values in columns.items()}
    count = max((len(values) for values in arrays.values() if values.ndim), default=1)
    row = [(column, values.dtype, values.shape[1:]) for column, values in arrays.items()]
    rows = np.zeros(count, row)
    for column, values in arrays.items():
        rows[column] = values
    return Table(name, np.arange(count), rows)


def log_tables(time_column: str, **messages: Mapping[str, Any]) -> LogTables:
    """Tables of a file in which all rows lie in the order of their times, us."""
    tables = {}
    for name, columns in messages.items():
        rows = table(columns, name).stored_rows()
        places = rows[time_column].astype(np.int64)
        tables[name] = Table(name, places, rows)
    return LogTables(tables, {})


class MadeMessage(NamedTuple):
    """One instance of a message."""

    name: str
    columns: Mapping[str, Any]
    number: int = 0


class MadeLog:
    """Messages in one of the formats, a row every tenth of a second from 1 s after boot."""

    def __init__(self, kind: str, *messages: MadeMessage) -> None:
        self.format = Format(kind)
        self._messages = messages

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """Those of a message that have the columns."""
        for message in self._messages:
            if message.name == name and set(columns) <= set(message.columns):
                found = table(message.columns, name)
                t_us = 1_000_000 + PERIOD_US * np.arange(len(found))
                yield Rows(message.number, found, t_us, (t_us - 1_000_000) * 1e-6)
