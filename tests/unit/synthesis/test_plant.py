"""The linear plants: their matrices against the non-linear error, their samples against expm."""

import numpy as np
import pytest
from scipy.linalg import expm

from h2nav.maths import so3
from h2nav.synthesis.plant import (
    Plant,
    VectorSensor,
    attitude_bias_plant,
    attitude_plant,
    cross_matrix,
    discretise,
)

SENSORS = (VectorSensor((0.0, 0.0, 9.8), 3e-3), VectorSensor((20.0, 5.0, 43.0), 0.06))


def test_measurement_matrix_is_the_derivative_of_the_residual() -> None:
    """R^ y - v = [v]x eps for R = Exp(eps) R^ and y = R^T v: Eq. (2.5), (4.2)."""
    random = np.random.default_rng(1)
    R_hat = so3.exp(random.standard_normal(3))
    eps = 1e-6 * random.standard_normal(3)
    R = so3.exp(eps) @ R_hat
    C = attitude_plant(1.0, SENSORS).C_y
    residual = np.concatenate([R_hat @ R.T @ np.array(s.v_n) - np.array(s.v_n) for s in SENSORS])
    assert residual == pytest.approx(C @ eps, rel=1e-4, abs=1e-9)


def test_information_is_what_the_measurements_say() -> None:
    """Source: docs/derivation.md Eq. (4.3)."""
    M = np.zeros((3, 3))
    for sensor in SENSORS:
        v = np.asarray(sensor.v_n)
        M += (v @ v * np.eye(3) - np.outer(v, v)) / sensor.density**2
    plant = attitude_plant(1.0, SENSORS)
    whole = plant.C_y.T @ np.linalg.inv(plant.D_w @ plant.D_w.T) @ plant.C_y
    assert pytest.approx(whole, rel=1e-12) == M


def test_cross_matrix() -> None:
    u, v = np.array([1.0, 2.0, 3.0]), np.array([-2.0, 0.5, 4.0])
    assert cross_matrix(u) @ v == pytest.approx(np.cross(u, v))


@pytest.mark.parametrize("dt_s", [0.0025, 0.01, 0.5])
def test_discretisation_is_van_loans(dt_s: float) -> None:
    """Against the block exponential, which knows nothing of A A = 0."""
    plant = attitude_bias_plant(1e-2, 2e-2, SENSORS)
    n = 6
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[n:, n:] = -plant.A, plant.A.T
    block[:n, n:] = plant.B_w @ plant.B_w.T
    big = expm(block * dt_s)
    A_d = big[n:, n:].T
    Q_d = A_d @ big[:n, n:]
    sampled = discretise(plant, dt_s)
    np.testing.assert_allclose(sampled.A, A_d, atol=1e-14)
    assert sampled.B_w @ sampled.B_w.T == pytest.approx(Q_d, rel=1e-9, abs=1e-18)
    assert sampled.D_w @ sampled.D_w.T == pytest.approx(plant.D_w @ plant.D_w.T / dt_s)
    assert sampled.dt_s == dt_s
    assert not np.any(sampled.B_w @ sampled.D_w.T)


def test_other_plants_are_not_discretised_wrongly() -> None:
    plant = attitude_plant(1.0, SENSORS)
    spinning = Plant(cross_matrix((0.0, 0.0, 1.0)), plant.B_w, plant.C_y, plant.D_w, plant.C_z)
    with pytest.raises(ValueError, match="A A = 0"):
        discretise(spinning, 0.01)
    shared = Plant(plant.A, plant.B_w, plant.C_y, plant.D_w + 1.0, plant.C_z)
    with pytest.raises(ValueError, match="B_w D_w"):
        discretise(shared, 0.01)
