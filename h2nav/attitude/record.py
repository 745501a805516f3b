"""Records of the kernels: state, gains and samples, each field declared once and used by name.

A record is a dataclass with slots whose fields are made by `real`, `reals`, `integer` and
`integers`. From that declaration follow the attribute for the kernels, the range that the
translator proves, the member of the C struct, the check of a restored state, and the table of
symbols in the documents.
"""

import ctypes
import functools
import itertools
import struct
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import MISSING, Field, field, fields, make_dataclass
from operator import le
from typing import Any, NamedTuple, TypeVar, cast

from h2nav.maths.fixedpoint import to_fixed

Number = float | int
R = TypeVar("R")


class Grid(NamedTuple):
    """The integers that stand for the numbers of a float field: each for itself times the step."""

    step: float  # in the field's unit
    low: int  # lowest integer
    high: int  # highest integer, included
    saturates: bool = False  # what would leave the range stays at its end; else nothing leaves it
    q: int = 0  # fraction bits: the step is `per` 2^-q
    per: float = 1.0  # what 2^q stands for, in the field's unit


class Row(NamedTuple):
    """One field of a record."""

    name: str  # of the attribute and of the C member
    size: int | None  # length of a vector; None for a single number
    # lowest and highest value of an integer, both included; None for a float
    range: tuple[int, int] | None
    unit: str  # of the value; plain for a number without one
    about: str  # its meaning
    q: int = 0  # fraction bits of an integer, which represents value 2^-q
    # of a float: its form in integers, one for all numbers or one for each; empty if it has none
    grids: tuple[Grid, ...] = ()

    @property
    def length(self) -> int:
        """Number of values in the field."""
        return 1 if self.size is None else self.size

    def fixed(self, value: float) -> int:
        """The integer nearest to a value in the field's unit, clamped to the range.

        Raises:
            ValueError: `value` is not a number.
        """
        assert self.range is not None
        return to_fixed(value, self.q, *self.range)


# Fraction bits q of the integers of a float field; what 2^q stands for, in the field's unit (or one
# such number for each element); in that, the lowest value and what nothing reaches.
Form = tuple[int, float | tuple[float, ...], float, float]


def real(unit: str, about: str, form: Form | None = None) -> Any:
    """A field that is one float; in integers it has this form, and saturates at its ends."""
    made = Row("", None, None, unit, about, grids=grids_of(form))
    return field(default=0.0, metadata={"row": made})


def reals(size: int, unit: str, about: str, form: Form | None = None) -> Any:
    """A field that is a list of floats; see `real`."""
    made = Row("", size, None, unit, about, grids=grids_of(form))
    return field(default_factory=lambda: [0.0] * size, metadata={"row": made})


def grids_of(form: Form | None, *, saturates: bool = True) -> tuple[Grid, ...]:
    """The integers of a form: one, or one for each element."""
    if form is None:
        return ()
    q, units, low, limit = form
    ends = round(low * 2.0**q), round(limit * 2.0**q) - 1
    if ends[0] == -ends[1] - 1:
        ends = -ends[1], ends[1]
    each = units if isinstance(units, tuple) else (units,)
    return tuple(Grid(per / 2.0**q, *ends, saturates, q, per) for per in each)


def integer(low: int, high: int, unit: str, about: str, q: int = 0) -> Any:
    """A field that is one 32-bit integer from `low` to `high`."""
    return field(default=0, metadata={"row": Row("", None, (low, high), unit, about, q)})


def integers(size: int, low: int, high: int, unit: str, about: str, q: int = 0) -> Any:
    """A field that is a list of 32-bit integers, each from `low` to `high`."""
    made = Row("", size, (low, high), unit, about, q)
    return field(default_factory=lambda: [0] * size, metadata={"row": made})


def named_row(name: str, made: "Field[Any]") -> Row:
    """The row behind a field of this name."""
    nameless: Row = made.metadata["row"]
    return nameless._replace(name=name)


@functools.cache
def rows(record_type: type) -> tuple[Row, ...]:
    """The fields of a record, in the order of their places in memory."""
    return tuple(named_row(made.name, made) for made in fields(record_type))


def row(record_type: type, name: str) -> Row:
    """The row of one field."""
    return next(found for found in rows(record_type) if found.name == name)


def size_of(record_type: type) -> int:
    """Number of values in a record."""
    return sum(found.length for found in rows(record_type))


class _Layout(NamedTuple):
    """Where the numbers of a record stand in the order of memory, and their ranges."""

    single: tuple[tuple[str, int], ...]  # fields that are one number, and its place
    vectors: tuple[tuple[str, slice], ...]
    fields: tuple[str, ...]  # of each number
    lowest: tuple[Number, ...]
    highest: tuple[Number, ...]


@functools.cache
def _layout(record_type: type) -> _Layout:
    ranges = [
        (found.name, *(found.range or (-sys.float_info.max, sys.float_info.max)))
        for found in rows(record_type)
        for _ in range(found.length)
    ]
    names, lowest, highest = zip(*ranges, strict=True)
    starts = ((found, names.index(found.name)) for found in rows(record_type))
    places = [(found.name, found.size, start) for found, start in starts]
    single = tuple((name, start) for name, size, start in places if size is None)
    vectors = tuple((name, slice(start, start + size)) for name, size, start in places if size)
    return _Layout(single, vectors, names, lowest, highest)


def values(record: object, record_type: type) -> list[Number]:
    """All values of a record, in the order of memory."""
    layout = _layout(record_type)
    flat: list[Number] = [0] * len(layout.fields)
    for name, place in layout.single:
        flat[place] = getattr(record, name)
    for name, places in layout.vectors:
        flat[places] = getattr(record, name)
    return flat


def assign(record: object, record_type: type, flat: Sequence[Number]) -> None:
    """Writes all values of a record, in the order of memory.

    Raises:
        ValueError: a number is missing, outside its declared range, or not finite.
    """
    layout = _layout(record_type)
    if len(flat) != len(layout.fields):
        raise ValueError(f"{len(flat)} numbers for the {len(layout.fields)} of a record")
    limits = layout.lowest, layout.highest
    if not (all(map(le, limits[0], flat)) and all(map(le, flat, limits[1]))):
        each = zip(layout.fields, flat, *limits, strict=True)
        name, value, low, high = next(one for one in each if not one[2] <= one[1] <= one[3])
        raise ValueError(f"{name} holds {value}, outside {low}..{high}")
    for name, place in layout.single:
        setattr(record, name, flat[place])
    for name, places in layout.vectors:
        getattr(record, name)[:] = flat[places]


def copy(source: object, target: object, record_type: type) -> None:
    """Copies all values of a record into another of its type; either may be `in_c`."""
    for found in rows(record_type):
        value = getattr(source, found.name)
        if found.size is None:
            setattr(target, found.name, value)
        else:
            getattr(target, found.name)[:] = value[:]


def with_rows(record_type: type[R], before: Sequence[Row], after: Sequence[Row] = ()) -> type[R]:
    """The record with additional fields before and after its own."""
    own = [(made.name, Any, _again(made)) for made in fields(cast(Any, record_type))]
    names = {"__doc__": record_type.__doc__, "__module__": record_type.__module__}
    every = [*_all_made(before), *own, *_all_made(after)]
    made_type = make_dataclass(record_type.__name__, every, namespace=names, slots=True)
    return cast("type[R]", made_type)


def _all_made(rows_of: Sequence[Row]) -> list[tuple[str, Any, "Field[Any]"]]:
    return [(row.name, Any, _again(_made(row))) for row in rows_of]


def _made(row: Row) -> "Field[Any]":
    size = row.size
    if size is None:
        return cast("Field[Any]", field(default=0, metadata={"row": row}))
    return cast("Field[Any]", field(default_factory=lambda: [0] * size, metadata={"row": row}))


def integer_row(row: Row) -> Row:
    """The integer field of the same name that stands for a float field with a declared form."""
    grid = row.grids[0]
    units = [f"{one.per:.6g} {row.unit}".strip() for one in row.grids]
    unit = row.unit if grid.per == 1.0 else units[0]
    if len(set(units)) > 1:
        unit = f"{units[0]}; the last {units[-1]}"
    return Row(row.name, row.size, (grid.low, grid.high), unit, row.about, grid.q)


def _again(made: "Field[Any]") -> Any:
    """A new field with the same declaration: a dataclass field belongs to one record only."""
    if made.default is not MISSING:
        return field(default=made.default, metadata=made.metadata)
    assert made.default_factory is not MISSING
    return field(default_factory=made.default_factory, metadata=made.metadata)


def in_c(record_type: type[R]) -> R:
    """A record of zeros in the memory of its C struct, for the compiled kernels.

    It has the attributes of `record_type`, and its vectors take whole lists through ``[:]``.
    """
    return cast(R, _struct_of(cast(Any, record_type))())


def reader(
    record: object, record_type: type, names: Sequence[str]
) -> Callable[[], tuple[float, ...]]:
    """A function that reads some fields at once, as one tuple of numbers.

    Reading a C struct field by field costs ten times as much.

    Args:
        record: to be read.
        record_type: its type.
        names: of the fields, in the record's order.
    """
    if not is_in_c(record):
        return lambda: _flat(getattr(record, name) for name in names)
    found = [row for row in rows(record_type) if row.name in names]
    if [row.name for row in found] != list(names):
        raise ValueError("expected fields in the record's order")
    code, width = _number_format(record_type)
    layout = (
        f"{row.length}{code}" if row in found else f"{width * row.length}x"
        for row in rows(record_type)
    )
    return functools.partial(
        struct.Struct("".join(layout)).unpack_from, cast(ctypes.Structure, record)
    )


def writer(record: object, record_type: type, first: str, last: str) -> Callable[..., None]:
    """A function that writes adjacent fields at once, from one sequence of numbers.

    Args:
        record: to be written.
        record_type: its type.
        first: name of the first field.
        last: name of the last one.
    """
    if not is_in_c(record):
        return functools.partial(_write, record, _fields(record_type, first, last))
    code, width = _number_format(record_type)
    before, count = place_of(record_type, first, last)
    layout = struct.Struct(f"{count}{code}")
    return functools.partial(layout.pack_into, cast(ctypes.Structure, record), width * before)


def place_of(record_type: type, first: str, last: str) -> tuple[int, int]:
    """Where the numbers of adjacent fields begin in a record, and how many they are."""
    found = _fields(record_type, first, last)
    before = rows(record_type)[: rows(record_type).index(found[0])]
    return sum(row.length for row in before), sum(row.length for row in found)


def _fields(record_type: type, first: str, last: str) -> tuple[Row, ...]:
    names = [row.name for row in rows(record_type)]
    return rows(record_type)[names.index(first) : names.index(last) + 1]


def _write(record: object, found: Sequence[Row], *numbers: Number) -> None:
    coming = iter(numbers)
    for row in found:
        if row.size is None:
            setattr(record, row.name, next(coming))
        else:
            getattr(record, row.name)[:] = itertools.islice(coming, row.size)


def _number_format(record_type: type) -> tuple[str, int]:
    """Letter and size in bytes of a record's numbers, which are of one kind."""
    return ("d", 8) if rows(record_type)[0].range is None else ("i", 4)


def _flat(parts: Iterable[float | list[float]]) -> tuple[float, ...]:
    numbers: list[float] = []
    for part in parts:
        if isinstance(part, list):
            numbers += part
        else:
            numbers.append(part)
    return tuple(numbers)


def is_in_c(record: object) -> bool:
    """Whether `in_c` made the record."""
    return isinstance(record, ctypes.Structure)


@functools.cache
def _struct_of(record_type: Any) -> type[ctypes.Structure]:
    members = []
    for found in rows(record_type):
        number: type[Any] = ctypes.c_double if found.range is None else ctypes.c_int32
        members.append((found.name, number if found.size is None else number * found.size))
    return type(record_type.__name__, (ctypes.Structure,), {"_fields_": members})
