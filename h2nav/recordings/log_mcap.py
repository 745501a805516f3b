"""Exports every message of an autopilot's log or of telemetry as channels of an MCAP file.

Numbers keep their values: what a log stores as a multiple of a fraction becomes a double, all else
a protobuf type that holds it exactly. A recording is read in pieces, so that its length does not
matter; within a piece the messages are in the order of their times.
"""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from h2nav import __version__
from h2nav.errors import BadInput
from h2nav.log.file import new_file
from h2nav.log.message_schema import field_units
from h2nav.log.progress import Progress
from h2nav.maths.units import MICROSECOND_NS
from h2nav.recordings.dataflash_rows import DataflashRows
from h2nav.recordings.dataflash_tables import Piece, dataflash_pieces, is_dataflash
from h2nav.recordings.frame_tables import fields_of
from h2nav.recordings.link_recording import Recording
from h2nav.recordings.log_clock import LATEST_US
from h2nav.recordings.log_rows import Log
from h2nav.recordings.mcap_recording import McapRecording
from h2nav.recordings.opening import beginning_of
from h2nav.recordings.protobuf_rows import RowMessages, Rows
from h2nav.recordings.receiver_tables import start_unix_s
from h2nav.recordings.recording import open_recording
from h2nav.recordings.row_tables import Table
from h2nav.recordings.ulog_rows import ULogRows
from h2nav.recordings.ulog_tables import is_ulog, ulog_pieces
from h2nav.recordings.viewer_rows import SCHEMAS, viewer_messages
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.frame_scan import FoundFrames, FrameScan

CHUNK_BYTES = 1 << 20
# A damaged or hostile file may define any number of messages.
MAX_CHANNELS = 2_000


class Part(NamedTuple):
    """The rows of one message in one piece of a recording."""

    topic: str  # of the channel
    schema: str  # its name
    t_ns: NDArray[np.int64]  # (N,) UNIX time, or since boot if the date is unknown
    places: NDArray[np.int64]  # (N,) in the recording; decide between equal times
    rows: Rows  # (N,) structured
    divisors: Mapping[str, float]  # of the columns stored as multiples of a fraction
    units: Mapping[str, str]  # of the columns, as the recording names them


class McapResult(NamedTuple):
    """The result of an export."""

    path: Path  # the file
    messages: dict[str, int]  # topic -> number of messages
    left_out: int  # messages of channels beyond `MAX_CHANNELS`


def export_mcap(
    path: Path, output: Path, progress: Progress = lambda done, total: None
) -> McapResult:
    """Writes all messages of a recording.

    Args:
        path: a telemetry log, raw MAVLink, a dataflash log or a ULog file.
        output: a new file.
        progress: called with the bytes done and the total.

    Raises:
        BadInput: another kind of file, it cannot be read, `output` exists, or nothing is in it.
    """
    pieces = _pieces(path, progress)
    with new_file(output) as stream:
        channels = _Channels(stream)
        for parts in pieces:
            channels.add(parts)
        channels.finish()
        if not channels.messages:
            raise BadInput(f"{path}: no message in it")
    return McapResult(output, dict(sorted(channels.messages.items())), channels.left_out)


class _Channels:
    """The file being written: a channel with its schema per topic."""

    def __init__(self, stream: Any) -> None:
        self.messages: dict[str, int] = {}
        self.left_out = 0
        self._codecs: dict[tuple[str, Any], tuple[int, RowMessages]] = {}
        self._drawn: dict[str, tuple[int, str]] = {}
        # The library writes offsets of empty groups too, which is an error in the file.
        self._writer = Writer(stream, CHUNK_BYTES, CompressionType.ZSTD, use_summary_offsets=False)
        self._writer.start("", f"h2nav {__version__}")

    def add(self, parts: Iterable[Part]) -> None:
        """Adds the messages of a piece in the order of their times."""
        piece = _Ordered()
        for part in parts:
            codec = self._codec(part) if len(part.rows) else None
            if codec is None:
                self.left_out += len(part.rows)
                continue
            channel, messages = codec
            self._count(part.topic, len(part.rows))
            piece.add(channel, part.t_ns, part.places, messages.encode(part.rows))
            shown = viewer_messages(part.schema, part.rows, part.divisors, part.t_ns)
            for topic, rows, drawn in shown:
                if self._is_drawn(topic, part.topic):
                    self._count(topic, len(drawn))
                    channel = self._drawn[topic][0]
                    piece.add(channel, part.t_ns[rows], part.places[rows], drawn)
        for channel, t_ns, message in piece.in_order():
            self._writer.add_message(channel, t_ns, message, t_ns)

    def finish(self) -> None:
        """Writes the index."""
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _count(self, topic: str, number: int) -> None:
        self.messages[topic] = self.messages.get(topic, 0) + number

    def _codec(self, part: Part) -> tuple[int, RowMessages] | None:
        """Channel and encoding of a message; None if there are too many channels."""
        key = (part.topic, part.rows.dtype)
        known = self._codecs.get(key)
        if known is None and len(self._codecs) < MAX_CHANNELS:
            messages = RowMessages(part.schema, part.rows.dtype, part.divisors)
            schema = self._writer.register_schema(messages.name, "protobuf", messages.schema)
            units = {
                f"unit of {field}": unit
                for field, column in messages.columns.items()
                if (unit := part.units.get(column))
            }
            channel = self._writer.register_channel(part.topic, "protobuf", schema, units)
            known = self._codecs[key] = (channel, messages)
        return known

    def _is_drawn(self, topic: str, source: str) -> bool:
        """Whether a channel for viewers shows this message: the first that could be shown."""
        if topic not in self._drawn:
            name, descriptors = SCHEMAS[topic]
            schema = self._writer.register_schema(name, "protobuf", descriptors)
            channel = self._writer.register_channel(topic, "protobuf", schema, {"shows": source})
            self._drawn[topic] = (channel, source)
        return self._drawn[topic][1] == source


class _Ordered:
    """The messages of a piece, to be put in the order of their times."""

    def __init__(self) -> None:
        self._messages: list[bytes] = []
        self._keys: list[NDArray[np.int64]] = []

    def add(
        self,
        channel: int,
        t_ns: NDArray[np.int64],
        places: NDArray[np.int64],
        messages: list[bytes],
    ) -> None:
        """Adds the messages of one channel."""
        self._messages += messages
        channels = np.full(len(messages), channel)
        self._keys.append(np.array([t_ns.clip(min=0), places, channels], np.int64))

    def in_order(self) -> Iterator[tuple[int, int, bytes]]:
        """Yields channel, time and message; at equal times in the order of the recording."""
        if not self._messages:
            return
        t_ns, places, channels = np.concatenate(self._keys, axis=1)
        order = np.lexsort((places, t_ns))
        yield from zip(
            channels[order].tolist(),
            t_ns[order].tolist(),
            map(self._messages.__getitem__, order.tolist()),
            strict=True,
        )


def _pieces(path: Path, progress: Progress) -> Iterator[list[Part]]:
    """The parts of any recording, piece by piece."""
    start = beginning_of(path)
    if is_dataflash(start):
        return _of_dataflash(path, progress)
    if is_ulog(start):
        return _of_ulog(path, progress)
    recording = open_recording(path)
    if isinstance(recording, McapRecording):
        raise BadInput(f"{path}: is an MCAP file; h2nav log decode adds its messages as channels")
    return _of_frames(recording, progress)


def _of_dataflash(path: Path, progress: Progress) -> Iterator[list[Part]]:
    """The log is read twice, because its date may come late."""
    units = _Units()
    logs = (DataflashRows(piece.tables) for piece in dataflash_pieces(path))
    offset_ns = _unix_offset_ns((log, start_unix_s(log)) for log in logs)
    for piece in dataflash_pieces(path, progress):
        units.learn(piece)
        yield list(_table_parts("dataflash", DataflashRows(piece.tables), offset_ns, units))


def _of_ulog(path: Path, progress: Progress) -> Iterator[list[Part]]:
    """Like `_of_dataflash`."""
    logs = (ULogRows(piece) for piece in ulog_pieces(path))
    offset_ns = _unix_offset_ns((log, start_unix_s(log)) for log in logs)
    for piece in ulog_pieces(path, progress):
        log = ULogRows(piece)
        yield [*_ulog_notes(log, offset_ns), *_table_parts("ulog", log, offset_ns, _Units())]


def _unix_offset_ns(dated: Iterable[tuple[Log, float | None]]) -> int:
    """UNIX time minus the time since boot, from the first log with a date; 0 without one."""
    for log, unix_s in dated:
        if unix_s is not None:
            # A float holds it to a quarter of a microsecond.
            return (round(unix_s * 1e6) - log.clock.start_us) * MICROSECOND_NS
    return 0


def _ulog_notes(log: ULogRows, offset_ns: int) -> Iterator[Part]:
    """Parameters and texts, which ULog stores outside the topics."""
    settings = log.file.parameters
    rows = _with_texts(
        ("name", [setting.name for setting in settings]),
        {"value": np.array([setting.value for setting in settings])},
    )
    places = np.array([setting.place for setting in settings], np.int64)
    t_ns = log.clock.at(places) * MICROSECOND_NS + offset_ns
    yield Part("/parameters", "ulog.parameters", t_ns, places, rows, {}, {})
    texts = log.file.texts
    t_us = np.array([min(text.t_us, LATEST_US) for text in texts], np.int64)
    rows = _with_texts(
        ("text", [text.text for text in texts]),
        {"timestamp": t_us, "level": np.array([text.level for text in texts], np.uint8)},
    )
    t_ns = t_us * MICROSECOND_NS + offset_ns
    yield Part("/logged_texts", "ulog.logged_texts", t_ns, np.arange(len(rows)), rows, {}, {})


def _with_texts(named: tuple[str, list[str]], columns: dict[str, NDArray[Any]]) -> Rows:
    """(N,) structured rows of numbers and one text."""
    name, texts = named
    encoded = np.array([text.encode() for text in texts] or [b""])
    row = [(name, encoded.dtype), *((column, values.dtype) for column, values in columns.items())]
    rows = np.empty(len(texts), row)
    rows[name] = encoded[: len(texts)]
    for column, values in columns.items():
        rows[column] = values
    return rows


def _table_parts(kind: str, log: Log, offset_ns: int, units: "_Units") -> Iterator[Part]:
    for name in sorted(log.tables.names):
        table = log.tables.find(name)
        if table is not None:
            yield _table_part(kind, log, table, offset_ns, units)


def _table_part(kind: str, log: Log, table: Table, offset_ns: int, units: "_Units") -> Part:
    name = table.name
    t_us = log.clock.at(table.places)
    times = log.times_of(table)
    if times is not None:
        t_us = np.where(log.clock.believes(table.places, times), times, t_us)
    return Part(
        f"/{name}",
        f"{kind}.{name.partition('/')[0]}",
        t_us * MICROSECOND_NS + offset_ns,
        table.places,
        table.stored_rows(),
        table.divisors,
        units.of(name),
    )


class _Units:
    """The units that a dataflash log names for its columns; ULog names none."""

    def __init__(self) -> None:
        self._labels: dict[str, str] = {}  # by the letter that stands for it
        self._columns: dict[str, dict[str, str]] = {}  # letters by message and column

    def learn(self, piece: Piece) -> None:
        """Takes what a piece of the log declares."""
        labels = piece.tables.find("UNIT", "Id", "Label")
        if labels is not None:
            letters = map(chr, labels.integers("Id").clip(0, 127).tolist())
            self._labels.update(zip(letters, labels.texts("Label"), strict=True))
        declared = piece.tables.find("FMTU", "FmtType", "UnitIds")
        if declared is not None:
            numbers = declared.integers("FmtType").tolist()
            for number, letters_of in zip(numbers, declared.texts("UnitIds"), strict=True):
                form = piece.formats.get(number)
                if form is not None:
                    self._columns[form.name] = dict(zip(form.columns, letters_of, strict=False))

    def of(self, name: str) -> dict[str, str]:
        """Column -> unit of a message."""
        letters = self._columns.get(name, {})
        return {column: self._labels.get(letter, "") for column, letter in letters.items()}


def _of_frames(recording: Recording, progress: Progress) -> Iterator[list[Part]]:
    """The parts of telemetry: one channel per sender and message of the dialect."""
    scan = FrameScan()
    for arrivals in recording.batches():
        progress(*recording.progress)
        yield list(_frame_parts(scan.frames_of(arrivals), recording.unix_offset_ns))


def _frame_parts(found: FoundFrames, offset_ns: int) -> Iterator[Part]:
    senders = found.senders()
    keys = found.headers.msg_ids << 16 | senders
    for key in np.unique(keys).tolist():
        msg_id, sender = key >> 16, key & 0xFFFF
        layout = LAYOUTS.get(msg_id)
        if layout is None:
            continue
        rows = np.flatnonzero(keys == key)
        yield Part(
            f"/mavlink/{sender >> 8}/{sender & 0xFF}/{layout.name}",
            f"mavlink.{layout.name}",
            found.t_ns[found.arrivals[rows]] + offset_ns,
            rows,
            fields_of(found, msg_id, rows),
            {},
            field_units(msg_id),
        )
