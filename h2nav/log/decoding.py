"""Copies a log with the autopilot's common messages added as channels of their own."""

import zlib
from pathlib import Path
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from h2nav.errors import BadInput, TaskFailed
from h2nav.log.autopilot_channels import PREFIX, AutopilotDecoder
from h2nav.log.copying import LogCopy, Recovery, restrict
from h2nav.log.file import CHUNK_BYTES, RAW_ENCODING, new_file
from h2nav.log.progress import Progress
from h2nav.log.reader import Directory, LogEntry, LogScan, records_of
from h2nav.log.recorder import RECEIVED_TOPIC
from h2nav.log.records import HEAD, message
from h2nav.log.schema import RecordFormat
from h2nav.log.summary import record_bytes
from h2nav.log.survey import require_mcap

# Other writers number schemas and channels upwards from 0 or 1; these count down from here.
_HIGHEST_ID = 0xFFFF


class DecodeResult(NamedTuple):
    """The result of decoding."""

    decoded: dict[str, int]  # topic -> number of messages
    copied: Recovery  # the result for the log's own records


def decode_log(
    path: Path, output: Path, progress: Progress = lambda done, total: None
) -> DecodeResult:
    """Writes the log with the decoded channels to `output`.

    Args:
        path: an MCAP log, closed, cut off or damaged; it is only read.
        output: a new file.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: not a log, `output` exists, or the log already has decoded channels.
        TaskFailed: the log holds no messages of an autopilot.
        OSError: the output could not be written; none is left.
    """
    require_mcap(path)
    addition = _DecodedChunks(path)
    with new_file(output) as stream, path.open("rb") as source:
        restrict(stream)
        scan = LogScan(source)
        copy = LogCopy(path, stream, "h2nav log decode", addition)
        copied = copy.run(scan, lambda: progress(scan.position, scan.size))
        if not addition.counts:
            raise TaskFailed(f"{path}: no messages of an autopilot to decode")
    return DecodeResult(dict(sorted(addition.counts.items())), copied)


class _DecodedChunks:
    """Builds chunks of decoded messages; implements `Addition`."""

    def __init__(self, path: Path) -> None:
        self.counts: dict[str, int] = {}  # topic -> number of messages
        self._path = path
        self._decoder = AutopilotDecoder()
        self._channels: dict[str, int] = {}
        self._content = bytearray()
        self._times: list[int] = []

    def after(self, entry: LogEntry, known: Directory) -> LogEntry | None:
        """Returns a chunk of decoded messages, once it is large enough."""
        defines = False
        for opcode, body in records_of(entry):
            if opcode == Opcode.MESSAGE:
                stored = message(body)
                channel = known.channel(stored.channel_id)
                if channel is not None and self._is_received(channel):
                    self._decode(channel.topic, stored.log_ns, stored.data)
            defines |= opcode in (Opcode.SCHEMA, Opcode.CHANNEL)
        if defines:
            self._refuse_clash(known)
        return self.rest() if len(self._content) >= CHUNK_BYTES else None

    def rest(self) -> LogEntry | None:
        """Returns a chunk of the remaining messages."""
        if not self._times:
            return None
        content = bytes(self._content)
        data = record_bytes(
            Chunk(
                compression="zstd",
                data=zstandard.compress(content),
                message_end_time=max(self._times),
                message_start_time=min(self._times),
                uncompressed_crc=zlib.crc32(content),
                uncompressed_size=len(content),
            )
        )
        self._content.clear()
        self._times.clear()
        return LogEntry(0, Opcode.CHUNK, len(data), data[HEAD.size :], content)

    @staticmethod
    def _is_received(channel: Channel) -> bool:
        return channel.message_encoding == RAW_ENCODING and channel.topic.startswith(RECEIVED_TOPIC)

    def _decode(self, link: str, log_ns: int, data: bytes) -> None:
        for topic, form, fields in self._decoder.feed(link, data):
            if topic not in self._channels:
                self._channels[topic] = self._new_channel(topic, form)
                self.counts[topic] = 0
            self.counts[topic] += 1
            self._times.append(log_ns)
            self._content += record_bytes(
                Message(
                    channel_id=self._channels[topic],
                    sequence=self.counts[topic] & 0xFFFFFFFF,
                    log_time=log_ns,
                    publish_time=log_ns,
                    data=form.encode(fields),
                )
            )

    def _new_channel(self, topic: str, form: RecordFormat) -> int:
        number = _HIGHEST_ID - len(self._channels)
        schema = Schema(id=number, name=form.name, encoding="jsonschema", data=form.schema)
        channel = Channel(
            id=number, topic=topic, message_encoding="json", metadata={}, schema_id=number
        )
        self._content += record_bytes(schema) + record_bytes(channel)
        return number

    def _refuse_clash(self, known: Directory) -> None:
        """Raises BadInput if the log has decoded channels, or numbers as high as these."""
        lowest = _HIGHEST_ID - len(self._channels)
        for channel in known.channels.values():
            if channel.topic.startswith(f"{PREFIX}/"):
                raise BadInput(f"{self._path}: has {channel.topic}, so it is already decoded")
        if max([0, *known.channels, *known.schemas]) >= lowest:
            raise BadInput(f"{self._path}: its channels leave no numbers for decoded ones")
