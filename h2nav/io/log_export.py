"""A log's channels as CSV files: one per channel, one per message type for link bytes."""

import csv
from collections.abc import Callable, Collection
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import orjson
from mcap.opcode import Opcode
from mcap.records import Channel
from pymavlink.dialects.v20 import ardupilotmega

from h2nav.errors import BadInput
from h2nav.io.codec import decode, record_type
from h2nav.io.deframer import Deframer
from h2nav.io.foxglove_messages import flat_fields
from h2nav.io.log_file import RAW_ENCODING
from h2nav.io.log_reader import Directory, LogScan, records_of
from h2nav.io.log_records import StoredMessage, message
from h2nav.io.log_schema import time_from_object, unit_of
from h2nav.io.log_survey import Progress, require_mcap

TIME_COLUMNS = ("log_time [unix ns]", "publish_time [unix ns]")


class ExportedFile(NamedTuple):
    """One CSV file."""

    path: Path
    rows: int


class ExportResult(NamedTuple):
    """What was written, and what could not be.

    Attributes:
        files: the CSV files, in the order in which they were begun.
        skipped: topic -> why it has no file.
        damaged_records: damaged places of the log that were passed over.
    """

    files: list[ExportedFile]
    skipped: dict[str, str]
    damaged_records: int


def export_csv(
    path: Path,
    folder: Path,
    topics: Collection[str] = (),
    progress: Progress = lambda done, total: None,
) -> ExportResult:
    """Writes the channels of a log to `folder`.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        folder: made when missing; existing files are not overwritten.
        topics: only these; all when empty.
        progress: called with the bytes done and in all.

    Raises:
        BadInput: no log, a file exists, or none of `topics` is in the log.
    """
    require_mcap(path)
    directory = Directory(path)
    with ExitStack() as stack, path.open("rb") as stream:
        tables = _Tables(folder, stack)
        channels: dict[int, _ChannelExport | None] = {}
        seen: set[str] = set()
        scan = LogScan(stream)
        for entry in scan.entries():
            progress(scan.position, scan.size)
            for opcode, body in records_of(entry):
                if opcode != Opcode.MESSAGE:
                    directory.note(opcode, body)
                    continue
                stored = message(body)
                if stored.channel_id not in channels:
                    channel = directory.channel(stored.channel_id)
                    seen.add(channel.topic if channel else "")
                    wanted = channel is not None and (not topics or channel.topic in topics)
                    channels[stored.channel_id] = (
                        _ChannelExport(channel, directory, tables) if channel and wanted else None
                    )
                export = channels[stored.channel_id]
                if export is not None:
                    export.take(stored)
        absent = sorted(set(topics) - seen)
        if absent:
            known = ", ".join(sorted(seen - {""})) or "none"
            raise BadInput(f"{path}: no topic {', '.join(absent)}; the log has {known}")
        skipped = {
            export.topic: export.problem
            for export in channels.values()
            if export and export.problem
        }
        return ExportResult(tables.written(), skipped, scan.damaged_records)


class _Table:
    """One CSV file that is being written."""

    def __init__(self, path: Path, header: list[str], stack: ExitStack) -> None:
        try:
            stream = stack.enter_context(path.open("x", newline="", encoding="utf-8"))
        except FileExistsError:
            raise BadInput(f"{path}: exists; name another folder with -o") from None
        self.path = path
        self.rows = 0
        self._writer = csv.writer(stream, lineterminator="\n")
        self._writer.writerow([*TIME_COLUMNS, *header])

    def add(self, stored: StoredMessage, values: list[Any]) -> None:
        self.rows += 1
        self._writer.writerow([stored.log_ns, stored.publish_ns, *values])


class _Tables:
    """The CSV files by name."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._folder = folder
        self._stack = stack
        self._tables: dict[str, _Table] = {}

    def table(self, name: str, header: Callable[[], list[str]]) -> _Table:
        if name not in self._tables:
            # A topic of a foreign log must not lead out of the folder.
            file_name = "".join(c if c.isalnum() or c in "-." else "_" for c in name).strip("_.")
            path = self._folder / f"{file_name or 'channel'}.csv"
            self._tables[name] = _Table(path, header(), self._stack)
        return self._tables[name]

    def written(self) -> list[ExportedFile]:
        return [ExportedFile(table.path, table.rows) for table in self._tables.values()]


class _ChannelExport:
    """Turns one channel's messages into rows.

    Attributes:
        topic: the channel's name.
        problem: why its messages could not be exported; empty while they can.
    """

    def __init__(self, channel: Channel, directory: Directory, tables: _Tables) -> None:
        self.topic = channel.topic
        self.problem = ""
        schema = directory.schema(channel)
        self._schema_name = schema.name if schema else ""
        self._tables = tables
        self._deframer = Deframer()
        self._fields: list[str] = []
        takers = {RAW_ENCODING: self._take_raw, "json": self._take_json}
        self._take = takers.get(channel.message_encoding, self._take_protobuf)
        if channel.message_encoding == "json" and schema is not None:
            self._fields = _field_names(schema.data)

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
            name = type(fields).__name__
            header = partial(_dialect_header, frame.msg_id)
            table = self._tables.table(f"{self.topic}/{name}", header)
            table.add(stored, [frame.sysid, frame.compid, *fields])

    def _take_json(self, stored: StoredMessage) -> None:
        values = orjson.loads(stored.data)
        if not isinstance(values, dict):
            raise ValueError("messages are no JSON objects")
        names = self._fields = self._fields or list(values)
        table = self._tables.table(self.topic, lambda: [_with_unit(name) for name in names])
        table.add(stored, [time_from_object(values.get(name)) for name in names])

    def _take_protobuf(self, stored: StoredMessage) -> None:
        values = flat_fields(self._schema_name, stored.data)
        if values is None:
            raise ValueError(f"no export of {self._schema_name or 'this encoding'}")
        table = self._tables.table(self.topic, lambda: list(values))
        table.add(stored, list(values.values()))


def _field_names(schema: bytes) -> list[str]:
    """The properties of a JSON schema; none when it is not one, and the first message decides."""
    try:
        document = orjson.loads(schema)
    except ValueError:
        return []
    properties = document.get("properties") if isinstance(document, dict) else None
    return list(properties) if isinstance(properties, dict) else []


def _with_unit(name: str) -> str:
    unit = unit_of(name)
    return f"{name} [{unit}]" if unit else name


def _dialect_header(msg_id: int) -> list[str]:
    units = ardupilotmega.mavlink_map[msg_id].fieldunits_by_name
    names = record_type(msg_id)._fields
    fields = [f"{name} [{units[name]}]" if units.get(name) else name for name in names]
    return ["sysid", "compid", *fields]
