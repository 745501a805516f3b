"""The records of an MCAP file: their fields, and whether they are intact.

A record is intact when its structure fills its length and its checksum, if any, matches. Until then
nothing is trusted: neither the length of a record nor the size of an unpacked chunk can cost more
memory than `LARGEST_RECORD`.
"""

import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import NamedTuple, TypeVar

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Metadata, Schema

HEAD = struct.Struct("<BQ")
LARGEST_RECORD = 64 << 20
_MESSAGE = struct.Struct("<HIQQ")
_READERS: dict[int, Callable[[ReadDataStream], object]] = {
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.METADATA: Metadata.read,
    Opcode.ATTACHMENT: Attachment.read,
}
Record = TypeVar("Record")


class StoredMessage(NamedTuple):
    """A message as stored in the file; times in UNIX ns."""

    channel_id: int
    sequence: int
    log_ns: int
    publish_ns: int
    data: bytes


def message(body: bytes) -> StoredMessage:
    """Parses a message record."""
    channel_id, sequence, log_ns, publish_ns = _MESSAGE.unpack_from(body)
    return StoredMessage(channel_id, sequence, log_ns, publish_ns, body[_MESSAGE.size :])


def parse(read: Callable[[ReadDataStream], Record], body: bytes) -> Record:
    """Parses a record's body into a record of the mcap library."""
    return read(ReadDataStream(BytesIO(body)))


def inner_records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Opcode and body of each record of a chunk's content, or of one record outside chunks."""
    offset = 0
    while offset + HEAD.size <= len(content):
        opcode, length = HEAD.unpack_from(content, offset)
        offset += HEAD.size
        yield opcode, content[offset : offset + length]
        offset += length


def intact_content(opcode: int, body: bytes) -> bytes | None:
    """The decompressed content of an intact chunk, b"" for another intact record, else None."""
    try:
        if opcode == Opcode.CHUNK:
            return _chunk_content(body)
        fits = _is_intact(opcode, body)
    except (McapError, ValueError, OverflowError, struct.error):
        fits = False
    return b"" if fits else None


def _is_intact(opcode: int, body: bytes) -> bool:
    if opcode == Opcode.ATTACHMENT:
        whole = zlib.crc32(body[:-4]) == struct.unpack("<I", body[-4:])[0]
        return whole and _fills(opcode, body)
    if opcode == Opcode.MESSAGE_INDEX:
        return len(body) >= 6 and len(body) == 6 + int(struct.unpack_from("<I", body, 2)[0])
    if opcode == Opcode.MESSAGE:
        return len(body) >= _MESSAGE.size
    if opcode == Opcode.DATA_END:
        return len(body) == 4
    return opcode == Opcode.HEADER or (opcode in _READERS and _fills(opcode, body))


def _fills(opcode: int, body: bytes) -> bool:
    """Whether a record of texts parses to exactly its length."""
    stream = ReadDataStream(BytesIO(body))
    _READERS[opcode](stream)
    return stream.count == len(body)


def _chunk_content(body: bytes) -> bytes | None:
    (compression_length,) = struct.unpack_from("<I", body, 28)
    (length,) = struct.unpack_from("<Q", body, 32 + compression_length)
    if 40 + compression_length + length != len(body):
        return None
    chunk = parse(Chunk.read, body)
    if chunk.uncompressed_size > LARGEST_RECORD:
        return None
    content = _decompressed(chunk)
    if content is None or len(content) != chunk.uncompressed_size:
        return None
    if chunk.uncompressed_crc not in (0, zlib.crc32(content)):
        return None
    return content if _chained(content) else None


def _decompressed(chunk: Chunk) -> bytes | None:
    """Unpacks a chunk, at most one byte beyond its declared size; None when damaged."""
    most = chunk.uncompressed_size + 1
    try:
        if chunk.compression == "zstd":
            unpacker = zstandard.ZstdDecompressor(max_window_size=LARGEST_RECORD)
            return unpacker.stream_reader(chunk.data).read(most)
        if chunk.compression == "lz4":
            content: bytes = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, most)
            return content
    except Exception:  # each decompressor raises errors of its own
        return None
    return chunk.data if chunk.compression == "" else None


def _chained(content: bytes) -> bool:
    """Whether the records of a chunk are intact and fill it."""
    offset = 0
    while offset + HEAD.size <= len(content):
        opcode, length = HEAD.unpack_from(content, offset)
        offset += HEAD.size
        if opcode == Opcode.MESSAGE:
            if length < _MESSAGE.size:
                return False
        elif opcode in _READERS and not _is_intact(opcode, content[offset : offset + length]):
            return False
        offset += length
    return offset == len(content)
