"""PX4's ULog files as tables of columns, parameters and texts.

A file is a chain of messages: two bytes of size, one of type. Formats name the fields of a topic
(fields may be topics again), subscriptions give a topic's instance a number, and data messages
carry it. As with dataflash logs, the chain is followed once and the columns are taken out
with numpy afterwards; tests hold them to those of pyulog, value for value.

A data message has the size defined by its format, so that damage is detected at once. The reader
then continues where three messages follow each other again.
"""

import math
import re
import struct
from array import array
from collections import Counter
from collections.abc import Callable, Iterator
from functools import partial
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput
from h2nav.log.progress import Progress
from h2nav.recordings.row_tables import LogTables, RowSource

MAGIC = b"ULog\x01\x12\x35"
FILE_HEADER = struct.Struct("<7sBQ")
HEADER_BYTES = 3
# Of a data message: size, type, number of the subscription.
DATA_HEADER_BYTES = 5
DATA_HEADER = struct.Struct("<HBH")
DATA, FORMAT, SUBSCRIPTION, PARAMETER, INFO, TEXT, TAGGED_TEXT, DROPOUT, FLAGS = b"DFAPILCOB"
# Least and largest size of a message after its header, by type; all other types are invalid. Texts
# and values are short: longer ones are damage.
SIZES: dict[int, tuple[int, int]] = {
    DATA: (3, 65_535),
    FORMAT: (3, 4_096),
    SUBSCRIPTION: (4, 512),
    PARAMETER: (6, 512),
    INFO: (2, 4_096),
    TEXT: (9, 4_096),
    TAGGED_TEXT: (11, 4_096),
    DROPOUT: (2, 2),
    FLAGS: (40, 512),
    ord("M"): (3, 4_096),
    ord("Q"): (7, 512),
    ord("R"): (2, 2),
    ord("S"): (8, 8),
}
TYPES = {
    "int8_t": "i1",
    "uint8_t": "u1",
    "int16_t": "<i2",
    "uint16_t": "<u2",
    "int32_t": "<i4",
    "uint32_t": "<u4",
    "int64_t": "<i8",
    "uint64_t": "<u8",
    "float": "<f4",
    "double": "<f8",
    "bool": "u1",
    "char": "S1",
}
FIELD = re.compile(r"(\w+)(?:\[(\d{1,5})\])? (\w+)")
PADDING = "_padding"
# Topics within topics: PX4 uses one level.
DEEPEST = 8
MAX_COLUMNS = 4_096
LARGEST_ROW = 65_533
APPENDED = 1  # flag: data were appended, at the given places
FLAGS_BODY = struct.Struct("<8x8s3Q")
PIECE_BYTES = 1 << 21
# After damage this many bytes are searched at a time, at first and at last.
MIN_SEARCH, MAX_SEARCH = 1 << 10, 1 << 18
NUMBERS = 1 << 16
Bytes = NDArray[np.uint8]


class ULogField(NamedTuple):
    """One field of a format: `length` is None if it is not an array."""

    kind: str
    length: int | None
    name: str


class ParameterSet(NamedTuple):
    """A parameter's value from a place in the file on."""

    place: int
    name: str
    value: float


class LoggedText(NamedTuple):
    """A text: `level` is that of syslog, 0 to 7."""

    t_us: int
    level: int
    text: str


class ULogFile(NamedTuple):
    """The contents of a file."""

    start_us: int  # beginning of the log
    tables: LogTables  # of the topics; the name of a table is that of `instance`
    parameters: list[ParameterSet]  # in the order in which they were set
    texts: list[LoggedText]  # of the autopilot
    info: dict[str, str | float]  # such as ``sys_name``; texts and numbers


class ULogLayout(NamedTuple):
    """Where the messages of a file are."""

    # of each subscription: topic, type of a data message with its header, (N,) places
    topics: list[tuple[str, "np.dtype[np.void]", NDArray[np.int64]]]
    others: NDArray[np.int64]  # places of all messages that are no data


def instance(topic: str, number: int) -> str:
    """Name of the table of a topic's instance."""
    return f"{topic}/{number}"


def is_ulog(start: bytes) -> bool:
    """Whether a file with this beginning is a ULog."""
    return start.startswith(MAGIC)


def read_ulog(path: Path) -> ULogFile:
    """Reads a file, as far as possible.

    Raises:
        BadInput: the file cannot be opened, or is not a ULog.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from error
    if not is_ulog(data) or len(data) < FILE_HEADER.size:
        raise BadInput(f"{path}: not a ULog file; expected one that begins with ULog and a header")
    return _Chain(data).follow()


def ulog_pieces(path: Path, progress: Progress = lambda done, total: None) -> Iterator[ULogFile]:
    """Reads a file piece by piece, so that its size does not matter.

    Args:
        progress: called with the bytes done and the total.

    Raises:
        BadInput: the file ends in its header.
        OSError: it cannot be opened.
    """
    with path.open("rb") as stream:
        data = mmap(stream.fileno(), 0, access=ACCESS_READ)
    if len(data) < FILE_HEADER.size:
        raise BadInput(f"{path}: no message in it")
    for done, piece in _Chain(data).pieces():
        yield piece
        progress(done, len(data))
        data.madvise(MADV_DONTNEED)  # what was read need not stay in memory


def ulog_layout(data: bytes | mmap) -> ULogLayout:
    """Where the messages of a file are, as far as they can be read."""
    chain = _Chain(data)
    chain.follow()
    return chain.layout()


class _Formats:
    """The formats of a file, which are not trusted: they are expanded on demand only."""

    def __init__(self) -> None:
        self._fields: dict[str, tuple[ULogField, ...]] = {}
        self._padding: dict[str, int] = {}
        self._sizes: dict[str, int | None] = {}
        self._rows: dict[str, np.dtype[np.void] | None] = {}

    def add(self, text: str) -> bool:
        """Adds ``name:type field;type[n] field;``; returns False if it is not valid."""
        name, _, rest = text.partition(":")
        matches = [FIELD.fullmatch(part) for part in rest.split(";") if part]
        fields = [
            ULogField(m[1], int(m[2]) if m[2] else None, m[3]) for m in matches if m is not None
        ]
        if not name or not fields or len(fields) != len(matches):
            return False
        padding = 0
        while fields and fields[-1].name.startswith(PADDING):
            padding += fields.pop().length or 1
        if name not in self._fields:
            self._fields[name], self._padding[name] = tuple(fields), padding
        return True

    def padding(self, name: str) -> int:
        """Bytes at the end of a row that some writers omit."""
        return self._padding[name]

    def size(self, name: str, depth: int = 0) -> int | None:
        """Size of a row without the padding at its end; None if the format is invalid."""
        if name in TYPES:
            return np.dtype(TYPES[name]).itemsize
        if name not in self._sizes and depth < DEEPEST:
            self._sizes[name] = None  # also during the computation: a topic inside itself
            self._sizes[name] = self._size(name, depth)
        return self._sizes.get(name)

    def _size(self, name: str, depth: int) -> int | None:
        total = 0
        for field in self._fields.get(name, ()):
            size = self._inner_size(field.kind, depth + 1)
            if size is None:
                return None
            total += size * (1 if field.length is None else field.length)
        return total if 0 < total <= LARGEST_ROW else None

    def _inner_size(self, name: str, depth: int = 0) -> int | None:
        """Size within another row: the padding at its end is written there."""
        size = self.size(name, depth)
        return None if size is None else size + self._padding.get(name, 0)

    def row(self, name: str) -> np.dtype[np.void] | None:
        """A data message with its header; None if the format has too many columns."""
        if name not in self._rows:
            self._rows[name] = self._row(name)
        return self._rows[name]

    def _row(self, name: str) -> np.dtype[np.void] | None:
        columns: list[tuple[str, str, int]] = []
        size = self.size(name)
        if size is None or not self._unfold(name, "", DATA_HEADER_BYTES, columns):
            return None
        names, types, offsets = zip(*columns, strict=True)
        if len(set(names)) != len(names):
            return None
        return np.dtype(
            {
                "names": names,
                "formats": types,
                "offsets": offsets,
                "itemsize": DATA_HEADER_BYTES + size,
            }
        )

    def _unfold(
        self, name: str, prefix: str, offset: int, columns: list[tuple[str, str, int]]
    ) -> bool:
        """Adds the columns of a topic; returns False as soon as there are too many."""
        for field in self._fields[name]:
            size = self._inner_size(field.kind) or 0
            if field.kind == "char" and field.length:
                columns.append((prefix + field.name, f"S{field.length}", offset))
                offset += field.length
                continue
            for number in range(1 if field.length is None else field.length):
                whole = prefix + field.name + ("" if field.length is None else f"[{number}]")
                if field.kind in TYPES:
                    columns.append((whole, TYPES[field.kind], offset))
                elif not self._unfold(field.kind, whole + ".", offset, columns):
                    return False
                offset += size
                if len(columns) > MAX_COLUMNS:
                    return False
        return True


class _Subscription(NamedTuple):
    """A number of data messages: its topic, and the places of the messages."""

    table: str
    topic: str
    places: "array[int]"


class _Chain:
    """Follows the messages of a file."""

    def __init__(self, data: bytes | mmap) -> None:
        self._data = data
        self._others = array("q")
        self._formats = _Formats()
        self._subscriptions: dict[int, _Subscription] = {}
        # By number: least and largest size, and what takes the place of a message.
        self._takers: dict[int, tuple[int, int, Callable[[int], None]]] = {}
        # By number of data, then by type of others.
        self._least = np.ones(NUMBERS + 256, np.int64)
        self._most = np.zeros(NUMBERS + 256, np.int64)
        for kind, sizes in SIZES.items():
            self._least[NUMBERS + kind], self._most[NUMBERS + kind] = sizes
        self._notes: Counter[str] = Counter()
        self._start_us = FILE_HEADER.unpack_from(data)[2]
        self._parameters: list[ParameterSet] = []
        self._texts: list[LoggedText] = []
        self._info: dict[str, str | float] = {}
        self._handlers = {
            FORMAT: self._on_format,
            SUBSCRIPTION: self._on_subscription,
            PARAMETER: self._on_parameter,
            INFO: self._on_info,
            TEXT: lambda _place, body: self._on_text(body, 1),
            TAGGED_TEXT: lambda _place, body: self._on_text(body, 3),
            DROPOUT: self._on_dropout,
        }

    def follow(self) -> ULogFile:
        """Follows the whole file."""
        for _ in self._stretches():
            pass
        return self._followed()

    def pieces(self) -> Iterator[tuple[int, ULogFile]]:
        """Yields successive pieces, with the place where each ends."""
        for place in self._stretches():
            topics = self._subscriptions.values()
            # What is set before the first data has their time.
            if place < len(self._data) and not any(one.places for one in topics):
                continue
            yield place, self._followed()
            self._parameters, self._texts, self._others = [], [], array("q")
            for one in topics:
                del one.places[:]

    def _followed(self) -> ULogFile:
        """The contents since the last piece."""
        tables = LogTables(self._sources(), dict(self._notes))
        return ULogFile(self._start_us, tables, self._parameters, self._texts, self._info)

    def _stretches(self) -> Iterator[int]:
        """Follows the file; yields the places reached, the end last."""
        place = FILE_HEADER.size
        # Appended data begin at places of their own, whatever was cut off before them.
        for end in (*self._appended(), len(self._data)):
            yield from self._stretch(place, end)
            place = end
        yield place

    def layout(self) -> ULogLayout:
        """Where the messages are that were followed."""
        topics = []
        for topic in self._subscriptions.values():
            row = self._formats.row(topic.topic)
            if row is not None and topic.places:
                topics.append((topic.topic, row, np.array(topic.places, np.int64)))
        return ULogLayout(topics, np.array(self._others, np.int64))

    def _appended(self) -> list[int]:
        """The places of appended data; the flags, if any, are the first message."""
        data, place = self._data, FILE_HEADER.size
        body = data[place + HEADER_BYTES : place + HEADER_BYTES + FLAGS_BODY.size]
        if len(body) < FLAGS_BODY.size or data[place + 2] != FLAGS:
            return []
        flags, *places = FLAGS_BODY.unpack(body)
        if flags[0] & ~APPENDED or any(flags[1:]):
            self._notes["the file asks for a newer reader"] += 1
        if not flags[0] & APPENDED:
            return []
        return [found for found in sorted(places) if place < found < len(data)]

    def _stretch(self, place: int, end: int) -> Iterator[int]:
        """Follows the chain between two places; yields some that are reached."""
        data, handlers = self._data, self._handlers
        last, stop = end - HEADER_BYTES, place + PIECE_BYTES
        while place <= last:
            place = self._data_messages(place, end, stop)
            if place > last:
                break
            if place >= stop:
                yield place
                stop = place + PIECE_BYTES
                continue
            size, kind = data[place] | data[place + 1] << 8, data[place + 2]
            following = place + HEADER_BYTES + size
            if kind != DATA and following <= end and self._may_be_message(place):
                self._others.append(place)
                handler = handlers.get(kind)
                if handler is not None:
                    handler(place, data[place + HEADER_BYTES : following])
                place = following
                continue
            found = self._next_message(place, end)
            is_cut_off = found == end and following > end and self._may_be_message(place)
            what = "a message is cut off at the end" if is_cut_off else "bytes that are no message"
            self._notes[what] += 1 if is_cut_off else found - place
            place = found
        if place < end:
            self._notes["bytes that are no message"] += end - place

    def _data_messages(self, place: int, end: int, stop: int) -> int:
        """Follows data messages, of which a file has by far the most; returns where they end.

        Args:
            stop: no message from here on is followed.
        """
        data, takers, header = self._data, self._takers, DATA_HEADER.unpack_from
        last = min(end - DATA_HEADER_BYTES, stop - 1)
        while place <= last:
            size, kind, number = header(data, place)
            following = place + HEADER_BYTES + size
            if kind != DATA or number not in takers or following > end:
                break
            least, most, take = takers[number]
            if not least <= size <= most:
                break
            take(place)
            place = following
        return place

    def _may_be_message(self, place: int) -> bool:
        data = self._data
        size, kind = data[place] | data[place + 1] << 8, data[place + 2]
        least, most = SIZES.get(kind, (1, 0))
        return least <= size <= most

    def _next_message(self, place: int, end: int) -> int:
        """The next place where a message begins that two others follow, or the end."""
        place += 1
        step = MIN_SEARCH
        while place < end:
            # Followers of the last ones may lie beyond the block; the next block has them first.
            block = np.frombuffer(self._data, np.uint8, min(2 * step, end - place), place)
            begins = self._beginnings(block, is_last=place + len(block) == end)[:step]
            if begins.any():
                return place + int(begins.argmax())
            place += step
            step = min(4 * step, MAX_SEARCH)
        return end

    def _beginnings(self, block: Bytes, *, is_last: bool) -> NDArray[np.bool_]:
        """The places in a block where messages begin that two others follow."""
        count = len(block) - DATA_HEADER_BYTES + 1
        if count <= 0:
            return np.zeros(0, np.bool_)
        wide = block.astype(np.int64)
        size, kind = wide[:count] | wide[1 : count + 1] << 8, wide[2 : count + 2]
        number = wide[3 : count + 3] | wide[4 : count + 4] << 8
        least, most = self._least, self._most
        is_data = kind == DATA
        place = np.where(is_data, number, NUMBERS + kind)
        good = (size >= least[place]) & (size <= most[place])
        following = np.arange(count) + HEADER_BYTES + size
        # The end of the file counts as a follower.
        at_end = following >= len(block) - DATA_HEADER_BYTES + 1
        ends_well = at_end & (following == len(block)) & is_last
        following = np.where(at_end, 0, following)
        for _ in range(2):
            good = good & (ends_well | (~at_end & good[following]))
        return good

    # --- messages that are no data --------------------------------------------------------------

    def _on_format(self, _place: int, body: bytes) -> None:
        if not self._formats.add(body.decode("utf-8", "replace")):
            self._notes["a topic is defined with a contradiction"] += 1

    def _on_subscription(self, _place: int, body: bytes) -> None:
        number, topic = body[1] | body[2] << 8, body[3:].decode("utf-8", "replace")
        size = self._formats.size(topic)
        if size is None or number in self._subscriptions:
            self._notes["a subscription makes no sense"] += 1
            return
        padding = self._formats.padding(topic)
        least, most, places = size + 2, size + padding + 2, array("q")
        self._subscriptions[number] = _Subscription(instance(topic, body[0]), topic, places)
        self._takers[number] = (least, most, places.append)
        self._least[number], self._most[number] = least, most

    def _on_parameter(self, place: int, body: bytes) -> None:
        name, value = _keyed(body)
        if isinstance(value, float):
            self._parameters.append(ParameterSet(place, name, value))

    def _on_info(self, _place: int, body: bytes) -> None:
        name, value = _keyed(body)
        if value is not None:
            self._info.setdefault(name, value)

    def _on_text(self, body: bytes, start: int) -> None:
        """A text; its level is a digit."""
        t_us = int.from_bytes(body[start : start + 8], "little")
        text = body[start + 8 :].decode("utf-8", "replace").rstrip("\0")
        self._texts.append(LoggedText(t_us, (body[0] - ord("0")) & 7, text))

    def _on_dropout(self, _place: int, _body: bytes) -> None:
        self._notes["dropouts of the autopilot's logger"] += 1

    def _sources(self) -> dict[str, RowSource]:
        """The sources of the tables of all topics present; a topic may be subscribed to again."""
        found: dict[str, list[_Subscription]] = {}
        for topic in self._subscriptions.values():
            if topic.places:
                found.setdefault(topic.table, []).append(topic)
        return {
            table: RowSource(
                self._data,
                np.sort(np.concatenate([np.array(one.places, np.int64) for one in topics])),
                partial(self._formats.row, topics[0].topic),
                {},
            )
            for table, topics in found.items()
        }


def _keyed(body: bytes) -> tuple[str, str | float | None]:
    """Name and value of an information or a parameter; None if it is not used here."""
    key = body[1 : 1 + body[0]].decode("utf-8", "replace")
    kind, _, name = key.partition(" ")
    value = body[1 + body[0] :]
    if kind.startswith("char["):
        return name, value.decode("utf-8", "replace").rstrip("\0")
    form = TYPES.get(kind)
    if form is None or np.dtype(form).itemsize != len(value) or kind == "char":
        return name, None
    number = float(np.frombuffer(value, form)[0])
    return name, number if math.isfinite(number) else None
