"""The semidefinite programme in natural units."""

import dataclasses

import numpy as np
import pytest

from h2nav.synthesis.certificate import accept
from h2nav.synthesis.lmi import solve_lmi
from h2nav.synthesis.method import SynthesisError, relative_distance
from h2nav.synthesis.plant import VectorSensor, attitude_bias_plant, attitude_plant, discretise
from h2nav.synthesis.riccati import error_covariance, solve_riccati
from h2nav.synthesis.scaling import delta_form, scale, unscale_gain

SENSORS = (VectorSensor((0.0, 0.0, 9.8), 3e-3), VectorSensor((25.0, 0.0, 43.0), 0.06))
PLANT = attitude_bias_plant(1.7e-4, 3e-6, SENSORS)


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
@pytest.mark.parametrize("dt_s", [0.0, 0.0025, 0.02])
def test_gain_is_the_optimum(solver: str, dt_s: float) -> None:
    plant = discretise(PLANT, dt_s) if dt_s else PLANT
    candidate = solve_lmi(plant, solver)
    assert relative_distance(candidate.L, solve_riccati(plant).L) < 1e-5
    accept(plant, candidate)
    assert candidate.wall_time_s is not None


def test_gain_does_not_depend_on_the_output() -> None:
    yaw_only = dataclasses.replace(PLANT, C_z=PLANT.C_z[2:])
    one, other = solve_lmi(PLANT), solve_lmi(yaw_only)
    assert relative_distance(one.L, other.L) < 1e-5
    assert other.claimed_h2_norm < one.claimed_h2_norm


def test_impossible_plant_is_an_error_not_a_gain() -> None:
    parallel = (VectorSensor((0.0, 0.0, 9.8), 0.2), VectorSensor((0.0, 0.0, 50.0), 2.0))
    with pytest.raises(SynthesisError):
        solve_lmi(attitude_plant(0.01, parallel))


@pytest.mark.parametrize("dt_s", [0.0, 0.01])
def test_scaling_is_undone_exactly(dt_s: float) -> None:
    """The scaled plant's closed loop has the same eigenvalues, in its own unit of time."""
    plant = discretise(PLANT, dt_s) if dt_s else PLANT
    scaled, scaling = scale(plant, error_covariance(plant))
    L_scaled = np.random.default_rng(2).standard_normal((6, 6))
    L = unscale_gain(plant, scaling, L_scaled)
    delta = delta_form(plant)
    per_second = L / dt_s if dt_s else L
    ours = np.linalg.eigvals(delta.F - per_second @ delta.C)
    theirs = np.linalg.eigvals(scaled.F - L_scaled @ scaled.C) / scaling.time_s
    np.testing.assert_allclose(np.sort(np.abs(ours)), np.sort(np.abs(theirs)), rtol=1e-6)
    np.testing.assert_allclose(scaled.D @ scaled.D.T, np.eye(6), atol=1e-12)
