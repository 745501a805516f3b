import math

import numpy as np
import pytest

from h2nav.maths import quaternion
from h2nav.motion import odometry_records
from h2nav.motion.samples import PoseFrame, TwistEstimate
from h2nav.motion.wheel_odometry import WheelEstimate


def matrix(triangle):
    full = np.zeros((6, 6))
    full[np.triu_indices(6)] = triangle
    return full + np.triu(full, 1).T


def test_left_and_counter_clockwise_become_right_and_clockwise():
    P = ((0.04, 0.01, 0.002), (0.01, 0.09, 0.003), (0.002, 0.003, 0.01))
    estimate = WheelEstimate(7, (1.0, 2.0, 0.5), (3.0, 0.4, 0.6), P, P, 3)
    record = odometry_records.of_wheels(estimate)
    assert record.p_m == (1.0, -2.0, 0.0)
    assert quaternion.to_euler(record.q) == pytest.approx((0.0, 0.0, -0.5))
    assert record.v_b_m_s == (3.0, -0.4, 0.0)
    assert record.w_b_rad_s == (0.0, 0.0, -0.6)
    assert (record.t_us, record.reset_counter, record.frame) == (7, 3, PoseFrame.LOCAL_FRD)
    flip = np.diag([1.0, -1.0, -1.0])
    planar = matrix(record.pose_covariance)[np.ix_([0, 1, 5], [0, 1, 5])]
    np.testing.assert_allclose(planar, flip @ np.array(P) @ flip)
    assert np.all(np.linalg.eigvalsh(matrix(record.pose_covariance)) > 0.0)


def test_twist_estimate_becomes_a_message_of_21_covariances():
    zero = (0.0, 0.0, 0.0)
    estimate = TwistEstimate(
        5, (1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (0.1, 0.2, 0.3), (4.0, 5.0, 6.0), zero, zero,
        zero, zero, 0.01, 0.02, 0.03, 0.04, 0.0, PoseFrame.LOCAL_NED, 2,
    )  # fmt: skip
    record = odometry_records.of_twist(estimate)
    assert np.diag(matrix(record.pose_covariance)) == pytest.approx([4e-4] * 3 + [1e-4] * 3)
    assert np.diag(matrix(record.velocity_covariance)) == pytest.approx([16e-4] * 3 + [9e-4] * 3)
    assert record.frame is PoseFrame.LOCAL_NED
    assert all(map(math.isfinite, record.pose_covariance))
