"""Shared parts of the fits against matrices, and on noise whose properties are known."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from h2nav.calibration.knots import Knots
from h2nav.calibration.regression import (
    halves_of,
    longer,
    noise_of,
    part_of,
    robust,
    together,
    wander,
)

RANDOM = np.random.default_rng(12)


@pytest.mark.parametrize("flights", [1, 2])
def test_a_wandering_angle_has_the_information_of_a_stationary_process_and_of_a_slow_gyro(flights):
    """Of correlation time 60 s between knots, with a drift of 0.15 deg/s at the most."""
    t_s = np.arange(0.0, 41.0)
    numbers = np.repeat(np.arange(flights), len(t_s))
    knots = Knots.of(numbers, np.tile(t_s, flights), 10.0)
    sigma = RANDOM.uniform(0.01, 0.05, len(numbers))
    sigma[5] = np.inf  # seen by no knot
    diagonal, beside = wander(knots, sigma, 0.02)
    count = knots.number // flights
    assert len(diagonal) == knots.number == 5 * flights
    for flight in range(flights):
        own = slice(flight * count, (flight + 1) * count)
        at_knots = np.maximum(sigma[knots.row[own]], 0.02)
        apart_s = 10.0 * np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        covariance = np.outer(at_knots, at_knots) * np.exp(-apart_s / 60.0)
        steps = np.diff(np.eye(count), axis=0) / (math.radians(0.15) * 10.0)
        information = np.linalg.inv(covariance) + steps.T @ steps
        assert diagonal[own] == pytest.approx(np.diag(information))
        assert beside[own] == pytest.approx([*np.diag(information, 1), 0.0])


def test_an_unknown_attitude_may_be_off_by_a_right_angle():
    knots = Knots.of(np.zeros(41, np.int64), np.arange(41.0), 10.0)
    for sigma in (np.inf, np.nan, 9.0):
        unknown = wander(knots, np.full(41, sigma), 0.02)
        known = wander(knots, np.full(41, 0.5 * math.pi), 0.02)
        assert unknown[0] == pytest.approx(known[0])
        assert unknown[1] == pytest.approx(known[1])


class Rows(NamedTuple):
    t_s: np.ndarray
    value: np.ndarray


def test_rows_are_joined_selected_and_halved():
    one, other = Rows(np.arange(3), np.arange(6).reshape(3, 2)), Rows(np.arange(2), np.ones((2, 2)))
    both = together([one, other])
    assert both.t_s.tolist() == [0, 1, 2, 0, 1]
    assert both.value.shape == (5, 2)
    assert part_of(both, np.array([4, 2])).t_s.tolist() == [1, 2]
    first, last = halves_of(both)
    assert (first.t_s.tolist(), last.t_s.tolist()) == ([0, 1], [2, 0, 1])
    assert type(first) is Rows


def test_noise_is_that_of_one_axis_although_some_rows_are_wild():
    length = np.linalg.norm(RANDOM.normal(0.0, 0.3, (20_001, 3)), axis=1)
    assert noise_of(length, np.ones(20_001)) == pytest.approx(0.3, rel=0.02)
    wild = np.concatenate((length, np.full(5_000, 99.0)))
    assert noise_of(wild, np.ones(25_001)) < 0.4
    balance = np.concatenate((np.ones(20_001), np.zeros(5_000)))
    assert noise_of(wild, balance) == pytest.approx(noise_of(length, np.ones(20_001)))
    assert noise_of(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 5.0])) == 2.0 / 1.538
    assert noise_of(np.array([4.0]), np.array([0.0])) == 4.0 / 1.538


def test_a_row_of_three_deviations_has_a_quarter_of_the_weight():
    weights = robust(np.array([0.0, 3.0, 6.0, 9.0]), 1.0, 1.0)
    assert weights == pytest.approx([1.0, 0.25, 0.04, 0.01])
    assert robust(np.array([6.0]), 0.5, 4.0) == pytest.approx([0.25])
    assert robust(np.array([3.0, 3.0]), np.array([1.0, 0.5]), 1.0) == pytest.approx([0.25, 0.04])


ONES = np.ones(3000)
T_S = 0.5 * np.arange(3000)  # sixty rows in a block of half a minute
ALIKE = np.zeros(3000, np.int64)


@pytest.mark.parametrize(
    ("flights", "held_s", "factor"),
    [(ALIKE, 30.0, 60.0), (ALIKE, 15.0, 30.0), (ALIKE, 0.5, 1.0), (np.arange(3000), 30.0, 1.0)],
)
def test_residuals_that_stay_for_half_a_minute_count_once(flights, held_s, factor):
    held = RANDOM.normal(size=(3000, 2))[np.floor(T_S / held_s).astype(int)]
    found = longer(flights, T_S, held, ONES, 0)
    assert found == pytest.approx(factor, rel=0.25)
    assert found >= 1.0
    # weights that are all alike change nothing
    assert longer(flights, T_S, held, 0.1 * ONES, 0) == pytest.approx(found)


def test_what_parameters_absorb_is_missing_in_the_sums():
    held = RANDOM.normal(size=(50, 2))[np.floor(T_S / 30.0).astype(int)]
    alone = longer(ALIKE, T_S, held, ONES, 0)
    assert longer(ALIKE, T_S, held, ONES, 50) == pytest.approx(2.0 * alone)
    assert longer(ALIKE, T_S, held, ONES, 75) == pytest.approx(4.0 * alone)
    assert longer(ALIKE, T_S, held, ONES, 99) == pytest.approx(4.0 * alone)
    assert longer(ALIKE, T_S, 0.0 * held, ONES, 0) == 1.0


def test_rows_without_weight_are_none():
    held = RANDOM.normal(size=(50, 2))[np.floor(T_S / 30.0).astype(int)]
    weight = np.where(np.arange(3000) % 2, 0.0, 1.0)
    half = longer(ALIKE[::2], T_S[::2], held[::2], ONES[::2], 0)
    assert longer(ALIKE, T_S, held, weight, 0) == pytest.approx(half)
