"""Reads MCAP files front to back in any state: cut off, damaged, never closed.

The index is not used, because it is missing exactly when a log matters most. After a damaged
record the scan looks for the next intact one, as `records` defines it.
"""

import os
import re
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from h2nav.log.magic import MAGIC
from h2nav.log.records import (
    HEAD,
    LARGEST_RECORD,
    StoredMessage,
    inner_records,
    intact_content,
    message,
    parse,
)

_FOOTER = struct.Struct("<BQQQI")
_FIRST_BLOCK, _SEARCH_BLOCK = 1 << 12, 1 << 20
# A record as it may follow damage: an opcode of the data section and a length below 16 MiB. Looked
# ahead, because the byte before it may look like the opcode.
_FIND_HEAD = re.compile(rb"(?=[\x03-\x09\x0c]...\x00{5}|\x0f\x04\x00{7})", re.DOTALL).finditer
_HOLE = bytes(_SEARCH_BLOCK + HEAD.size - 1)
# What looks like a record and is none may be read in vain as far as this: some bytes, and more for
# each byte before it. Otherwise a few bytes that repeat would cost the square of their number.
_FREE_BYTES, _BYTES_PER_BYTE = 1 << 26, 64
_LOWEST, _HIGHEST = int(Opcode.HEADER), int(Opcode.DATA_END)


class LogEntry(NamedTuple):
    """An intact record of the data section."""

    offset: int  # of the record in the file
    opcode: int  # its kind
    size: int  # bytes of the whole record
    body: bytes  # the record without opcode and length
    content: bytes  # the decompressed records of a chunk; empty otherwise


class LogScan:
    """One pass over a file.

    Args:
        stream: the file, opened for reading and seekable.
        outline: leave the bodies of chunks and message indexes empty, which is much faster.

    Attributes:
        size: bytes of the file.
        position: bytes seen so far.
        damaged_records: runs of bytes without an intact record.
        skipped_bytes: their total length, including a last record that is cut off.
        ended: the data section ended regularly.
    """

    def __init__(self, stream: BinaryIO, *, outline: bool = False) -> None:
        self._stream = stream
        self._passed_over = (Opcode.CHUNK, Opcode.MESSAGE_INDEX) if outline else ()
        self.size = os.fstat(stream.fileno()).st_size
        self.position = 0
        self.damaged_records = self.skipped_bytes = 0
        self.ended = False
        self._in_vain = 0  # bytes

    def entries(self) -> Iterator[LogEntry]:
        """Yields all intact records in order, up to the end of the data section."""
        self._stream.seek(0)
        offset = len(MAGIC)
        if self._stream.read(offset) != MAGIC:
            self._skip(0, min(offset, self.size))
        while offset < self.size and not self.ended:
            entry = self._entry_at(offset)
            if entry is None:
                found = self._entry_behind(offset)
                self._skip(offset, found.offset if found else self.size)
                if found is None:
                    break
                entry = found
            offset = entry.offset + entry.size
            self.position = offset
            self.ended = entry.opcode == Opcode.DATA_END
            yield entry
        self.position = self.size

    def _skip(self, start: int, end: int) -> None:
        self.damaged_records += 1
        self.skipped_bytes += end - start

    def _entry_at(self, offset: int) -> LogEntry | None:
        self._stream.seek(offset)
        head = self._stream.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        end = offset + HEAD.size + length
        if not _LOWEST <= opcode <= _HIGHEST or length > LARGEST_RECORD or end > self.size:
            return None
        if opcode in self._passed_over:
            return LogEntry(offset, opcode, HEAD.size + length, b"", b"")
        body = self._stream.read(length)
        content = intact_content(opcode, body) if len(body) == length else None
        if content is None:
            return None
        return LogEntry(offset, opcode, HEAD.size + length, body, content)

    def _entry_behind(self, damaged: int) -> LogEntry | None:
        """The first intact record after a damaged one; tries the damaged record's length first."""
        self._stream.seek(damaged)
        head = self._stream.read(HEAD.size)
        if len(head) == HEAD.size:
            follower = damaged + HEAD.size + HEAD.unpack(head)[1]
            entry = self._entry_at(follower) if follower < self.size else None
            if entry is not None:
                return entry
        start, step = damaged + 1, _FIRST_BLOCK
        while start < self.size:
            self._stream.seek(start)
            block = self._stream.read(step + HEAD.size - 1)
            # A hole of a file that was cut by a full disk may be long, and is read in no time.
            for match in _FIND_HEAD(block) if block != _HOLE else ():
                place, length = start + match.start(), HEAD.unpack_from(block, match.start())[1]
                if self._in_vain + length > _FREE_BYTES + _BYTES_PER_BYTE * place:
                    continue
                entry = self._entry_at(place)
                if entry is not None:
                    return entry
                if place + length < self.size:  # otherwise it was not read
                    self._in_vain += length
            start += step
            step = min(4 * step, _SEARCH_BLOCK)
        return None


def is_closed(path: Path) -> bool:
    """Whether the file ends as a closed MCAP file does."""
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - len(MAGIC)))
        return size > 2 * len(MAGIC) and stream.read() == MAGIC


class Definitions:
    """Schemas and channels by id, as far as they have been read."""

    def __init__(self) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}

    def note(self, opcode: int, body: bytes) -> None:
        """Adds a schema or channel record; ignores others."""
        if opcode == Opcode.SCHEMA:
            schema = parse(Schema.read, body)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = parse(Channel.read, body)
            self.channels[channel.id] = channel


class Directory(Definitions):
    """The definitions of a log.

    A channel is described only once, in the first chunk; if that is damaged, the summary of a
    closed file still describes it.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._summary_read = False

    def channel(self, channel_id: int) -> Channel | None:
        """Returns the channel, or None if no intact record describes it."""
        if channel_id not in self.channels and not self._summary_read:
            self._read_summary()
        return self.channels.get(channel_id)

    def schema(self, channel: Channel) -> Schema | None:
        """Returns the channel's schema; None if it has none."""
        if channel.schema_id and channel.schema_id not in self.schemas and not self._summary_read:
            self._read_summary()
        return self.schemas.get(channel.schema_id)

    def _read_summary(self) -> None:
        self._summary_read = True
        for opcode, body in inner_records(_summary(self._path)):
            if opcode == Opcode.SCHEMA and intact_content(opcode, body) is not None:
                schema = parse(Schema.read, body)
                self.schemas.setdefault(schema.id, schema)
            elif opcode == Opcode.CHANNEL and intact_content(opcode, body) is not None:
                channel = parse(Channel.read, body)
                self.channels.setdefault(channel.id, channel)


def _summary(path: Path) -> bytes:
    """The records between data section and footer; empty if the end of the file is damaged."""
    if not is_closed(path):
        return b""
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        footer = size - len(MAGIC) - _FOOTER.size
        if footer < len(MAGIC):
            return b""
        stream.seek(footer)
        opcode, _, start, _, _ = _FOOTER.unpack(stream.read(_FOOTER.size))
        if opcode != Opcode.FOOTER or not start or not 0 < footer - start <= LARGEST_RECORD:
            return b""
        stream.seek(start)
        return stream.read(footer - start)


def records_of(entry: LogEntry) -> Iterator[tuple[int, bytes]]:
    """The records in a chunk; for another entry, the entry itself."""
    if entry.opcode == Opcode.CHUNK:
        return inner_records(entry.content)
    return iter(((entry.opcode, entry.body),))


def messages_of(
    path: Path, progress: Callable[[int, int], None]
) -> Iterator[tuple[Channel, StoredMessage]]:
    """Yields all messages of a log in order, with their channels.

    Messages whose channel is unknown are skipped.

    Args:
        path: an MCAP log, closed, cut off or damaged.
        progress: called with the bytes done and the total.
    """
    directory = Directory(path)
    with path.open("rb") as stream:
        for stored in stored_messages(LogScan(stream), directory, progress):
            channel = directory.channel(stored.channel_id)
            if channel is not None:
                yield channel, stored


def stored_messages(
    scan: LogScan, directory: Directory, progress: Callable[[int, int], None]
) -> Iterator[StoredMessage]:
    """Yields every message; the directory takes the other records.

    Args:
        scan: of the log.
        directory: of the log.
        progress: called with the bytes done and the total.
    """
    for entry in scan.entries():
        progress(scan.position, scan.size)
        for opcode, body in records_of(entry):
            if opcode == Opcode.MESSAGE:
                yield message(body)
            else:
                directory.note(opcode, body)
