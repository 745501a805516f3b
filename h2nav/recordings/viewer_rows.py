"""Attitude and position of recorded messages, in schemas that viewers draw by themselves."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from foxglove_schemas_protobuf.LocationFix_pb2 import LocationFix
from numpy.typing import NDArray

from h2nav.log.foxglove_messages import AttitudeMessages, descriptor_set, protobuf_schemas
from h2nav.maths.rows import Array, from_euler
from h2nav.maths.units import DEG, SECOND_NS
from h2nav.recordings.protobuf_rows import Rows
from h2nav.recordings.rotations import are_units
from h2nav.recordings.row_tables import Table

LOCATION_TOPIC = "/location"
SCHEMAS = {
    **{topic: schema for topic, schema in protobuf_schemas().items() if topic != "/log"},
    LOCATION_TOPIC: (LocationFix.DESCRIPTOR.full_name, descriptor_set(LocationFix)),
}
"""Topic -> schema name and descriptors of all channels of this module."""


class ViewerMessages(NamedTuple):
    """Messages of one topic."""

    topic: str  # a key of `SCHEMAS`
    rows: NDArray[np.int64]  # (M,) number of the row that each one shows
    messages: list[bytes]  # (M,)


class _Columns(NamedTuple):
    """Where a message has an attitude or a position."""

    names: tuple[str, ...]
    factors: tuple[float, ...]  # of their units, to radians, degrees of position, meters


def _same(names: tuple[str, ...], factor: float = 1.0) -> _Columns:
    return _Columns(names, (factor,) * len(names))


ANGLES = {
    "dataflash.ATT": _same(("Roll", "Pitch", "Yaw"), DEG),
    "mavlink.ATTITUDE": _same(("roll", "pitch", "yaw")),
}
QUATERNIONS = {"ulog.vehicle_attitude": _same(("q[0]", "q[1]", "q[2]", "q[3]"))}
PLACES = {
    "dataflash.GPS": (_same(("Lat", "Lng", "Alt")),),
    "mavlink.GPS_RAW_INT": (_Columns(("lat", "lon", "alt"), (1e-7, 1e-7, 1e-3)),),
    "ulog.sensor_gps": (
        _same(("latitude_deg", "longitude_deg", "altitude_msl_m")),
        _Columns(("lat", "lon", "alt"), (1e-7, 1e-7, 1e-3)),
    ),
    "ulog.vehicle_gps_position": (
        _same(("latitude_deg", "longitude_deg", "altitude_msl_m")),
        _Columns(("lat", "lon", "alt"), (1e-7, 1e-7, 1e-3)),
    ),
}


def viewer_messages(
    schema: str, rows: Rows, divisors: Mapping[str, float], unix_ns: NDArray[np.int64]
) -> Iterator[ViewerMessages]:
    """The attitude as ``/tf`` and ``/pose``, the position as ``/location``.

    Args:
        schema: of the rows, such as ``dataflash.ATT``.
        rows: (N,) structured, as stored.
        divisors: of the columns stored as multiples of a fraction.
        unix_ns: (N,) their times.
    """
    table = Table(schema, np.arange(len(rows)), rows, divisors)
    if schema in ANGLES:
        angles = _values(table, ANGLES[schema])
        good = np.flatnonzero(np.isfinite(angles).all(axis=1))
        yield from _attitudes(good, unix_ns[good], from_euler(angles[good]))
    elif schema in QUATERNIONS:
        q_nb = _values(table, QUATERNIONS[schema])
        good = np.flatnonzero(are_units(q_nb))
        yield from _attitudes(good, unix_ns[good], q_nb[good])
    for columns in PLACES.get(schema, ()):
        if all(name in table for name in columns.names):
            places = _values(table, columns)
            has_fix = np.isfinite(places).all(axis=1) & places[:, :2].any(axis=1)
            yield _locations(np.flatnonzero(has_fix), unix_ns[has_fix], places[has_fix])
            return


def _values(table: Table, columns: _Columns) -> Array:
    """(N, k) columns in the units of `_Columns`; NaN where the message lacks one."""
    found: Array = table.numbers_or_nan(*columns.names) * columns.factors
    return found


def _attitudes(
    rows: NDArray[np.int64], unix_ns: NDArray[np.int64], q_nb: Array
) -> Iterator[ViewerMessages]:
    attitudes = AttitudeMessages()
    encoders: dict[str, Callable[..., bytes]] = {
        "/tf": attitudes.transform,
        "/pose": attitudes.pose,
    }
    times, rotations = unix_ns.tolist(), q_nb.tolist()
    for topic, encode in encoders.items():
        yield ViewerMessages(topic, rows, list(map(encode, times, rotations)))


def _locations(
    rows: NDArray[np.int64], unix_ns: NDArray[np.int64], places: Array
) -> ViewerMessages:
    messages = []
    for at_ns, (latitude, longitude, altitude) in zip(
        unix_ns.tolist(), places.tolist(), strict=True
    ):
        fix = LocationFix(latitude=latitude, longitude=longitude, altitude=altitude)
        fix.timestamp.seconds, fix.timestamp.nanos = divmod(at_ns, SECOND_NS)
        messages.append(fix.SerializeToString())
    return ViewerMessages(LOCATION_TOPIC, rows, messages)
