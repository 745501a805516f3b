"""What measured velocities show beside theta, in integers against matrices: a Kalman filter."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.kernel.aiding import (
    apply_accel,
    apply_lag,
    find_fix_gain,
    find_spread,
    in_force,
    predict_innovation,
    show_accel,
    use_accel_gain,
    use_lag_gain,
)
from h2nav.attitude.velocity_aided.integer.kernel.theta import use_gain, weigh_gain
from h2nav.attitude.velocity_aided.integer.memory import LATENCY_MAX, THETA_MAX, Gains, State
from h2nav.attitude.velocity_aided.units import ACCEL_UNIT_G

Q13, Q15, Q24, Q26, Q28, Q30 = (2.0**bits for bits in (13, 15, 24, 26, 28, 30))
THETA = (("p_xx", "p_xy", "p_xz", "p_xh"), ("p_yy", "p_yz", "p_yh"), ("p_zz", "p_zh"),
         ("heading_variance",))  # fmt: skip


def drawn(number):
    """A covariance of theta and of the accelerometer's bias, and a row (6,) of a measurement."""
    random = np.random.default_rng(number)
    root = random.uniform(-1.0, 1.0, (6, 6)) * (0.4, 0.6, 0.5, 0.6, 0.3, 0.5)
    return root.T @ root, random.normal(size=6)


def state(covariance):
    s = State()
    for row, names in enumerate(THETA):
        for column, name in enumerate(names, row):
            setattr(s, name, round(covariance[row, column] * Q28))
    s.p_accel_x[:] = whole(covariance[4, :4], Q28)
    s.p_accel_y[:] = whole(covariance[5, :4], Q28)
    s.p_accel[:] = whole((covariance[4, 4], covariance[4, 5], covariance[5, 5]), Q28)
    return s


def covariance_of(s):
    found = np.zeros((6, 6))
    for row, names in enumerate(THETA):
        for column, name in enumerate(names, row):
            found[row, column] = found[column, row] = getattr(s, name) / Q28
    found[4, :4] = found[:4, 4] = np.array(s.p_accel_x[:]) / Q28
    found[5, :4] = found[:4, 5] = np.array(s.p_accel_y[:]) / Q28
    x, xy, y = np.array(s.p_accel[:]) / Q28
    found[4:, 4:] = ((x, xy), (xy, y))
    return found


def whole(values, unit):
    return [round(float(value) * unit) for value in values]


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("learns", [0.0, 0.5, 1.0])
def test_a_measurement_teaches_the_bias_by_a_share_of_kalmans_gain(number, learns):
    covariance, row = drawn(number)
    s = state(covariance)
    before = 0.03 * drawn(number + 50)[1]
    s.dtheta[:], s.daccel[:] = whole(before[:4], Q28), whole(before[4:], Q28)
    rows = whole(row, Q24)
    explained = find_spread(s, rows[:4], rows[4:])
    assert explained / Q24 == pytest.approx(row @ before, abs=2e-3)
    noise, innovation = 0.5, 0.3
    weigh_gain(s, round(innovation * Q24) - explained, round(256.0 * math.log2(noise)))
    use_gain(s)
    use_accel_gain(s, min(round(learns * Q15), 32767))
    gain = covariance @ row / (row @ covariance @ row + noise)
    fall = np.outer(gain, row @ covariance)
    # a variance by share (2 - share) of its largest fall
    fall[4:, 4:] *= learns * (2.0 - learns)
    size = float(np.abs(covariance).max())
    assert covariance_of(s) == pytest.approx(covariance - fall, abs=5e-3 * size)
    moved = gain * (innovation - row @ before) * (1.0, 1.0, 1.0, 1.0, learns, learns)
    assert np.array([*s.dtheta, *s.daccel]) / Q28 == pytest.approx(before + moved, abs=5e-3)


def test_a_bias_that_is_not_estimated_is_not_learnt():
    covariance, row = drawn(1)
    s = state(covariance)
    s.p_accel[:] = [0, 0, 0]
    rows = whole(row, Q24)
    weigh_gain(s, round(0.3 * Q24) - find_spread(s, rows[:4], rows[4:]), 0)
    use_accel_gain(s, 32767)
    assert s.daccel[:] == [0, 0]
    assert s.p_accel[:] == [0, 0, 0]


def lagged(theta_variance=0.0, accel_g=-0.5, dvelocity_lag_g=0.0, learns=1.0, moved_s=0.0, axis=0):
    """A fix that is 0.05 s (of gravity) off, of which only tilt and latency may be the reason."""
    s = State()
    s.p_xx = round(theta_variance * Q28)
    s.fix_lag_variance, s.fix_noise = round(0.01 * Q30), round(0.002 * Q26)
    s.dvelocity_lag[axis] = round(dvelocity_lag_g * Q24)
    s.accel_learns = min(round(learns * Q15), 32767)
    s.dfix_lag = round(moved_s * Q30)
    accel = round(accel_g * Q13)
    s.accel_n, s.accel_e = (accel, 0) if axis == 0 else (0, accel)
    find_fix_gain(s, [1 << 24, 0, 0, 0], [0, 0], round(0.05 * Q24), accel, axis)
    predict_innovation(s, axis)
    use_gain(s)
    use_lag_gain(s)
    return s


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(
    "how",
    [
        {},
        {"theta_variance": 0.01},
        {"learns": 0.5},
        {"accel_g": 0.3, "dvelocity_lag_g": -0.4},
        {"moved_s": 0.02},
    ],
)
def test_a_fix_teaches_its_latency_by_kalmans_gain(how, axis):
    s = lagged(**how, axis=axis)
    row = how.get("dvelocity_lag_g", 0.0) - how.get("accel_g", -0.5)
    learns, moved_s = how.get("learns", 1.0), how.get("moved_s", 0.0)
    theta = how.get("theta_variance", 0.0)
    variance = theta + 0.01 * row * row + 0.002
    innovation = 0.05 - moved_s * row
    assert s.dfix_lag / Q30 == pytest.approx(
        moved_s + learns * 0.01 * row / variance * innovation, rel=0.02
    )
    fall = learns * (2.0 - learns) * (0.01 * row) ** 2 / variance
    assert s.fix_lag_variance / Q30 == pytest.approx(0.01 - fall, rel=0.02)
    # The latency's error is noise to theta.
    assert s.dtheta[0] / Q28 == pytest.approx(theta / variance * innovation, rel=0.02)
    # ... and a part of what was predicted, s^2.
    assert s.fix_predicted / Q28 == pytest.approx(theta + 0.01 * row * row, rel=0.01)


def test_what_is_predicted_of_both_parts_adds_up():
    s = lagged(0.01)
    first = s.fix_predicted
    s.dvelocity_lag[:], s.accel_e = [0, 0], round(-0.5 * Q13)
    find_fix_gain(s, [0, 1 << 24, 0, 0], [0, 0], 0, s.accel_e, 1)
    s.gain_variance = 0
    predict_innovation(s, 1)
    more = s.fix_lag_variance / Q30 * 0.25
    assert (s.fix_predicted - first) / Q28 == pytest.approx(more, rel=0.01)
    predict_innovation(s, 0)
    assert s.fix_predicted / Q28 == pytest.approx(more, rel=0.01)


@pytest.mark.parametrize(("variance", "least"), [(0, 0), (1200, 1024), (1 << 20, 1 << 18)])
def test_a_latency_stays_uncertain_by_a_millisecond(variance, least):
    s = lagged()
    s.fix_lag_variance = variance
    use_lag_gain(s)
    assert (s.fix_lag_variance == least) is (variance < 1 << 20)


@pytest.mark.parametrize(
    ("before_s", "moved_s", "removed_s", "after_s"),
    [
        (0.1, 0.05, 0.0, 0.15),
        (0.1, -0.2, 0.0, 0.0),  # not early
        (0.1, -0.2, 0.08, -0.08),  # but too much may have been removed
        (0.1, 0.4, 0.0, 0.3),
    ],
)
def test_a_latency_moves_velocity_and_tilt_within_its_limits(before_s, moved_s, removed_s, after_s):
    s, g = State(), Gains()
    g.fix_lag_limit = round(0.3 * Q30)
    s.fix_lag, s.dfix_lag = round(before_s * Q30), round(moved_s * Q30)
    s.fix_removed = round(removed_s * Q30)
    s.velocity_n, s.velocity_e = round(1.0 * Q24), round(-2.0 * Q24)
    s.dvelocity_lag[:], s.dtilt_lag[:] = whole((0.4, -0.2), Q24), whole((0.1, 0.3), Q24)
    apply_lag(s, g)
    change = after_s - before_s
    assert s.fix_lag / Q30 == pytest.approx(after_s, abs=1e-8)
    assert s.dfix_lag == 0
    assert s.velocity_n / Q24 == pytest.approx(1.0 + 0.4 * change, abs=1e-4)
    assert s.velocity_e / Q24 == pytest.approx(-2.0 - 0.2 * change, abs=1e-4)
    # half radians; a tilt north turns about the east axis
    assert s.correction[0] / Q30 == pytest.approx(0.5 * 0.3 * change, abs=1e-4)
    assert s.correction[1] / Q30 == pytest.approx(-0.5 * 0.1 * change, abs=1e-4)


def test_a_bias_moves_velocity_and_tilt():
    s = State()
    s.accel_bias[:], s.daccel[:] = whole((0.5, -0.2), Q28), whole((0.03, -0.07), Q28)
    s.dvelocity_accel_n[:], s.dvelocity_accel_e[:] = whole((0.5, -1.0), Q24), whole((2.0, 0.3), Q24)
    s.dtilt_accel_n[:], s.dtilt_accel_e[:] = whole((0.4, 0.2), Q28), whole((-0.6, 0.9), Q28)
    apply_accel(s)
    assert np.array(s.accel_bias[:]) / Q28 == pytest.approx((0.53, -0.27), abs=1e-8)
    assert s.daccel[:] == [0, 0]
    assert s.velocity_n / Q24 == pytest.approx(0.5 * 0.03 + 0.07, abs=1e-4)
    assert s.velocity_e / Q24 == pytest.approx(2.0 * 0.03 - 0.3 * 0.07, abs=1e-4)
    north, east = 0.4 * 0.03 - 0.2 * 0.07, -0.6 * 0.03 - 0.9 * 0.07
    assert s.correction[0] / Q30 == pytest.approx(0.5 * east, abs=1e-4)
    assert s.correction[1] / Q30 == pytest.approx(-0.5 * north, abs=1e-4)
    s.daccel[0] = THETA_MAX
    apply_accel(s)
    assert s.accel_bias[0] == THETA_MAX


def test_a_tilt_from_a_resting_force_is_wrong_by_its_bias_once():
    attitude = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
    s, r = State(), [0] * 9
    x, y, z, w = attitude.as_quat().tolist()
    s.q_nb[:] = whole((w, x, y, z), 2.0**29)
    rotation(s.q_nb, r)
    s.accel_shows, s.dtilt_lag[0] = 1, 5
    show_accel(s, r)
    matrix = attitude.as_matrix()
    unit = ACCEL_UNIT_G * Q28  # rad per g, of a bias in its unit
    assert s.dtilt_accel_n[:] == pytest.approx(matrix[0, :2] * unit, abs=200)
    assert s.dtilt_accel_e[:] == pytest.approx(matrix[1, :2] * unit, abs=200)
    assert (s.accel_shows, s.dtilt_lag[0]) == (0, 0)
    s.dtilt_accel_n[0] = 7
    show_accel(s, r)
    assert s.dtilt_accel_n[0] == 7


@pytest.mark.parametrize("bias_g", [0.05, -0.03])
def test_a_bias_is_a_part_of_the_force(bias_g):
    assert in_force(round(bias_g / ACCEL_UNIT_G * Q28)) == pytest.approx(bias_g * 2.0**20, abs=2)


def test_the_largest_latency_stays_in_its_format():
    s = lagged(accel_g=-3.9)
    s.gain_innovation, s.dfix_lag = 32767, LATENCY_MAX
    use_lag_gain(s)
    assert s.dfix_lag == LATENCY_MAX
