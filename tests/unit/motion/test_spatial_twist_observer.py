"""The source's own form: right near the origin, useless far from it."""

import numpy as np
import pytest

from h2nav.maths import se3
from h2nav.motion.finite_time import FiniteTimeGains
from h2nav.motion.spatial_twist_observer import SpatialTwistObserver

BIAS = np.array([0.05, -0.03, 0.02, 0.1, -0.2, 0.15])
TWIST = np.array([0.3, 0.2, 0.5, 1.0, 0.2, 0.1])
OFF = np.full(6, 0.1)


def bias_error(arm_m, dt_s, origin):
    T = se3.pose(np.eye(3), [arm_m, 0.0, 0.0])
    observer = SpatialTwistObserver(FiniteTimeGains(4.0, 4.0, 0.75), T @ se3.exp(OFF), origin)
    for _ in range(round(8.0 / dt_s)):
        observer.update(TWIST + BIAS, T, dt_s)
        T = T @ se3.exp(TWIST * dt_s)
    return float(np.linalg.norm(observer.bias - BIAS))


def test_it_finds_the_bias_near_the_origin():
    assert bias_error(0.0, 1e-3, (0, 0, 0)) < 1e-3


def test_it_diverges_at_a_lever_arm_of_30_m():
    assert bias_error(30.0, 1e-2, (0, 0, 0)) > 10.0 * np.linalg.norm(BIAS)


def test_a_local_origin_repairs_it():
    assert bias_error(30.0, 1e-3, (30, 0, 0)) < 1e-3


def test_its_output_is_the_spatial_twist():
    T = se3.exp([0.1, 0.2, 0.3, 1.0, 2.0, 3.0])
    observer = SpatialTwistObserver(FiniteTimeGains(4.0, 4.0, 0.75), T)
    assert observer.update(TWIST, T, 1e-3) == pytest.approx(se3.adjoint(T) @ TWIST, abs=1e-6)
