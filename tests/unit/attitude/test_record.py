"""Records: one declaration gives fields, ranges, flat numbers and the struct in C."""

import ctypes
import math
from dataclasses import dataclass

import pytest

from h2nav.attitude.constant_gain import memory as constant_gain
from h2nav.attitude.record import (
    Row,
    assign,
    copy,
    grids_of,
    in_c,
    integer,
    integer_row,
    integers,
    is_in_c,
    reader,
    real,
    reals,
    row,
    rows,
    size_of,
    values,
    writer,
)
from h2nav.attitude.velocity_aided import memory as velocity_aided
from h2nav.attitude.velocity_aided.integer import memory as velocity_aided_integer

MODULES = (constant_gain, velocity_aided, velocity_aided_integer)
RECORDS = [
    pytest.param(record, id=f"{module.__name__.removeprefix('h2nav.attitude.')}.{record.__name__}")
    for module in MODULES
    for name in ("State", "Workspace", "Gains", "Sample")
    if (record := getattr(module, name, None))
]


@dataclass(slots=True)
class Integers:
    """A record of integers."""

    level: int = integer(-100, 100, "m", "the level", q=3)
    parts: list[int] = integers(3, 0, 9, "", "its parts")
    age_us: int = integer(-1, 1 << 30, "us", "its age")


@dataclass(slots=True)
class Reals:
    """A record of floats."""

    level: float = real("m", "the level")
    parts: list[float] = reals(2, "s", "its parts")


def test_rows_are_as_declared_and_named() -> None:
    assert rows(Integers) == (
        Row("level", None, (-100, 100), "m", "the level", 3),
        Row("parts", 3, (0, 9), "", "its parts", 0),
        Row("age_us", None, (-1, 1 << 30), "us", "its age", 0),
    )
    assert rows(Reals) == (
        Row("level", None, None, "m", "the level"),
        Row("parts", 2, None, "s", "its parts"),
    )
    assert row(Integers, "parts").length == 3
    assert size_of(Reals) == 3
    assert row(Integers, "level").length == 1
    assert size_of(Integers) == 5


def test_a_new_record_is_of_zeros_and_shares_no_vector() -> None:
    first, second = Integers(), Integers()
    assert values(first, Integers) == [0] * 5
    first.parts[0] = 7
    assert second.parts == [0, 0, 0]


def test_a_misspelt_field_is_an_error() -> None:
    with pytest.raises(AttributeError):
        Integers().levle = 3  # type: ignore[attr-defined]


def test_numbers_go_out_and_in_by_place() -> None:
    record = Integers()
    parts = record.parts
    assign(record, Integers, [-100, 1, 2, 3, 5])
    assert (record.level, record.parts, record.age_us) == (-100, [1, 2, 3], 5)
    assert record.parts is parts  # whoever holds the vector sees the change
    assert values(record, Integers) == [-100, 1, 2, 3, 5]


@pytest.mark.parametrize(
    ("record_type", "numbers", "reason"),
    [
        (Integers, [0, 0, 0, 0], "4 numbers for the 5 of a record"),
        (Integers, [0, 0, 0, 0, 0, 0], "6 numbers"),
        (Integers, [101, 0, 0, 0, 0], r"level holds 101, outside -100\.\.100"),
        (Integers, [1, 0, 0, 10, 0], r"parts holds 10, outside 0\.\.9"),
        (Integers, [1, 0, 0, 0, -2], "age_us holds -2"),
        (Integers, [1, 0, 0, 0, math.nan], "age_us holds nan"),
        (Reals, [1.0, math.nan, 0.0], "parts holds nan"),
        (Reals, [math.inf, 0.0, 0.0], "level holds inf"),
    ],
)
def test_refused_numbers_change_nothing(
    record_type: type, numbers: list[float], reason: str
) -> None:
    record = record_type()
    before = values(record, record_type)
    with pytest.raises(ValueError, match=reason):
        assign(record, record_type, numbers)
    assert values(record, record_type) == before


@pytest.mark.parametrize(
    ("value", "expected"), [(1.5, 12), (-1.0, -8), (0.06, 0), (0.07, 1), (13.0, 100), (-99.0, -100)]
)
def test_a_value_becomes_the_nearest_integer_inside_the_range(value: float, expected: int) -> None:
    assert row(Integers, "level").fixed(value) == expected


def test_what_is_no_number_becomes_no_integer() -> None:
    with pytest.raises(ValueError, match="not a number"):
        row(Integers, "level").fixed(math.nan)


def test_in_c_is_the_same_record_in_one_piece_of_memory() -> None:
    record = in_c(Integers)
    assert is_in_c(record)
    assert not is_in_c(Integers())
    assert isinstance(record, ctypes.Structure)
    record.level = -3
    record.parts[:] = [4, 5, 6]
    record.age_us += 7
    assert values(record, Integers) == [-3, 4, 5, 6, 7]
    assert list((ctypes.c_int32 * 5).from_buffer(record)) == [-3, 4, 5, 6, 7]
    assign(record, Integers, [1, 2, 3, 4, 5])
    assert (record.level, list(record.parts), record.age_us) == (1, [2, 3, 4], 5)
    floats = in_c(Reals)
    assign(floats, Reals, [0.5, 1.5, 2.5])
    assert list((ctypes.c_double * 3).from_buffer(floats)) == [0.5, 1.5, 2.5]


def test_a_copy_goes_to_c_and_back() -> None:
    first, second, third = Integers(), in_c(Integers), Integers()
    assign(first, Integers, [1, 2, 3, 4, 5])
    copy(first, second, Integers)
    copy(second, third, Integers)
    first.parts[0] = second.parts[0] = 9  # nothing is shared
    assert values(third, Integers) == [1, 2, 3, 4, 5]
    assert isinstance(third.parts, list)


@pytest.mark.parametrize(
    ("unit", "per", "told"),
    [
        ("m", 1.0, "m"),
        ("", 1.0, ""),
        ("m", 0.5, "0.5 m"),
        ("", 67.108864, "67.1089"),
        ("m", (0.5, 0.5), "0.5 m"),
        ("m", (0.5, 0.5, 2.0), "0.5 m; the last 2 m"),
        ("", (0.5, 2.0), "0.5; the last 2"),
        ("m", (1.0, 2.0), "1 m; the last 2 m"),
        ("m", (2.0, 1.0), "2 m; the last 1 m"),
    ],
)
def test_the_integers_of_a_float_field_tell_what_they_count_in(unit, per, told) -> None:
    """Plain where 2^q stands for one, and once where all elements are alike."""
    size = len(per) if isinstance(per, tuple) else None
    of_floats = Row("level", size, None, unit, "a", grids=grids_of((4, per, -2.0, 2.0)))
    assert integer_row(of_floats) == Row("level", size, (-31, 31), told, "a", 4)


@pytest.mark.parametrize("record_type", RECORDS)
def test_the_filters_records_have_one_kind_of_number_and_no_gap_in_c(record_type: type) -> None:
    """An array of their numbers and their struct are the same memory."""
    kinds = {found.range is None for found in rows(record_type)}
    assert len(kinds) == 1
    number = ctypes.c_double if kinds == {True} else ctypes.c_int32
    record = in_c(record_type)
    assert isinstance(record, ctypes.Structure)
    assert ctypes.sizeof(record) == size_of(record_type) * ctypes.sizeof(number)
    for found in rows(record_type):
        low, high = found.range or (0, 0)
        assert -(1 << 31) <= low <= high < 1 << 31, found.name
        assert found.about, found.name


@pytest.mark.parametrize("made", [velocity_aided.State, lambda: in_c(velocity_aided.State)])
def test_a_reader_gives_the_numbers_of_its_fields_as_they_are_now(made):
    memory = made()
    read = reader(memory, velocity_aided.State, ("gyro_bias", "p_xx", "fix_lag_s"))
    memory.gyro_bias[:] = [1.0, 2.0, 3.0]
    memory.q_nb[:] = [9.0, 9.0, 9.0, 9.0]
    memory.p_xx, memory.fix_lag_s = 4.0, 5.0
    assert read() == (1.0, 2.0, 3.0, 4.0, 5.0)


@pytest.mark.parametrize("names", [("p_xx", "gyro_bias"), ("p_xx", "nonsense")])
def test_a_reader_of_a_struct_refuses_fields_out_of_order_and_unknown_ones(names):
    with pytest.raises(ValueError, match="order"):
        reader(in_c(velocity_aided.State), velocity_aided.State, names)


@pytest.mark.parametrize("made", [Integers, lambda: in_c(Integers)])
def test_integers_are_read_and_written_at_once(made):
    record = made()
    read = reader(record, Integers, ("parts", "age_us"))
    writer(record, Integers, "parts", "age_us")(4, 5, 6, 7)
    assert values(record, Integers) == [0, 4, 5, 6, 7]
    assert read() == (4, 5, 6, 7)


@pytest.mark.parametrize("made", [velocity_aided.Sample, lambda: in_c(velocity_aided.Sample)])
def test_a_writer_changes_its_fields_and_no_other(made):
    sample = made()
    sample.dt_s, sample.has_mag = 0.25, 1.0
    write = writer(sample, velocity_aided.Sample, "gyro", "accel")
    for start in (1.0, 2.0):
        write(*(start + i for i in range(6)))
        assert list(sample.gyro) == [start, start + 1.0, start + 2.0]
        assert list(sample.accel) == [start + 3.0, start + 4.0, start + 5.0]
    assert (sample.dt_s, sample.has_mag, list(sample.mag)) == (0.25, 1.0, [0.0, 0.0, 0.0])
