"""The discrete equations of docs/derivation.md section 3 against expm and the Riccati equation."""

import numpy as np
import pytest
from needs import DEG
from scipy.linalg import expm, solve_discrete_are
from synthetic_imu import DENSITIES, FIELD_N, GRAVITY

from h2nav.attitude.two_stage.gains import FORCE_WEIGHTS, design_two_stage
from h2nav.attitude.two_stage.kernel.correction import correct
from h2nav.attitude.two_stage.kernel.motion import propagate
from h2nav.attitude.two_stage.memory import Gains, Memory, Sample
from h2nav.attitude.two_stage.trust import TrustLimits, kernel_gains
from h2nav.maths import quaternion, so3


def gains_and_memory() -> tuple[Gains, Memory]:
    gains = design_two_stage(DENSITIES, 100.0, "test")
    g = kernel_gains(gains, DENSITIES.field, TrustLimits(), mean_rate=True)
    s = Memory(q_nb=list(quaternion.from_euler(0.3, -0.8, 2.0)), heading_referenced=1.0)
    return g, s


@pytest.mark.parametrize("rate_hz", [25.0, 100.0, 400.0])
@pytest.mark.parametrize("number", range(len(FORCE_WEIGHTS)))
def test_the_closed_form_is_the_riccati_solution(rate_hz: float, number: int) -> None:
    """Eq. (3.5) - (3.7)."""
    level = design_two_stage(DENSITIES, rate_hz, "test").levels[number]
    scale = np.sqrt(rate_hz)
    force = DENSITIES.accelerometer * scale / np.sqrt(level.force_weight)
    field = DENSITIES.magnetometer * scale
    C = np.vstack([so3.hat([0.0, 0.0, GRAVITY]) / force, so3.hat(FIELD_N) / field])
    # In units of the gyro's step: scipy then keeps its digits.
    unit = DENSITIES.gyro / scale
    prior = solve_discrete_are(np.eye(3), C.T * unit, np.eye(3), np.eye(6)) * unit**2
    K = np.linalg.inv(np.linalg.inv(prior) + C.T @ C)
    ours = np.array([[level.k_nn, 0, level.k_nd], [0, level.k_ee, 0], [level.k_nd, 0, level.k_dd]])
    assert np.abs(ours - K).max() < 1e-9 * np.abs(K).max()


def test_propagation_is_the_exponential_of_the_rate() -> None:
    """Eq. (3.8)."""
    g, s = gains_and_memory()
    before = np.array(quaternion.to_matrix(tuple(s.q_nb)))
    sample = Sample(dt_s=0.01, gyro=[3.0, -7.0, 4.0], accel=[0.0, 0.0, -GRAVITY])
    propagate(s, g, sample)
    after = before @ expm(0.01 * so3.hat(sample.gyro))
    assert np.abs(np.array(s.r_nb).reshape(3, 3) - after).max() < 1e-15


def test_the_regressor_is_the_derivative_by_the_bias() -> None:
    """Eq. (3.1), (3.9): U against finite differences of the propagated attitude, over a second."""
    rates = [(0.5 * np.sin(0.05 * i), 0.8, -0.3 * np.cos(0.03 * i)) for i in range(100)]

    def end(bias: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        g, s = gains_and_memory()
        s.gyro_bias = bias.tolist()
        for w in rates:
            propagate(s, g, Sample(dt_s=0.01, gyro=list(w), accel=[0.0, 0.0, -GRAVITY]))
        U = np.array(s.regressor).reshape(3, 3)
        return np.array(quaternion.to_matrix(tuple(s.q_nb))), U

    size = 1e-6
    R, U = end(np.zeros(3))
    numeric = np.column_stack([so3.log(R @ end(size * axis)[0].T) / size for axis in np.eye(3)])
    # eps = -U delta with delta = true - estimate: an estimate too large by d turns by +U d.
    assert np.abs(numeric - U).max() < 0.01


def test_one_correction_is_the_full_kalman_correction() -> None:
    """Eq. (3.10) - (3.13) against a six-state update with the same prior."""
    g, s = gains_and_memory()
    U = np.array([[0.3, -0.1, 0.2], [0.05, 0.4, 0.1], [-0.2, 0.1, 0.5]])
    P_eps = np.diag([4e-6, 5e-6, 9e-6])
    P_eps[0, 2] = P_eps[2, 0] = 1e-6
    P_b = 1e-6 * np.array([[3.0, 0.5, 0.2], [0.5, 2.0, -0.4], [0.2, -0.4, 4.0]])
    s.regressor = U.reshape(-1).tolist()
    s.variance_n, s.variance_e, s.variance_d, s.covariance_nd = 4e-6, 5e-6, 9e-6, 1e-6
    s.p_xx, s.p_xy, s.p_xz, s.p_yy, s.p_yz, s.p_zz = P_b[np.triu_indices(3)].tolist()
    M = np.array([[2e5, 0, -6e4], [0, 3e5, 0], [-6e4, 0, 5e4]])
    zeta = np.array([30.0, -50.0, 12.0])
    s.info_n, s.info_e, s.info_d, s.info_nd = M[0, 0], M[1, 1], M[2, 2], M[0, 2]
    s.zeta = zeta.tolist()
    before = np.array(quaternion.to_matrix(tuple(s.q_nb)))
    assert correct(s, g, 0) == 0
    after = np.array(quaternion.to_matrix(tuple(s.q_nb)))

    T = np.block([[np.eye(3), -U], [np.zeros((3, 3)), np.eye(3)]])
    P = T @ np.block([[P_eps, np.zeros((3, 3))], [np.zeros((3, 3)), P_b]]) @ T.T
    H = np.hstack([np.eye(3), np.zeros((3, 3))])
    P = np.linalg.inv(np.linalg.inv(P) + H.T @ M @ H)
    expected = P @ H.T @ zeta
    assert np.abs(so3.log(after @ before.T) - expected[:3]).max() < 1e-12
    assert np.abs(np.array(s.gyro_bias) - expected[3:]).max() < 1e-15
    P_after = np.array([s.p_xx, s.p_xy, s.p_xz, s.p_yy, s.p_yz, s.p_zz])
    assert np.abs(P_after - P[3:, 3:][np.triu_indices(3)]).max() < 1e-14
    assert np.abs(expected[3:]).max() < TrustLimits().bias_step_deg_s * DEG
