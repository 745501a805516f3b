"""Which times of an autopilot's log are believed."""

import numpy as np
import pytest

from h2nav.recordings.log_clock import LONGEST_PAUSE_US, LogClock

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
    assert not clock.believes(np.array([5]), np.array([1_000])).any()
    assert clock.at(np.array([5])).tolist() == [0]
