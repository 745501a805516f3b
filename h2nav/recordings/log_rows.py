"""Rows of an autopilot's own log by name and instance, with plausible times."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from typing import NamedTuple

import numpy as np

from h2nav.recordings.context import Array, Series, Span
from h2nav.recordings.imu_series import Mask, Times
from h2nav.recordings.log_clock import LogClock, in_order, is_running
from h2nav.recordings.row_tables import LogTables, Table
from h2nav.recordings.spans import MIN_SILENCE_S, silences, spans

MAX_INSTANCES = 8
FIX_AGE_US = 1_000_000


class Rows(NamedTuple):
    """Rows of one instance of a message or topic, with plausible times."""

    number: int  # of the instance, from 0
    table: Table  # the rows
    t_us: Times  # (N,) when they were written, in order
    t_s: Array  # (N,) since the log began

    def where(self, wanted: Mask) -> "Rows":
        """The selected rows."""
        return Rows(self.number, self.table.only(wanted), self.t_us[wanted], self.t_s[wanted])

    def series(self, *columns: str, largest: float = np.inf) -> Series:
        """Columns over time, where they are finite and not larger than a bound."""
        return Series.finite(self.t_s, self.table.numbers(*columns), largest)

    @property
    def sample_us(self) -> Times:
        """(N,) times of measurement if known, never after the times of writing."""
        if "timestamp_sample" not in self.table:
            return self.t_us
        stamps = self.table.integers("timestamp_sample")
        age_us = self.t_us - stamps
        is_age = (age_us >= 0) & (age_us <= FIX_AGE_US)
        return np.where(is_age, stamps, self.t_us)

    @property
    def sample_s(self) -> Array:
        """(N,) the same since the log began."""
        return np.asarray(np.maximum(self.t_s - (self.t_us - self.sample_us) * 1e-6, 0.0))


class Log(ABC):
    """The tables of a file with the clock of its rows; each format has a subclass."""

    def __init__(self, tables: LogTables) -> None:
        self.tables = tables
        self.preamble = tables.preamble  # lines of text before the first definition
        self.notes = dict(tables.notes)  # what was damaged or skipped: reason -> count
        self.clock = self._clock()  # of the name with most rows that have a time
        self._kept: dict[str, Rows | None] = {}

    @staticmethod
    @abstractmethod
    def times_of(table: Table) -> Times | None:
        """(N,) microseconds since boot; None if the rows have no times."""

    @abstractmethod
    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """The rows of each instance of a message or topic that has these columns."""

    @property
    def duration_s(self) -> float:
        """From the first time to the last."""
        return (self.clock.end_us - self.clock.start_us) * 1e-6

    def since_start(self, t_us: Times) -> Array:
        """Times of the autopilot as seconds since the log began."""
        return np.asarray((t_us - self.clock.start_us) * 1e-6)

    def spans(self, rows: Rows, names: Iterable[str]) -> tuple[Span, ...]:
        """Spans of equal names, one name a row; the last one ends with the log."""
        return spans(rows.t_s.tolist(), names, self.duration_s)

    def note(self, reason: str, count: int) -> None:
        """Counts something that was skipped."""
        if count:
            self.notes[reason] = self.notes.get(reason, 0) + count

    def silences(self) -> tuple[Span, ...]:
        """While no row of any kind was written."""
        if self.clock.longest_pause_s <= MIN_SILENCE_S:
            return ()
        named = (self.tables.find(name) for name in self.tables.names)
        times = (self._times(table) for table in named if table is not None)
        t_us = [one for one in times if one is not None]
        if not t_us:
            return ()
        every_us = np.sort(np.concatenate(t_us), kind="stable").clip(
            self.clock.start_us, self.clock.end_us
        )
        return silences(self.since_start(every_us))

    def _times(self, table: Table) -> Times | None:
        """Times of rows as far as they are believed."""
        times = self.times_of(table)
        return None if times is None else times[self.clock.believes(table.places, times)]

    def kept(
        self, name: str, table: Table, times_of: Callable[[Table], Times], number: int = 0
    ) -> Rows | None:
        """The same as `believed` of a whole table, looked at once."""
        if table.name not in self._kept:
            self._kept[table.name] = self.believed(name, table, times_of(table), number)
        return self._kept[table.name]

    def believed(self, name: str, table: Table, times: Times, number: int = 0) -> Rows | None:
        """The rows with times like those around them in the file; None if there are none.

        Args:
            name: for the notes.
        """
        good = self.clock.believes(table.places, times)
        good[good] = in_order(times[good])
        self.note(f"rows of {name} far from the times around them", int((~good).sum()))
        if not good.any():
            return None
        if not good.all():
            table, times = table.only(good), times[good]
        times = times.clip(self.clock.start_us, self.clock.end_us)
        return Rows(number, table, times, self.since_start(times))

    def _clock(self) -> LogClock:
        tables = self.tables
        for name in sorted(tables.names, key=lambda name: (-tables.rows(name), name)):
            table = tables.find(name)
            times = None if table is None else self.times_of(table)
            if table is not None and times is not None and is_running(times):
                return LogClock(table.places, times)
        return LogClock(np.empty(0, np.int64), np.empty(0, np.int64))
