"""Rows of ArduPilot's dataflash logs by message; instances have been encoded in two ways."""

from collections.abc import Iterator

import numpy as np

from h2nav.recordings.columns import Format
from h2nav.recordings.imu_series import Times
from h2nav.recordings.log_clock import LogClock, is_running
from h2nav.recordings.log_rows import MAX_INSTANCES, Log, Rows
from h2nav.recordings.row_tables import Table
from h2nav.wire.imu import MAX_IMUS

# Columns with the number of an instance.
NUMBER = ("I", "C", "Instance", "Inst", "IMU")


# What tells the time where no row has one since boot: message, column, unit in us, whether it is
# the time since the row before. ArduCopter's main loop ran 100 times a second.
SUBSTITUTES = (
    ("GPS", "TimeMS", 1_000, False),
    ("GPS", "Time", 1_000, False),
    ("PM", "LTime", 1_000, True),
    ("PM", "NLoop", 10_000, True),
)
# They come now and then, and until 2015 had no time.
OCCASIONAL = frozenset({"ARM", "ERR", "EV", "MODE", "MSG", "PARM", "VER"})
MAX_INTERVAL, MAX_TIME = 1_000_000, 1 << 32


class DataflashRows(Log):
    """The messages of a dataflash log."""

    format = Format.DATAFLASH
    is_timed: bool  # whether most rows have a time of their own

    @staticmethod
    def times_of(table: Table) -> Times | None:
        """(N,) microseconds since boot; None if the rows have no times."""
        column, unit_us = _time_column(table)
        return table.integers(column) * unit_us if column else None

    def _clock(self) -> LogClock:
        """That of the rows; until 2014 only GPS rows had a time, if any."""
        clock = super()._clock()
        if not clock.end_us:
            clock = self._substitute()
        named = (self.tables.find(name) for name in self.tables.names)
        tables = [table for table in named if table is not None and len(table)]
        untimed = [table for table in tables if not _time_column(table)[0]]
        self.is_timed = 2 * sum(map(len, untimed)) < sum(map(len, tables))
        if self.is_timed or clock.end_us == clock.start_us:
            return clock
        ends = [int(table.places[place]) for table in tables for place in (0, -1)]
        return clock.extended(min(ends), max(ends))

    def _substitute(self) -> LogClock:
        """The clock of a log without times since boot."""
        for name, column, unit_us, is_interval in SUBSTITUTES:
            table = self.tables.find(name, column)
            if table is None:
                continue
            times = table.integers(column).clip(0, MAX_INTERVAL if is_interval else MAX_TIME)
            times = times.cumsum() if is_interval else times
            times, places = times[times > 0] * unit_us, table.places[times > 0]
            if len(times) > 1 and is_running(times):
                return LogClock(places, times)
        return LogClock(np.empty(0, np.int64), np.empty(0, np.int64))

    def find(self, name: str, *columns: str) -> Rows | None:
        """All rows of a message; None if there are none with these columns.

        Rows without a time get that of their place in the file; those of `OCCASIONAL` that of the
        row before them.
        """
        table = self.tables.find(name, *columns)
        return None if table is None else self.kept(name, table, self._times_or_places)

    def _times_or_places(self, table: Table) -> Times:
        times = self.times_of(table)
        if times is not None:
            return times
        return (self.clock.at if table.name in OCCASIONAL else self.clock.between)(table.places)

    def beginnings(self, name: str, *columns: str) -> Rows | None:
        """Like `find`, for rows of `OCCASIONAL` that begin something.

        Rows without a time get that of the row after them in the file, because the autopilot may
        have logged nothing until then.
        """
        table = self.tables.find(name, *columns)
        if table is None or self.times_of(table) is not None:
            return self.find(name, *columns)
        return self.believed(name, table, self.clock.after(table.places))

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """Yields one per instance: of one message with numbers, or of messages with a number."""
        rows = self.find(name, *columns)
        if rows is None:
            return
        number = next((column for column in NUMBER if column in rows.table), None)
        if number is not None:
            numbers = rows.table.integers(number)
            for value in range(MAX_INSTANCES):
                if (numbers == value).any():
                    yield rows.where(numbers == value)._replace(number=value)
            return
        yield rows
        for count in range(2, MAX_IMUS + 1):
            more = self.find(f"{name}{count}", *columns)
            if more is not None:
                yield more._replace(number=count - 1)


def _time_column(table: Table) -> tuple[str, int]:
    """The column with the time since boot, and its unit in microseconds; empty if there is none."""
    if "TimeUS" in table:
        return "TimeUS", 1
    # The TimeMS of GPS is that of the week.
    name = "T" if table.name.startswith("GPS") else "TimeMS"
    return (name, 1000) if name in table else ("", 0)
