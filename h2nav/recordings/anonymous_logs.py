"""Autopilots' own logs without the vehicle's identity and place, dataflash and ULog.

The new file has the length and the structure of the old one: it begins as a copy, and what
identifies is written over in place, so that memory does not grow with the log. Bytes that belong to
no message are zeroed, since nobody knows what they hold.
"""

import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, MADV_DONTNEED, mmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.log.progress import Progress
from h2nav.recordings import anonymous_field
from h2nav.recordings.anonymous import DEG_E7, Coordinates, Replacement, is_identity, which_of
from h2nav.recordings.dataflash_tables import (
    FMT_BYTES,
    FMT_TYPE,
    HEAD,
    RowFormat,
    dataflash_pieces,
)
from h2nav.recordings.row_tables import LogTables, rows_of
from h2nav.recordings.ulog_tables import (
    FILE_HEADER,
    HEADER_BYTES,
    INFO,
    PARAMETER,
    TAGGED_TEXT,
    TEXT,
    TYPES,
    ULogLayout,
    ulog_layout,
)

Integers = NDArray[np.int64]

# Raw data of receivers and where they saw which satellite (both show the place), the map's heights
# under the way, other vehicles, files.
DATAFLASH_DROPPED = re.compile(r"ADSB|AIS\w|FILE|GRAW|GRX[HS]|ODID|SBR\w|TERR")
ULOG_DROPPED = re.compile(
    r"transponder_report|gps_inject_data|gps_dump|mavlink_tunnel|ulog_stream|open_drone_id.*"
    r"|uavcan_parameter.*|log_message|sensor_gnss_relative|parameter_.*|satellite_info"
    r"|device_information"
)
# Texts whose values are names of messages, parameters and units, or of the firmware.
DATAFLASH_KEPT_TEXTS = frozenset({"FMT", "FMTU", "UNIT", "MULT", "VER"})
ULOG_KEPT_INFO = re.compile(
    r"sys_name|sys_mcu|sys_os.*|sys_toolchain.*|ver_hw|ver_hw_subtype|ver_sw|ver_sw_release"
    r"|ver_vendor_sw_release|ver_os.*|ver_data_format|metadata_\w+"
)
ULOG_PLACES = ("sensor_gps", "vehicle_gps_position", "vehicle_global_position", "home_position")
FIX_3D = 3
# Heights above the map's ground, which with the altitude are the ground's.
MAP_HEIGHTS = frozenset({("CTUN", "TAlt")})
# Columns that carry a place, or anything else: only what is near the flight is moved.
PLACE_COLUMNS = (
    ("MAVC", "X", "lat"),
    ("MAVC", "Y", "lon"),
    ("GUID", "pX", "lat"),
    ("GUID", "pY", "lon"),
    ("vehicle_command", "param5", "lat"),
    ("vehicle_command", "param6", "lon"),
    ("estimator_aid_src_gnss_pos", "observation[0]", "lat"),
    ("estimator_aid_src_gnss_pos", "observation[1]", "lon"),
    ("estimator_aid_src_aux_global_position", "observation[0]", "lat"),
    ("estimator_aid_src_aux_global_position", "observation[1]", "lon"),
)
# Floats that hold multiples of 1e-7 deg.
FLOATS_OF_E7 = frozenset({"GUID"})
# In metres if they are stored as floats: the local position.
DOUBLES_ONLY, DOUBLE_BYTES = "observation[", 8
# Positions of an estimate, metres.
DISPLACEMENTS = {"PN": "latitude", "PE": "longitude"}
_MULTI_INFO, _DEFAULT = ord("M"), ord("Q")


class Counted(NamedTuple):
    """What was replaced."""

    places: int = 0  # values
    dates: int = 0
    texts: int = 0
    parameters: int = 0
    dropped: int = 0  # messages whose content was removed
    other_bytes: int = 0  # that belong to no message

    def plus(self, **more: int) -> "Counted":
        """With more of some."""
        return self._replace(**{name: getattr(self, name) + count for name, count in more.items()})


# --- where and who it was -------------------------------------------------------------------------


def dataflash_facts(path: Path) -> tuple[list[Coordinates], float | None]:
    """Some fixes of a log, the first one first, and its date."""
    from h2nav.recordings.dataflash_rows import DataflashRows
    from h2nav.recordings.receiver_tables import start_unix_s

    fixes: list[Coordinates] = []
    unix_s: float | None = None
    for piece in dataflash_pieces(path):
        fixes += _fixes(piece.tables, (("GPS", "Lat", "Lng", "Status"), ("ORGN", "Lat", "Lng", "")))
        fixes += _fixes(piece.tables, (("GPS2", "Lat", "Lng", "Status"), ("POS", "Lat", "Lng", "")))
        if unix_s is None:
            unix_s = start_unix_s(DataflashRows(piece.tables))
    return fixes, unix_s


def ulog_facts(path: Path) -> tuple[list[Coordinates], float | None]:
    """The same of PX4's log."""
    from h2nav.recordings.receiver_tables import start_unix_s
    from h2nav.recordings.ulog_rows import ULogRows
    from h2nav.recordings.ulog_tables import read_ulog

    file = read_ulog(path)
    names = sorted(file.tables.names)
    rows = [
        (name, latitude, longitude, fix)
        for name in names
        for latitude, longitude, fix in (
            ("lat", "lon", "fix_type"),
            ("latitude_deg", "longitude_deg", "fix_type"),
            ("lat", "lon", ""),
        )
        if name.startswith(ULOG_PLACES)
    ]
    return _fixes(file.tables, rows), start_unix_s(ULogRows(file))


def _fixes(tables: LogTables, rows: Iterable[tuple[str, str, str, str]]) -> list[Coordinates]:
    """The first and the last fix of each message."""
    found = []
    for name, latitude, longitude, fix in rows:
        table = tables.find(name, latitude, longitude, *([fix] if fix else []))
        if table is None or not len(table):
            continue
        good = table.integers(fix) >= FIX_3D if fix else np.ones(len(table), np.bool_)
        values = table.numbers(latitude, longitude)
        if table.kind(latitude) == "i" and not table.is_scaled(latitude):
            values = values / 1e7
        good &= np.isfinite(values).all(axis=1) & (values != 0.0).any(axis=1)
        good &= (np.abs(values[:, 0]) <= 90.0) & (np.abs(values[:, 1]) <= 180.0)
        kept = values[good]
        found += [Coordinates(*map(float, kept[place])) for place in (0, -1)] if len(kept) else []
    return found


# --- dataflash ------------------------------------------------------------------------------------


def anonymise_dataflash(
    path: Path, output: Path, by: Replacement, progress: Progress = lambda done, total: None
) -> Counted:
    """Writes a binary log without identity and place; `output` must not exist."""
    counted = Counted()
    end = 0
    with _copy(path, output) as data:
        for piece in dataflash_pieces(path, progress):
            spans = []
            for name in sorted(piece.tables.names):
                table = piece.tables.find(name)
                if table is None:
                    continue
                # By its number, since several types may have one name.
                form = piece.formats[data[table.places[0] + len(HEAD)]]
                rows = _Rows(data, form.row(), table.places)
                counted = _dataflash_rows(name, rows, form, by, counted)
                spans.append(np.stack((table.places, table.places + form.length), axis=1))
            covered = np.concatenate(spans) if spans else np.empty((0, 2), np.int64)
            zeroed, end = _zero_between(data, covered, end, _definitions)
            counted = counted.plus(other_bytes=zeroed)
            data.madvise(MADV_DONTNEED)  # what was written goes to the file
        rest = np.array([[len(data), len(data)]])
        return counted.plus(other_bytes=_zero_between(data, rest, end, _definitions)[0])


class _Rows:
    """Rows of one message in a file that is written over.

    Args:
        data: of the file.
        row: the type of a row, with its header.
        places: (N,) of the rows, bytes.
    """

    def __init__(self, data: mmap, row: "np.dtype[np.void] | None", places: Integers) -> None:
        assert row is not None
        self.row = row
        self._view = rows_of(data, row)
        self._places = places

    def __len__(self) -> int:
        return len(self._places)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names, in order."""
        return self.row.names or ()

    def has_numbers(self, column: str) -> bool:
        """Whether there is such a column, with one number in each row."""
        return column in self.columns and self.row[column].kind in "iuf"

    def stored(self, column: str) -> NDArray[Any]:
        """(N,) as stored."""
        found: NDArray[Any] = self._view[column][self._places]
        return found

    def write(self, column: str, values: Any) -> None:
        """Writes a column."""
        self._view[column][self._places] = values


def _dataflash_rows(
    name: str, rows: _Rows, form: RowFormat, by: Replacement, counted: Counted
) -> Counted:
    if DATAFLASH_DROPPED.fullmatch(name):
        for column in rows.columns:
            if column != "TimeUS":
                rows.write(column, np.zeros_like(rows.stored(column)))
        return counted.plus(dropped=len(rows))
    letters = dict(zip(form.columns, form.letters, strict=True))
    if name == "PARM" and letters.get("Name") in tuple("nNZ"):
        return _dataflash_parameters(rows, by, counted)
    others = _other_axes(rows)
    for column in rows.columns:
        is_sure = letters[column] == "L"
        described = _Column(name, column, is_sure, others.get(column))
        counted = _column(rows, described, by, counted)
        if letters[column] in "nNZ" and name not in DATAFLASH_KEPT_TEXTS:
            counted = _texts(rows, column, by, counted)
        elif is_sure and which_of(column) is None:
            rows.write(column, 0)
            counted = counted.plus(places=len(rows))
        elif column.startswith("UID"):
            stored = rows.stored(column)
            rows.write(column, [_other_number(one, by) for one in stored])
            counted = counted.plus(texts=len(rows))
    return _field_states(rows, by, counted)


def _other_number(value: Any, by: Replacement) -> Any:
    return np.frombuffer(by.pseudonym(value.tobytes()), value.dtype)[0]


def _dataflash_parameters(rows: _Rows, by: Replacement, counted: Counted) -> Counted:
    """The values, and the defaults beside them."""
    names = [bytes(name).split(b"\0", 1)[0].decode("latin-1") for name in rows.stored("Name")]
    for column in ("Value", "Default"):
        if rows.has_numbers(column):
            stored = rows.stored(column)
            own = zip(names, stored.tolist(), strict=True)
            values = np.array([by.parameter(*pair) for pair in own], stored.dtype)
            differs = int(np.count_nonzero(values != np.nan_to_num(stored)))
            rows.write(column, np.where(np.isnan(stored), stored, values))
            counted = counted.plus(parameters=differs)
    return counted


def _definitions(data: mmap, place: int, end: int) -> Iterator[tuple[int, int]]:
    """Beginnings and ends of the definitions between two places."""
    head = HEAD + bytes((FMT_TYPE,))
    while 0 <= (place := data.find(head, place, end)) <= end - FMT_BYTES:
        yield place, place + FMT_BYTES
        place += FMT_BYTES


# --- ULog -----------------------------------------------------------------------------------------


def anonymise_ulog(
    path: Path, output: Path, by: Replacement, progress: Progress = lambda done, total: None
) -> Counted:
    """Writes a ULog file without identity and place; `output` must not exist."""
    counted = Counted()
    with path.open("rb") as stream:
        layout = ulog_layout(mmap(stream.fileno(), 0, access=ACCESS_READ))
        with _copy(path, output) as data:
            spans = [np.array([[0, FILE_HEADER.size]], np.int64)]
            for number, (topic, row, places) in enumerate(layout.topics):
                progress(number, len(layout.topics))
                counted = _ulog_rows(topic, _Rows(data, row, places), by, counted)
                spans.append(_whole(data, places))
                data.madvise(MADV_DONTNEED)  # what was written goes to the file
            spans.append(_whole(data, layout.others))
            counted = _ulog_notes(data, layout, by, counted)
            covered = np.concatenate([*spans, [[len(data), len(data)]]])
            zeroed, _ = _zero_between(data, covered, 0, lambda *_: iter(()))
    return counted.plus(other_bytes=zeroed)


def _whole(data: mmap, places: Integers) -> Integers:
    """(N, 2) beginnings and ends of messages."""
    octets = np.frombuffer(data, np.uint8)
    sizes = octets[places].astype(np.int64) | octets[places + 1].astype(np.int64) << 8
    found: Integers = np.stack((places, places + HEADER_BYTES + sizes), axis=1)
    del octets
    return found


def _ulog_rows(topic: str, rows: _Rows, by: Replacement, counted: Counted) -> Counted:
    is_dropped = ULOG_DROPPED.fullmatch(topic) is not None
    for column in rows.columns:
        if is_dropped:
            if column != "timestamp":
                rows.write(column, np.zeros_like(rows.stored(column)))
            continue
        counted = _column(rows, _Column(topic, column), by, counted)
        if rows.row[column].kind == "S":
            counted = _texts(rows, column, by, counted)
    if is_dropped:
        return counted.plus(dropped=len(rows))
    return _field_states(rows, by, counted)


def _ulog_notes(data: mmap, layout: ULogLayout, by: Replacement, counted: Counted) -> Counted:
    """Parameters, information and texts."""
    for place in layout.others.tolist():
        size, kind = data[place] | data[place + 1] << 8, data[place + 2]
        begin, end = place + HEADER_BYTES, place + HEADER_BYTES + size
        if kind in (TEXT, TAGGED_TEXT):
            first = begin + (9 if kind == TEXT else 11)
            counted = _write(data, first, by.text(data[first:end]), counted, "texts")
        elif kind in (PARAMETER, INFO, _MULTI_INFO, _DEFAULT):
            begin += kind in (_MULTI_INFO, _DEFAULT)
            value_at = begin + 1 + data[begin]
            type_name, _, name = data[begin + 1 : value_at].decode("latin-1").partition(" ")
            value = data[value_at:end]
            if kind in (PARAMETER, _DEFAULT):
                other = _ulog_parameter(type_name, name, value, by)
                counted = _write(data, value_at, other, counted, "parameters")
            else:
                other = _ulog_info(type_name, name, value, by)
                counted = _write(data, value_at, other, counted, "texts")
    return counted


def _ulog_parameter(type_name: str, name: str, value: bytes, by: Replacement) -> bytes:
    kind = TYPES.get(type_name)
    if kind is None or np.dtype(kind).itemsize != len(value):
        return value
    stored = np.frombuffer(value, kind)
    other = by.parameter(name, float(stored[0]))
    return value if other == float(stored[0]) else np.array([other], kind).tobytes()


def _ulog_info(type_name: str, name: str, value: bytes, by: Replacement) -> bytes:
    """Ids become pseudonyms; what is not known to be harmless, blanks or zeros."""
    if name == "sys_uuid":
        return by.text(value)
    if ULOG_KEPT_INFO.fullmatch(name):
        return value
    return (b" " if type_name.startswith("char") else b"\0") * len(value)


def _write(data: mmap, place: int, value: bytes, counted: Counted, what: str) -> Counted:
    if data[place : place + len(value)] == value:
        return counted
    data[place : place + len(value)] = value
    return counted.plus(**{what: 1})


# --- both -----------------------------------------------------------------------------------------


@contextmanager
def _copy(path: Path, output: Path) -> Iterator[mmap]:
    """A copy of a file, to be written over; removed again if that fails."""
    with path.open("rb") as old, output.open("x+b") as stream:
        try:
            shutil.copyfileobj(old, stream, 1 << 22)
            stream.flush()
            # It closes with the last view of it.
            yield mmap(stream.fileno(), 0)
        except BaseException:
            output.unlink()
            raise


class _Column(NamedTuple):
    """A column of a message."""

    message: str
    name: str
    is_sure: bool = False  # the format says that it is a place
    other: NDArray[Any] | None = None  # what the column of the other axis held


def _other_axes(rows: _Rows) -> dict[str, NDArray[Any]]:
    """The longitudes that belong to each column of latitudes, and the other way round."""
    pairs: dict[str, list[str]] = {"latitude": [], "longitude": []}
    for column in rows.columns:
        if which := which_of(column):
            pairs[which].append(column)
    found = {}
    for one, other in zip(*pairs.values(), strict=False):
        if rows.row[one] == rows.row[other]:
            found[one], found[other] = rows.stored(other), rows.stored(one)
    return found


def _column(rows: _Rows, column: _Column, by: Replacement, counted: Counted) -> Counted:
    """Moves places and dates of one column, and clears what identifies."""
    other = _replaced(rows, column, by)
    what = "places"
    if other is None and rows.row[column.name].kind in "iu":
        what, other = "dates", by.dated(column.name, rows.stored(column.name))
    if other is None:
        return counted
    differs = int(np.count_nonzero(other != rows.stored(column.name)))
    if differs:
        rows.write(column.name, other)
    return counted.plus(**{what: differs})


def _replaced(rows: _Rows, column: _Column, by: Replacement) -> NDArray[Any] | None:
    """What shows a place or an identity, replaced; None if the column is of neither."""
    message, name = column.message, column.name
    kind = rows.row[name]
    if not rows.has_numbers(name):
        return None
    if is_identity(name) or (message, name) in MAP_HEIGHTS:
        return np.zeros(len(rows), kind)
    if name in DISPLACEMENTS and kind.kind == "f":
        return by.displaced(DISPLACEMENTS[name], rows.stored(name))
    if name in anonymous_field.REFERENCES:
        return anonymous_field.reference(by.fields, name, rows.stored(name))
    as_place = next((one[2] for one in PLACE_COLUMNS if one[:2] == (message, name)), None)
    if as_place is not None:
        if name.startswith(DOUBLES_ONLY) and kind.itemsize < DOUBLE_BYTES:
            return None
        scale = DEG_E7 if message in FLOATS_OF_E7 else None
        return by.moved(as_place, rows.stored(name), scale=scale)
    if which_of(name) is None:
        return None
    return by.moved(name, rows.stored(name), is_sure=column.is_sure, other=column.other)


def _field_states(rows: _Rows, by: Replacement, counted: Counted) -> Counted:
    """The earth's field among the states of the autopilot's filter."""
    for columns, unit_ut in anonymous_field.STATES:
        if all(map(rows.has_numbers, columns)):
            stored = np.stack([rows.stored(column) for column in columns], axis=1)
            other = anonymous_field.states(by.fields, stored, unit_ut)
            differs = (other != stored).any(axis=1)
            for column, values in zip(columns, other.T, strict=True):
                rows.write(column, values)
            counted = counted.plus(places=int(np.count_nonzero(differs)))
    return counted


def _texts(rows: _Rows, column: str, by: Replacement, counted: Counted) -> Counted:
    stored = rows.stored(column).tolist()
    other = [by.text(text) for text in stored]
    differs = sum(one != two for one, two in zip(stored, other, strict=True))
    if differs:
        rows.write(column, np.array(other, rows.row[column]))
    return counted.plus(texts=differs)


def _zero_between(
    data: mmap,
    covered: Integers,
    begin: int,
    kept: Callable[[mmap, int, int], Iterator[tuple[int, int]]],
) -> tuple[int, int]:
    """Zeroes what no message covers from a place on, to the end of the last one.

    Args:
        covered: (N, 2) beginnings and ends of messages.
        kept: beginnings and ends of what is kept between two places though it is not covered.

    Returns:
        The number of zeroed bytes, and the end of the last message.
    """
    if not len(covered):
        return 0, begin
    order = covered[np.argsort(covered[:, 0], kind="stable")]
    ends = np.maximum.accumulate(np.concatenate(([begin], order[:, 1])))
    zeroed = 0
    for gap in np.flatnonzero(order[:, 0] > ends[:-1]).tolist():
        place, end = int(ends[gap]), int(order[gap, 0])
        for first, last in (*kept(data, place, end), (end, end)):
            data[place:first] = bytes(first - place)
            zeroed += first - place
            place = last
    return zeroed, int(ends[-1])
