"""Copies the intact records of a log unchanged, with optional additions."""

import os
import struct
import zlib
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, Protocol

from mcap.opcode import Opcode
from mcap.records import Chunk, Header
from mcap.writer import MCAP0_MAGIC

from h2nav.log.folder import LOG_MODE
from h2nav.log.reader import Directory, LogEntry, LogScan, is_closed, records_of
from h2nav.log.records import HEAD, message
from h2nav.log.summary import LogSummary, record_bytes


class Recovery(NamedTuple):
    """The result of a copy."""

    messages: int  # messages saved
    attachments: int  # attachments saved
    damaged_records: int  # runs of bytes without an intact record
    lost_bytes: int  # their total length
    orphaned_messages: int  # intact messages whose channel is unknown; not saved
    was_closed: bool  # the input was complete

    @property
    def lost_something(self) -> bool:
        """Whether anything of the input is missing in the output."""
        return self.lost_bytes > 0 or self.orphaned_messages > 0


class Addition(Protocol):
    """Derives further records from those of a log."""

    def after(self, entry: LogEntry, known: Directory) -> LogEntry | None:
        """Returns what to write after a record; `known` are the channels so far."""

    def rest(self) -> LogEntry | None:
        """Returns what to write at the end."""


def restrict(stream: BinaryIO) -> None:
    """Gives a rewritten log the same access mode as one of the recorder."""
    descriptor = stream.fileno()
    os.fchmod(descriptor, os.fstat(descriptor).st_mode & LOG_MODE)


class LogCopy:
    """Writes the intact records of a log to a new file, and those of an addition.

    Args:
        program: the writer's name, used if the log has none.
        addition: derives further records.
    """

    def __init__(
        self, source: Path, stream: BinaryIO, program: str, addition: Addition | None = None
    ) -> None:
        self._stream = stream
        self._source = source
        self._known = Directory(source)
        self._summary = LogSummary()
        self._position = 0
        self._orphaned = 0
        self._program = program
        self._addition = addition

    def run(self, scan: LogScan, pause: Callable[[], None]) -> Recovery:
        """Copies every record that `scan` finds; calls `pause` after each."""
        self._write(MCAP0_MAGIC)
        for entry in scan.entries():
            if self._position == len(MCAP0_MAGIC) and entry.opcode != Opcode.HEADER:
                self._write(record_bytes(Header("", self._program)))
            if entry.opcode not in (Opcode.MESSAGE_INDEX, Opcode.DATA_END):
                self._copy(entry)
                if self._addition is not None:
                    self._add(self._addition.after(entry, self._known))
                pause()
        if self._position == len(MCAP0_MAGIC):
            self._write(record_bytes(Header("", self._program)))
        if self._addition is not None:
            self._add(self._addition.rest())
        summary = self._summary
        self._write(summary.ending(self._position))
        return Recovery(
            summary.message_count,
            summary.attachment_count,
            scan.damaged_records,
            scan.skipped_bytes,
            self._orphaned,
            is_closed(self._source),
        )

    def _add(self, entry: LogEntry | None) -> None:
        """Writes a record of the addition."""
        if entry is not None:
            indexes = self._summary.add(entry, self._position)
            self._write(HEAD.pack(entry.opcode, len(entry.body)) + entry.body + indexes)

    def _copy(self, entry: LogEntry) -> None:
        for opcode, body in records_of(entry):
            self._known.note(opcode, body)
        if entry.opcode in (Opcode.SCHEMA, Opcode.CHANNEL) and self._is_known(entry):
            return
        used = dict.fromkeys(
            message(body).channel_id
            for opcode, body in records_of(entry)
            if opcode == Opcode.MESSAGE
        )
        announced = self._announced_in(entry)
        unknown = {channel for channel in used if self._known.channel(channel) is None}
        for channel_id in used:
            if channel_id not in unknown and channel_id not in announced:
                self._announce(channel_id)
        if unknown:
            kept = self._without(entry, unknown)
            if kept is None:
                return
            entry = kept
        indexes = self._summary.add(entry, self._position)
        self._write(HEAD.pack(entry.opcode, len(entry.body)) + entry.body + indexes)

    def _announced_in(self, entry: LogEntry) -> set[int]:
        """Channels defined in the output once the entry is copied."""
        inside = {
            struct.unpack_from("<H", body)[0]
            for opcode, body in records_of(entry)
            if opcode == Opcode.CHANNEL
        }
        return inside | self._summary.channels.keys()

    def _is_known(self, entry: LogEntry) -> bool:
        (number,) = struct.unpack_from("<H", entry.body)
        known = self._summary.schemas if entry.opcode == Opcode.SCHEMA else self._summary.channels
        return number in known

    def _announce(self, channel_id: int) -> None:
        """Writes a channel, and its schema, known only from the source's summary."""
        channel = self._known.channel(channel_id)
        schema = self._known.schema(channel) if channel else None
        for record in (schema, channel):
            if record is not None:
                data = record_bytes(record)
                opcode, _ = HEAD.unpack_from(data)
                self._summary.add(
                    LogEntry(0, opcode, len(data), data[HEAD.size :], b""), self._position
                )
                self._write(data)

    def _without(self, entry: LogEntry, unknown: set[int]) -> LogEntry | None:
        """The entry without the messages of unknown channels."""
        kept, count = BytesIO(), 0
        times = []
        for opcode, body in records_of(entry):
            if opcode == Opcode.MESSAGE:
                stored = message(body)
                if stored.channel_id in unknown:
                    self._orphaned += 1
                    continue
                times.append(stored.log_ns)
            kept.write(HEAD.pack(opcode, len(body)) + body)
            count += 1
        if not times or entry.opcode != Opcode.CHUNK:
            return None
        content = kept.getvalue()
        chunk = Chunk("", content, max(times), min(times), zlib.crc32(content), len(content))
        data = record_bytes(chunk)
        return LogEntry(0, Opcode.CHUNK, len(data), data[HEAD.size :], content)

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._position += len(data)
