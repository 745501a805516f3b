"""Telemetry without the vehicle's identity and place.

Each frame is written again with a checksum of its own; signatures are dropped, since they hold for
the old bytes and nobody else has the key. Messages that carry foreign bytes, files, names or other
vehicles are left out, and so is everything that is no frame of the dialect.
"""

import math
import re
import struct
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from fastcrc import crc16

from h2nav.log.file import new_file
from h2nav.log.progress import Progress
from h2nav.recordings import anonymous_field
from h2nav.recordings.anonymous import Coordinates, Replacement, is_identity, which_of
from h2nav.recordings.anonymous_logs import Counted
from h2nav.recordings.frame_tables import TableMaker
from h2nav.recordings.link_recording import Recording
from h2nav.wire.deframer import Deframer, Frame
from h2nav.wire.dialect import LAYOUTS, MessageLayout, WireField
from h2nav.wire.frame_scan import FrameScan
from h2nav.wire.tlog import TIME_SIZE

DROPPED = re.compile(
    r"ADSB_VEHICLE|AIS_VESSEL|OPEN_DRONE_ID_.*|UTM_GLOBAL_POSITION|UAVIONIX_.*|COLLISION"
    r"|PARAM_EXT_.*|VIDEO_STREAM_.*|STORAGE_INFORMATION|COMPONENT_.*|GIMBAL_DEVICE_INFORMATION"
    r"|WIFI_CONFIG_AP|CELLULAR_.*|AUTH_KEY|PLAY_TUNE.*|CHANGE_OPERATOR_CONTROL|DEVICE_OP_.*"
    r"|REMOTE_LOG_.*|LOG_ENTRY|TERRAIN_.*|GPS2?_RTK"
)
NAMED = re.compile(r"NAMED_VALUE_.*|DEBUG_.*")  # by the autopilot's own program
# Commands and mission items carry places in these, or anything else: only what is near is moved.
_ITEM = {"x": "lat", "y": "lon"}
AS_PLACE = {
    "COMMAND_LONG": {"param5": "lat", "param6": "lon"},
    "COMMAND_INT": _ITEM,
    "MISSION_ITEM": _ITEM,
    "MISSION_ITEM_INT": _ITEM,
}
# Metres from the origin of an estimate, which may be 0 deg.
DISPLACEMENTS = {
    ("LOCAL_POSITION_NED", "x"): "latitude",
    ("LOCAL_POSITION_NED", "y"): "longitude",
}
# Positions by which the flight is found, best first.
FIXES = {
    "GPS_RAW_INT": ("lat", "lon"),
    "GPS2_RAW": ("lat", "lon"),
    "GLOBAL_POSITION_INT": ("lat", "lon"),
    "HOME_POSITION": ("latitude", "longitude"),
}
IDS = {layout.name: layout.msg_id for layout in LAYOUTS.values()}
SIGNED_FLAG, PARAMETER_BYTES = 1, 16
HEADER_1, HEADER_2 = 6, 10
ARDUPILOT_ID_BYTES = 12
_NUMPY = {
    "uint16_t": "<u2",
    "uint32_t": "<u4",
    "uint64_t": "<u8",
    "int32_t": "<i4",
    "int64_t": "<i8",
    "float": "<f4",
    "double": "<f8",
}
_COUNTED_AS = {
    "place": "places",
    "metres": "places",
    "declination": "places",
    "date": "dates",
    "parameter": "parameters",
}
_PLACE_TYPES, _DATE_TYPES = (
    ("int32_t", "float", "double"),
    ("uint16_t", "uint32_t", "uint64_t", "int64_t"),
)


class _Edit(NamedTuple):
    """What is done to one field of a message."""

    # ``place``, ``metres``, ``declination``, ``date``, ``text``, ``name``, ``id``, ``identity`` or
    # ``parameter``
    what: str
    name: str  # for the rules
    type_name: str
    offset: int  # bytes in the payload
    size: int
    is_sure: bool  # a place for certain
    id_at: int  # of a parameter: where its name begins
    other_at: int  # of a latitude: where its longitude is, and the other way round; -1: nowhere


def frame_facts(recording: Recording) -> tuple[list[Coordinates], float | None]:
    """Some fixes of telemetry, those of the receiver first, and its date."""
    scan = FrameScan()
    found: dict[str, list[Coordinates]] = {name: [] for name in FIXES}
    first_ns: int | None = None
    for arrivals in recording.batches():
        if first_ns is None and len(arrivals.t_ns):
            first_ns = int(arrivals.t_ns[0]) + recording.unix_offset_ns
        maker = TableMaker([IDS[name] for name in FIXES])
        maker.add(scan.frames_of(arrivals))
        tables = maker.tables()
        for name, columns in FIXES.items():
            fields = tables[IDS[name]].fields
            values = np.stack([fields[column] for column in columns], axis=1) / 1e7
            good = (values != 0.0).any(axis=1) & (np.abs(values) <= (90.0, 180.0)).all(axis=1)
            kept = values[good]
            found[name] += [Coordinates(*map(float, kept[row])) for row in (0, -1) if len(kept)]
    fixes = [fix for name in FIXES for fix in found[name]]
    if first_ns is None or recording.times_are_synthetic:
        return fixes, None
    return fixes, first_ns * 1e-9


def anonymise_frames(
    recording: Recording,
    output: Path,
    by: Replacement,
    progress: Progress = lambda done, total: None,
) -> tuple[Counted, int]:
    """Writes telemetry without identity and place, as a telemetry log.

    Args:
        output: a new file.

    Returns:
        What was replaced, and the number of signatures that were dropped.

    Raises:
        BadInput: `output` exists, or cannot be created.
    """
    counted, signatures, before_us = Counted(), 0, 0
    deframer = Deframer()
    with new_file(output) as stream:
        for t_us, frame in _frames(recording, deframer, progress):
            signatures += frame.signed
            written, counted = _written(frame, by, counted)
            before_us = max(before_us, t_us)
            if written is not None:
                stream.write(by.earlier_us(before_us).to_bytes(TIME_SIZE, "big") + written)
    return counted, signatures


def _frames(
    recording: Recording, deframer: Deframer, progress: Progress
) -> Iterator[tuple[int, Frame]]:
    """UNIX microseconds and frames."""
    for arrivals in recording.batches():
        progress(*recording.progress)
        for t_ns, data in arrivals.pieces():
            for frame in deframer.feed(data):
                yield (t_ns + recording.unix_offset_ns) // 1000, frame
    yield from ((0, frame) for frame in deframer.flush())


def _written(frame: Frame, by: Replacement, counted: Counted) -> tuple[bytes | None, Counted]:
    """The frame's new bytes; None if it is left out."""
    layout = LAYOUTS[frame.msg_id]
    is_foreign = layout.carries_bytes and layout.name != "AUTOPILOT_VERSION"
    if is_foreign or DROPPED.fullmatch(layout.name):
        return None, counted.plus(dropped=1)
    payload = frame.payload[: layout.size]  # of later dialects there may be more
    edits = _edits(frame.msg_id)
    if edits:
        old = payload.ljust(layout.size, b"\0")
        whole = bytearray(old)
        for edit in edits:
            part = slice(edit.offset, edit.offset + edit.size)
            whole[part] = new = _replaced(old, edit, by)
            if new != old[part]:
                counted = counted.plus(**{_COUNTED_AS.get(edit.what, "texts"): 1})
        # MAVLink 2 sends no zeros at the end.
        is_first = frame.version == 1
        payload = bytes(whole[: len(payload)]) if is_first else bytes(whole).rstrip(b"\0") or b"\0"
    if not frame.signed and payload == frame.payload:
        return frame.raw, counted
    return _framed(frame, layout, payload), counted


def _framed(frame: Frame, layout: MessageLayout, payload: bytes) -> bytes:
    """A frame of the same sender and number around another payload, without a signature."""
    header = bytearray(frame.raw[: HEADER_1 if frame.version == 1 else HEADER_2])
    header[1] = len(payload)
    if frame.version != 1:
        header[2] &= ~SIGNED_FLAG
    body = bytes(header) + payload
    checksum = crc16.mcrf4xx(bytes((layout.crc_extra,)), crc16.mcrf4xx(body[1:]))
    return body + checksum.to_bytes(2, "little")


# --- fields ---------------------------------------------------------------------------------------


@cache
def _edits(msg_id: int) -> tuple[_Edit, ...]:
    """What has to be done to the fields of a message."""
    layout = LAYOUTS[msg_id]
    found, offset = [], 0
    id_at = _offset_of(layout, "param_id")
    others = _other_axes(layout)
    for field in layout.wire_fields:
        as_place = AS_PLACE.get(layout.name, {}).get(field.name)
        what = "place" if as_place else _what(layout.name, field)
        if what:
            name = as_place or DISPLACEMENTS.get((layout.name, field.name), field.name)
            is_sure = what == "place" and not as_place
            other_at = _offset_of(layout, others[field.name]) if field.name in others else -1
            found.append(
                _Edit(what, name, field.type_name, offset, field.size, is_sure, id_at, other_at)
            )
        offset += field.size
    return tuple(found)


def _what(message: str, field: WireField) -> str:
    """What is done to a field; empty for nothing."""
    if field.type_name == "char":
        if field.name == "param_id" or NAMED.fullmatch(message):
            return ""
        return "text" if message == "STATUSTEXT" else "name"
    if message == "AUTOPILOT_VERSION" and field.name.startswith("uid"):
        return "id"
    if message in ("PARAM_VALUE", "PARAM_SET") and field.name == "param_value":
        return "parameter"
    if (message, field.name) in DISPLACEMENTS:
        return "metres"
    if field.name in anonymous_field.DECLINATIONS:
        return "declination"
    if is_identity(field.name):
        return "identity"
    if field.length == 0 and field.type_name in _PLACE_TYPES and which_of(field.name):
        return "place"
    return "date" if field.length == 0 and field.type_name in _DATE_TYPES else ""


def _other_axes(layout: MessageLayout) -> dict[str, str]:
    """The longitude that belongs to each latitude, and the other way round."""
    named: dict[str, list[WireField]] = {"latitude": [], "longitude": []}
    for field in layout.wire_fields:
        if which := which_of(field.name):
            named[which].append(field)
    found = {}
    for one, other in zip(*named.values(), strict=False):
        if one.type_name == other.type_name:
            found[one.name], found[other.name] = other.name, one.name
    return found


def _offset_of(layout: MessageLayout, name: str) -> int:
    """Where a field begins in the payload; its end if there is none of this name."""
    names = [field.name for field in layout.wire_fields]
    place = names.index(name) if name in names else len(names)
    return sum(field.size for field in layout.wire_fields[:place])


def _replaced(payload: bytes, edit: _Edit, by: Replacement) -> bytes:
    """The new bytes of a field in a whole payload."""
    old = payload[edit.offset : edit.offset + edit.size]
    if not any(old):
        return old
    if edit.what == "place":
        kind = _NUMPY[edit.type_name]
        stored = np.frombuffer(old, kind)
        other_axis = None if edit.other_at < 0 else np.frombuffer(payload, kind, 1, edit.other_at)
        moved = by.moved(edit.name, stored, is_sure=edit.is_sure, other=other_axis)
        return old if moved is None else moved.tobytes()
    if edit.what == "metres":
        return by.displaced(edit.name, np.frombuffer(old, "<f4")).tobytes()
    if edit.what == "date":
        dated = by.dated(edit.name, np.frombuffer(old, _NUMPY[edit.type_name]))
        return old if dated is None else dated.tobytes()
    if edit.what == "text":
        return by.text(old)
    if edit.what == "id":
        # The pseudonym is as long as the id, so that it is one of the same kind of autopilot.
        used = max(len(old.rstrip(b"\0")), min(ARDUPILOT_ID_BYTES, edit.size))
        return by.pseudonym(old[:used]).ljust(edit.size, b"\0")
    if edit.what in ("name", "identity"):
        return bytes(edit.size)
    if edit.what == "declination":
        (value,) = struct.unpack("<f", old)
        return struct.pack("<f", anonymous_field.declination(by.fields, edit.name, value))
    name = payload[edit.id_at : edit.id_at + PARAMETER_BYTES].split(b"\0", 1)[0]
    (value,) = struct.unpack("<f", old)
    other_value = by.parameter(name.decode("latin-1"), value)
    if other_value == value or math.isnan(value):
        return old
    return struct.pack("<f", other_value)
