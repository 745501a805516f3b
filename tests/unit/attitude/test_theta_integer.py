"""The second stage of the filter in integers against matrices: it is a Kalman filter."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.kernel.aiding import find_spread
from h2nav.attitude.velocity_aided.integer.kernel.theta import (
    apply_theta,
    fade_tilt_sigma,
    forget_sensitivities,
    limit_heading,
    lowered_variance,
    use_gain,
    use_level_gain,
    weigh_gain,
)
from h2nav.attitude.velocity_aided.integer.memory import (
    SATURATED,
    THETA_MAX,
    VARIANCE_MIN,
    Gains,
    State,
)
from h2nav.attitude.velocity_aided.units import BIAS_UNIT_RAD_S, HEADING_UNIT_RAD

ATTITUDE = Rotation.random(random_state=8)
Q24, Q28 = 2.0**24, 2.0**28
NAMES = (("p_xx", "p_xy", "p_xz", "p_xh"), ("p_yy", "p_yz", "p_yh"), ("p_zz", "p_zh"),
         ("heading_variance",))  # fmt: skip
NOTHING = [0, 0]


def drawn(number):
    """A covariance of four unknowns within the format, and a row, in units of the integers."""
    random = np.random.default_rng(number)
    root = random.uniform(-1.0, 1.0, (4, 4)) * (0.4, 0.6, 0.5, 0.6)
    return root.T @ root, random.normal(size=4)


def state(covariance):
    s = State()
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            setattr(s, name, round(covariance[row, column] * Q28))
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [round(part * 2.0**29) for part in (q_w, x, y, z)]
    return s


def covariance_of(s):
    found = np.zeros((4, 4))
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            found[row, column] = found[column, row] = getattr(s, name) / Q28
    return found


def measured(s, row, innovation, noise, apply):
    """A measurement of `row` theta, in the units of the integers."""
    integers = [round(float(part) * Q24) for part in row]
    explained = find_spread(s, integers, NOTHING)
    log_noise = round(256.0 * math.log2(noise))
    weigh_gain(s, round(innovation * Q24) - explained, log_noise)
    apply(s)


@pytest.mark.parametrize("number", range(6))
@pytest.mark.parametrize("noise", [0.01, 1.0, 30.0])
def test_a_measurement_is_kalmans(number, noise):
    covariance, row = drawn(number)
    s = state(covariance)
    before = 0.05 * drawn(number + 50)[1]
    s.dtheta[:] = [round(part * Q28) for part in before]
    measured(s, row, 0.3, noise, use_gain)
    gain = covariance @ row / (row @ covariance @ row + noise)
    size = float(np.abs(covariance).max())
    expected = before + gain * (0.3 - row @ before)
    assert np.array(s.dtheta[:]) / Q28 == pytest.approx(expected, abs=4e-3)
    assert covariance_of(s) == pytest.approx(
        covariance - np.outer(gain, row @ covariance), abs=4e-3 * size
    )


@pytest.mark.parametrize("scale", [1e-3, 1.0, 20.0])
def test_sensitivities_of_any_size_serve(scale):
    covariance = 0.1 * np.eye(4)
    row = scale * np.array((0.6, -0.3, 0.2, 0.5))
    s = state(covariance)
    noise = 0.1 * scale**2
    measured(s, row, 0.2 * scale, noise, use_gain)
    gain = covariance @ row / (row @ covariance @ row + noise)
    assert np.array(s.dtheta[:]) / Q28 == pytest.approx(0.2 * scale * gain, rel=0.02, abs=1e-4)


def test_a_noise_beyond_all_measures_corrects_nothing():
    covariance, _ = drawn(0)
    s = state(covariance)
    measured(s, np.ones(4), 0.3, 2.0**39, use_gain)
    assert s.dtheta[:] == [0] * 4
    assert covariance_of(s) == pytest.approx(covariance, abs=1e-7)


@pytest.mark.parametrize("variance", [4, 20, 100, 999, 1 << 16, 1 << 29])
@pytest.mark.parametrize("noise", [0.01, 3.0, 2.0**20, 2.0**28.9, 2.0**29.1, 2.0**34, 2.0**58.9])
def test_the_gain_is_divided_by_variance_and_noise_of_any_size(variance, noise):
    """To one unit of the variance, which grows with the noise; a power of two errs by 0.33 %."""
    s = State()
    s.gain_variance = variance
    weigh_gain(s, 0, round(256.0 * math.log2(noise)) - 61 * 256)
    unit = max(1.0, noise / 2.0**28)
    found = 2.0 ** (14 + s.gain_digits) / s.gain_inverse
    error = unit + 0.005 * noise + 2.0**-12 * (variance + noise)
    assert found == pytest.approx(variance + noise, abs=error)


@pytest.mark.parametrize(("power", "is_used"), [(58.99, True), (59.0, False)])
def test_a_noise_of_two_to_the_59_units_leaves_nothing_of_the_gain(power, is_used):
    s = State()
    s.gain_variance = 1 << 29
    weigh_gain(s, 1 << 24, math.floor(256.0 * power) - 61 * 256)
    assert (s.gain_inverse > 0) is (s.gain_innovation > 0) is is_used


@pytest.mark.parametrize("size", [1.4, 2.0])
def test_a_covariance_as_large_as_at_the_start_falls_as_kalmans(size):
    """1.4: of a bias of 1 deg/s; the fall is larger than the product of its factors."""
    covariance, row = drawn(0)
    covariance *= size / covariance.max()
    s = state(covariance)
    measured(s, row, 0.3, 0.01, use_gain)
    h = covariance @ row
    expected = covariance - np.outer(h, h) / (row @ h + 0.01)
    assert covariance_of(s) == pytest.approx(expected, abs=2e-3 * size)


@pytest.mark.parametrize("number", range(4))
@pytest.mark.parametrize("largest", [0.1, 1.4, 3.9])
def test_without_a_heading_the_vertical_part_only_adds_uncertainty(number, largest):
    """The gain has no part along the vertical and of the heading; so does the covariance."""
    covariance, row = drawn(number)
    covariance *= largest / np.abs(covariance).max()
    s, r = state(covariance), [0] * 9
    rotation(s.q_nb, r)
    measured(s, row, 0.3, 0.1, lambda s: use_level_gain(s, r))
    down = ATTITUDE.as_matrix()[2]
    level = np.zeros((4, 4))
    level[:3, :3] = np.eye(3) - np.outer(down, down)
    variance = row @ covariance @ row + 0.1
    gain = level @ covariance @ row / variance
    size = float(np.abs(covariance).max())
    assert np.array(s.dtheta[:]) / Q28 == pytest.approx(0.3 * gain, abs=5e-3)
    h = covariance @ row
    kept = h - variance * gain
    expected = covariance - (np.outer(h, h) - np.outer(kept, kept)) / variance
    assert covariance_of(s) == pytest.approx(expected, abs=6e-3 * size)


def test_a_variance_stays_positive():
    assert lowered_variance(1000, 500) == 500
    assert lowered_variance(1000, 1000 - VARIANCE_MIN) == VARIANCE_MIN
    assert lowered_variance(1000, 2000) == VARIANCE_MIN
    assert lowered_variance(THETA_MAX, -5) == THETA_MAX


# --- what a correction does -------------------------------------------------------------------


def limits(bias=0.1, heading=4.0):
    g = Gains()
    g.bias_limit = round(bias / 2e6 * 2.0**53)
    g.heading_variance = round(heading / HEADING_UNIT_RAD**2 * Q28)
    return g


@pytest.mark.parametrize("size", [1.0, 1e-2])
def test_theta_corrects_bias_velocity_and_attitude(size):
    s = state(0.01 * np.eye(4))
    theta = size * np.array((0.1, -0.2, 0.3, 0.4))
    rows = np.array([drawn(number)[1] for number in range(4)])
    s.dtheta[:] = [round(part * Q28) for part in theta]
    s.dvelocity_n[:], s.dvelocity_e[:] = ([round(part * Q24) for part in row] for row in rows[:2])
    s.dtilt_n[:], s.dtilt_e[:] = ([round(part * Q28) for part in row] for row in rows[2:])
    s.velocity_n, s.velocity_e = round(2.0 * Q24), round(3.0 * Q24)
    assert apply_theta(s, limits()) == 0
    found = [part / 2.0**53 * 2e6 for part in s.gyro_bias[:]]
    assert found == pytest.approx((theta[:3] * BIAS_UNIT_RAD_S).tolist(), rel=1e-3)
    velocity = s.velocity_n / Q24 - 2.0, s.velocity_e / Q24 - 3.0
    assert velocity == pytest.approx((rows[0] @ theta, rows[1] @ theta), abs=2e-3 * size)
    # half radians: a tilt north turns about east, backward
    turned = [part / 2.0**30 for part in s.correction[:]]
    expected = 0.5 * rows[3] @ theta, -0.5 * rows[2] @ theta, theta[3] / 4.0
    assert turned == pytest.approx(expected, abs=2e-3 * size)
    assert s.heading_added == s.heading_due == s.correction[2]
    assert s.dtheta[:] == [0] * 4


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "bits"), [(0.999, 0), (1.001, SATURATED)])
def test_a_bias_stays_within_its_limit(axis, sign, share, bits):
    g, s = limits(bias=0.1), state(0.01 * np.eye(4))
    s.gyro_bias[axis] = round(sign * share * g.bias_limit)
    assert apply_theta(s, g) == bits
    assert s.gyro_bias[axis] == pytest.approx(sign * min(share, 1.0) * g.bias_limit, rel=1e-6)


@pytest.mark.parametrize(("share", "keep"), [(0.99, 1.0), (1.01, 0.995), (4.0, 0.5)])
def test_the_variance_of_the_heading_stays_where_theta_is_linear_and_correlations_stay(share, keep):
    g = limits(heading=0.2)
    s = State()
    s.heading_variance = round(share * g.heading_variance)
    s.p_xh, s.p_yh, s.p_zh = 1 << 24, -(1 << 24), 1 << 23
    limit_heading(s, g)
    assert s.heading_variance == min(round(share * g.heading_variance), g.heading_variance)
    found = [s.p_xh, s.p_yh, s.p_zh]
    expected = [keep * 2.0**24, -keep * 2.0**24, keep * 2.0**23]
    assert found == pytest.approx(expected, rel=0.01)


def test_a_new_tilt_and_velocity_depend_on_nothing():
    s = State()
    rows = (s.dtilt_n, s.dtilt_e, s.dvelocity_n, s.dvelocity_e)
    for row in rows:
        row[:] = [1, 2, 3, 4]
    s.dtilt_lag[:], s.accel_shows = [5, 6], 0
    forget_sensitivities(s)
    assert all(row[:] == [0] * 4 for row in rows)
    assert (s.dtilt_lag[:], s.accel_shows) == ([0, 0], 1)


@pytest.mark.parametrize(("gain", "left"), [(0.0, 1.0), (0.25, 0.875), (0.5, 0.75)])
def test_a_doubt_of_the_tilt_fades_at_the_rate_of_the_loop(gain, left):
    s = State()
    s.extra_tilt_sigma = round(0.4 * Q28)
    s.k_velocity_m, s.k_velocity_s = round(gain * 2.0**15), 0
    fade_tilt_sigma(s)
    assert s.extra_tilt_sigma / Q28 == pytest.approx(0.4 * left, rel=1e-3)
