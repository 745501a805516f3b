"""Builds the summary at the end of an MCAP file from its records."""

import zlib

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Statistics,
)
from mcap.writer import MCAP0_MAGIC

from h2nav.log.reader import Definitions, LogEntry
from h2nav.log.records import HEAD, inner_records, message, parse

_SUMMARY_CRC_SIZE = 4


class LogSummary(Definitions):
    """Collects the index of a log; `add` takes each record of the data section in order."""

    def __init__(self) -> None:
        super().__init__()
        self.message_count = 0
        self._counts: dict[int, int] = {}
        self._first_ns = self._last_ns = 0
        self._chunks: list[ChunkIndex] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []

    @property
    def attachment_count(self) -> int:
        """Attachments added."""
        return len(self._attachments)

    def add(self, entry: LogEntry, offset: int) -> bytes:
        """Adds a record located at `offset`.

        Returns:
            The message index records that must follow a chunk; empty for other records.
        """
        length = entry.size
        if entry.opcode == Opcode.CHUNK:
            return self._add_chunk(entry, offset, length)
        if entry.opcode == Opcode.ATTACHMENT:
            attachment = parse(Attachment.read, entry.body)
            index = AttachmentIndex(
                offset=offset,
                length=length,
                log_time=attachment.log_time,
                create_time=attachment.create_time,
                data_size=len(attachment.data),
                name=attachment.name,
                media_type=attachment.media_type,
            )
            self._attachments.append(index)
        elif entry.opcode == Opcode.METADATA:
            name = parse(Metadata.read, entry.body).name
            self._metadata.append(MetadataIndex(offset=offset, length=length, name=name))
        else:
            self._note(entry.opcode, entry.body)
        return b""

    def _add_chunk(self, entry: LogEntry, offset: int, length: int) -> bytes:
        indexes: dict[int, MessageIndex] = {}
        place = 0
        for opcode, body in inner_records(entry.content):
            channel_and_time = self._note(opcode, body)
            if channel_and_time is not None:
                channel_id, log_ns = channel_and_time
                index = indexes.setdefault(channel_id, MessageIndex(channel_id, []))
                index.records.append((log_ns, place))
            place += HEAD.size + len(body)
        builder = RecordBuilder()
        offsets: dict[int, int] = {}
        for channel_id, index in indexes.items():
            offsets[channel_id] = offset + length + builder.count
            index.write(builder)
        chunk = parse(Chunk.read, entry.body)
        data = _built(builder)
        self._chunks.append(
            ChunkIndex(
                chunk_length=length,
                chunk_start_offset=offset,
                compression=chunk.compression,
                compressed_size=len(chunk.data),
                message_end_time=chunk.message_end_time,
                message_index_length=len(data),
                message_index_offsets=offsets,
                message_start_time=chunk.message_start_time,
                uncompressed_size=chunk.uncompressed_size,
            )
        )
        return data

    def _note(self, opcode: int, body: bytes) -> tuple[int, int] | None:
        """Counts one record; channel and log time (ns) of a message."""
        if opcode == Opcode.MESSAGE:
            stored = message(body)
            first = self.message_count == 0
            self._first_ns = stored.log_ns if first else min(self._first_ns, stored.log_ns)
            self._last_ns = max(self._last_ns, stored.log_ns)
            self._counts[stored.channel_id] = self._counts.get(stored.channel_id, 0) + 1
            self.message_count += 1
            return stored.channel_id, stored.log_ns
        self.note(opcode, body)
        return None

    def ending(self, offset: int) -> bytes:
        """Returns everything from the end of the data section, at `offset`, to the end."""
        data_end = record_bytes(DataEnd(0))
        start = offset + len(data_end)
        body = RecordBuilder()
        for record in self._records():
            record.write(body)
        summary = _built(body)
        footer = Footer(summary_start=start, summary_offset_start=0, summary_crc=0)
        covered = summary + record_bytes(footer)[:-_SUMMARY_CRC_SIZE]
        footer.summary_crc = zlib.crc32(covered)
        return data_end + summary + record_bytes(footer) + MCAP0_MAGIC

    def _records(self) -> list[McapRecord]:
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self.channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=self.message_count,
            metadata_count=len(self._metadata),
            message_start_time=self._first_ns,
            message_end_time=self._last_ns,
            schema_count=len(self.schemas),
        )
        return [
            *self.schemas.values(),
            *self.channels.values(),
            statistics,
            *self._chunks,
            *self._attachments,
            *self._metadata,
        ]


def record_bytes(record: McapRecord) -> bytes:
    """Encodes a record as stored in a file."""
    builder = RecordBuilder()
    record.write(builder)
    return _built(builder)


def _built(builder: RecordBuilder) -> bytes:
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data
