"""The exercises of source 003 against numerical differentiation."""

import math

import numpy as np
import pytest

from h2nav.maths import quaternion, rotation_derivatives, so3

H = 1e-6


def rotations():
    rng = np.random.default_rng(11)
    return [so3.exp(rng.normal(size=3)) for _ in range(8)]


def central(function):
    return np.array(
        [(function(H * axis) - function(-H * axis)) / (2.0 * H) for axis in np.eye(3)]
    ).T


@pytest.mark.parametrize("R", rotations())
def test_conjugation_turns_the_rotation_vector(R):
    phi = np.array([0.4, -1.1, 0.7])
    np.testing.assert_allclose(
        R @ so3.exp(phi) @ R.T, rotation_derivatives.conjugated(R, phi), atol=1e-14
    )


@pytest.mark.parametrize("R", rotations())
def test_rotating_back(R):
    p = np.array([2.0, -1.0, 0.5])
    numeric = central(lambda phi: (R @ so3.exp(phi)).T @ p)
    np.testing.assert_allclose(
        rotation_derivatives.back_rotation_by_rotation(R, p), numeric, atol=1e-9
    )


@pytest.mark.parametrize(("R1", "R2"), list(zip(rotations(), rotations()[::-1], strict=True)))
def test_logarithm_of_a_relative_rotation(R1, R2):
    by_second = central(lambda phi: so3.log(R1 @ (R2 @ so3.exp(phi)).T))
    by_first = central(lambda phi: so3.log(R1 @ so3.exp(phi) @ R2.T))
    np.testing.assert_allclose(
        rotation_derivatives.relative_log_by_second(R1, R2), by_second, atol=1e-7
    )
    np.testing.assert_allclose(
        rotation_derivatives.relative_log_by_first(R1, R2), by_first, atol=1e-7
    )


@pytest.mark.parametrize("angle", [0.01, 0.1, 1.0, 3.0])
def test_first_order_update_turns_too_little_and_is_not_unit(angle):
    update = (1.0, 0.0, 0.5 * angle, 0.0)
    assert math.hypot(*update) == pytest.approx(rotation_derivatives.first_order_norm(angle))
    turned = math.hypot(*quaternion.log(update))
    assert turned == pytest.approx(rotation_derivatives.first_order_angle(angle), rel=1e-12)
    assert turned < angle
    assert angle - turned == pytest.approx(angle**3 / 12.0, rel=0.2 * angle**2 + 1e-3) or angle > 1
