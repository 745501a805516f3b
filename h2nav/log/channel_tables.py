"""A log's channels as tables: one per channel, and one per message type for link bytes.

The caller decides the format of a table (CSV, Parquet).
"""

from collections.abc import Callable, Collection, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import orjson
from mcap.records import Channel

from h2nav.errors import BadInput
from h2nav.log.file import RAW_ENCODING
from h2nav.log.foxglove_messages import flat_fields
from h2nav.log.message_schema import field_units
from h2nav.log.progress import Progress
from h2nav.log.reader import Directory, LogScan, stored_messages
from h2nav.log.records import StoredMessage
from h2nav.log.schema import time_from_object, unit_of
from h2nav.log.survey import require_mcap
from h2nav.wire.codec import decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS


class Column(NamedTuple):
    """A column of a table."""

    name: str  # of the field
    unit: str  # of its values; empty where none is known
    # of a value: ``time`` (UNIX ns), ``number``, ``integer``, ``boolean``, ``text``,
    # ``anything`` (any JSON value), or a type of the dialect, such as ``uint16_t``
    kind: str
    length: int = 0  # elements of an array; 0 for a scalar


class ChannelTable(Protocol):
    """Receives the rows of one table."""

    path: Path
    rows: int

    def add(self, log_ns: int, publish_ns: int, values: Sequence[Any]) -> None:
        """Adds a row.

        Raises:
            ValueError: a value, of this row or an earlier one, does not fit its column.
        """

    def finish(self) -> None:
        """Writes buffered rows; ValueError as in `add`."""


OpenTable = Callable[[Path, Sequence[Column], ExitStack], ChannelTable]
"""Opens the table of a file, which the stack closes; FileExistsError if the file exists."""


class ExportedFile(NamedTuple):
    """One file."""

    path: Path
    rows: int


class ExportResult(NamedTuple):
    """The result of an export."""

    files: list[ExportedFile]  # in the order of their creation
    skipped: dict[str, str]  # topic -> why it has no file, or lacks messages
    damaged_records: int  # damaged places of the log that were skipped


class Destination(NamedTuple):
    """Where tables are written."""

    folder: Path  # created if missing; existing files are not overwritten
    suffix: str  # of the files, such as ``.csv``
    open_table: OpenTable  # opens each


def export_tables(
    path: Path, destination: Destination, topics: Collection[str], progress: Progress
) -> ExportResult:
    """Exports the channels of a log as tables; none is left if that fails.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        destination: of the tables.
        topics: only these; all when empty.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: not a log, a file exists, or a topic of `topics` is not in the log.
    """
    require_mcap(path)
    opened: list[Path] = []
    try:
        with path.open("rb") as stream, ExitStack() as stack:
            return _exported(
                path, LogScan(stream), _Tables(destination, stack, opened), topics, progress
            )
    except BaseException:
        for table in opened:
            table.unlink(missing_ok=True)
        raise


def _exported(
    path: Path, scan: LogScan, tables: "_Tables", topics: Collection[str], progress: Progress
) -> ExportResult:
    directory = Directory(path)
    channels: dict[int, _ChannelRows | None] = {}
    seen: set[str] = set()
    for stored in stored_messages(scan, directory, progress):
        if stored.channel_id not in channels:
            channel = directory.channel(stored.channel_id)
            seen.add(channel.topic if channel else "")
            wanted = channel is not None and (not topics or channel.topic in topics)
            channels[stored.channel_id] = (
                _ChannelRows(channel, directory, tables) if channel and wanted else None
            )
        rows = channels[stored.channel_id]
        if rows is not None:
            rows.take(stored)
    require_topics(path, topics, seen)
    skipped = tables.finish()
    skipped |= {rows.topic: rows.problem for rows in channels.values() if rows and rows.problem}
    return ExportResult(tables.written(), skipped, scan.damaged_records)


def require_topics(path: Path, topics: Collection[str], seen: Collection[str]) -> None:
    """BadInput unless all the `topics` are among the `seen`."""
    absent = sorted(set(topics) - set(seen))
    if absent:
        known = ", ".join(sorted(set(seen) - {""})) or "none"
        raise BadInput(f"{path}: no topic {', '.join(absent)}; the log has {known}")


class _Tables:
    """The tables by name.

    Args:
        stack: closes them.
        opened: takes their files.
    """

    def __init__(self, destination: Destination, stack: ExitStack, opened: list[Path]) -> None:
        destination.folder.mkdir(parents=True, exist_ok=True)
        self._destination, self._stack, self._opened = destination, stack, opened
        self._tables: dict[str, ChannelTable] = {}

    def table(self, name: str, columns: Callable[[], Sequence[Column]]) -> ChannelTable:
        if name not in self._tables:
            # A topic of a foreign log must not lead out of the folder.
            file_name = "".join(c if c.isalnum() or c in "-." else "_" for c in name).strip("_.")
            folder, suffix, open_table = self._destination
            path = folder / f"{file_name or 'channel'}{suffix}"
            while path in self._opened:
                path = path.with_stem(f"{path.stem}_")
            try:
                self._tables[name] = open_table(path, columns(), self._stack)
            except FileExistsError:
                raise BadInput(f"{path}: exists; name another folder with -o") from None
            self._opened.append(path)
        return self._tables[name]

    def finish(self) -> dict[str, str]:
        """Writes what is buffered; returns name -> error for each table that failed."""
        problems: dict[str, str] = {}
        for name, table in self._tables.items():
            try:
                table.finish()
            except ValueError as error:
                problems[name] = str(error)
        return problems

    def written(self) -> list[ExportedFile]:
        return [ExportedFile(table.path, table.rows) for table in self._tables.values()]


class _ChannelRows:
    """Turns one channel's messages into rows.

    Attributes:
        topic: the channel's name.
        problem: why its messages cannot be exported; empty while they can.
    """

    def __init__(self, channel: Channel, directory: Directory, tables: _Tables) -> None:
        self.topic = channel.topic
        self.problem = ""
        schema = directory.schema(channel)
        self._schema_name = schema.name if schema else ""
        self._tables = tables
        self._deframer = Deframer()
        self._columns: list[Column] = []
        takers = {RAW_ENCODING: self._take_raw, "json": self._take_json}
        self._take = takers.get(channel.message_encoding, self._take_protobuf)
        if channel.message_encoding == "json" and schema is not None:
            self._columns = _schema_columns(schema.data)

    def take(self, stored: StoredMessage) -> None:
        """Writes the rows of one message."""
        if self.problem:
            return
        try:
            self._take(stored)
        except ValueError as error:
            self.problem = str(error)

    def _take_raw(self, stored: StoredMessage) -> None:
        for frame in self._deframer.feed(stored.data):
            fields = decode(frame)
            name = f"{self.topic}/{type(fields).__name__}"
            table = self._tables.table(name, partial(_dialect_columns, frame.msg_id))
            table.add(stored.log_ns, stored.publish_ns, [frame.sysid, frame.compid, *fields])

    def _take_json(self, stored: StoredMessage) -> None:
        values = orjson.loads(stored.data)
        if not isinstance(values, dict):
            raise ValueError("messages are not JSON objects")
        if not self._columns:
            self._columns = [Column(name, unit_of(name), "anything") for name in values]
        columns = self._columns
        table = self._tables.table(self.topic, lambda: columns)
        row = [time_from_object(values.get(column.name)) for column in columns]
        table.add(stored.log_ns, stored.publish_ns, row)

    def _take_protobuf(self, stored: StoredMessage) -> None:
        values = flat_fields(self._schema_name, stored.data)
        if values is None:
            raise ValueError(f"no export of {self._schema_name or 'this encoding'}")
        table = self._tables.table(self.topic, lambda: _value_columns(values))
        table.add(stored.log_ns, stored.publish_ns, list(values.values()))


def _schema_columns(schema: bytes) -> list[Column]:
    """The properties of a JSON schema; empty for anything else (the first message decides then)."""
    try:
        document = orjson.loads(schema)
    except ValueError:
        return []
    properties = document.get("properties") if isinstance(document, dict) else None
    if not isinstance(properties, dict):
        return []
    return [_schema_column(name, found) for name, found in properties.items()]


_KINDS = {"number": "number", "integer": "integer", "boolean": "boolean", "string": "text"}


def _schema_column(name: str, found: Any) -> Column:
    declared = found if isinstance(found, dict) else {}
    members = declared.get("properties")
    if isinstance(members, dict) and members.keys() == {"sec", "nsec"}:
        return Column(name, unit_of(name), "time")
    json_type = declared.get("type")
    kind = _KINDS.get(json_type, "anything") if isinstance(json_type, str) else "anything"
    return Column(name, unit_of(name), kind)


def _value_columns(values: dict[str, Any]) -> list[Column]:
    return [
        Column(name, "", "text" if isinstance(value, str) else "number")
        for name, value in values.items()
    ]


def _dialect_columns(msg_id: int) -> list[Column]:
    layout = LAYOUTS[msg_id]
    units = field_units(msg_id)
    wire = {field.name: field for field in layout.wire_fields}
    fields = [
        Column(
            name,
            units.get(name, ""),
            "text" if wire[name].type_name == "char" else wire[name].type_name,
            0 if wire[name].type_name == "char" else wire[name].length,
        )
        for name in layout.field_names
    ]
    return [Column("sysid", "", "uint8_t"), Column("compid", "", "uint8_t"), *fields]
