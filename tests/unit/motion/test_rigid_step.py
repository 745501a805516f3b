import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from h2nav.maths import quaternion, se3, so3
from h2nav.motion import rigid_step
from h2nav.motion.rigid_step import RigidState

START = RigidState(0, quaternion.exp((0.3, -0.8, 1.1)), (1.0, -2.0, 3.0), (2.0, 0.5, -1.0))


def matrix(state):
    return se3.pose(np.array(quaternion.to_matrix(state.q_ob)), state.p_o)


@pytest.mark.parametrize(
    "w", [(0.0, 0.0, 0.0), (1e-9, 0.0, 0.0), (0.4, -0.3, 0.9), (3.0, 2.0, 9.0)]
)
@pytest.mark.parametrize("dt_us", [1, 2_500, 100_000, 1_000_000])
def test_constant_twist_is_the_exponential_of_se3(w, dt_us):
    v = (1.0, 0.3, -0.2)
    end = rigid_step.with_velocity(START, dt_us, w, v)
    expected = matrix(START) @ se3.exp(np.array([*w, *v]) * dt_us * 1e-6)
    np.testing.assert_allclose(matrix(end), expected, atol=1e-12)
    assert quaternion.norm(end.q_ob) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize("angle", [0.0, 1e-8, 9.9e-3, 1.01e-2, 1.0, 3.1, 7.0])
def test_left_jacobian_agrees_with_the_matrix(angle):
    phi = angle * np.array([0.6, -0.48, 0.64])
    v = (0.3, -1.0, 2.0)
    got = rigid_step.left_jacobian_times(tuple(phi), v)
    np.testing.assert_allclose(got, so3.left_jacobian(phi) @ v, atol=1e-13)


def test_constant_acceleration_against_integration():
    w, a, dt_s = np.array([0.4, -0.3, 0.9]), np.array([1.0, 2.0, -0.5]), 0.01

    def rates(_, y):
        R = y[:9].reshape(3, 3)
        return np.concatenate([(R @ so3.hat(w)).ravel(), R @ y[12:], a - np.cross(w, y[12:])])

    y0 = np.concatenate([matrix(START)[:3, :3].ravel(), START.p_o, START.v_b])
    y = solve_ivp(rates, (0.0, dt_s), y0, rtol=1e-12, atol=1e-13).y[:, -1]
    end = rigid_step.with_acceleration(START, 10_000, tuple(w), tuple(a))
    np.testing.assert_allclose(matrix(end)[:3, :3].ravel(), y[:9], atol=1e-10)
    np.testing.assert_allclose(end.v_b, y[12:], atol=1e-10)
    np.testing.assert_allclose(end.p_o, y[9:12], atol=2e-7)  # |w x a| dt^3 / 12


def test_20_000_steps_keep_the_quaternion_unit():
    state = START
    for i in range(1, 20_001):
        state = rigid_step.with_velocity(state, i * 2500, (3.0, -2.0, 5.0), (0.0, 0.0, 0.0))
    assert abs(quaternion.norm(state.q_ob) - 1.0) < 1e-15
    assert math.isfinite(state.p_o[0])
