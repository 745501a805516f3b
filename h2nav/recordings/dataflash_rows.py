"""Rows of ArduPilot's dataflash logs by message and instance, with times that can be believed."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from h2nav.recordings.context import Array
from h2nav.recordings.imu_series import Mask, Times
from h2nav.recordings.log_clock import LogClock, in_order, is_running
from h2nav.recordings.row_tables import LogTables, Table
from h2nav.wire.imu import MOST_IMUS

MOST_INSTANCES = 8
# Columns that number the instances of a message.
NUMBER = ("I", "C", "Instance", "Inst", "IMU")


class Rows(NamedTuple):
    """Rows of one instance of a message whose times can be believed.

    Attributes:
        number: of the instance, from 0.
        table: the rows.
        t_us: (N,) their times, in order.
        t_s: (N,) since the log began.
    """

    number: int
    table: Table
    t_us: Times
    t_s: Array

    def where(self, wanted: Mask) -> "Rows":
        """Some of them."""
        return Rows(self.number, self.table.only(wanted), self.t_us[wanted], self.t_s[wanted])


class Log:
    """The tables with the log's clock.

    Args:
        tables: of the file.

    Attributes:
        clock: of the rows.
        notes: what was damaged or skipped: reason -> count.
    """

    def __init__(self, tables: LogTables) -> None:
        self._tables = tables
        self.notes = dict(tables.notes)
        self.clock = _clock(tables)

    @property
    def duration_s(self) -> float:
        """From the first time to the last."""
        return (self.clock.end_us - self.clock.start_us) * 1e-6

    def note(self, reason: str, count: int) -> None:
        """Something was skipped."""
        if count:
            self.notes[reason] = self.notes.get(reason, 0) + count

    def since_start(self, t_us: Times) -> Array:
        """Times of the autopilot as seconds since the log began."""
        t_s: Array = np.asarray((t_us - self.clock.start_us) * 1e-6)
        return t_s

    def find(self, name: str, *columns: str) -> Rows | None:
        """All rows of a message; None where there are none with these columns."""
        table = self._tables.find(name, *columns)
        times = None if table is None else _times(table)
        return None if table is None or times is None else self._believed(table, times)

    def told(self, name: str, *columns: str, begins: bool = False) -> Rows | None:
        """Like `find`, of what is told now and then, which until 2015 had no time.

        Rows without one are as old as those before them in the file; where they `begins` something,
        as those after them, because an autopilot may have logged nothing until then.
        """
        table = self._tables.find(name, *columns)
        if table is None:
            return None
        times = _times(table)
        if times is None:
            times = (self.clock.after if begins else self.clock.at)(table.places)
        return self._believed(table, times)

    def _believed(self, table: Table, times: Times) -> Rows | None:
        name = table.name
        good = self.clock.believes(table.places, times)
        good[good] = in_order(times[good])
        self.note(f"rows of {name} far from the times around them", int((~good).sum()))
        if not good.any():
            return None
        if not good.all():
            table, times = table.only(good), times[good]
        times = times.clip(self.clock.start_us, self.clock.end_us)
        return Rows(0, table, times, self.since_start(times))

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """One per instance: of one message with their numbers, or of messages with a number."""
        rows = self.find(name, *columns)
        if rows is None:
            return
        number = next((column for column in NUMBER if column in rows.table), None)
        if number is not None:
            numbers = rows.table.integers(number)
            for value in range(MOST_INSTANCES):
                if (numbers == value).any():
                    yield rows.where(numbers == value)._replace(number=value)
            return
        yield rows
        for count in range(2, MOST_IMUS + 1):
            more = self.find(f"{name}{count}", *columns)
            if more is not None:
                yield more._replace(number=count - 1)


def _clock(tables: LogTables) -> LogClock:
    """By the message of which there are most rows that have a time."""
    for name in sorted(tables.names, key=lambda name: (-tables.rows(name), name)):
        table = tables.find(name)
        times = None if table is None else _times(table)
        if table is not None and times is not None and is_running(times):
            return LogClock(table.places, times)
    return LogClock(np.empty(0, np.int64), np.empty(0, np.int64))


def _times(table: Table) -> Times | None:
    """Microseconds since boot; None where the rows do not tell them."""
    if "TimeUS" in table:
        return table.integers("TimeUS")
    if table.name.startswith("GPS"):  # its TimeMS is that of the week
        return table.integers("T") * 1000 if "T" in table else None
    return table.integers("TimeMS") * 1000 if "TimeMS" in table else None
