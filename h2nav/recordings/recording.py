"""Any recording as received bytes with their times: telemetry log, raw bytes, MCAP of h2nav."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.records import Attachment as AttachmentRecord
from mcap.records import Metadata

from h2nav.errors import BadInput
from h2nav.log.file import RAW_ENCODING, Attachment
from h2nav.log.reader import Directory, LogScan, is_mcap, records_of
from h2nav.log.recorder import RECEIVED_TOPIC
from h2nav.log.records import StoredMessage, message, parse
from h2nav.wire.arrivals import BATCH_BYTES, Arrivals, gathered
from h2nav.wire.deframer import Deframer
from h2nav.wire.tlog import TlogReader, looks_like_tlog

NS_PER_S = 1_000_000_000
SYNTHETIC_BYTES_S = 11_520  # a serial line at 115,200 baud, the usual source of raw captures
SYNTHETIC_CHUNK = 64
_PROBE_BYTES = 1 << 18


class Recording:
    """A recording that can be read any number of times, each time front to back.

    Attributes:
        path: the file.
        kind: ``tlog``, ``bytes`` or ``mcap``.
        unix_offset_ns: UNIX time minus the `t_ns` of `received`.
        times_are_synthetic: the file holds no arrival times; they follow from the byte count.
        attachments: name -> attachment (MCAP).
        metadata: name -> texts (MCAP).
        notes: what was damaged or skipped so far in this pass: reason -> count.
        progress: bytes read in this pass, and bytes of the file.
    """

    kind = ""
    times_are_synthetic = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unix_offset_ns = 0
        self.attachments: dict[str, Attachment] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes: dict[str, int] = {}
        self.progress = (0, path.stat().st_size)

    @property
    def unix_start_ns(self) -> int:
        """UNIX time of the first arrival; 0 without arrivals or times."""
        if self.times_are_synthetic:
            return 0
        # A separate pass, so that progress and notes of a running one are not disturbed.
        first = next(type(self)(self.path).received(), None)
        return first[0] + self.unix_offset_ns if first else 0

    def batches(self) -> Iterator[Arrivals]:
        """Yields all arrivals of all links in order, many at a time."""
        raise NotImplementedError

    def received(self) -> Iterator[tuple[int, bytes]]:
        """Yields single arrivals: host monotonic time (ns, never decreasing) and bytes."""
        for batch in self.batches():
            yield from batch.pieces()

    def records(self, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yields the JSON records of a topic (MCAP): (unix_ns, fields); none for other kinds."""
        return iter(())


class TlogRecording(Recording):
    """Time stamps and frames; the frames may come from several senders."""

    kind = "tlog"

    def batches(self) -> Iterator[Arrivals]:
        """One arrival per frame; `t_ns` is the recorder's UNIX time."""
        with self.path.open("rb") as stream:
            reader = TlogReader(stream)
            for batch in reader.batches():
                self.progress = (reader.position, self.progress[1])
                yield batch
            self.notes = _nonzero(
                damaged_bytes=reader.damaged_bytes,
                corrected_times=reader.corrected_times,
                clock_steps_back=reader.clock_steps_back,
            )


class BytesRecording(Recording):
    """The bytes of a link and nothing else, such as a capture of a serial line.

    They are returned in pieces of `SYNTHETIC_CHUNK` at `SYNTHETIC_BYTES_S`, from time 0 on. Only
    the autopilot's time stamps inside the messages are real.
    """

    kind = "bytes"
    times_are_synthetic = True

    def batches(self) -> Iterator[Arrivals]:
        """Yields pieces of equal size at a constant rate."""
        position = 0
        with self.path.open("rb") as stream:
            while data := stream.read(BATCH_BYTES):
                starts = np.arange(0, len(data), SYNTHETIC_CHUNK)
                ends = np.minimum(starts + SYNTHETIC_CHUNK, len(data))
                t_ns = (position + ends) * NS_PER_S // SYNTHETIC_BYTES_S
                position += len(data)
                self.progress = (position, self.progress[1])
                yield Arrivals(data, starts, ends, t_ns, framed=False)


class McapRecording(Recording):
    """A log of h2nav, closed or cut off, intact or damaged; read front to back only."""

    kind = "mcap"

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        self._read_outline()
        about = self.metadata.get("recording", {})
        with contextlib.suppress(ValueError):
            self.unix_offset_ns = int(about.get("unix_offset_ns", "0"))

    def batches(self) -> Iterator[Arrivals]:
        """Yields each received piece with its exact monotonic time, in order of arrival."""
        return gathered(self.received())

    def received(self) -> Iterator[tuple[int, bytes]]:
        """Yields single arrivals."""
        for topic, _, stored in self._messages(RAW_ENCODING):
            if topic.startswith(RECEIVED_TOPIC):
                yield stored.log_ns - self.unix_offset_ns, stored.data

    def records(self, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yields the records of `topic` as written; NaN reads as None."""
        for found, encoding, stored in self._messages("json"):
            if found == topic and encoding == "json":
                yield stored.log_ns, orjson.loads(stored.data)

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

    def _messages(self, wanted: str) -> Iterator[tuple[str, str, StoredMessage]]:
        """Yields topic, encoding and message of every channel of the encoding `wanted`."""
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
                    if channel is not None and channel.message_encoding == wanted:
                        yield channel.topic, channel.message_encoding, stored
            self.notes = _nonzero(
                damaged_records=scan.damaged_records, skipped_bytes=scan.skipped_bytes
            )


def open_recording(path: Path | str) -> Recording:
    """Opens a recording; its content decides the kind.

    Raises:
        BadInput: there is no such file, it cannot be read, or it holds no MAVLink.
    """
    path = Path(path)
    try:
        with path.open("rb") as stream:
            start = stream.read(_PROBE_BYTES)
    except OSError as error:
        raise BadInput(f"{path}: {error.strerror}; expected a recording") from error
    if start and is_mcap(path):
        return McapRecording(path)
    if looks_like_tlog(start[:4096]):
        return TlogRecording(path)
    deframer = Deframer()
    if deframer.feed(start) or deframer.flush():
        return BytesRecording(path)
    raise BadInput(
        f"{path}: not a recording; expected a telemetry log (.tlog), raw MAVLink bytes, MCAP, "
        "or an autopilot's own log (.bin, .log, .ulg)"
    )


def _nonzero(**counts: int) -> dict[str, int]:
    return {reason: count for reason, count in counts.items() if count}
