"""Rows of PX4's ULog files: by topic and instance."""

from collections.abc import Iterator

import numpy as np

from h2nav.recordings.columns import Format
from h2nav.recordings.imu_series import Times
from h2nav.recordings.log_rows import MAX_INSTANCES, Log, Rows
from h2nav.recordings.row_tables import Table
from h2nav.recordings.ulog_tables import ULogFile, instance

# The name of the table of texts; no topic is called that.
TEXTS = "logged_messages"


class ULogRows(Log):
    """The topics of a ULog file."""

    format = Format.ULOG

    def __init__(self, file: ULogFile) -> None:
        self.file = file  # the contents
        super().__init__(file.tables)

    @staticmethod
    def times_of(table: Table) -> Times | None:
        """(N,) microseconds since boot; None if the rows have no times."""
        return table.integers("timestamp") if "timestamp" in table else None

    def find(self, topic: str, *columns: str, number: int = 0) -> Rows | None:
        """The rows of an instance of a topic; None if there are none with these columns."""
        if topic == TEXTS:
            return self._texts() if number == 0 and self.file.texts else None
        table = self.tables.find(instance(topic, number), "timestamp", *columns)
        if table is None:
            return None
        return self.kept(topic, table, lambda one: one.integers("timestamp"), number)

    def _texts(self) -> Rows:
        """What ULog stores outside the topics; each has a time of its own, wherever it stands."""
        texts, clock = self.file.texts, self.clock
        times = [min(max(one.t_us, clock.start_us), clock.end_us) for one in texts]
        order = np.argsort(np.array(times), kind="stable")
        row = [("level", "u1"), ("text", "O")]
        rows = np.array([(one.level, one.text.encode()) for one in texts], row)
        t_us = np.array(times)[order]
        return Rows(0, Table(TEXTS, order, rows[order]), t_us, self.since_start(t_us))

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """One per instance of a topic."""
        for number in range(MAX_INSTANCES):
            rows = self.find(name, *columns, number=number)
            if rows is not None:
                yield rows
