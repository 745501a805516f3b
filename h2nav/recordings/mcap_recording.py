"""A log of h2nav as received bytes with their times, whatever its state."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
from mcap.opcode import Opcode
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Metadata

from h2nav.log.file import RAW_ENCODING, Attachment
from h2nav.log.reader import Directory, LogScan, records_of
from h2nav.log.recorder import RECEIVED_TOPIC
from h2nav.log.records import StoredMessage, message, parse
from h2nav.recordings.link_recording import Recording, nonzero
from h2nav.wire.arrivals import Arrivals, gathered

# Times of a hostile file are brought within 2^62 ns, which is the year 2116.
LATEST_NS = 1 << 62


class McapRecording(Recording):
    """A log of h2nav, closed or cut off, intact or damaged; read front to back only."""

    kind = "mcap"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._read_outline()
        about = self.metadata.get("recording", {})
        with contextlib.suppress(ValueError):
            offset_ns = int(about.get("unix_offset_ns", "0"))
            self.unix_offset_ns = offset_ns if abs(offset_ns) <= LATEST_NS else 0

    def batches(self) -> Iterator[Arrivals]:
        """Yields each received piece with its exact monotonic time, in order of arrival."""
        return gathered(self.received())

    def received(self) -> Iterator[tuple[int, bytes]]:
        """Yields single arrivals; our own recorder's times never decrease, those of others may."""
        newest_ns = 0
        for topic, stored in self._messages(RAW_ENCODING):
            if topic.startswith(RECEIVED_TOPIC):
                newest_ns = max(newest_ns, min(stored.log_ns, LATEST_NS))
                yield newest_ns - self.unix_offset_ns, stored.data

    def records(self, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yields the records of `topic` as written; NaN reads as None."""
        for found, stored in self._messages("json"):
            if found == topic:
                with contextlib.suppress(orjson.JSONDecodeError):
                    fields = orjson.loads(stored.data)
                    if isinstance(fields, dict):
                        yield stored.log_ns, fields

    def _read_outline(self) -> None:
        """Reads attachments and metadata, wherever they are in the file."""
        with self.path.open("rb") as stream:
            for entry in LogScan(stream, outline=True).entries():
                if entry.opcode == Opcode.ATTACHMENT:
                    found = parse(AttachmentRecord.read, entry.body)
                    attachment = Attachment(found.name, found.media_type, found.data)
                    self.attachments[found.name] = attachment
                elif entry.opcode == Opcode.METADATA:
                    texts = parse(Metadata.read, entry.body)
                    self.metadata[texts.name] = texts.metadata

    def _messages(self, encoding: str) -> Iterator[tuple[str, StoredMessage]]:
        """Yields topic and message of every channel of one encoding."""
        directory = Directory(self.path)
        with self.path.open("rb") as stream:
            scan = LogScan(stream)
            for entry in scan.entries():
                self.progress = (scan.position, scan.size)
                for opcode, body in records_of(entry):
                    if opcode != Opcode.MESSAGE:
                        directory.note(opcode, body)
                        continue
                    stored = message(body)
                    channel = directory.channel(stored.channel_id)
                    if channel is not None and channel.message_encoding == encoding:
                        yield channel.topic, stored
            self.notes = nonzero(
                damaged_records=scan.damaged_records, skipped_bytes=scan.skipped_bytes
            )
