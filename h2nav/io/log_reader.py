"""Reading MCAP files front to back whatever happened to them: cut off, damaged, never closed.

The index of a file is not used, because it is missing exactly when a log matters most. A record
counts as intact when its structure fills its length and its checksum, where it has one, fits; after
a damaged one the scan looks for the next intact record.
"""

import os
import re
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

HEAD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<HIQQ")
LARGEST_RECORD = 64 << 20
_SEARCH_BLOCK = 1 << 20
# A record as it may follow damage: an opcode of the data section and a length below 16 MiB.
_FIND_HEAD = re.compile(rb"[\x03-\x09\x0c]...\x00{5}|\x0f\x04\x00{7}", re.DOTALL).finditer
Record = TypeVar("Record")
_LOWEST, _HIGHEST = int(Opcode.HEADER), int(Opcode.DATA_END)


class Entry(NamedTuple):
    """An intact record of the data section.

    Attributes:
        offset: where it begins in the file.
        opcode: what it is.
        size: bytes of the whole record.
        body: the record without opcode and length.
        content: for a chunk, the records in it, decompressed; else empty.
    """

    offset: int
    opcode: int
    size: int
    body: bytes
    content: bytes


class StoredMessage(NamedTuple):
    """A message as it stands in the file; times in UNIX ns."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


class LogScan:
    """One pass over a file.

    Args:
        stream: the file, opened for reading and seekable.
        outline: give chunks and message indexes unread, with an empty body, which is much faster.

    Attributes:
        size: bytes of the file.
        position: bytes seen so far.
        damaged_records: runs of bytes that hold no intact record.
        skipped_bytes: their length together; a cut-off last record is among them.
        ended: the data section came to its regular end.
    """

    def __init__(self, stream: BinaryIO, *, outline: bool = False) -> None:
        self._stream = stream
        self._passed_over = (Opcode.CHUNK, Opcode.MESSAGE_INDEX) if outline else ()
        self.size = os.fstat(stream.fileno()).st_size
        self.position = 0
        self.damaged_records = self.skipped_bytes = 0
        self.ended = False

    def entries(self) -> Iterator[Entry]:
        """All intact records in the order of the file, up to the end of the data section."""
        self._stream.seek(0)
        offset = len(MCAP0_MAGIC)
        if self._stream.read(offset) != MCAP0_MAGIC:
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

    def _entry_at(self, offset: int) -> Entry | None:
        self._stream.seek(offset)
        head = self._stream.read(HEAD.size)
        if len(head) < HEAD.size:
            return None
        opcode, length = HEAD.unpack(head)
        end = offset + HEAD.size + length
        if not _LOWEST <= opcode <= _HIGHEST or length > LARGEST_RECORD or end > self.size:
            return None
        if opcode in self._passed_over:
            return Entry(offset, opcode, HEAD.size + length, b"", b"")
        body = self._stream.read(length)
        content = _intact_content(opcode, body) if len(body) == length else None
        if content is None:
            return None
        return Entry(offset, opcode, HEAD.size + length, body, content)

    def _entry_behind(self, damaged: int) -> Entry | None:
        """The first intact record behind a damaged one; its length is believed if that works."""
        self._stream.seek(damaged)
        head = self._stream.read(HEAD.size)
        if len(head) == HEAD.size:
            follower = damaged + HEAD.size + HEAD.unpack(head)[1]
            entry = self._entry_at(follower) if follower < self.size else None
            if entry is not None:
                return entry
        start = damaged + 1
        while start < self.size:
            self._stream.seek(start)
            block = self._stream.read(_SEARCH_BLOCK + HEAD.size - 1)
            for match in _FIND_HEAD(block):
                entry = self._entry_at(start + match.start())
                if entry is not None:
                    return entry
            start += _SEARCH_BLOCK
        return None


def is_mcap(path: Path) -> bool:
    """Whether the file begins like an MCAP file; two damaged bytes are forgiven."""
    with path.open("rb") as stream:
        start = stream.read(len(MCAP0_MAGIC))
    equal = sum(a == b for a, b in zip(start, MCAP0_MAGIC, strict=False))
    return equal >= len(MCAP0_MAGIC) - 2


def is_closed(path: Path) -> bool:
    """Whether the file ends as a closed MCAP file does."""
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.seek(max(0, size - len(MCAP0_MAGIC)))
        return size > 2 * len(MCAP0_MAGIC) and stream.read() == MCAP0_MAGIC


class Directory:
    """Which schemas and channels a log has, as far as they have been seen.

    A channel is told only once, inside the first chunk; when that chunk is damaged, the summary at
    the end of a closed file still knows it.
    """

    def __init__(self, path: Path) -> None:
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._path = path
        self._summary_read = False

    def note(self, opcode: int, body: bytes) -> None:
        """Takes a schema or channel record; others are ignored."""
        if opcode == Opcode.SCHEMA:
            schema = parse(Schema.read, body)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = parse(Channel.read, body)
            self.channels[channel.id] = channel

    def channel(self, channel_id: int) -> Channel | None:
        """The channel, or None when the file does not tell it (any more)."""
        if channel_id not in self.channels and not self._summary_read:
            self._read_summary()
        return self.channels.get(channel_id)

    def schema(self, channel: Channel) -> Schema | None:
        """The channel's schema; None when it has none."""
        if channel.schema_id and channel.schema_id not in self.schemas and not self._summary_read:
            self._read_summary()
        return self.schemas.get(channel.schema_id)

    def _read_summary(self) -> None:
        self._summary_read = True
        if not is_closed(self._path):
            return
        with self._path.open("rb") as stream:
            try:
                summary = make_reader(stream).get_summary()
            except (McapError, ValueError, OSError, struct.error):
                return
        if summary is not None:
            self.schemas = {**summary.schemas, **self.schemas}
            self.channels = {**summary.channels, **self.channels}


def inner_records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and body of each record of a chunk's content, or of one record outside chunks."""
    offset = 0
    while offset + HEAD.size <= len(content):
        opcode, length = HEAD.unpack_from(content, offset)
        offset += HEAD.size
        yield opcode, content[offset : offset + length]
        offset += length


def records_of(entry: Entry) -> Iterator[tuple[int, bytes]]:
    """The records that an entry stands for: those in a chunk, else itself."""
    if entry.opcode == Opcode.CHUNK:
        return inner_records(entry.content)
    return iter(((entry.opcode, entry.body),))


def message(body: bytes) -> StoredMessage:
    """A message record's fields."""
    channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
    return StoredMessage(channel_id, sequence, log_ns, publish_ns, body[_MESSAGE.size :])


def parse(read: Callable[[ReadDataStream], Record], body: bytes) -> Record:
    """A record of the mcap library from a record's body."""
    return read(ReadDataStream(BytesIO(body)))


def _intact_content(opcode: int, body: bytes) -> bytes | None:
    """The decompressed content of an intact chunk, b"" for another intact record, else None."""
    try:
        if opcode == Opcode.CHUNK:
            return _chunk_content(body)
        if opcode == Opcode.ATTACHMENT:
            fits = zlib.crc32(body[:-4]) == struct.unpack("<I", body[-4:])[0]
        elif opcode == Opcode.MESSAGE_INDEX:
            fits = len(body) >= 6 and len(body) == 6 + struct.unpack_from("<I", body, 2)[0]
        elif opcode == Opcode.MESSAGE:
            fits = len(body) >= _MESSAGE.size
        elif opcode == Opcode.DATA_END:
            fits = len(body) == 4
        else:
            fits = _fills(opcode, body)
    except (McapError, ValueError, struct.error):
        fits = False
    return b"" if fits else None


def _chunk_content(body: bytes) -> bytes | None:
    (compression_length,) = struct.unpack_from("<I", body, 28)
    (length,) = struct.unpack_from("<Q", body, 32 + compression_length)
    if 40 + compression_length + length != len(body):
        return None
    chunk = parse(Chunk.read, body)
    if chunk.uncompressed_size > LARGEST_RECORD:
        return None
    try:
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        content = stream.read(size)
    except Exception:  # each decompressor has errors of its own
        return None
    return content if len(content) == chunk.uncompressed_size and _chained(content) else None


def _chained(content: bytes) -> bool:
    """Whether the records of a chunk fill it."""
    offset = 0
    while offset + HEAD.size <= len(content):
        opcode, length = HEAD.unpack_from(content, offset)
        if opcode == Opcode.MESSAGE and length < _MESSAGE.size:
            return False
        offset += HEAD.size + length
    return offset == len(content)


def _fills(opcode: int, body: bytes) -> bool:
    """Whether a record of texts parses to exactly its length."""
    stream = ReadDataStream(BytesIO(body))
    readers: dict[int, Callable[[ReadDataStream], object]] = {
        Opcode.SCHEMA: Schema.read,
        Opcode.CHANNEL: Channel.read,
        Opcode.METADATA: Metadata.read,
    }
    if opcode in readers:
        readers[opcode](stream)
        return stream.count == len(body)
    return opcode == Opcode.HEADER
