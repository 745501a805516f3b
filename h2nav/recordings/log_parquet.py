"""Exports a log's channels as Parquet files: typed columns, units in the fields' metadata."""

from collections.abc import Collection, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import orjson
import pyarrow as pa
import pyarrow.parquet as pq

from h2nav.log.channel_tables import Column, Destination, ExportResult, export_tables
from h2nav.log.progress import Progress

# Rows per compact array; the same number of arrays makes a row group of the file.
_BATCH_ROWS = 2048
_GROUP_BATCHES = 32
_TIME = pa.timestamp("ns", tz="UTC")
_TYPES: dict[str, Any] = {
    "time": _TIME,
    "number": pa.float64(),
    "integer": pa.int64(),
    "boolean": pa.bool_(),
    "text": pa.string(),
    "anything": pa.string(),
    "uint8_t": pa.uint8(),
    "int8_t": pa.int8(),
    "uint16_t": pa.uint16(),
    "int16_t": pa.int16(),
    "uint32_t": pa.uint32(),
    "int32_t": pa.int32(),
    "uint64_t": pa.uint64(),
    "int64_t": pa.int64(),
    "float": pa.float32(),
    "double": pa.float64(),
}


def export_parquet(
    path: Path,
    folder: Path,
    topics: Collection[str] = (),
    progress: Progress = lambda done, total: None,
) -> ExportResult:
    """Writes the channels of a log to `folder`; see `export_tables`.

    The columns `log_time` and `publish_time` are UTC with nanoseconds. Values without a schema
    become JSON text.
    """
    destination = Destination(folder, ".parquet", _ParquetTable)
    return export_tables(path, destination, topics, progress)


class _ParquetTable:
    """One Parquet file that is being written."""

    def __init__(self, path: Path, columns: Sequence[Column], stack: ExitStack) -> None:
        self.path = path
        self.rows = 0
        self._is_text = [column.kind == "anything" for column in columns]
        self._schema = pa.schema([pa.field("log_time", _TIME), pa.field("publish_time", _TIME)])
        for column in columns:
            self._schema = self._schema.append(_field(column))
        self._rows: list[tuple[Any, ...]] = []
        self._batches: list[Any] = []
        stream = stack.enter_context(path.open("xb"))
        self._writer = stack.enter_context(
            pq.ParquetWriter(stream, self._schema, compression="zstd")
        )

    def add(self, log_ns: int, publish_ns: int, values: Sequence[Any]) -> None:
        texts = (
            orjson.dumps(value).decode() if is_text and value is not None else value
            for is_text, value in zip(self._is_text, values, strict=True)
        )
        self._rows.append((log_ns, publish_ns, *texts))
        self.rows += 1
        if len(self._rows) == _BATCH_ROWS:
            self._pack()
            if len(self._batches) == _GROUP_BATCHES:
                self._write()

    def _pack(self) -> None:
        """Converts the rows to arrays; raises ValueError where one does not fit its column."""
        rows, self._rows = self._rows, []
        try:
            arrays = [
                pa.array(values, field.type)
                for values, field in zip(zip(*rows, strict=True), self._schema, strict=True)
            ]
        except (pa.ArrowException, OverflowError, TypeError) as error:
            self.rows -= len(rows)
            raise ValueError(f"values unlike the schema of the channel: {error}") from error
        self._batches.append(pa.record_batch(arrays, schema=self._schema))

    def _write(self) -> None:
        if self._batches:
            self._writer.write_table(pa.Table.from_batches(self._batches))
            self._batches = []

    def finish(self) -> None:
        try:
            if self._rows:
                self._pack()
        finally:
            self._write()


def _field(column: Column) -> Any:
    value_type = _TYPES[column.kind]
    if column.length:
        value_type = pa.list_(value_type, column.length)
    return pa.field(
        column.name, value_type, metadata={"unit": column.unit} if column.unit else None
    )
