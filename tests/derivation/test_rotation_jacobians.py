"""The derivatives of docs/derivation.md sections 1 and 2 by complex step: exact to rounding."""

import numpy as np
import pytest
from scipy.linalg import expm

from h2nav.maths import so3

STEP = 1e-30
ANGLES = [0.0, 1e-9, 1e-3, 0.4999, 0.5001, 1.5, 3.0, np.pi - 1e-9, np.pi, 5.0]
AXIS = np.array([0.36, 0.48, -0.8])


def columns(directional):  # type: ignore[no-untyped-def]
    return np.column_stack([directional(axis) for axis in np.eye(3)])


@pytest.mark.parametrize("angle", ANGLES)
def test_left_jacobian_is_the_derivative_of_exp(angle: float) -> None:
    """Eq. (1.8)."""
    phi = angle * AXIS
    R = so3.exp(phi)
    numeric = columns(lambda d: so3.vee(so3.exp(phi + 1j * STEP * d).imag / STEP @ R.T))
    assert np.abs(numeric - so3.left_jacobian(phi)).max() < 2e-15


@pytest.mark.parametrize("angle", ANGLES)
def test_right_jacobian_is_the_derivative_of_exp(angle: float) -> None:
    """Eq. (1.9)."""
    phi = angle * AXIS
    R = so3.exp(phi)
    numeric = columns(lambda d: so3.vee(R.T @ so3.exp(phi + 1j * STEP * d).imag / STEP))
    assert np.abs(numeric - so3.right_jacobian(phi)).max() < 2e-15


def test_exp_is_the_matrix_exponential() -> None:
    """Eq. (1.6)."""
    for angle in ANGLES:
        assert np.abs(so3.exp(angle * AXIS) - expm(so3.hat(angle * AXIS))).max() < 1e-14


def test_the_innovation_is_linear_in_the_error_at_every_attitude() -> None:
    """Eq. (2.5), (2.7), (2.8): zeta' = M, whatever the attitude."""
    v_n = np.array([0.4, 0.0, 0.9])
    M = v_n @ v_n * np.eye(3) - np.outer(v_n, v_n)
    for angle in ANGLES:
        estimate = so3.exp(angle * AXIS)

        def zeta(eps, estimate=estimate):  # type: ignore[no-untyped-def]
            y_b = (so3.exp(eps) @ estimate).T @ v_n
            return np.cross(estimate @ y_b, v_n)

        numeric = columns(lambda d, zeta=zeta: zeta(1j * STEP * d).imag / STEP)
        assert np.abs(numeric - M).max() < 1e-14
