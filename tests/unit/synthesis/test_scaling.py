"""The form that solvers see, and the gains without any solver, against Riccati equations."""

import math

import numpy as np
import pytest
from scipy import linalg

from h2nav.synthesis.closed_form import attitude_bias_gain, attitude_gain
from h2nav.synthesis.method import relative_distance
from h2nav.synthesis.plant import (
    Plant,
    VectorSensor,
    attitude_bias_plant,
    attitude_plant,
    discretise,
)
from h2nav.synthesis.scaling import delta_form, delta_gain, scale, unscale_gain
from h2nav.synthesis.sensors import _rounded, _weighted

SENSORS = (VectorSensor((0.0, 0.0, 9.8), 3e-3), VectorSensor((20.0, 5.0, 43.0), 0.06))


def optimum(plant):
    """(gain, trace of the error's covariance) by scipy."""
    Q, R = plant.B_w @ plant.B_w.T, plant.D_w @ plant.D_w.T
    if plant.dt_s:
        P = linalg.solve_discrete_are(plant.A.T, plant.C_y.T, Q, R)
        L = plant.A @ P @ plant.C_y.T @ np.linalg.inv(plant.C_y @ P @ plant.C_y.T + R)
    else:
        P = linalg.solve_continuous_are(plant.A.T, plant.C_y.T, Q, R)
        L = P @ plant.C_y.T @ np.linalg.inv(R)
    return L, math.sqrt(float(np.trace(plant.C_z @ P @ plant.C_z.T))), P


@pytest.mark.parametrize("dt_s", [0.0, 0.01, 0.2])
@pytest.mark.parametrize("walk", [None, 2e-2, 5.0])
def test_closed_forms_are_the_optimum(dt_s, walk):
    if walk is None:
        plant, found = attitude_plant(1e-2, SENSORS), attitude_gain(1e-2, SENSORS, dt_s)
    else:
        plant = attitude_bias_plant(1e-2, walk, SENSORS)
        found = attitude_bias_gain(1e-2, walk, SENSORS, dt_s)
    L, norm, _ = optimum(discretise(plant, dt_s) if dt_s else plant)
    assert pytest.approx(L, rel=1e-6, abs=1e-8 * np.abs(L).max()) == found.L
    assert found.claimed_h2_norm == pytest.approx(norm, rel=1e-6)
    assert (found.method, found.wall_time_s) == ("closed_form", None)


@pytest.mark.parametrize("dt_s", [0.0, 0.05])
def test_the_scaled_problem_has_the_same_optimum(dt_s):
    plant = attitude_bias_plant(1e-2, 2e-2, SENSORS)
    plant = discretise(plant, dt_s) if dt_s else plant
    L, norm, P = optimum(plant)
    delta, undo = scale(plant, P)
    # unit noise of the measurements, and states and output of the size of one
    assert pytest.approx(np.eye(6), abs=1e-9) == delta.D @ delta.D.T
    h = delta.h
    scaled = Plant(delta.F, delta.G, delta.C, delta.D, delta.C_z)
    if h:
        root = math.sqrt(h)
        scaled = Plant(
            np.eye(6) + h * delta.F, root * delta.G, delta.C, delta.D / root, delta.C_z, h
        )
    mine, size, variance = optimum(scaled)
    assert size == pytest.approx(1.0, rel=1e-6)
    assert np.diag(variance) == pytest.approx(1.0, rel=1e-6)
    assert undo.z == pytest.approx(norm)
    assert undo.state == pytest.approx(np.sqrt(np.diag(P)))
    per_second = mine / h if h else mine
    assert unscale_gain(plant, undo, per_second) == pytest.approx(L, abs=1e-6 * np.abs(L).max())
    if not h:  # time runs in units of the closed loop
        rates = np.abs(np.linalg.eigvals(delta.F - per_second @ delta.C))
        assert np.exp(np.mean(np.log(rates))) == pytest.approx(1.0, rel=1e-6)


def test_a_plant_in_delta_form_has_densities_and_gains_per_second():
    plant = discretise(attitude_bias_plant(1e-2, 2e-2, SENSORS), 0.05)
    delta = delta_form(plant)
    assert delta.h == 0.05
    assert pytest.approx(attitude_bias_plant(1e-2, 2e-2, SENSORS).A) == delta.F
    assert pytest.approx(plant.B_w @ plant.B_w.T / 0.05) == delta.G @ delta.G.T
    assert pytest.approx(np.diag([9e-6] * 3 + [3.6e-3] * 3)) == delta.D @ delta.D.T
    L = np.ones((6, 6))
    assert delta_gain(plant, L) == pytest.approx(20.0 * L)
    still = attitude_plant(1e-2, SENSORS)
    assert delta_gain(still, L) is L
    assert delta_form(still).G is still.B_w


def test_the_distance_of_gains_is_that_of_the_worse_block():
    reference = np.vstack((np.eye(3), 1e-6 * np.eye(3)))
    L = reference + np.vstack((0.1 * np.eye(3), 2e-7 * np.eye(3)))
    assert relative_distance(L, reference) == pytest.approx(0.2)
    assert relative_distance(reference, reference) == 0.0


def test_a_weight_multiplies_the_information_of_the_accelerometer_alone():
    force, field = _weighted(SENSORS, 0.25)
    assert force == VectorSensor((0.0, 0.0, 9.8), 6e-3)
    assert field == SENSORS[1]


@pytest.mark.parametrize(
    ("x", "rounded"),
    [(1.23456789012345, 1.23456789012), (9e-13, 0.0), (-1.1e-12, -1.1e-12), (0.0, 0.0)],
)
def test_a_gain_is_written_to_twelve_digits_and_its_rounding_noise_as_zero(x, rounded):
    assert _rounded(x, 1.0) == rounded
