"""A measurement of theta, accelerometer, latency and offset together, against matrices."""

import numpy as np
import pytest

from h2nav.attitude.velocity_aided.kernel import aiding
from h2nav.attitude.velocity_aided.kernel.estimate import (
    LOST_HEADING_RAD,
    estimate,
    heading_deviation,
    of_accel,
    tilt_deviation,
)
from h2nav.attitude.velocity_aided.memory import (
    CONVERGED,
    VELOCITY_USED,
    YAW_REFERENCED,
    Gains,
    Sample,
    State,
    Workspace,
)
from h2nav.maths.units import DEG

# Unknowns: theta (4), accelerometer (2), latency, offset of the field (3).
THETA, ACCEL, LAG, OFFSET = slice(0, 4), slice(4, 6), 6, slice(7, 10)
NAMES = (("p_xx", "p_xy", "p_xz", "p_xh"), ("p_yy", "p_yz", "p_yh"), ("p_zz", "p_zh"),
         ("heading_variance",))  # fmt: skip
UPPER = np.triu_indices(3)


def drawn(number):
    """A covariance in which the latency is independent, as the filter has it."""
    root = np.random.default_rng(number).normal(size=(10, 10))
    covariance = root @ root.T
    covariance[LAG] = covariance[:, LAG] = 0.0
    covariance[LAG, LAG] = 0.7
    return covariance


def state(covariance):
    s = State()
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            setattr(s, name, float(covariance[row, column]))
    s.p_accel_x[:], s.p_accel_y[:] = covariance[ACCEL, THETA].tolist()
    s.p_accel[:] = covariance[ACCEL, ACCEL][np.triu_indices(2)].tolist()
    s.fix_lag_variance = float(covariance[LAG, LAG])
    s.p_offset[:] = covariance[OFFSET, OFFSET][UPPER].tolist()
    s.p_offset_x[:], s.p_offset_y[:], s.p_offset_z[:] = covariance[OFFSET, THETA].tolist()
    s.p_accel_offset[:] = covariance[ACCEL, OFFSET].ravel().tolist()
    return s


def covariance_of(s):
    found = np.zeros((10, 10))
    for row, names in enumerate(NAMES):
        for column, name in enumerate(names, row):
            found[row, column] = getattr(s, name)
    found[THETA, ACCEL] = np.transpose((s.p_accel_x[:], s.p_accel_y[:]))
    found[4, 4], found[4, 5], found[5, 5] = s.p_accel
    found[LAG, LAG] = s.fix_lag_variance
    found[OFFSET, OFFSET][UPPER] = s.p_offset
    found[THETA, OFFSET] = np.transpose((s.p_offset_x[:], s.p_offset_y[:], s.p_offset_z[:]))
    found[ACCEL, OFFSET] = np.reshape(s.p_accel_offset, (2, 3))
    return found + np.triu(found, 1).T


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("learns", [0.0, 0.4, 1.0])
def test_a_measurement_is_kalmans_and_bias_and_latency_learn_by_a_share(number, learns):
    random = np.random.default_rng(number + 10)
    covariance, row, before = drawn(number), random.normal(size=10), random.normal(size=10)
    s, w = state(covariance), Workspace()
    w.dtheta[:], w.daccel[:] = before[THETA].tolist(), before[ACCEL].tolist()
    w.dfix_lag = float(before[LAG])
    w.row_offset[:], w.doffset[:] = row[OFFSET].tolist(), before[OFFSET].tolist()
    aiding.measure_all(
        s, w, row[THETA].tolist(), row[ACCEL].tolist(), float(row[LAG]), 0.3, 2.0, learns
    )
    h = covariance @ row
    assert w.predicted == pytest.approx(row @ h)
    gain = h / (row @ h + 2.0)
    shares = np.array([1.0] * 4 + [learns] * 3 + [1.0] * 3)
    found = np.array([*w.dtheta, *w.daccel, w.dfix_lag, *w.doffset])
    assert found == pytest.approx(before + shares * gain * (0.3 - row @ before))
    fall = np.outer(gain, h)
    fall[4:7, 4:7] *= learns * (2.0 - learns)
    # The latency stays independent of all others.
    fall[LAG, :LAG] = fall[:LAG, LAG] = fall[LAG, OFFSET] = fall[OFFSET, LAG] = 0.0
    assert covariance_of(s) == pytest.approx(covariance - fall)


# --- deviations ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("known", "deviation_rad"),
    [
        # a field of which nothing is known but a percent, at a dip of 60 deg
        ({}, 0.01 / 0.5),
        ({"mag_ref_dip": 0.0}, 0.01),
        ({"heading_variance": 0.04}, np.hypot(0.1, 0.02)),
        ({"heading_variance": -1.0}, 0.02),
        ({"heading_off": 0.3}, np.hypot(0.3, 0.02)),
        ({"mag_offset_norm": 0.2}, np.sqrt(0.01**2 + 0.5 * 0.2**2) / 0.5),
        ({"mag_offset_dip": -0.2}, np.sqrt(0.01**2 + 0.5 * 0.2**2) / 0.5),
        # five percent of iron, until velocities have shown the heading better
        ({"mag_ref_given": 1.0}, np.hypot(0.01, 0.05) / 0.5),
        ({"mag_ref_given": 1.0, "heading_confirmed": 0.05}, np.hypot(0.02, 0.05)),
        ({"mag_ref_given": 1.0, "heading_confirmed": 0.2}, np.hypot(0.01, 0.05) / 0.5),
    ],
)
def test_the_deviation_of_a_heading(known, deviation_rad):
    s = State(**{"mag_ref_dip": 60.0 * DEG} | known)
    assert heading_deviation(s) == pytest.approx(deviation_rad)


@pytest.mark.parametrize(
    ("known", "deviation_rad"),
    [
        # of the gain set: twice both gains times the noise
        ({"k_tilt": 0.1, "k_velocity": 0.2, "velocity_noise": 1e-3}, 0.85 * np.sqrt(4e-5)),
        ({"extra_tilt_sigma": 0.2}, 0.85 * 0.2),
        ({"p_xx": 1e-4, "dtilt_n": [3.0, 0.0, 0.0, 0.0], "dtilt_e": [4.0, 0, 0, 0]}, 0.85 * 0.05),
        ({"p_yy": 1e-4, "dtilt_n": [0, 3.0, 0, 0], "dtilt_e": [0, 4.0, 0, 0]}, 0.85 * 0.05),
        ({"p_zz": 1e-4, "dtilt_n": [0, 0, 3.0, 0], "dtilt_e": [0, 0, 4.0, 0]}, 0.85 * 0.05),
        # gains at a fix are those per second times its period
        (
            {"aided": 1.0, "fix_period_s": 0.2, "k_tilt": 0.02, "k_velocity": 0.04,
             "velocity_noise": 1e-3},
            0.85 * np.sqrt(4e-5),
        ),
        # what innovations do not show of what was predicted, up to 84 %
        ({"aided": 1.0, "fix_period_s": 1.0, "unused_variance": 0.75, "p_xx": 0.04,
          "dtilt_n": [0.2, 0, 0, 0]}, 0.85 * 0.02),
        ({"aided": 1.0, "fix_period_s": 1.0, "unused_variance": 0.99, "p_xx": 0.04,
          "dtilt_n": [0.2, 0, 0, 0]}, 0.85 * 0.04 * 0.4),
        ({"unused_variance": 0.75, "p_xx": 0.04, "dtilt_n": [0.2, 0, 0, 0]}, 0.85 * 0.04),
        ({"p_xx": -1.0, "dtilt_n": [0.2, 0, 0, 0]}, 0.0),
        # the accelerometer's bias, of half its first variance by turns, that innovations confirm
        ({"aided": 1.0, "fix_period_s": 1.0, "p_accel": [5e-5, 0.0, 5e-5],
          "dtilt_accel_n": [1.0, 0.0]}, 0.85 * np.sqrt(5e-5)),
        ({"aided": 1.0, "fix_period_s": 1.0, "p_accel": [5e-5, 0.0, 5e-5], "unused_variance": 0.5,
          "dtilt_accel_e": [0.0, -1.0]}, 0.85 * np.sqrt(5e-5 / 1.5)),
        ({"aided": 1.0, "fix_period_s": 1.0, "p_accel": [3e-4, 0.0, 3e-4], "unused_variance": 0.5,
          "dtilt_accel_n": [1.0, 0.0]}, 0.85 * np.sqrt(3e-4)),
        ({"p_accel": [5e-5, 0.0, 5e-5], "dtilt_accel_n": [1.0, 0.0]}, 0.0),
    ],
)  # fmt: skip
def test_the_deviation_of_a_tilt(known, deviation_rad):
    assert tilt_deviation(State(**known), Gains(accel_variance=1e-4)) == pytest.approx(
        deviation_rad
    )


def test_a_variance_by_both_axes_of_the_accelerometer():
    s = State(p_accel=[2.0, 0.5, 3.0])
    matrix, row = np.array(((2.0, 0.5), (0.5, 3.0))), np.array((0.7, -1.1))
    assert of_accel(s, *row) == pytest.approx(row @ matrix @ row)


LOST = {"mag_accepted_age_s": -1.0}


@pytest.mark.parametrize(
    ("known", "bits", "is_lost"),
    [
        ({}, YAW_REFERENCED, False),
        (LOST, 0, True),
        (LOST | {"heading_confirmed": 0.1}, YAW_REFERENCED, False),
        (LOST | {"heading_witnessed": 1.0}, YAW_REFERENCED, False),
        # of a deviation below 15 deg, which something has shown
        ({"heading_variance": (14.9 * DEG) ** 2}, YAW_REFERENCED, False),
        ({"heading_variance": (15.1 * DEG) ** 2}, 0, False),
        ({"heading_unknown": 1.0}, 0, False),
        (LOST | {"heading_unknown": 1.0, "heading_confirmed": 0.1}, 0, True),
        ({"heading_variance": 20.0}, 0, True),
        ({"age_s": 10.0}, YAW_REFERENCED, False),
        ({"age_s": 10.01}, YAW_REFERENCED | CONVERGED, False),
        ({"aided": 1.0}, YAW_REFERENCED | VELOCITY_USED, False),
    ],
)
def test_what_an_estimate_is_based_on(known, bits, is_lost):
    s = State(**{"mag_ref_dip": 60.0 * DEG, "fix_period_s": 1.0} | known)
    s.gyro_bias[:] = [0.1, 0.2, -0.3]
    w = Workspace()
    assert estimate(s, w, Gains(), Sample(gyro=[1.0, 1.0, 1.0]), 2) == bits | 2
    assert w.rate[:] == pytest.approx([0.9, 0.8, 1.3])
    assert (w.sigma_heading == LOST_HEADING_RAD) is is_lost
    # of an angle that may be any
    assert pytest.approx(np.pi / np.sqrt(3.0)) == LOST_HEADING_RAD


# --- corrections ---------------------------------------------------------------------------------


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize(
    ("bias_g", "correction_g", "excess_g"),
    [(0.05, 0.009, 0.0), (0.05, 0.03, 0.02), (-0.05, -0.03, -0.02), (0.05, -0.03, 0.0)],
)
def test_estimates_become_those_of_a_bias_at_the_limit(axis, bias_g, correction_g, excess_g):
    """As if the bias had been measured to be there, without learning anything of it."""
    covariance = drawn(3)
    s, w = state(covariance), Workspace()
    s.accel_bias[axis], w.daccel[axis] = bias_g, correction_g
    before = np.array([0.1, 0.2, 0.3, 0.4])
    w.dtheta[:], w.doffset[:] = before.tolist(), [0.5, 0.6, 0.7]
    other = 1 - axis
    aiding.bound_bias(s, w, Gains(accel_variance=99.0), axis, (s.p_accel_x, s.p_accel_y)[axis])
    row = covariance[4 + axis] / covariance[4 + axis, 4 + axis]
    assert w.daccel[axis] == pytest.approx(correction_g - excess_g)
    assert w.daccel[other] == pytest.approx(-excess_g * row[4 + other])
    assert w.dtheta[:] == pytest.approx(before - excess_g * row[THETA])
    assert w.doffset[:] == pytest.approx(np.array([0.5, 0.6, 0.7]) - excess_g * row[OFFSET])
    assert (s.p_accel[2 * axis] == 99.0) is (excess_g != 0.0)


def test_a_bias_that_is_not_estimated_bounds_nothing():
    s, w = State(), Workspace()
    s.accel_bias[0], w.daccel[0], w.dtheta[0] = 0.05, 0.03, 0.1
    aiding.bound_bias(s, w, Gains(accel_variance=9.0), 0, s.p_accel_x)
    assert (w.daccel[0], w.dtheta[0], s.p_accel[0]) == (0.03, 0.1, 0.0)


@pytest.mark.parametrize(
    ("lag_s", "moved_s", "removed_s", "after_s"),
    [(0.1, 0.05, 0.0, 0.15), (0.1, -0.2, 0.0, 0.0), (0.1, -0.2, 0.08, -0.08), (0.1, 0.4, 0.0, 0.3)],
)
def test_bias_and_latency_move_velocity_and_tilt(lag_s, moved_s, removed_s, after_s):
    s = State(fix_lag_s=lag_s, fix_removed_s=removed_s, velocity_n=1.0, velocity_e=-2.0)
    w = Workspace(daccel=[0.01, -0.02], dfix_lag=moved_s)
    s.accel_bias[:] = [0.02, 0.03]
    s.dvelocity_accel_n[:], s.dvelocity_accel_e[:], s.dvelocity_lag[:] = (
        [0.5, 0.6],
        [0.7, 0.8],
        [3, 4],
    )
    s.dtilt_accel_n[:], s.dtilt_accel_e[:], s.dtilt_lag[:] = [0.1, 0.2], [0.3, 0.4], [5.0, 6.0]
    aiding.correct_accel(s, w, Gains(fix_lag_limit=0.3))
    change = after_s - lag_s
    assert s.fix_lag_s == pytest.approx(after_s)
    assert s.accel_bias[:] == pytest.approx([0.03, 0.01])
    assert s.velocity_n == pytest.approx(1.0 + 0.5 * 0.01 - 0.6 * 0.02 + 3.0 * change)
    assert s.velocity_e == pytest.approx(-2.0 + 0.7 * 0.01 - 0.8 * 0.02 + 4.0 * change)
    assert aiding.accel_tilt_n(s, w) == pytest.approx(0.1 * 0.01 - 0.2 * 0.02 + 5.0 * change)
    assert aiding.accel_tilt_e(s, w) == pytest.approx(0.3 * 0.01 - 0.4 * 0.02 + 6.0 * change)


@pytest.mark.parametrize(("predicted", "unseen"), [(0.2, 0.5), (0.1, 0.0), (0.05, 0.0)])
def test_what_innovations_do_not_show_of_what_was_predicted(predicted, unseen):
    """Of a low-passed innovation of hypot(0.3, 0.1), over 30 s."""
    s, g = State(fix_mean_n=0.3, fix_mean_e=-0.1, unused_variance=0.2), Gains()
    g.innovation_mean_time_s = 5.0
    aiding.match_variance(s, g, 0.3, -0.1, predicted, 2.0)
    assert (s.fix_mean_n, s.fix_mean_e) == pytest.approx((0.3, -0.1))
    assert s.unused_variance == pytest.approx(0.2 + 2.0 / 32.0 * (unseen - 0.2))
    aiding.match_variance(s, g, 1.0, -0.1, 0.2, 2.0)
    assert s.fix_mean_n == pytest.approx(0.3 + 2.0 / 7.0 * 0.7)
