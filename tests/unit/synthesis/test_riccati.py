"""The Riccati route: against scipy's bare result, and plants that have no solution."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import linalg

from h2nav.synthesis.method import SynthesisError
from h2nav.synthesis.plant import VectorSensor, attitude_bias_plant, attitude_plant, discretise
from h2nav.synthesis.riccati import (
    closed_loop_covariance,
    error_covariance,
    optimal_gain,
    solve_riccati,
)

SENSORS = (VectorSensor((0.0, 0.0, 9.8), 0.2), VectorSensor((25.0, 0.0, 43.0), 2.0))
PLANT = attitude_bias_plant(0.01, 0.02, SENSORS)


@pytest.mark.parametrize("dt_s", [0.0, 0.02])
def test_agrees_with_scipy(dt_s: float) -> None:
    plant = discretise(PLANT, dt_s) if dt_s else PLANT
    solve = linalg.solve_discrete_are if dt_s else linalg.solve_continuous_are
    R = plant.D_w @ plant.D_w.T
    expected = solve(plant.A.T, plant.C_y.T, plant.B_w @ plant.B_w.T, R)
    np.testing.assert_allclose(error_covariance(plant), expected, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("dt_s", [0.0, 0.0025, 0.5])
def test_covariance_is_that_of_its_own_gain(dt_s: float) -> None:
    plant = discretise(PLANT, dt_s) if dt_s else PLANT
    P = error_covariance(plant)
    L = optimal_gain(plant, P)
    np.testing.assert_allclose(closed_loop_covariance(plant, L), P, rtol=1e-10, atol=1e-16)


def test_any_other_gain_is_worse() -> None:
    random = np.random.default_rng(3)
    best = solve_riccati(PLANT)
    for _ in range(20):
        L = best.L * (1.0 + 0.05 * random.standard_normal(best.L.shape))
        P = closed_loop_covariance(PLANT, L)
        assert math.sqrt(np.trace(PLANT.C_z @ P @ PLANT.C_z.T)) > best.claimed_h2_norm


def test_correlated_noise_is_allowed() -> None:
    """D_w may share noises with B_w; the slides' own plant does."""
    shared = dataclasses.replace(PLANT, D_w=PLANT.D_w + 0.3 * np.eye(6, 12))
    P = error_covariance(shared)
    L = optimal_gain(shared, P)
    np.testing.assert_allclose(closed_loop_covariance(shared, L), P, rtol=1e-8, atol=1e-14)


def test_parallel_vectors_have_no_solution() -> None:
    parallel = (VectorSensor((0.0, 0.0, 9.8), 0.2), VectorSensor((0.0, 0.0, 50.0), 2.0))
    with pytest.raises(SynthesisError, match=r"Riccati|covariance"):
        solve_riccati(attitude_bias_plant(0.01, 0.02, parallel))


def test_plant_without_process_noise_has_nothing_to_estimate() -> None:
    with pytest.raises(SynthesisError, match="nothing to estimate"):
        solve_riccati(attitude_plant(0.0, SENSORS))
