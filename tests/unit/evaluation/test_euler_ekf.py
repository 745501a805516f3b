"""The Euler EKF: consistent where Euler angles are, and a real Kalman filter."""

import math

import numpy as np
import pytest

from h2nav.evaluation.paper.euler_ekf import EulerEkf
from h2nav.evaluation.paper.filter import Weights, directions, linearised_plant
from h2nav.maths import quaternion
from h2nav.synthesis.plant import discretise
from h2nav.synthesis.riccati import error_covariance

DEG = math.pi / 180.0
VECTORS = np.array([[0.0, 0.0, 1.0], [math.cos(60 * DEG), 0.0, math.sin(60 * DEG)]])
DT_S = 0.01


def test_covariance_settles_at_the_riccati_solution() -> None:
    """At rest at zero the EKF is the Kalman filter of the linearised plant."""
    weights = Weights(0.02, 0.01, 0.03, 0.05)
    ekf = EulerEkf(
        VECTORS,
        np.repeat([weights.gyro**2, weights.bias_walk**2], 3),
        np.repeat([weights.accelerometer**2, weights.magnetometer**2], 3) / DT_S,
        np.full(6, 0.1),
        1,
    )
    measured = directions(np.zeros((1, 3)), VECTORS)
    for _ in range(3000):
        ekf.predict(np.zeros((1, 3)), DT_S)
        ekf.correct(measured)
    ekf.predict(np.zeros((1, 3)), DT_S)
    plant = discretise(linearised_plant(VECTORS, weights), DT_S)
    assert ekf._P[0] == pytest.approx(error_covariance(plant), rel=0.01, abs=1e-9)


def test_turning_body_is_followed_exactly_without_noise() -> None:
    """Midpoint steps: 10 s at 60 deg/s about a tilted axis stay within 0.02 deg."""
    rate = np.array([[0.6, -0.5, 0.7]])
    ekf = EulerEkf(VECTORS, np.full(6, 1e-12), np.ones(6), np.full(6, 1e-12), 1)
    q = (1.0, 0.0, 0.0, 0.0)
    worst = 0.0
    for _ in range(1000):
        ekf.predict(rate, DT_S)
        q = quaternion.multiply(q, quaternion.exp(tuple((rate[0] * DT_S).tolist())))
        truth = np.array(quaternion.to_euler(q))
        if abs(truth[1]) > 80 * DEG:
            break
        error = (ekf.angles[0] - truth + math.pi) % (2 * math.pi) - math.pi
        worst = max(worst, float(np.max(np.abs(error))))
    assert worst < 0.02 * DEG


@pytest.mark.thorough
def test_gyro_bias_is_learnt() -> None:
    bias = np.array([[0.5, -0.3, 0.2]]) * DEG
    ekf = EulerEkf(
        VECTORS,
        np.repeat([1e-8, 1e-12], 3),
        np.repeat([1e-4, 1e-3], 3),
        np.repeat([1e-2, 1e-3], 3),
        1,
    )
    truth = np.array([[0.2, -0.3, 0.5]])
    for _ in range(4000):
        ekf.predict(bias, DT_S)
        ekf.correct(directions(truth, VECTORS))
    assert ekf.bias == pytest.approx(bias, abs=0.002 * DEG)
    assert ekf.angles == pytest.approx(truth, abs=0.01 * DEG)


def test_runs_do_not_touch_each_other() -> None:
    random = np.random.default_rng(4)
    truth = random.uniform(-0.5, 0.5, (3, 3))
    measured = directions(truth, VECTORS) + 0.01 * random.standard_normal((3, 6))
    together = EulerEkf(VECTORS, np.ones(6), np.ones(6), np.ones(6), 3)
    alone = EulerEkf(VECTORS, np.ones(6), np.ones(6), np.ones(6), 1)
    rate = random.standard_normal((3, 3))
    for _ in range(5):
        together.predict(rate, DT_S)
        together.correct(measured)
        alone.predict(rate[1:2], DT_S)
        alone.correct(measured[1:2])
    assert together.angles[1] == pytest.approx(alone.angles[0], rel=1e-12)


@pytest.mark.parametrize(("sigma", "share"), [(1e-6, 1.0), (1e6, 0.0)])
def test_a_sure_measurement_is_taken_and_an_unsure_one_changes_nothing(sigma, share) -> None:
    """Angles alone are uncertain at the start: what is measured says nothing of the bias."""
    ekf = EulerEkf(VECTORS, np.ones(6), np.full(6, sigma**2), np.ones(6), 2)
    truth = np.array([[0.01, -0.02, 0.03], [-0.02, 0.01, 0.0]])
    ekf.correct(directions(truth, VECTORS))
    assert ekf.angles == pytest.approx(share * truth, abs=1e-3)
    assert (ekf.bias == 0.0).all()


def test_an_attitude_that_is_known_shows_the_bias_by_one_turn() -> None:
    sure = np.repeat([1e-12, 1.0], 3)
    ekf = EulerEkf(VECTORS, np.full(6, 1e-14), np.full(6, 1e-12), sure, 1)
    rate, bias = np.array([[0.3, -0.2, 0.1]]), np.array([[0.02, 0.01, -0.03]])
    ekf.predict(rate + bias, 0.1)
    truth = EulerEkf(VECTORS, np.ones(6), np.ones(6), np.ones(6), 1)
    truth.predict(rate, 0.1)
    ekf.correct(directions(truth.angles, VECTORS))
    assert ekf.angles == pytest.approx(truth.angles, abs=1e-5)
    assert ekf.bias == pytest.approx(bias, abs=1e-3)
