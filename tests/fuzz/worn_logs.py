"""Logs worn row by row, as loggers, links and clocks wear them: seeded, of any format.

Bytes are damaged in `file_mutations`. Here every row stays whole, and the recording is odd: rows of
some kinds are missing, come twice, late, once a second, with NaN, with zeros, on another clock.
"""

import io
import random
import re
import struct
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.generator.mavcrc import x25crc

FMT = b"\xa3\x95\x80"
FMT_LENGTH = 89
ULOG = b"ULog"
MAX_CHANGES = 4
WIDTHS = {
    **dict.fromkeys("bBM", 1),
    **dict.fromkeys("hHcC", 2),
    **dict.fromkeys("iIeELfn", 4),
    **dict.fromkeys("qQd", 8),
    "N": 16,
    "Z": 64,
    "a": 64,
}
# Seconds by which a clock may be off: a leap, a restart, a date that is set, a counter that ends.
LEAPS_S = (-1e9, -4294.967, -60.0, -1.0, 0.5, 5.0, 71.58, 3600.0, 4294.967, 1e6, 1e9)
ODD = (float("nan"), float("inf"), -float("inf"), 1e30, -1e9, 0.0)


class Row(NamedTuple):
    """One row of a log."""

    kind: str  # its message or topic
    data: bytes  # as stored
    time: tuple[int, str] | None = None  # place and `struct` format of its time; None without one
    unit_s: float = 1e-6  # of that time
    floats: tuple[int, ...] = ()  # places of its floats


class Log(NamedTuple):
    """A log as rows."""

    ending: str  # of its name
    head: bytes  # what every reader needs
    rows: list[Row]

    def bytes(self) -> bytes:
        """The file."""
        return self.head + b"".join(row.data for row in self.rows)


def log_of(name: str, data: bytes) -> Log:
    """Takes a log apart.

    Args:
        name: its ending decides how.
        data: its content.
    """
    ending = name[name.rindex(".") :].lower()
    takes = {".bin": _dataflash, ".log": _text, ".ulg": _ulog, ".tlog": _telemetry}
    head, rows = takes[ending](data)
    return Log(ending, head, rows)


def _dataflash(data: bytes) -> tuple[bytes, list[Row]]:
    head, rows = b"", []
    known: dict[int, Row] = {}
    lengths: dict[int, int] = {}
    place = data.find(FMT)
    while 0 <= place < len(data) - 3:
        kind = data[place + 2]
        length = FMT_LENGTH if data[place : place + 3] == FMT else lengths.get(kind, 0)
        if data[place : place + 2] != FMT[:2] or not length:
            place = data.find(FMT[:2], place + 1)
            continue
        row = data[place : place + length]
        place += length
        if kind == FMT[2] and len(row) == FMT_LENGTH:
            head += row
            number, size, name, letters, columns = struct.unpack("<BB4s16s64s", row[3:])
            texts = [text.rstrip(b"\0").decode("ascii", "replace") for text in (name, letters)]
            lengths[number] = size
            known[number] = _defined(*texts, columns.split(b"\0")[0].decode("ascii", "replace"))
        elif kind in known:
            rows.append(known[kind]._replace(data=row))
    return head, rows


def _defined(name: str, letters: str, columns: str) -> Row:
    place, floats = 3, []
    for letter in letters:
        floats += [place] if letter == "f" else []
        place += WIDTHS.get(letter, 1)
    if columns.startswith("TimeUS") and letters.startswith("Q"):
        return Row(name, b"", (3, "<Q"), 1e-6, tuple(floats))
    if columns.startswith("TimeMS") and letters.startswith("I"):
        return Row(name, b"", (3, "<I"), 1e-3, tuple(floats))
    return Row(name, b"", None, 1e-6, tuple(floats))


def _text(data: bytes) -> tuple[bytes, list[Row]]:
    lines = data.splitlines(keepends=True)
    head = [line for line in lines if line.startswith(b"FMT")]
    rows = [
        Row(line.split(b",")[0].decode("ascii", "replace"), line)
        for line in lines
        if line.strip() and not line.startswith(b"FMT")
    ]
    return b"".join(head), rows


def _ulog(data: bytes) -> tuple[bytes, list[Row]]:
    place, head, rows = 16, data[:16], []
    while place + 3 <= len(data):
        size, kind = struct.unpack("<Hc", data[place : place + 3])
        row = data[place : place + 3 + size]
        place += 3 + size
        if kind == b"D" and len(row) >= 13:
            topic = struct.unpack("<H", row[3:5])[0]
            floats = tuple(range(13, len(row) - 3, 4))
            rows.append(Row(str(topic), row, (5, "<Q"), 1e-6, floats))
        elif rows:
            rows.append(Row(kind.decode("ascii", "replace"), row))
        else:
            head += row
    return head, rows


def _telemetry(data: bytes) -> tuple[bytes, list[Row]]:
    place, rows = 0, []
    while place + 20 <= len(data):
        magic, size = data[place + 8], data[place + 9]
        if magic == 0xFD:
            number = int.from_bytes(data[place + 15 : place + 18], "little")
            length = 8 + size + 12 + (13 if data[place + 10] & 1 else 0)
            first = place + 18
        elif magic == 0xFE:
            number, length, first = data[place + 13], 8 + size + 8, place + 14
        else:
            place += 1
            continue
        floats = tuple(range(first - place, first - place + size - 3, 4))
        rows.append(Row(str(number), data[place : place + length], (0, ">Q"), 1e-6, floats))
        place += length
    return b"", rows


def text_of(data: bytes) -> bytes:
    """A binary dataflash log in its text form, by its own definitions."""
    log = log_of("a.bin", data)
    lines = io.BytesIO()
    columns: dict[str, str] = {}
    for place in range(0, len(log.head), FMT_LENGTH):
        row = log.head[place : place + FMT_LENGTH]
        number, size, name, letters, names = struct.unpack("<BB4s16s64s", row[3:])
        texts = [part.split(b"\0")[0].decode() for part in (name, letters, names)]
        columns[texts[0]] = texts[1]
        lines.write(f"FMT, {number}, {size}, {', '.join(texts)}\n".encode())
    for row in log.rows:
        if len(row.data) < 3 + sum(WIDTHS[letter] for letter in columns[row.kind]):
            continue  # the log ends in it
        lines.write(f"{', '.join((row.kind, *_values(row.data, columns[row.kind])))}\n".encode())
    return lines.getvalue()


def _values(row: bytes, letters: str) -> Iterator[str]:
    hundredths, place = {"c": "h", "C": "H", "e": "i", "E": "I"}, 3
    for letter in letters:
        part = row[place : place + WIDTHS[letter]]
        place += WIDTHS[letter]
        if letter in "nNZ":
            yield part.split(b"\0")[0].decode("ascii", "replace")
        elif letter in hundredths:
            yield f"{struct.unpack('<' + hundredths[letter], part)[0] / 100.0:.2f}"
        else:
            stored = {"L": "i", "M": "B"}.get(letter, letter)
            value = struct.unpack("<" + stored, part)[0]
            yield f"{value * 1e-7:.7f}" if letter == "L" else f"{value}"


# --- wear -----------------------------------------------------------------------------------------


def worn(dice: random.Random, log: Log) -> tuple[Log, str]:
    """The log with a few changes, and their names."""
    rows, names = list(log.rows), []
    for _ in range(dice.randint(1, MAX_CHANGES)):
        change = dice.choice(CHANGES)
        rows = change(dice, rows) or rows
        names.append(change.__name__.strip("_"))
    return log._replace(rows=rows), ", ".join(names)


def _stretch(dice: random.Random, rows: list[Row]) -> slice:
    first = dice.randrange(len(rows))
    return slice(first, first + dice.randint(1, max(len(rows) // 2, 1)))


def _kinds(dice: random.Random, rows: list[Row]) -> set[str]:
    every = sorted({row.kind for row in rows})
    return set(dice.sample(every, min(dice.randint(1, 3), len(every))))


def _cut(dice: random.Random, rows: list[Row]) -> list[Row]:
    part = _stretch(dice, rows)
    return rows[part] if dice.random() < 0.3 else rows[: part.start] + rows[part.stop :]


def _without_kinds(dice: random.Random, rows: list[Row]) -> list[Row]:
    kinds = _kinds(dice, rows)
    part = _stretch(dice, rows) if dice.random() < 0.4 else slice(0, len(rows))
    kept = [row for row in rows[part] if row.kind not in kinds]
    return rows[: part.start] + kept + rows[part.stop :]


def _few_kinds(dice: random.Random, rows: list[Row]) -> list[Row]:
    kinds = _kinds(dice, rows) | _kinds(dice, rows) | _kinds(dice, rows)
    return [row for row in rows if row.kind in kinds]


def _twice(dice: random.Random, rows: list[Row]) -> list[Row]:
    part = _stretch(dice, rows)
    return rows[: part.stop] + rows[part] + rows[part.stop :]


def _disordered(dice: random.Random, rows: list[Row]) -> list[Row]:
    if dice.random() < 0.5:
        late = [(place + dice.gauss(0.0, 20.0), row) for place, row in enumerate(rows)]
        return [row for _, row in sorted(late, key=lambda one: one[0])]
    edges = sorted({0, len(rows), *(dice.randrange(len(rows)) for _ in range(4))})
    pieces = [rows[a:b] for a, b in pairwise(edges)]
    dice.shuffle(pieces)
    return [row for piece in pieces for row in piece]


def _once_a_second(dice: random.Random, rows: list[Row]) -> list[Row]:
    part, last, kept = _stretch(dice, rows), dict[str, float](), []
    for row in rows[part]:
        t_s = time_of(row)
        if t_s is None or abs(t_s - last.get(row.kind, -1e9)) >= 1.0:
            kept.append(row)
            last[row.kind] = t_s or 0.0
    return rows[: part.start] + kept + rows[part.stop :]


def _stuck(dice: random.Random, rows: list[Row]) -> list[Row]:
    part, kinds, first = _stretch(dice, rows), _kinds(dice, rows), dict[str, Row]()
    changed = list(rows)
    for place, row in list(enumerate(rows))[part]:
        if row.kind in kinds and row.time is not None:
            held = first.setdefault(row.kind, row)
            if len(held.data) == len(row.data):
                changed[place] = _at(held, time_of(row) or 0.0)
    return changed


def _odd_values(dice: random.Random, rows: list[Row]) -> list[Row]:
    part, kinds, value = _stretch(dice, rows), _kinds(dice, rows), dice.choice(ODD)
    share = dice.choice((0.01, 0.3, 1.0))
    changed = list(rows)
    for place, row in list(enumerate(rows))[part]:
        if row.kind in kinds and row.floats and dice.random() < share:
            data = bytearray(row.data)
            struct.pack_into("<f", data, dice.choice(row.floats), value)
            changed[place] = sealed(row._replace(data=bytes(data)))
        elif row.kind in kinds and row.time is None and dice.random() < share:
            words = re.sub(rb"-?\d+\.\d+", repr(value).encode(), row.data)
            changed[place] = row._replace(data=words)
    return changed


def _zeros(dice: random.Random, rows: list[Row]) -> list[Row]:
    part, kinds = _stretch(dice, rows), _kinds(dice, rows)
    changed = list(rows)
    for place, row in list(enumerate(rows))[part]:
        if row.kind in kinds and row.floats:
            data = bytearray(row.data)
            for at in row.floats:
                data[at : at + 4] = bytes(4)
            changed[place] = sealed(row._replace(data=bytes(data)))
    return changed


def _leap(dice: random.Random, rows: list[Row]) -> list[Row]:
    """The clock leaps, of all rows or of some kinds."""
    part, leap_s = _stretch(dice, rows), dice.choice(LEAPS_S)
    kinds = _kinds(dice, rows) if dice.random() < 0.5 else {row.kind for row in rows}
    return [
        _at(row, (time_of(row) or 0.0) + leap_s)
        if place >= part.start and row.kind in kinds and row.time is not None
        else row
        for place, row in enumerate(rows)
    ]


def _other_pace(dice: random.Random, rows: list[Row]) -> list[Row]:
    """The clock runs quicker or slower, backward, or not at all."""
    pace = dice.choice((0.0, 0.5, 1.01, 3.0, -1.0))
    kinds = _kinds(dice, rows) if dice.random() < 0.5 else {row.kind for row in rows}
    begun = next((t_s for row in rows if (t_s := time_of(row)) is not None), 0.0)
    return [
        _at(row, begun + pace * ((time_of(row) or 0.0) - begun))
        if row.kind in kinds and row.time is not None
        else row
        for row in rows
    ]


Change = Callable[[random.Random, list[Row]], list[Row]]
CHANGES: tuple[Change, ...] = (
    _cut,
    _without_kinds,
    _few_kinds,
    _twice,
    _disordered,
    _once_a_second,
    _stuck,
    _odd_values,
    _zeros,
    _leap,
    _other_pace,
)


def time_of(row: Row) -> float | None:
    if row.time is None or len(row.data) < row.time[0] + struct.calcsize(row.time[1]):
        return None
    return float(struct.unpack_from(row.time[1], row.data, row.time[0])[0]) * row.unit_s


def _at(row: Row, t_s: float) -> Row:
    """The row at another time; a counter begins anew at its end."""
    if row.time is None or time_of(row) is None:
        return row
    place, form = row.time
    data, most = bytearray(row.data), 1 << (8 * struct.calcsize(form))
    struct.pack_into(form, data, place, round(t_s / row.unit_s) % most)
    return row._replace(data=bytes(data))


def sealed(row: Row) -> Row:
    """A frame of MAVLink with its checksum; other rows have none."""
    if row.time != (0, ">Q"):
        return row
    data = bytearray(row.data)
    length = data[9] + (10 if data[8] == 0xFD else 6)
    message = mavlink.mavlink_map.get(int(row.kind))
    if message is not None and len(data) >= 8 + length + 2:
        crc = x25crc(bytes(data[9 : 8 + length]))
        crc.accumulate(bytes([message.crc_extra]))
        struct.pack_into("<H", data, 8 + length, crc.crc)
    return row._replace(data=bytes(data))


def is_readable(path: str) -> bool:
    """Whether pymavlink or pyulog reads anything of a file."""
    if path.endswith(".ulg"):
        from pyulog import ULog

        try:
            return bool(ULog(path).data_list)
        except Exception:  # whatever it raises, it does not read it
            return False
    try:
        log = mavutil.mavlink_connection(path)
        for _ in range(2000):
            found = log.recv_msg()
            if found is None:
                return False
            if found.get_type() not in ("FMT", "BAD_DATA", "PARM", "FMTU", "UNIT", "MULT"):
                return True
    except Exception:
        return False
    return False
