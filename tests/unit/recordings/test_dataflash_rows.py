"""Rows of dataflash logs: instances by number or by name, and what tells the time of old logs."""

import numpy as np
import pytest
from made_rows import table

from h2nav.recordings.dataflash_rows import DataflashRows
from h2nav.recordings.row_tables import LogTables, Table

PLACES = 1000 * np.arange(1, 101)


def log(**messages):
    """Messages with a row each thousand bytes; some begin elsewhere: a pair of places, columns."""
    tables = {}
    for name, given in messages.items():
        places, columns = given if isinstance(given, tuple) else (None, given)
        made = table(columns, name)
        places = PLACES[: len(made)] if places is None else np.asarray(places)
        tables[name] = Table(name, places, made.stored_rows())
    return DataflashRows(LogTables(tables, {}))


TIMED = {"TimeUS": 1_000_000 + 10_000 * np.arange(100), "v": np.arange(100)}


@pytest.mark.parametrize("column", ["I", "C", "Instance", "Inst", "IMU"])
def test_instances_of_one_message_have_a_number(column):
    numbers = np.tile([0, 2, 7, 8], 25)
    found = list(log(X=TIMED | {column: numbers}).instances("X", "v"))
    assert [rows.number for rows in found] == [0, 2, 7]
    assert found[1].table.integers("v").tolist() == list(range(1, 100, 4))
    assert found[1].t_us.tolist() == TIMED["TimeUS"][1::4].tolist()


def test_instances_of_numbered_messages():
    found = log(X=TIMED, X2=TIMED, X3=TIMED, X4=TIMED)
    assert [rows.number for rows in found.instances("X", "v")] == [0, 1, 2]
    assert list(found.instances("X", "w")) == []
    assert list(found.instances("Y")) == []
    # Without the first one there are none.
    assert list(log(X2=TIMED).instances("X")) == []


@pytest.mark.parametrize(
    ("name", "columns", "unit_us"),
    [
        ("X", {"TimeUS": np.arange(100, 200)}, 1),
        ("X", {"TimeMS": np.arange(100, 200)}, 1000),
        ("X", {"TimeUS": np.arange(100, 200), "TimeMS": 7}, 1),
        ("GPS", {"T": np.arange(100, 200), "TimeMS": 7}, 1000),  # there TimeMS is of the week
        ("X", {"T": np.arange(100, 200)}, None),
    ],
)
def test_the_column_of_the_time(name, columns, unit_us):
    found = DataflashRows.times_of(table(columns, name))
    assert (
        found is None
        if unit_us is None
        else found.tolist() == [unit_us * t for t in range(100, 200)]
    )


@pytest.mark.parametrize(
    ("substitute", "times_us"),
    [
        ({"GPS": {"TimeMS": np.arange(100, 200)}}, (100_000, 199_000)),
        ({"GPS": {"Time": np.arange(100, 200)}}, (100_000, 199_000)),
        ({"PM": {"LTime": np.full(100, 20)}}, (20_000, 2_000_000)),
        ({"PM": {"NLoop": np.full(100, 5)}}, (50_000, 5_000_000)),
        ({"PM": {"LTime": np.zeros(100, int), "NLoop": np.full(100, 5)}}, (50_000, 5_000_000)),
        ({"GPS": {"TimeMS": np.full(100, 7)}}, (0, 0)),  # it stands still
        ({"GPS": {"Week": np.arange(100)}}, (0, 0)),
    ],
)
def test_what_tells_the_time_where_no_row_has_one(substitute, times_us):
    found = log(**substitute)
    assert (found.clock.start_us, found.clock.end_us) == times_us
    assert not found.is_timed


def test_a_log_most_of_whose_rows_have_no_time_begins_with_its_first_row():
    """It grows as fast before the first time as behind it: a byte each 10 us."""
    places = np.arange(1, 5_001, dtype=np.int64) * 100
    gps = ([200_000, 250_000, 300_000, 400_000], {"TimeMS": [12_000, 12_500, 13_000, 14_000]})
    found = log(GPS=gps, ATT=(places, {"Roll": np.zeros(5_000)}))
    assert not found.is_timed
    assert (found.clock.start_us, found.clock.end_us) == pytest.approx((10_001_000, 15_000_000),
                                                                       abs=1_000_000)  # fmt: skip
    rows = found.find("ATT", "Roll")
    assert rows.t_us[2500] == pytest.approx(12_501_000, abs=2_000)
    # With times of most of the rows these are the log's.
    assert not log(X=TIMED, ATT={"Roll": np.zeros(100)}).is_timed
    timed = log(X=TIMED, ATT={"Roll": np.zeros(99)})
    assert timed.is_timed
    assert (timed.clock.start_us, timed.clock.end_us) == (1_000_000, 1_990_000)


def test_a_row_without_a_time_has_that_of_its_place():
    mode = ([10_500, 20_500], {"Mode": [1, 2]})
    found = log(X=TIMED, MODE=mode, Y=mode)
    # What comes now and then has the time of the row before it; other rows one in between.
    assert found.find("MODE").t_us.tolist() == [1_090_000, 1_190_000]
    assert found.beginnings("MODE").t_us.tolist() == [1_100_000, 1_200_000]
    assert found.find("Y").t_us.tolist() == [1_095_000, 1_195_000]
    assert found.find("MODE", "Rsn") is None
    assert found.beginnings("Z") is None
    # One with a time has its own, whatever begins.
    own = log(X=TIMED, EV=([10_500], {"TimeUS": [1_095_123], "Id": 10}))
    assert own.beginnings("EV").t_us.tolist() == [1_095_123]


def test_rows_with_times_far_from_those_around_them_are_noted():
    times = TIMED["TimeUS"].copy()
    times[50] += 100_000_000
    found = log(X=TIMED, W={"TimeUS": times})
    assert len(found.find("W").t_us) == 99
    assert found.notes == {"rows of W far from the times around them": 1}
    found.find("W")  # looked at once
    assert found.notes == {"rows of W far from the times around them": 1}
    assert found.duration_s == pytest.approx(0.99)
    assert found.silences() == ()
