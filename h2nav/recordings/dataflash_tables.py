"""ArduPilot's dataflash logs, binary (.bin) and as text (.log), as tables of columns.

A binary log is a chain of records: a header of two bytes, a byte for the type, and the fields, in a
length that an earlier FMT record defined. This reader follows the chain once, notes where each
type's records start, and reads columns with numpy on demand. It exists beside pymavlink's, which
makes an object per record, because fleets have many logs; tests compare the two value for value.

Damage costs only the damaged bytes: the reader continues where the next record begins with another
directly behind it, and counts the bytes skipped.
"""

import math
import re
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput
from h2nav.log.progress import Progress
from h2nav.recordings.row_tables import LogTables, RowSource, Table

HEAD = b"\xa3\x95"
HEAD_1, HEAD_2 = HEAD
HEADER_BYTES = 3
FMT_TYPE = 128
FMT_BYTES = 89
# Each binary log defines FMT itself first; so does a text, behind lines of whoever downloaded it.
FMT_OF_FMT = HEAD + bytes((FMT_TYPE, FMT_TYPE, FMT_BYTES)) + b"FMT\0"
TEXT_START = re.compile(rb"(?:[\t\r\n\x20-\xff]*\n)?\s*FMT, *\d+, *\d+, *\w+, *\w+,")
# Format letter: numpy's type, divisor.
FIELDS: dict[str, tuple[str, float | None]] = {
    "a": ("(32,)<i2", None),
    "b": ("i1", None),
    "B": ("u1", None),
    "g": ("<f2", None),
    "h": ("<i2", None),
    "H": ("<u2", None),
    "i": ("<i4", None),
    "I": ("<u4", None),
    "f": ("<f4", None),
    "d": ("<f8", None),
    "n": ("S4", None),
    "N": ("S16", None),
    "Z": ("S64", None),
    "c": ("<i2", 100.0),
    "C": ("<u2", 100.0),
    "e": ("<i4", 100.0),
    "E": ("<u4", 100.0),
    "L": ("<i4", 1e7),
    "M": ("u1", None),
    "q": ("<i8", None),
    "Q": ("<u8", None),
}
# In a text, a flight mode may be written as its name.
WORDS = frozenset("nNZM")
WHOLE_NUMBERS = frozenset("bBhHiIqQ")


PROBE_BYTES = 4096
MAX_PREAMBLE = 64
# A definition that is believed without another one.
MIN_COLUMNS = 3
# Bytes that are followed together, or one by one where that fails.
STRETCH, SINGLY = 1 << 20, 1 << 9
# Of a log that is read piece by piece.
PIECE_BYTES = 1 << 21
LARGEST = 2.0**62


class RowFormat(NamedTuple):
    """The definition of a type by a FMT record."""

    name: str  # of the message
    length: int  # bytes of a record, with its head
    letters: str  # one per column
    columns: tuple[str, ...]  # their names

    def row(self) -> np.dtype[np.void] | None:
        """A record with its head; None if letters, names and length contradict each other."""
        if not self.is_sound:
            return None
        types = [np.dtype(FIELDS[letter][0]) for letter in self.letters]
        offsets = np.cumsum([HEADER_BYTES, *(kind.itemsize for kind in types)]).tolist()
        if offsets.pop() != self.length:
            return None
        return np.dtype(
            {
                "names": self.columns,
                "formats": types,
                "offsets": offsets,
                "itemsize": self.length,
            }
        )

    @property
    def is_sound(self) -> bool:
        """Whether every column has a unique name and a known letter."""
        are_known = all(letter in FIELDS for letter in self.letters)
        return are_known and 0 < len(self.letters) == len(set(self.columns)) == len(self.columns)

    @property
    def divisors(self) -> dict[str, float]:
        """Divisors of the columns stored as multiples of a fraction."""
        pairs = zip(self.columns, self.letters, strict=True)
        return {name: d for name, letter in pairs if (d := FIELDS[letter][1]) is not None}


class Piece(NamedTuple):
    """A part of a log."""

    tables: LogTables  # of the messages in it
    formats: Mapping[int, RowFormat]  # of all types defined so far, by number


def is_dataflash(start: bytes) -> bool:
    """Whether a file with this beginning is a dataflash log, binary or text.

    Args:
        start: some kilobytes from its beginning.
    """
    return is_binary(start) or TEXT_START.match(start) is not None


def is_binary(start: bytes) -> bool:
    """Whether a binary log begins so: with the definition of definitions, or, cut there, any."""
    if FMT_OF_FMT in start:
        return True
    definition = HEAD + bytes((FMT_TYPE,))
    place = start.find(definition)
    while place >= 0:
        form = _binary_format(start[place : place + FMT_BYTES])
        # No chance makes its letters, its names and its length agree.
        if form is not None and len(form.letters) >= MIN_COLUMNS and form.row() is not None:
            return True
        place = start.find(definition, place + 1)
    return False


def _binary_format(record: bytes) -> RowFormat | None:
    """What a record FMT defines; None of one that is cut off."""
    if len(record) < FMT_BYTES:
        return None
    name, letters, names = (
        record[first:last].split(b"\0", 1)[0].decode("latin-1")
        for first, last in ((5, 9), (9, 25), (25, 89))
    )
    return RowFormat(name, record[4], letters, tuple(names.split(",")))


def read_dataflash(path: Path) -> LogTables:
    """Reads the tables of a log, as far as possible.

    Raises:
        BadInput: the file cannot be opened.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise BadInput(f"{path}: cannot be read: {error.strerror}") from error
    if not is_binary(data[:PROBE_BYTES]) and TEXT_START.match(data[:PROBE_BYTES]):
        return _text_tables(data)
    return _Chain(data).follow()


def dataflash_pieces(path: Path, progress: Progress = lambda done, total: None) -> Iterator[Piece]:
    """Reads the tables of a log piece by piece, so that its size does not matter.

    Args:
        progress: called with the bytes done and the total.

    Raises:
        BadInput: the file cannot be opened.
    """
    with path.open("rb") as stream, mmap(stream.fileno(), 0, access=ACCESS_READ) as data:
        start = data[:PROBE_BYTES]
        if not is_binary(start) and TEXT_START.match(start):
            yield Piece(_text_tables(data[:]), {})
            return
        for done, piece in _Chain(data).pieces():
            yield piece
            progress(done, len(data))
            data.madvise(MADV_DONTNEED)  # what was read need not stay in memory


class _Chain:
    """Follows the records of a binary log."""

    def __init__(self, data: bytes | mmap) -> None:
        self._data = data
        self._lengths = [0] * 256
        self._lengths[FMT_TYPE] = FMT_BYTES
        self._declared: dict[int, bytes] = {}
        self._formats: dict[int, RowFormat] = {}
        self._places = [array("q") for _ in range(256)]
        self._notes: Counter[str] = Counter()

    def follow(self) -> LogTables:
        """The tables."""
        for _ in self._stretches():
            pass
        return LogTables(self._sources(), dict(self._notes))

    def pieces(self) -> Iterator[tuple[int, Piece]]:
        """Yields successive pieces, with the place where each ends."""
        begun = 0
        for place in self._stretches():
            if place - begun >= PIECE_BYTES or place >= len(self._data):
                yield place, Piece(LogTables(self._sources(), {}), self._formats)
                self._places = [array("q") for _ in range(256)]
                begun = place

    def _stretches(self) -> Iterator[int]:
        """Follows the log; yields the places reached, the end last."""
        place, size, singly = 0, len(self._data), SINGLY
        while place + HEADER_BYTES <= size:
            before, place = place, self._follow_stretch(place)
            # Stretches that lead nowhere are tried less and less often.
            singly = SINGLY if place - before >= STRETCH // 16 else min(2 * singly, STRETCH)
            place = self._follow_singly(place, place + singly)
            if place + HEADER_BYTES <= size:
                yield place
        if place < size:
            self._notes["bytes that are no record"] += size - place
        yield size

    def _follow_stretch(self, place: int) -> int:
        """Follows many records at once while their types are known; returns where it ended.

        Every head in a stretch may begin a record. Usually the next head is the end of the record,
        and the few heads inside a record are skipped.
        """
        data = np.frombuffer(self._data, np.uint8, min(STRETCH, len(self._data) - place), place)
        heads = np.flatnonzero((data[:-2] == HEAD_1) & (data[1:-1] == HEAD_2))
        if not len(heads) or heads[0] != 0:
            return place
        kinds = data[heads + 2]
        lengths = self._known_lengths()[kinds]
        ends = heads + lengths
        stops = np.flatnonzero((ends[:-1] != heads[1:]) | (lengths[:-1] == 0)).tolist()
        followed, first = [], 0
        for stop in [*stops, len(heads) - 1]:
            if stop < first:
                continue
            whole = lengths[stop] > 0 and ends[stop] <= len(data)
            followed.append(np.arange(first, stop + whole))
            if not whole:
                first = stop
                break
            first = int(np.searchsorted(heads, ends[stop]))
            if first == len(heads) or heads[first] != ends[stop]:
                break
        taken = np.concatenate(followed)
        if not len(taken):
            return place
        for kind in np.unique(kinds[taken]).tolist():
            self._places[kind].frombytes((heads[taken[kinds[taken] == kind]] + place).tobytes())
        return place + int(ends[taken[-1]])

    def _known_lengths(self) -> NDArray[np.int64]:
        """Length by type; 0 for definitions, which are handled one by one."""
        lengths = np.array(self._lengths, np.int64)
        lengths[FMT_TYPE] = 0
        return lengths

    def _follow_singly(self, place: int, end: int) -> int:
        """Follows records one by one to a place: definitions, newly defined types, damage."""
        data, lengths = self._data, self._lengths
        size = len(data)
        end = min(size - HEADER_BYTES, end)
        while place <= end:
            kind = data[place + 2]
            length = lengths[kind]
            if data[place] == HEAD_1 and data[place + 1] == HEAD_2 and length:
                if place + length > size:
                    self._notes["a record is cut off at the end"] += 1
                    return size
                if kind == FMT_TYPE:
                    self._tells_format(data[place : place + FMT_BYTES])
                self._places[kind].append(place)
                place += length
            else:
                place = self._next_record(place)
        return place

    def _tells_format(self, record: bytes) -> None:
        """Takes the first definition of each type, so that many cost no more than their bytes."""
        form = _binary_format(record)
        if form is None or record[3] == FMT_TYPE:
            return
        kind, length = record[3], record[4]
        declared = self._declared.setdefault(kind, record)
        if declared != record:
            self._notes["a message type is defined twice, differently"] += 1
            return
        if kind in self._formats:
            return
        self._formats[kind] = form
        if length > HEADER_BYTES:
            self._lengths[kind] = length
        if form.row() is None:
            self._notes["a message type is defined with a contradiction"] += 1

    def _next_record(self, place: int) -> int:
        """The next place where a record begins and another one follows."""
        data, lengths = self._data, self._lengths
        found = place
        while True:
            found = data.find(HEAD, found + 1)
            if found < 0 or found + HEADER_BYTES > len(data):
                found = len(data)
                break
            length = lengths[data[found + 2]]
            following = found + length
            if length and (data[following : following + 2] == HEAD or following == len(data)):
                break
        self._notes["bytes that are no record"] += found - place
        return found

    def _sources(self) -> dict[str, RowSource]:
        """The sources of the tables of all messages present."""
        sources: dict[str, RowSource] = {}
        for kind, form in self._formats.items():
            places = np.frombuffer(self._places[kind], np.int64)
            if not len(places) or form.row() is None:
                continue
            # Of two types with one name, the one with more rows counts.
            if form.name in sources and len(sources[form.name].places) >= len(places):
                continue
            sources[form.name] = RowSource(self._data, places, form.row, form.divisors)
        return sources


def _text_tables(data: bytes) -> LogTables:
    """The tables of a text: lines of name and values, separated by commas."""
    notes: Counter[str] = Counter()
    formats: dict[bytes, RowFormat] = {}
    lines: dict[bytes, list[bytes]] = {}
    places: dict[bytes, array[int]] = {}
    place = 0
    preamble: list[str] = []
    for line in data.splitlines(keepends=True):
        name, comma, values = line.strip().partition(b",")
        if name == b"FMT":
            form = _text_format(values)
            if form is not None:
                formats.setdefault(form.name.encode("latin-1"), form)
        elif comma and name in formats:
            lines.setdefault(name, []).append(values)
            places.setdefault(name, array("q")).append(place)
        elif name and not formats and len(preamble) < MAX_PREAMBLE:
            preamble.append(line.strip().decode("utf-8", "replace"))
        elif name:
            notes["lines that are no record"] += 1
        place += len(line)
    tables = {}
    for name, values_of in lines.items():
        table = _text_table(formats[name], values_of, np.array(places[name], np.int64))
        notes["lines that are no record"] += len(values_of) - len(table)
        if len(table):
            tables[formats[name].name] = table
    counted = {reason: count for reason, count in notes.items() if count}
    return LogTables(tables, counted, tuple(preamble))


def _text_format(values: bytes) -> RowFormat | None:
    """Parses a line ``FMT, type, length, name, letters, columns...``; None if it is not valid."""
    declared = [value.strip().decode("latin-1") for value in values.split(b",")]
    if len(declared) < 5:
        return None
    form = RowFormat(declared[2], 0, declared[3], tuple(declared[4:]))
    # There is no common text form of arrays.
    return form if form.is_sound and "a" not in form.letters else None


def _text_table(form: RowFormat, lines: list[bytes], places: NDArray[np.int64]) -> Table:
    """The complete lines of one message, with numbers where expected."""
    count = len(form.columns)
    split = [line.split(b",", count - 1) for line in lines]
    whole = np.array([len(values) == count for values in split], np.bool_)
    columns = list(zip(*(values for values in split if len(values) == count), strict=True))
    places = places[whole]
    if not columns:
        return Table(form.name, places, np.empty(0, [(name, "f8") for name in form.columns]))
    arrays: list[NDArray[Any]] = []
    good = np.ones(len(places), np.bool_)
    for letter, values in zip(form.letters, columns, strict=True):
        if letter in WORDS:
            arrays.append(np.array([value.strip() for value in values], "S64"))
            continue
        numbers = np.array([_number(value) for value in values])
        good &= ~np.isnan(numbers) | (letter in "fdg")
        if letter in WHOLE_NUMBERS:
            numbers = np.nan_to_num(numbers).clip(-LARGEST, LARGEST).astype(np.int64)
        arrays.append(numbers)
    row = [(name, column.dtype) for name, column in zip(form.columns, arrays, strict=True)]
    rows = np.empty(len(places), row)
    for name, column in zip(form.columns, arrays, strict=True):
        rows[name] = column
    return Table(form.name, places[good], rows[good])


def _number(text: bytes) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan
