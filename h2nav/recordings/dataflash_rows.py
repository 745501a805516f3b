"""Rows of ArduPilot's dataflash logs by message; instances have been encoded in two ways."""

from collections.abc import Iterator

from h2nav.recordings.imu_series import Times
from h2nav.recordings.log_rows import MOST_INSTANCES, Log, Rows
from h2nav.recordings.row_tables import Table
from h2nav.wire.imu import MOST_IMUS

# Columns with the number of an instance.
NUMBER = ("I", "C", "Instance", "Inst", "IMU")


class DataflashRows(Log):
    """The messages of a dataflash log."""

    @staticmethod
    def times_of(table: Table) -> Times | None:
        """(N,) microseconds since boot; None if the rows have no times."""
        if "TimeUS" in table:
            return table.integers("TimeUS")
        if table.name.startswith("GPS"):  # its TimeMS is that of the week
            return table.integers("T") * 1000 if "T" in table else None
        return table.integers("TimeMS") * 1000 if "TimeMS" in table else None

    def find(self, name: str, *columns: str) -> Rows | None:
        """All rows of a message; None if there are none with these columns."""
        table = self.tables.find(name, *columns)
        times = None if table is None else self.times_of(table)
        return None if table is None or times is None else self.kept(name, table, times)

    def occasional(self, name: str, *columns: str, begins: bool = False) -> Rows | None:
        """Like `find`, for occasional messages, which until 2015 had no time.

        Rows without one get the time of the row before them in the file; if they `begins`
        something, of the row after them, because the autopilot may have logged nothing until then.
        """
        table = self.tables.find(name, *columns)
        if table is None:
            return None
        if self.times_of(table) is not None:
            return self.find(name)
        times = (self.clock.after if begins else self.clock.at)(table.places)
        return self.believed(name, table, times)

    def instances(self, name: str, *columns: str) -> Iterator[Rows]:
        """Yields one per instance: of one message with numbers, or of messages with a number."""
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
