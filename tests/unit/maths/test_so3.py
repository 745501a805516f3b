import numpy as np
import pytest

from h2nav.maths import so3


def test_hat_is_the_cross_product_and_vee_undoes_it() -> None:
    v, u = np.array([1.0, -2.0, 3.0]), np.array([0.5, 0.7, -0.2])
    assert np.array_equal(so3.hat(v) @ u, np.cross(v, u))
    assert np.array_equal(so3.vee(so3.hat(v)), v)


@pytest.mark.parametrize("axis", np.vstack([np.eye(3), np.full((1, 3), 3**-0.5)]))
def test_log_of_a_half_turn_is_pi_about_its_axis(axis: np.ndarray) -> None:
    R = 2.0 * np.outer(axis, axis) - np.eye(3)
    assert np.abs(np.abs(so3.log(R)) - np.pi * np.abs(axis)).max() < 1e-14


def test_log_keeps_the_side_of_the_axis_next_to_a_half_turn() -> None:
    for angle in (np.pi - 1e-6, -(np.pi - 1e-6)):
        phi = angle * np.array([-0.8, 0.0, 0.6])
        assert np.abs(so3.log(so3.exp(phi)) - phi).max() < 1e-9
