"""A log's channels as CSV files."""

import csv
from collections.abc import Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from h2nav.log.channel_tables import Column, Destination, ExportResult, export_tables
from h2nav.log.progress import Progress

TIME_COLUMNS = ("log_time [unix ns]", "publish_time [unix ns]")


def export_csv(
    path: Path,
    folder: Path,
    topics: Collection[str] = (),
    progress: Progress = lambda done, total: None,
) -> ExportResult:
    """Writes the channels of a log to `folder`, units in the headers; see `export_tables`."""
    return export_tables(path, Destination(folder, ".csv", _CsvTable), topics, progress)


class _CsvTable:
    """One CSV file that is being written."""

    def __init__(self, path: Path, columns: Sequence[Column], stack: ExitStack) -> None:
        stream = stack.enter_context(path.open("x", newline="", encoding="utf-8"))
        self.path = path
        self.rows = 0
        self._writer = csv.writer(stream, lineterminator="\n")
        self._writer.writerow([*TIME_COLUMNS, *(_header(column) for column in columns)])

    def add(self, log_ns: int, publish_ns: int, values: Sequence[Any]) -> None:
        self.rows += 1
        self._writer.writerow([log_ns, publish_ns, *values])

    def finish(self) -> None:
        """Does nothing: rows are not buffered here."""


def _header(column: Column) -> str:
    return f"{column.name} [{column.unit}]" if column.unit else column.name
