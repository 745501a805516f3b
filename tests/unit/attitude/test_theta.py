"""The second stage of the velocity-aided filter against matrices: it is a Kalman filter."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.theta import (
    MAX_WALK,
    adapt_walk,
    apply_theta,
    follow_bias,
    limit,
    measure_level,
    measure_theta,
    predict_theta,
    times_covariance,
)
from h2nav.attitude.velocity_aided.memory import SATURATED, State, Workspace

RANDOM = np.random.default_rng(8)
ATTITUDE = Rotation.random(random_state=8)
NAMES = (("p_xx", "p_xy", "p_xz", "p_xh"), ("p_yy", "p_yz", "p_yh"), ("p_zz", "p_zh"),
         ("heading_variance",))  # fmt: skip


def drawn(scale=1.0):
    """A covariance of four unknowns."""
    root = RANDOM.normal(size=(4, 4)) * (0.01, 0.02, 0.015, 0.1)
    return scale * root.T @ root


def state(covariance):
    """With that covariance of theta, an attitude and a theta to add to."""
    s, w = State(), Workspace()
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            setattr(s, name, float(covariance[row, column]))
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    w.r_nb[:] = ATTITUDE.as_matrix().ravel().tolist()
    w.dtheta[:] = RANDOM.normal(0.0, 0.01, 4).tolist()
    return s, w


def covariance_of(s):
    found = np.zeros((4, 4))
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            found[row, column] = found[column, row] = getattr(s, name)
    return found


def gains(**changes):
    found = new_filter().kernel_gains
    for name, value in changes.items():
        setattr(found, name, value)
    return found


def test_a_row_times_the_covariance():
    covariance, row, product = drawn(), RANDOM.normal(size=4), [0.0] * 4
    times_covariance(state(covariance)[0], row.tolist(), product)
    assert product == pytest.approx((covariance @ row).tolist())


@pytest.mark.parametrize("dt_s", [0.01, 0.2])
def test_the_heading_error_grows_by_the_vertical_bias_and_by_noise(dt_s):
    """theta' = F theta: a true rate is the measured one minus the bias."""
    covariance = drawn()
    s, w = state(covariance)
    g = gains(gyro_noise=1e-3, jitter_share=0.5, heading_scale_noise=0.25, bias_walk=1e-4,
              bias_variance=1.0)  # fmt: skip
    s.gyro_jitter, s.turning, s.bias_walk[:] = 2e-3, 8e-3, [1e-5, 2e-5, 3e-5]
    predict_theta(s, w, g, dt_s)
    step = np.eye(4)
    step[3, :3] = -dt_s * ATTITUDE.as_matrix()[2]
    noise = dt_s * np.diag((1.1e-4, 1.2e-4, 1.3e-4, 1e-3 + 0.5 * 2e-3 + 0.25 * 8e-3))
    assert covariance_of(s) == pytest.approx(step @ covariance @ step.T + noise)


@pytest.mark.parametrize("axis", range(3))
def test_the_variance_of_a_bias_stays_where_it_began(axis):
    covariance = np.diag((1.0, 2.0, 3.0, 4.0))
    s, w = state(covariance)
    least = covariance[axis, axis]
    predict_theta(s, w, gains(bias_variance=least, bias_walk=1.0), 0.1)
    assert covariance_of(s)[axis, axis] == least
    s, w = state(covariance)
    predict_theta(s, w, gains(bias_variance=1.01 * least, bias_walk=1.0), 0.1)
    assert covariance_of(s)[axis, axis] == pytest.approx(least + 0.1)


def test_sensitivities_follow_tilt_and_velocity_of_an_error():
    """Euler's steps of d(velocity)/dt = d(tilt), d(tilt)/dt = a turn by the bias."""
    s, w = state(drawn())
    rows = RANDOM.normal(size=(4, 4))
    for name, values in zip(("dvelocity_n", "dvelocity_e", "dtilt_n", "dtilt_e"), rows,
                            strict=True):  # fmt: skip
        getattr(s, name)[:] = values.tolist()
    dt = 0.01
    predict_theta(s, w, gains(), dt)
    matrix = ATTITUDE.as_matrix()
    own = dt * np.append(matrix[2], 0.0)  # by the heading error to which a bias has grown
    velocity_n, velocity_e, tilt_n, tilt_e = rows
    assert s.dvelocity_n[:] == pytest.approx(velocity_n + dt * tilt_n + own * velocity_n[3])
    assert s.dvelocity_e[:] == pytest.approx(velocity_e + dt * tilt_e + own * velocity_e[3])
    east, north = np.append(matrix[1], 0.0), np.append(matrix[0], 0.0)
    assert s.dtilt_n[:] == pytest.approx(tilt_n + dt * east + own * tilt_n[3])
    assert s.dtilt_e[:] == pytest.approx(tilt_e - dt * north + own * tilt_e[3])


def test_a_measurement_is_kalmans():
    covariance, row = drawn(), RANDOM.normal(size=4)
    s, w = state(covariance)
    before = np.array(w.dtheta)
    measure_theta(s, w, row.tolist(), 0.3, 0.002)
    gain = covariance @ row / (row @ covariance @ row + 0.002)
    assert w.dtheta[:] == pytest.approx(before + gain * (0.3 - row @ before))
    assert covariance_of(s) == pytest.approx(covariance - np.outer(gain, row @ covariance))


def test_without_a_heading_the_vertical_part_only_adds_uncertainty():
    """The gain has no part along the vertical and of the heading; so does Joseph's covariance."""
    covariance, row = drawn(), RANDOM.normal(size=4)
    s, w = state(covariance)
    before = np.array(w.dtheta)
    measure_level(s, w, row.tolist(), 0.3, 0.002)
    down = ATTITUDE.as_matrix()[2]
    level = np.zeros((4, 4))
    level[:3, :3] = np.eye(3) - np.outer(down, down)
    variance = row @ covariance @ row + 0.002
    gain = level @ covariance @ row / variance
    assert w.dtheta[:] == pytest.approx(before + gain * (0.3 - row[:3] @ before[:3]))
    kept = np.eye(4) - np.outer(gain, row)
    assert covariance_of(s) == pytest.approx(
        kept @ covariance @ kept.T + 0.002 * np.outer(gain, gain)
    )


def test_theta_corrects_bias_velocity_and_attitude():
    s, w = state(drawn())
    bias, rows = RANDOM.normal(size=3), 0.01 * RANDOM.normal(size=(4, 4))
    s.gyro_bias[:] = bias.tolist()
    for name, values in zip(("dvelocity_n", "dvelocity_e", "dtilt_n", "dtilt_e"), rows,
                            strict=True):  # fmt: skip
        getattr(s, name)[:] = values.tolist()
    s.velocity_n, s.velocity_e = 2.0, 3.0
    theta = np.array((1e-3, -2e-3, 3e-3, 4e-3))
    w.dtheta[:] = theta.tolist()
    apply_theta(s, w, 5e-4, -6e-4)
    assert s.gyro_bias[:] == pytest.approx(bias + theta[:3])
    assert (s.velocity_n, s.velocity_e) == pytest.approx((2.0 + rows[0] @ theta,
                                                          3.0 + rows[1] @ theta))  # fmt: skip
    north, east = 5e-4 + rows[2] @ theta, -6e-4 + rows[3] @ theta
    turned = Rotation.from_quat(np.roll(s.q_nb, -1)) * ATTITUDE.inv()
    assert turned.as_rotvec() == pytest.approx((east, -north, theta[3]), abs=1e-7)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_bias_stays_within_its_limit(axis, sign):
    g = gains(bias_limit=0.1, heading_variance=9.0)
    for size, bits in ((0.099, 0), (0.101, SATURATED)):
        s, _ = state(drawn())
        s.gyro_bias[axis] = sign * size
        assert limit(s, g) == bits
        assert s.gyro_bias[axis] == pytest.approx(sign * min(size, 0.1))


def test_the_variance_of_the_heading_stays_where_theta_is_linear_and_correlations_stay():
    covariance = drawn(100.0)
    s, _ = state(covariance)
    others = (s.p_accel_x, s.p_accel_y, s.p_offset_x, s.p_offset_y, s.p_offset_z)
    for number, row in enumerate(others):
        row[:] = [1.0, 2.0, 3.0, 4.0 + number]
    most = 0.25 * covariance[3, 3]
    assert limit(s, gains(heading_variance=most, bias_limit=9.0)) == 0
    scale = np.diag((1.0, 1.0, 1.0, 0.5))
    assert covariance_of(s) == pytest.approx(scale @ covariance @ scale)
    for number, row in enumerate(others):
        assert row[:] == pytest.approx([1.0, 2.0, 3.0, 2.0 + 0.5 * number])
    s, _ = state(covariance)
    limit(s, gains(heading_variance=1.01 * covariance[3, 3], bias_limit=9.0))
    assert covariance_of(s) == pytest.approx(covariance)


# --- a bias that moves ----------------------------------------------------------------------------


def test_corrections_and_what_was_expected_of_them_add_up():
    s, w = state(np.diag((1.0, 2.0, 3.0, 4.0)))
    w.dtheta[:] = [0.1, 0.2, 0.3, 0.4]
    for _ in range(2):
        follow_bias(s, w, 1.5, 2.6, 3.7)
    assert s.bias_moved[:] == pytest.approx([0.2, 0.4, 0.6])
    assert s.bias_expected[:] == pytest.approx([1.0, 1.2, 1.4])


def adapted(moved, expected=0.0, seconds=2000, age_s=99.0):
    """The walk when each second moves a bias by so much."""
    s = State()
    s.age_s = age_s
    for _ in range(seconds):
        s.bias_moved[1] += moved
        s.bias_expected[1] += expected
        adapt_walk(s, 1.0)
    assert s.bias_walk[0] == s.bias_walk[2] == 0.0
    return s.bias_walk[1]


def test_a_bias_that_moves_one_way_walks_by_what_it_moves_in_twenty_seconds():
    """Corrections of c a second add up to 20 c over 20 s: a walk of (20 c)^2 in 10 s."""
    per_s = 1e-6
    assert adapted(per_s) == pytest.approx(2.0 * (20.0 * per_s) ** 2 / 20.0, rel=1e-6)
    assert adapted(-per_s) == adapted(per_s)
    assert adapted(1.0) == MAX_WALK
    assert pytest.approx(math.radians(0.5 / 60.0) ** 2 * 20.0) == MAX_WALK
    assert adapted(per_s, age_s=29.9) == 0.0
    assert adapted(per_s, age_s=30.1) > 0.0


def test_what_was_expected_is_no_movement():
    """Of an expected variance v a second, 10.5 v or so are known of a sum over 20 s."""
    per_s = 1e-6
    keep = 20.0 / 21.0
    usual = keep**2 / (1.0 - keep**2)
    free = 2.0 * (20.0 * per_s) ** 2 / 20.0
    expected = 6e-11
    # what the walk itself lets in is taken off what was expected
    found = adapted(per_s, expected)
    assert 0.0 < found < free
    assert found == pytest.approx(
        2.0 * ((20.0 * per_s) ** 2 - 0.5 * usual * (expected - found)) / 20.0, rel=1e-4
    )
    assert adapted(per_s, 1e-10) == 0.0
