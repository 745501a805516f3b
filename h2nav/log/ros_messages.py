"""The messages of ROS 2 that an exported bag has: their definitions, and their bytes in CDR.

A message is given as its values in the order of the definition, with those of nested messages in
between: ``(sec, nanosec, frame_id, x, y, z, w, ...)``; a sequence is a list of such tuples.

Source: OMG DDS-XTypes, plain CDR, little endian; ROS 2 common_interfaces and rcl_interfaces.
"""

import re
import struct
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from itertools import islice
from typing import Any

_DEFINITIONS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist",
    "geometry_msgs/Transform": (
        "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation"
    ),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "sensor_msgs/Imu": (
        "std_msgs/Header header\n"
        "geometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance"
    ),
    "sensor_msgs/MagneticField": (
        "std_msgs/Header header\n"
        "geometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\n"
        "diagnostic_msgs/KeyValue[] values"
    ),
    "diagnostic_msgs/DiagnosticArray": (
        "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
}
_FIELD = re.compile(r"(?m)^([a-z0-9_/A-Z]+)(\[\d*\])? \w+(?: [\d.]+)?$")
_FORMATS = {"float64": "d", "int32": "i", "uint32": "I", "byte": "B", "string": "s"}
_SIZES = {"d": 8, "i": 4, "I": 4, "B": 1}
_LITTLE_ENDIAN_CDR = b"\x00\x01\x00\x00"
_LENGTH = struct.Struct("<I")

# What follows one another in a message: a format with a number of values, or a sequence's element.
_Plan = list[tuple[str, int] | tuple["_Plan", int]]


def full_name(name: str) -> str:
    """``sensor_msgs/Imu`` as types are called in a bag: ``sensor_msgs/msg/Imu``."""
    return name.replace("/", "/msg/")


def definition(name: str) -> bytes:
    """A type's definition with those of all types in it, as encoding ``ros2msg`` has it."""
    nested = "".join(f"\n{'=' * 80}\nMSG: {each}\n{_DEFINITIONS[each]}" for each in _nested(name))
    return (_DEFINITIONS[name] + nested).encode()


def encode(name: str, values: Iterable[Any]) -> bytes:
    """A message's bytes.

    Args:
        name: of the type, such as ``sensor_msgs/Imu``.
        values: as the module says.
    """
    data = bytearray()  # places are counted from behind the head
    _append(data, _plan(name), iter(values))
    return _LITTLE_ENDIAN_CDR + data


def _nested(name: str) -> list[str]:
    found: dict[str, None] = {}
    for kind, _ in _FIELD.findall(_DEFINITIONS[name]):
        if kind in _DEFINITIONS:
            found |= dict.fromkeys([kind, *_nested(kind)])
    return list(found)


@cache
def _plan(name: str) -> _Plan:
    plan: _Plan = []
    for kind, brackets in _FIELD.findall(_DEFINITIONS[name]):
        if brackets == "[]":
            plan.append((_plan(kind), 0))
        elif kind in _DEFINITIONS:
            plan += _plan(kind)
        else:
            plan.append((_FORMATS[kind], int(brackets[1:-1] or 1) if brackets else 1))
    return _joined(plan)


def _joined(plan: _Plan) -> _Plan:
    """The same with neighbours of one format together: they need no padding between them."""
    joined: _Plan = []
    for step in plan:
        kind, count = step
        if isinstance(kind, str) and kind in _SIZES and joined and kind == joined[-1][0]:
            joined[-1] = (kind, joined[-1][1] + count)
        else:
            joined.append(step)
    return joined


def _append(data: bytearray, plan: _Plan, values: Iterator[Any]) -> None:
    for kind, count in plan:
        if isinstance(kind, list):
            _append_sequence(data, kind, next(values))
        elif kind == "s":
            text = next(values).encode(errors="replace") + b"\0"
            _align(data, 4)
            data += _LENGTH.pack(len(text)) + text
        else:
            _align(data, _SIZES[kind])
            data += struct.pack(f"<{count}{kind}", *islice(values, count))


def _append_sequence(data: bytearray, plan: _Plan, elements: Sequence[Iterable[Any]]) -> None:
    _align(data, 4)
    data += _LENGTH.pack(len(elements))
    for element in elements:
        _append(data, plan, iter(element))


def _align(data: bytearray, size: int) -> None:
    data += bytes(-len(data) % size)
