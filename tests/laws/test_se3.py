"""Group laws of SE(3), near zero, near half turns and in between."""

import math

import numpy as np
import pytest
from scipy.linalg import expm

from h2nav.maths import se3

ANGLES = (0.0, 1e-12, 1e-7, 1e-3, 0.5, 2.0, math.pi - 1e-3, math.pi - 1e-6)


def twists(seed=3):
    rng = np.random.default_rng(seed)
    for angle in ANGLES:
        for _ in range(5):
            axis = rng.normal(size=3)
            yield np.concatenate([angle * axis / np.linalg.norm(axis), rng.normal(0, 10, 3)])


@pytest.mark.parametrize("twist", list(twists()))
def test_exp_is_the_matrix_exponential(twist):
    np.testing.assert_allclose(se3.exp(twist), expm(se3.hat(twist)), atol=1e-12)


@pytest.mark.parametrize("twist", list(twists()))
def test_log_undoes_exp(twist):
    np.testing.assert_allclose(se3.log(se3.exp(twist)), twist, atol=1e-7)


@pytest.mark.parametrize("twist", list(twists()))
def test_inverse_undoes(twist):
    T = se3.exp(twist)
    np.testing.assert_allclose(T @ se3.inverse(T), np.eye(4), atol=1e-13)


@pytest.mark.parametrize("twist", list(twists(4)))
def test_adjoint_takes_a_body_twist_to_the_spatial_one(twist):
    T = se3.exp(twist)
    V = np.array([0.3, -0.2, 0.1, 1.0, 2.0, -3.0])
    np.testing.assert_allclose(
        se3.hat(se3.adjoint(T) @ V), T @ se3.hat(V) @ se3.inverse(T), atol=1e-11
    )


def test_adjoint_is_a_homomorphism():
    A, B = (se3.exp(twist) for twist in list(twists(5))[20:22])
    np.testing.assert_allclose(se3.adjoint(A @ B), se3.adjoint(A) @ se3.adjoint(B), atol=1e-12)
