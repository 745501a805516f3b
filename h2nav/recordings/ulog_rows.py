"""The rows of PX4's ULog files, by topic and instance, with times that can be believed."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from h2nav.recordings.context import Array
from h2nav.recordings.imu_series import Times
from h2nav.recordings.log_clock import LogClock, in_order, is_running
from h2nav.recordings.row_tables import Table
from h2nav.recordings.ulog_tables import ULogFile, instance

MOST_INSTANCES = 8
FIX_AGE_US = 1_000_000


class Rows(NamedTuple):
    """Rows of one instance of a topic whose times can be believed.

    Attributes:
        number: of the instance, from 0.
        table: the rows.
        t_us: (N,) when they were published, in order.
        t_s: (N,) since the log began.
    """

    number: int
    table: Table
    t_us: Times
    t_s: Array

    @property
    def sample_us(self) -> Times:
        """(N,) when what they tell was measured, as far as they say so; never after they came."""
        if "timestamp_sample" not in self.table:
            return self.t_us
        stamps = self.table.integers("timestamp_sample")
        age_us = self.t_us - stamps
        is_age = (age_us >= 0) & (age_us <= FIX_AGE_US)
        return np.where(is_age, stamps, self.t_us)


class Log:
    """The tables with the log's clock.

    Args:
        file: what was read.

    Attributes:
        file: what was read.
        clock: of the rows.
        notes: what was damaged or skipped: reason -> count.
    """

    def __init__(self, file: ULogFile) -> None:
        self.file = file
        self.notes = dict(file.tables.notes)
        self.clock = _clock(file)

    @property
    def duration_s(self) -> float:
        """From the first time to the last."""
        return (self.clock.end_us - self.clock.start_us) * 1e-6

    def since_start(self, t_us: Times) -> Array:
        """Times of the autopilot as seconds since the log began."""
        return np.asarray((t_us - self.clock.start_us) * 1e-6)

    def note(self, reason: str, count: int) -> None:
        """Something was skipped."""
        if count:
            self.notes[reason] = self.notes.get(reason, 0) + count

    def find(self, topic: str, *columns: str, number: int = 0) -> Rows | None:
        """The rows of an instance of a topic; None where there are none with these columns."""
        table = self.file.tables.find(instance(topic, number), "timestamp", *columns)
        if table is None:
            return None
        times = table.integers("timestamp")
        good = self.clock.believes(table.places, times)
        good[good] = in_order(times[good])
        self.note(f"rows of {topic} far from the times around them", int((~good).sum()))
        if not good.any():
            return None
        if not good.all():
            table, times = table.only(good), times[good]
        times = times.clip(self.clock.start_us, self.clock.end_us)
        return Rows(number, table, times, self.since_start(times))

    def instances(self, topic: str, *columns: str) -> Iterator[Rows]:
        """One per instance of a topic."""
        for number in range(MOST_INSTANCES):
            rows = self.find(topic, *columns, number=number)
            if rows is not None:
                yield rows

    def first(self, *choices: tuple[str, str]) -> tuple[Rows, str] | None:
        """The first topic and column of some that were used over the years."""
        for topic, column in choices:
            rows = self.find(topic, column)
            if rows is not None:
                return rows, column
        return None


def _clock(file: ULogFile) -> LogClock:
    """By the topic of which there are most rows."""
    tables = file.tables
    for name in sorted(tables.names, key=lambda name: (-tables.rows(name), name)):
        table = tables.find(name, "timestamp")
        times = None if table is None else table.integers("timestamp")
        if table is not None and times is not None and is_running(times):
            return LogClock(table.places, times)
    return LogClock(np.empty(0, np.int64), np.empty(0, np.int64))
