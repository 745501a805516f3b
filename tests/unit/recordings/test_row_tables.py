"""Columns of rows as stored: types, fractions, selections, and what damage makes of them."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage, table

from h2nav.recordings.columns import Field, Format, Source, column, messages_of, read, series
from h2nav.recordings.row_tables import LogTables, RowSource, Table, rows_of

NAN = math.nan


@pytest.mark.parametrize(
    ("values", "whole", "kind"),
    [
        (np.array([-5, 7], np.int8), [-5, 7], "i"),
        (np.array([0, 2**64 - 1], np.uint64), [0, 2**63 - 1], "u"),
        (np.array([1.9, -1.9]), [1, -1], "f"),
        (np.array([NAN, math.inf]), [0, 0], "f"),
        (np.array([1e300, -1e300]), [2**62, -(2**62)], "f"),
        (np.array([-math.inf, 2.0], np.float32), [0, 2], "f"),
    ],
)
def test_whole_numbers_of_any_type(values, whole, kind):
    made = table({"x": values})
    assert made.integers("x").tolist() == whole
    assert made.integers("x").dtype == np.int64
    assert made.kind("x") == kind


def test_numbers_in_the_units_of_the_log():
    rows = np.array([(150, 2, b"a"), (-50, 3, b"b")], [("x", "<i2"), ("y", "u1"), ("z", "S4")])
    made = Table("T", np.array([10, 20]), rows, {"x": 100.0})
    assert made.numbers("x").tolist() == [1.5, -0.5]
    assert made.numbers("y", "x").tolist() == [[2.0, 1.5], [3.0, -0.5]]
    assert made.integers("x").tolist() == [150, -50]
    assert (made.is_scaled("x"), made.is_scaled("y"), dict(made.divisors)) == (
        True, False, {"x": 100.0},
    )  # fmt: skip
    # What a damaged definition calls characters is no number, and a number is no text.
    np.testing.assert_array_equal(made.numbers("z", "y"), [[NAN, 2.0], [NAN, 3.0]])
    assert made.integers("z").tolist() == [0, 0]
    assert made.words("x") == [b"", b""]
    np.testing.assert_array_equal(made.numbers_or_nan("x", "w"), [[1.5, NAN], [-0.5, NAN]])
    assert made.numbers_or_nan("x").tolist() == [1.5, -0.5]
    assert np.isnan(made.numbers_or_nan("w")).tolist() == [True, True]


def test_selected_rows_of_selected_rows():
    made = table({"x": np.arange(10)})
    odd = made.only(np.arange(10) % 2 == 1)
    last = odd.only(np.array([False, False, False, True, True]))
    assert (odd.numbers("x").tolist(), last.numbers("x").tolist()) == ([1, 3, 5, 7, 9], [7, 9])
    assert (last.places.tolist(), len(last), last.name) == ([7, 9], 2, "X")
    assert last.stored_rows()["x"].tolist() == [7, 9]


def test_a_column_has_one_value_in_each_row():
    made = table({"x": np.zeros((2, 32)), "y": [1, 2]})
    assert ("x" in made, "y" in made, "z" in made) == (False, True, False)
    assert made.columns == ("x", "y")


@pytest.mark.parametrize(
    ("stored", "text"),
    [(b"abc", "abc"), (b"ab\0c", "ab"), (b"\0abc", ""), (b"\xff", "\ufffd"),
     ("\u00e4".encode(), "\u00e4")],
)  # fmt: skip
def test_a_text_ends_at_its_first_zero(stored, text):
    assert table({"x": np.array([stored], "S8")}).texts("x") == [text]


def test_rows_lie_anywhere_in_a_file():
    row = np.dtype([("x", "u1"), ("y", "<u2")])
    data = bytes(range(10))
    source = RowSource(data, np.array([1, 6]), lambda: row, {"y": 2.0})
    made = source.table("T")
    assert made.integers("x").tolist() == [1, 6]
    assert made.numbers("y").tolist() == [(2 + 3 * 256) / 2, (7 + 8 * 256) / 2]
    assert len(rows_of(data, row)) == 8
    assert len(rows_of(data[:2], row)) == 0
    assert source._replace(row=lambda: None).table("T") is None
    tables = LogTables({"T": source, "U": source._replace(row=lambda: None)}, {"damage": 1})
    assert tables.find("T") is tables.find("T", "x")
    assert [tables.find(*each) for each in (("T", "z"), ("U",), ("V",))] == [None] * 3
    assert [tables.rows(name) for name in "TUV"] == [2, 2, 0]


# --- columns ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("declared", "values", "expected"),
    [
        (column("x"), [1.0, NAN, -3.0], [1.0, NAN, -3.0]),
        (column("x", scale=-0.5), [1.0, NAN, -3.0], [-0.5, NAN, 1.5]),
        (column("x", largest=3.0), [3.0, 3.1, -3.1], [3.0, NAN, NAN]),
        (column("x", least=0.0), [0.0, -0.1, 1e9], [0.0, NAN, 1e9]),
        (column("x", most=2.0), [2.0, 2.1, -1e9], [2.0, NAN, -1e9]),
        # Bounds are in the unit of the field.
        (column("x", scale=0.01, most=1.0), [100.0, 101.0, 99.0], [1.0, NAN, 0.99]),
        (column("", "x"), [1.0, 2.0, 3.0], [[NAN, 1.0], [NAN, 2.0], [NAN, 3.0]]),
    ],
)
def test_values_of_a_column(declared, values, expected):
    np.testing.assert_allclose(declared.values(table({"x": values})), expected)


def series_of(alternatives, *messages, is_partial=False):
    field = Field("f", "", dataflash=alternatives, is_partial=is_partial)
    return read(MadeLog("dataflash", *messages), (field,))


def test_the_first_source_that_a_log_has_counts():
    new, old = series("NEW", "x"), series("OLD", "x")
    messages = [MadeMessage("OLD", {"x": [2.0]}), MadeMessage("NEW", {"x": [1.0]})]
    assert series_of((new, old), *messages).origins == {"f": "NEW.x"}
    assert series_of((new, old), messages[0]).values["f"].values.tolist() == [2.0]
    assert series_of((new, old)) == ({"f": None}, {})
    # One whose column is absent, or never known, is none.
    for empty in ({"y": [1.0]}, {"x": [NAN]}):
        assert series_of((new, old), messages[0], MadeMessage("NEW", empty)).origins == {
            "f": "OLD.x"
        }
    # Of several instances the first one that knows anything.
    found = series_of((new,), MadeMessage("NEW", {"x": [NAN]}), MadeMessage("NEW", {"x": [5.0]}, 1))
    assert found.values["f"].values.tolist() == [5.0]


@pytest.mark.parametrize(("is_partial", "times"), [(False, [0.2]), (True, [0.0, 0.2])])
def test_a_time_counts_where_all_or_any_of_it_is_known(is_partial, times):
    rows = MadeMessage("M", {"x": [1.0, NAN, 3.0], "y": [NAN, NAN, 4.0]})
    found = series_of((series("M", "x", "y"),), rows, is_partial=is_partial)
    np.testing.assert_allclose(found.values["f"].t_s, times)


def test_packed_records_are_numbered_from_zero_and_from_one():
    source = Source("M{0}", {"v": column("a{1}", "b{0}")}, packed=3, first=5)
    parts = list(source.parts())
    assert [(one.message, one.columns["v"].names, one.first, one.packed) for one in parts] == [
        ("M0", ("a1", "b0"), 5, 0), ("M1", ("a2", "b1"), 6, 0), ("M2", ("a3", "b2"), 7, 0),
    ]  # fmt: skip
    alone = Source("M", {"v": column("", "x"), "w": column("y", may_lack=True)})
    assert list(alone.parts()) == [alone]
    assert alone.needed() == ("x",)
    fields = (Field("f", "", ulog=(source, (alone, series("N", "x")))),)
    assert messages_of(Format.ULOG, fields) == {"M0", "M1", "M2", "M", "N"}
    assert messages_of(Format.DATAFLASH, fields) == frozenset()
