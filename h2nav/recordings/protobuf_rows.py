"""Rows of a structured array as protobuf messages, many at once.

Every number is stored in a type of fixed length and every column is present, so that all messages
of a schema have the same bytes in the same places: numpy writes them as rows of one array. Only
texts, which are rare in logs of sensors, are added row by row.
"""

import re
from collections.abc import Iterator, Mapping
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet
from numpy.typing import NDArray

Rows = NDArray[np.void]

WIRE_64, WIRE_LENGTH, WIRE_32 = 1, 2, 5
NOT_A_NAME = re.compile(r"\W+", re.ASCII)
ELEMENT = re.compile(r"(.+)\[\d+\]")
UNDERSCORES = re.compile(r"_+(.?)")


class _Form(NamedTuple):
    """How a number is stored."""

    dtype: np.dtype[Any]
    kind: Any  # protobuf's type
    wire: int  # its wire type


def _form(dtype: str, kind: Any, wire: int) -> _Form:
    return _Form(np.dtype(dtype), kind, wire)


SIGNED_32 = _form("<i4", FieldDescriptorProto.TYPE_SFIXED32, WIRE_32)
UNSIGNED_32 = _form("<u4", FieldDescriptorProto.TYPE_FIXED32, WIRE_32)
SIGNED_64 = _form("<i8", FieldDescriptorProto.TYPE_SFIXED64, WIRE_64)
UNSIGNED_64 = _form("<u8", FieldDescriptorProto.TYPE_FIXED64, WIRE_64)
FLOAT = _form("<f4", FieldDescriptorProto.TYPE_FLOAT, WIRE_32)
DOUBLE = _form("<f8", FieldDescriptorProto.TYPE_DOUBLE, WIRE_64)
# By numpy's letter and size in bytes; what is smaller is stored in the next larger type.
FORMS = {"i": (SIGNED_32, SIGNED_64), "u": (UNSIGNED_32, UNSIGNED_64), "f": (FLOAT, DOUBLE)}


class _Field(NamedTuple):
    """A field of the messages."""

    name: str  # in the schema
    columns: tuple[str, ...]  # of the rows; several make an array
    form: _Form | None  # of its numbers; None for a text
    length: int | None  # of an array; None for a single value
    divisor: float | None  # of values stored as multiples of a fraction

    @property
    def wire(self) -> int:
        """Its wire type; arrays are packed."""
        return WIRE_LENGTH if self.form is None or self.length is not None else self.form.wire


class RowMessages:
    """The messages of one schema.

    Args:
        name: of the schema, such as ``dataflash.IMU``; its last part names the message.
        row: the columns; subarrays and columns ``name[0]``, ``name[1]``, ... become arrays.
        divisors: of the columns stored as multiples of a fraction, which become doubles.

    Attributes:
        name: of the schema, as protobuf accepts it.
        schema: its descriptors (a FileDescriptorSet), as MCAP wants them.
        columns: field -> its column, or the first one of an array.
    """

    def __init__(self, name: str, row: np.dtype[np.void], divisors: Mapping[str, float]) -> None:
        package, _, message = name.partition(".")
        self.name = f"{package}.{_name(message, set())}"
        self._fields = tuple(_fields(row, divisors))
        self.schema = _schema(self.name, self._fields)
        self.columns = {field.name: field.columns[0] for field in self._fields}
        self._texts = [
            (_varint(number << 3 | WIRE_LENGTH), field.columns[0])
            for number, field in enumerate(self._fields, 1)
            if field.form is None
        ]
        self._blank = _blank(self._fields)

    def encode(self, rows: Rows) -> list[bytes]:
        """One message per row.

        Args:
            rows: (N,) of the type that was given.
        """
        filled = np.repeat(self._blank, len(rows))
        for number, field in enumerate(self._fields, 1):
            if field.form is None:
                continue
            values = filled[f"value {number}"]
            if len(field.columns) == 1:
                values[...] = _scaled(rows[field.columns[0]], field.divisor)
                continue
            for place, column in enumerate(field.columns):
                values[:, place] = _scaled(rows[column], field.divisor)
        size, data = filled.dtype.itemsize, filled.tobytes()
        messages = [data[size * row : size * (row + 1)] for row in range(len(rows))]
        for tag, column in self._texts:
            texts = [_utf8(stored) for stored in rows[column].tolist()]
            messages = [
                b"".join((message, tag, _varint(len(text)), text))
                for message, text in zip(messages, texts, strict=True)
            ]
        return messages


def _scaled(stored: NDArray[Any], divisor: float | None) -> NDArray[Any]:
    return stored if divisor is None else stored / divisor


def _utf8(stored: bytes) -> bytes:
    """A text up to its first zero, with invalid UTF-8 replaced."""
    return bytes(stored).split(b"\0", 1)[0].decode("utf-8", "replace").encode()


def _fields(row: np.dtype[np.void], divisors: Mapping[str, float]) -> Iterator[_Field]:
    """The fields of a row, with names that protobuf accepts."""
    taken: set[str] = set()
    for base, group in groupby(row.names or (), _array_name):
        columns = tuple(group)
        types = {row[column] for column in columns}
        if len(types) == 1 and len(columns) > 1:
            yield _field(_name(base, taken), columns, types.pop(), len(columns), None)
            continue
        for column in columns:
            dtype = row[column]
            length = dtype.shape[0] if dtype.shape else None
            name = _name(column, taken)
            yield _field(name, (column,), dtype.base, length, divisors.get(column))


def _array_name(column: str) -> str:
    element = ELEMENT.fullmatch(column)
    return element[1] if element else column


def _field(
    name: str,
    columns: tuple[str, ...],
    dtype: np.dtype[Any],
    length: int | None,
    divisor: float | None,
) -> _Field:
    if dtype.kind == "S":
        return _Field(name, columns, None, None, None)
    small, large = FORMS[dtype.kind]
    form = DOUBLE if divisor is not None else small if dtype.itemsize <= 4 else large
    return _Field(name, columns, form, length, divisor)


def _name(column: str, taken: set[str]) -> str:
    """A column's name in letters, digits and underscores, once; also as JSON, which has none."""
    name = NOT_A_NAME.sub("_", column).strip("_") or "field"
    if name[0].isdigit():
        name = f"_{name}"
    while (in_json := UNDERSCORES.sub(lambda found: found[1].upper(), name)) in taken:
        name += "_2"
    taken.add(in_json)
    return name


def _blank(fields: tuple[_Field, ...]) -> Rows:
    """(1,) a message without texts whose values are zero: only the tags are set."""
    columns: list[Any] = []
    tags: dict[str, bytes] = {}
    for number, field in enumerate(fields, 1):
        if field.form is None:
            continue
        tag = _varint(number << 3 | field.wire)
        shape: tuple[int, ...] = ()
        if field.length is not None:
            shape = (field.length,)
            tag += _varint(field.length * field.form.dtype.itemsize)
        tags[f"tag {number}"] = tag
        columns += [(f"tag {number}", f"V{len(tag)}"), (f"value {number}", field.form.dtype, shape)]
    blank = np.zeros(1, np.dtype(columns))
    for name, tag in tags.items():
        blank[name] = np.frombuffer(tag, f"V{len(tag)}")
    return blank


def _varint(number: int) -> bytes:
    found = bytearray()
    while number > 127:
        found.append(number & 127 | 128)
        number >>= 7
    found.append(number)
    return bytes(found)


def _schema(name: str, fields: tuple[_Field, ...]) -> bytes:
    package, _, message_name = name.rpartition(".")
    descriptors = FileDescriptorSet()
    file = descriptors.file.add(name=f"{name}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=message_name)
    for number, field in enumerate(fields, 1):
        message.field.add(
            name=field.name,
            number=number,
            type=FieldDescriptorProto.TYPE_STRING if field.form is None else field.form.kind,
            label=(
                FieldDescriptorProto.LABEL_OPTIONAL
                if field.length is None
                else FieldDescriptorProto.LABEL_REPEATED
            ),
        )
    return descriptors.SerializeToString()
