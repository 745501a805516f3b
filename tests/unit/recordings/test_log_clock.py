"""Which times of an autopilot's log are believed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.recordings.log_clock import (
    LONGEST_PAUSE_US,
    LONGEST_US,
    MAX_AT_ONCE,
    SLACK_US,
    LogClock,
    in_order,
    is_running,
)

STEP_US = 20_000


def rows(start_us: int, count: int) -> list[int]:
    return [start_us + row * STEP_US for row in range(count)]


def clock_of(t_us: list[int]) -> LogClock:
    return LogClock(np.arange(len(t_us)) * 100, np.array(t_us))


@pytest.mark.parametrize("longest", [0, 1, 2])
def test_of_parts_that_lie_hours_apart_the_longest_is_the_flight(longest: int) -> None:
    parts = [
        rows(place * 2 * LONGEST_PAUSE_US, 400 if place == longest else 50) for place in range(3)
    ]
    clock = clock_of([t_us for part in parts for t_us in part])
    assert (clock.start_us, clock.end_us) == (parts[longest][0], parts[longest][-1])


def test_a_time_that_does_not_fit_its_neighbours_is_damage() -> None:
    t_us = rows(1_000_000, 200)
    damaged = [*t_us[:100], t_us[100] + 3 * LONGEST_PAUSE_US, *t_us[101:]]
    clock = clock_of(damaged)
    assert (clock.start_us, clock.end_us) == (t_us[0], t_us[-1])
    assert clock.longest_pause_s == pytest.approx(2 * STEP_US * 1e-6)
    believed = clock.believes(np.array([10_000, 10_050]), np.array(damaged[100:102]))
    assert believed.tolist() == [False, True]


def test_of_a_log_without_times_nothing_is_believed() -> None:
    clock = clock_of([])
    assert (clock.start_us, clock.end_us, clock.longest_pause_s) == (0, 0, 0.0)
    places = np.array([5, 6])
    assert not clock.believes(places, np.array([0, 1_000])).any()
    for times in (clock.at, clock.after, clock.between):
        assert times(places).tolist() == [0, 0]


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    steps_us=st.lists(st.integers(0, 3_000_000), min_size=1, max_size=30),
    places=st.lists(st.integers(-50, 3_100), min_size=1, max_size=20),
)
def test_times_of_other_rows_are_those_of_the_rows_around_them(
    steps_us: list[int], places: list[int]
) -> None:
    t_us = np.cumsum(steps_us) + 1_000_000
    clock = clock_of(t_us.tolist())
    where = np.array(places)
    before = [max([0, *(row for row in range(len(t_us)) if row * 100 < place)]) for place in places]
    after = [
        min([len(t_us) - 1, *(row for row in range(len(t_us)) if row * 100 >= place)])
        for place in places
    ]
    assert clock.at(where).tolist() == t_us[before].tolist()
    assert clock.after(where).tolist() == t_us[after].tolist()
    between = clock.between(where)
    assert (between >= t_us[0]).all()
    assert (between <= t_us[-1]).all()
    assert (np.diff(between[np.argsort(where)]) >= 0).all()
    ends = clock.between(np.array([0, 100 * (len(t_us) - 1)]))
    assert ends[1] == t_us[-1]
    latest_us = t_us[after] + SLACK_US
    earliest_us = [
        t_us[row] - SLACK_US if place > 0 else 0 for row, place in zip(before, places, strict=True)
    ]
    earliest_us = np.array(earliest_us)
    assert clock.believes(where, latest_us).all()
    assert not clock.believes(where, latest_us + 1).any()
    assert clock.believes(where, earliest_us).all()
    assert not clock.believes(where, earliest_us - 1).any()


def test_in_a_pause_a_time_is_taken_by_place() -> None:
    clock = clock_of([0, 1_000_000, 2_000_000, 12_000_000, 13_000_000])
    assert clock.between(np.array([250, 290])).tolist() == [7_000_000, 11_000_000]
    assert clock.longest_pause_s == pytest.approx(10.0)


def test_a_file_whose_first_and_last_rows_have_no_time_grows_evenly() -> None:
    clock = LogClock(np.arange(100, 200) * 100, np.array(rows(60_000_000, 100)))
    found = clock.extended(0, 60_000)
    assert (found.start_us, found.end_us) == (58_000_000, 70_000_000)
    assert found.at(np.array([10_001])).tolist() == [60_000_000]
    # a row a second: 5000 bytes
    assert found.at(np.array([1, 4_999, 5_001, 10_001])).tolist() == [
        58_000_000, 58_000_000, 59_000_000, 60_000_000,
    ]  # fmt: skip
    assert found.after(np.array([19_901, 24_901, 59_901])).tolist() == [
        62_980_000, 63_980_000, 70_000_000,
    ]  # fmt: skip
    assert clock.extended(-1_000_000, 20_000).start_us == 0


def test_a_week_is_the_longest_of_flights() -> None:
    pause_us = LONGEST_PAUSE_US
    steps = LONGEST_US // pause_us
    clock = clock_of([step * pause_us for step in range(steps + 3) for _ in range(5)])
    assert clock.end_us == LONGEST_US
    apart = [step * (pause_us + 1) for step in range(3) for _ in range(5)]
    assert clock_of(apart).longest_pause_s == 0.0


@pytest.mark.parametrize(
    ("t_us", "runs"),
    [
        ([7] * 30, False),
        (range(30), True),
        ([row // MAX_AT_ONCE for row in range(10 * MAX_AT_ONCE)], False),
        ([row // (MAX_AT_ONCE - 1) for row in range(10 * MAX_AT_ONCE)], True),
        ([7] * MAX_AT_ONCE + [8], True),
        ([7] * (MAX_AT_ONCE + 1) + [8], False),
    ],
)
def test_a_clock_that_runs_is_told_from_one_that_is_not_set(t_us: list[int], runs: bool) -> None:
    assert is_running(np.array(t_us)) is runs


@pytest.mark.parametrize(
    ("t_us", "kept"),
    [
        ([1, 2, 3, 4], [1, 2, 3, 4]),
        ([1, 2, 99, 4, 5, 6], [1, 2, 4, 5, 6]),
        ([10, 20, 3, 40, 50], [10, 20, 40, 50]),
        ([99, 2, 3, 4, 5], [2, 3, 4, 5]),
        ([1, 2, 3, 4, 0], [1, 2, 3, 4]),
    ],
)
def test_one_wrong_time_costs_one_row(t_us: list[int], kept: list[int]) -> None:
    assert np.array(t_us)[in_order(np.array(t_us))].tolist() == kept


@settings(derandomize=True, deadline=None, max_examples=60)
@given(t_us=st.lists(st.integers(0, 100), max_size=30))
def test_what_is_kept_never_goes_back(t_us: list[int]) -> None:
    kept = np.array(t_us)[in_order(np.array(t_us))]
    assert (np.diff(kept) >= 0).all()
    assert len(kept) > 0 or not t_us


@pytest.mark.parametrize("wrong_us", [-1, 1 << 53])
def test_a_time_that_no_clock_has_is_damage(wrong_us: int) -> None:
    t_us = [wrong_us] * 3 + rows((1 << 53) - 60 * STEP_US, 50) + [wrong_us] * 3
    clock = clock_of(t_us)
    assert (clock.start_us, clock.end_us) == (t_us[3], t_us[-4])
    latest = (1 << 53) - 1
    assert clock_of([0, 1, 2, 3]).start_us == 0
    assert clock_of([latest - 2, latest - 1, latest]).end_us == latest


def test_within_a_second_times_follow_the_bytes_and_not_the_moments_of_writing() -> None:
    """Rows are written in bursts: their times jitter."""
    t_us = np.arange(0, 10_000_000, 100_000)
    places = 100 * np.arange(len(t_us)) + 40 * (np.arange(len(t_us)) % 10 == 5)
    clock = LogClock(places, t_us)
    where = np.arange(0, 9_000, 50)
    np.testing.assert_array_equal(clock.between(where), where * 1_000)
