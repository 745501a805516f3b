"""Rows of one kind in an autopilot's own log, as columns."""

from collections.abc import Callable, Mapping
from mmap import mmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Table:
    """All rows of one message; columns are extracted from the file on demand.

    Args:
        places: (N,) position of each row in the file, bytes.
        rows: (M,) structured, one field per column, as stored; never copied.
        divisors: of the columns stored as multiples of a fraction.
        wanted: (N,) numbers of the selected `rows`; None = all of them.
    """

    def __init__(
        self,
        name: str,
        places: NDArray[np.int64],
        rows: NDArray[np.void],
        divisors: Mapping[str, float] | None = None,
        wanted: NDArray[np.int64] | None = None,
    ) -> None:
        self.name = name  # of the message
        self.places = places  # (N,) bytes
        self._rows = rows
        self._divisors = divisors or {}
        self._wanted: NDArray[np.int64] | slice = slice(None) if wanted is None else wanted
        self.columns: tuple[str, ...] = rows.dtype.names or ()  # names, in order

    def __len__(self) -> int:
        return len(self.places)

    def __contains__(self, column: str) -> bool:
        """Whether it has the column, with one value in each row."""
        return column in self.columns and not self._rows.dtype[column].shape

    @property
    def divisors(self) -> Mapping[str, float]:
        """Of the columns stored as multiples of a fraction."""
        return self._divisors

    def stored_rows(self) -> NDArray[np.void]:
        """(N,) structured, as stored."""
        stored: NDArray[np.void] = self._rows[self._wanted]
        return stored

    def only(self, wanted: NDArray[np.bool_]) -> "Table":
        """The selected rows."""
        numbers = self._wanted
        numbers = np.flatnonzero(wanted) if isinstance(numbers, slice) else numbers[wanted]
        return Table(self.name, self.places[wanted], self._rows, self._divisors, numbers)

    def kind(self, column: str) -> str:
        """The storage type of a column, in numpy's letters: ``f``, ``i``, ``u`` or ``S``."""
        return str(self._rows.dtype[column].base.kind)

    def is_scaled(self, column: str) -> bool:
        """Whether the column is stored as multiples of a fraction."""
        return column in self._divisors

    def numbers(self, *columns: str) -> Array:
        """Values in the units of the log: (N,) of one column, (N, k) of several."""
        if len(columns) == 1:
            return self._numbers(columns[0])
        first = self._numbers(columns[0])
        values = np.empty((len(first), len(columns)))
        values[:, 0] = first
        for number, column in enumerate(columns[1:], 1):
            values[:, number] = self._numbers(column)
        return values

    def numbers_or_nan(self, *columns: str) -> Array:
        """Like `numbers`; NaN for columns that are absent."""
        nothing = np.full(len(self), np.nan)
        found = [self._numbers(name) if name in self else nothing for name in columns]
        return found[0] if len(found) == 1 else np.stack(found, axis=1)

    def integers(self, column: str) -> NDArray[np.int64]:
        """(N,) of a column of integers, as stored; clamped to int64."""
        stored: NDArray[Any] = self._stored_numbers(column)
        if stored.dtype.kind == "f":
            stored = np.nan_to_num(stored, nan=0.0, posinf=0.0, neginf=0.0)
            return stored.clip(-(2.0**62), 2.0**62).astype(np.int64)
        if stored.dtype == np.uint64:
            stored = np.minimum(stored, np.uint64(2**63 - 1))
        return stored.astype(np.int64)

    def texts(self, column: str) -> list[str]:
        """(N,) of a column of characters, up to the first zero; replaces invalid UTF-8."""
        return [word.decode("utf-8", "replace") for word in self.words(column)]

    def words(self, column: str) -> list[bytes]:
        """(N,) of a column of characters, up to the first zero; empty of any other column."""
        if self.kind(column) not in "SO":
            return [b""] * len(self)
        return [word.split(b"\0", 1)[0] for word in self._stored(column).tolist()]

    def _numbers(self, column: str) -> Array:
        with np.errstate(invalid="ignore"):  # damage may hold any kind of NaN
            values = self._stored_numbers(column).astype(np.float64)
        divisor = self._divisors.get(column)
        return values if divisor is None else values / divisor

    def _stored_numbers(self, column: str) -> NDArray[Any]:
        """NaN of a column that a damaged definition calls characters."""
        return np.full(len(self), np.nan) if self.kind(column) == "S" else self._stored(column)

    def _stored(self, column: str) -> NDArray[Any]:
        stored: NDArray[Any] = self._rows[column][self._wanted]
        return stored


def rows_of(data: bytes | mmap, row: np.dtype[np.void]) -> NDArray[np.void]:
    """The rows that might begin at each byte of the data: a view with overlapping rows."""
    return np.ndarray((max(len(data) - row.itemsize + 1, 0),), row, data, strides=(1,))


class RowSource(NamedTuple):
    """The location of the rows of one message in a file."""

    data: bytes | mmap  # of the file
    places: NDArray[np.int64]  # (N,) of the rows, bytes from its beginning
    row: Callable[[], np.dtype[np.void] | None]  # returns the type of a row, None if it is invalid
    divisors: dict[str, float]  # of the columns stored as multiples of a fraction

    def table(self, name: str) -> Table | None:
        """The rows as a table."""
        row = self.row()
        if row is None:
            return None
        return Table(name, self.places, rows_of(self.data, row), self.divisors, self.places)


class LogTables:
    """The messages of a log by name; tables are created on demand.

    Args:
        sources: of the messages present; tables if they had to be created at once.
        notes: what was damaged or skipped: reason -> count.
        preamble: lines of text before the first definition.
    """

    def __init__(
        self,
        sources: Mapping[str, RowSource | Table],
        notes: dict[str, int],
        preamble: tuple[str, ...] = (),
    ) -> None:
        self._sources = sources
        self._tables: dict[str, Table | None] = {}
        self.names = frozenset(sources)  # of the messages present
        self.notes = notes  # reason -> count
        self.preamble = preamble  # lines of text before the first definition

    def find(self, name: str, *columns: str) -> Table | None:
        """The table of a message; None if it is absent or lacks one of the columns."""
        if name not in self._tables:
            source = self._sources.get(name)
            self._tables[name] = source.table(name) if isinstance(source, RowSource) else source
        table = self._tables[name]
        if table is None or not all(column in table for column in columns):
            return None
        return table

    def rows(self, name: str) -> int:
        """Number of rows of a message."""
        source = self._sources.get(name)
        return 0 if source is None else len(source.places)
