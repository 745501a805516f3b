"""Encodes records of flat scalars as JSON, with a JSON Schema that names every unit.

No integer in the JSON exceeds 2^53, because viewers read numbers as doubles. Points in time in
nanoseconds (``t_ns``, ``unix_ns`` and fields that end so) become ``{"sec", "nsec"}``; any other
integer beyond the limit becomes null, as do NaN and the infinities. Every field may be null: the
schema gives its type otherwise.
"""

import inspect
import re
import types
import typing
from collections.abc import Callable
from enum import Enum
from typing import Any, NamedTuple

import orjson

from h2nav.maths.units import SECOND_NS

LARGEST_JSON_INTEGER = 2**53 - 1

# Longest ending first: gyro_x_rad_s is a rate, not a number of seconds.
_UNITS = (
    ("_rad_s_rthz", "rad/s/sqrt(Hz)"),
    ("_deg_s_rthz", "deg/s/sqrt(Hz)"),
    ("_rad_s2", "rad/s^2"),
    ("_rad_s", "rad/s"),
    ("_deg_s", "deg/s"),
    ("_m_s2", "m/s^2"),
    ("_m_s", "m/s"),
    ("_bytes_s", "bytes/s"),
    ("_deg_c", "degrees Celsius"),
    ("_percent", "%"),
    ("_bytes", "bytes"),
    ("_ppm", "ppm"),
    ("_rad", "rad"),
    ("_deg", "deg"),
    ("_hz", "Hz"),
    ("_hpa", "hPa"),
    ("_ut", "microtesla"),
    ("_ns", "ns"),
    ("_us", "microseconds"),
    ("_ms", "ms"),
    ("_s", "s"),
    ("_m", "m"),
    ("_v", "V"),
)
_JSON_TYPES = {float: "number", int: "integer", bool: "boolean", str: "string"}
_POINT_IN_TIME = re.compile(r"(^|_)(t|unix)_ns$")
_TIME_SCHEMA = {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}


class RecordFormat(NamedTuple):
    """The encoding of one type of record."""

    name: str  # schema name, ``h2nav.<class>``
    schema: bytes  # JSON Schema, UTF-8
    encode: Callable[[Any], bytes]  # encodes a record as JSON, UTF-8


def record_format(record_type: type[Any]) -> RecordFormat:
    """The format of a NamedTuple of int, float, bool, str, an enumeration of those, or None.

    Args:
        record_type: the class; units come from its field names, descriptions from the
            ``Attributes`` section of its docstring. A field without a description takes the
            previous one whose name differs in one word (``gyro_y_rad_s`` takes that of
            ``gyro_x_rad_s``).

    Raises:
        TypeError: a class or field of another kind.
    """
    if not (issubclass(record_type, tuple) and hasattr(record_type, "_fields")):
        raise TypeError(f"{record_type.__name__} is not a NamedTuple")
    hints = typing.get_type_hints(record_type)
    texts = _descriptions(record_type)
    properties = {
        name: _property(record_type, name, hints[name], texts.get(name, ""))
        for name in record_type._fields
    }
    schema = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": record_type.__name__,
        "description": inspect.cleandoc(record_type.__doc__ or "").partition("\n")[0],
        "type": "object",
        "properties": properties,
    }
    return RecordFormat(
        f"h2nav.{record_type.__name__}", orjson.dumps(schema), _encoder(record_type._fields)
    )


def unit_of(field_name: str) -> str:
    """The unit at the end of a field's name; empty if there is none."""
    return next((unit for ending, unit in _UNITS if field_name.endswith(ending)), "")


def time_object(t_ns: int) -> dict[str, int]:
    """Nanoseconds in the form that viewers accept as a time."""
    sec, nsec = divmod(t_ns, SECOND_NS)
    return {"sec": sec, "nsec": nsec}


def time_from_object(value: Any) -> Any:
    """The nanoseconds of a `time_object`; any other value unchanged."""
    if isinstance(value, dict) and value.keys() == {"sec", "nsec"}:
        sec, nsec = value["sec"], value["nsec"]
        if type(sec) is type(nsec) is int:
            return sec * SECOND_NS + nsec
    return value


def _property(record_type: type[Any], name: str, hint: Any, text: str) -> dict[str, Any]:
    optional = typing.get_origin(hint) in (typing.Union, types.UnionType)
    members = [m for m in typing.get_args(hint) if m is not type(None)] if optional else [hint]
    scalar = members[0] if len(members) == 1 else None
    json_type = _json_type(scalar)
    if json_type is None:
        raise TypeError(
            f"{record_type.__name__}.{name}: a log field is int, float, bool, str or one of "
            f"these or None, not {hint}"
        )
    unit = unit_of(name)
    described = {"description": f"{text} [{unit}]".strip()} if unit else {"description": text}
    if _POINT_IN_TIME.search(name):
        return {"type": "object", "properties": _TIME_SCHEMA, **described}
    # A list of types ("number" or "null") would be exact, but viewers reject it and accept null.
    return {"type": json_type, **described}


def _json_type(scalar: Any) -> str | None:
    if not isinstance(scalar, type):
        return None
    if issubclass(scalar, Enum):
        scalar = next((base for base in (int, str) if issubclass(scalar, base)), None)
    return _JSON_TYPES.get(scalar) if scalar is not None else None


def _encoder(fields: tuple[str, ...]) -> Callable[[Any], bytes]:
    times = [(name, fields.index(name)) for name in fields if _POINT_IN_TIME.search(name)]

    def encode(record: tuple[Any, ...]) -> bytes:
        values = dict(zip(fields, record, strict=True))
        for name, place in times:
            if record[place] is not None:
                values[name] = time_object(record[place])
        return json_object(values)

    return encode


def json_object(values: dict[str, Any]) -> bytes:
    """Encodes fields as a JSON object; NaN and integers beyond 2^53 become null."""
    try:
        return orjson.dumps(values, option=orjson.OPT_STRICT_INTEGER)
    except orjson.JSONEncodeError:
        return orjson.dumps({name: _within_json(value) for name, value in values.items()})


def _within_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_within_json(each) for each in value]
    too_large = isinstance(value, int) and abs(value) > LARGEST_JSON_INTEGER
    return None if too_large else value


def _descriptions(record_type: type[Any]) -> dict[str, str]:
    """Field name -> text, from the docstring's ``Attributes`` or a similar field."""
    _, _, section = inspect.cleandoc(record_type.__doc__ or "").partition("Attributes:\n")
    written: dict[str, str] = {}
    name = ""
    for line in section.splitlines():
        if line and not line.startswith(" "):
            break
        entry = re.match(r" {2,4}(\w+): (.*)", line)
        if entry:
            name = entry[1]
            written[name] = entry[2].strip()
        elif name and line.strip():
            written[name] += " " + line.strip()
    texts: dict[str, str] = {}
    for field in record_type._fields:
        similar = [other for other in texts if _differ_in_one_word(field, other)]
        texts[field] = written.get(field) or (texts[similar[-1]] if similar else "")
    return texts


def _differ_in_one_word(one: str, other: str) -> bool:
    ours, theirs = one.split("_"), other.split("_")
    if len(ours) < 2 or len(ours) != len(theirs):
        return False
    return sum(a != b for a, b in zip(ours, theirs, strict=True)) == 1
