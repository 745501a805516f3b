"""One step of the velocity-aided filter against scipy, matrices and the variance of noise."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.prediction import (
    forget_sensitivities,
    gyro_density,
    jolt_of,
    predict_accel,
    predict_attitude,
    predict_shared,
    predict_velocity,
    share_of_levels,
    turn,
)
from h2nav.attitude.velocity_aided.memory import MAX_REJECTED, Sample, State, Workspace

RANDOM = np.random.default_rng(9)
ATTITUDE = Rotation.random(random_state=9)
MATRIX = ATTITUDE.as_matrix()


def known():
    """State, workspace and a sample with an attitude."""
    s, w, sample = State(), Workspace(), Sample()
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    w.r_nb[:] = MATRIX.ravel().tolist()
    sample.dt_s = 0.01
    s.age_s = 99.0
    return s, w, sample


def gains(**changes):
    found = new_filter().kernel_gains
    for name, value in changes.items():
        setattr(found, name, value)
    return found


def attitude_of(s):
    return Rotation.from_quat(np.roll(s.q_nb, -1))


@pytest.mark.parametrize(
    ("dt_s", "share"), [(0.01, 1.0), (0.15, 1.0), (0.151, 0.5), (0.3, 0.5), (1e-12, 1.0)]
)
def test_the_attitude_turns_by_the_rate_without_its_bias(dt_s, share):
    """Of a step in which samples are missing, by the mean of both ends."""
    s, w, sample = known()
    rate, before, bias = RANDOM.normal(size=(3, 3))
    sample.dt_s, sample.gyro[:], s.gyro_last[:] = dt_s, rate.tolist(), before.tolist()
    s.gyro_bias[:] = bias.tolist()
    predict_attitude(s, w, sample)
    meant = share * rate + (1.0 - share) * before
    turned = ATTITUDE * Rotation.from_rotvec(dt_s * (meant - bias))
    assert (attitude_of(s).inv() * turned).magnitude() == pytest.approx(0.0, abs=1e-7)
    assert np.reshape(w.r_nb, (3, 3)) == pytest.approx(turned.as_matrix())
    assert np.linalg.norm(s.q_nb) == pytest.approx(1.0)


def test_a_length_that_is_off_is_taken_back_by_newton():
    s, w, sample = known()
    s.q_nb[:] = [1.001 * part for part in s.q_nb]
    predict_attitude(s, w, sample)
    assert np.linalg.norm(s.q_nb) == pytest.approx(1.0, abs=3e-6)


@pytest.mark.parametrize("size", [1e-3, 0.3, 3.0])
def test_a_correction_turns_in_ned_and_large_ones_shrink(size):
    s, *_ = known()
    half = size * np.array((0.6, -0.64, 0.48))
    s.heading_turned = 0.1
    turn(s, *half.tolist())
    turned = attitude_of(s) * ATTITUDE.inv()
    assert turned.as_rotvec() == pytest.approx(half / size * 2.0 * math.atan(size))
    assert s.heading_turned == pytest.approx(0.1 + 2.0 * math.atan(half[2]))
    assert np.linalg.norm(s.q_nb) == pytest.approx(1.0)


# --- velocity -------------------------------------------------------------------------------------

FORCE = np.array((1.0, -2.0, -9.0))
G = 9.8


def stepped(aided=1.0, before=1.0, rest_s=0.0, dt_s=0.01, **state):
    s, w, sample = known()
    s.aided, sample.aided, s.rest_s, sample.dt_s = before, aided, rest_s, dt_s
    s.accel_bias[:] = [0.02, -0.03]
    s.velocity_n, s.velocity_e, s.gained_n, s.gained_e = 1.0, 2.0, 3.0, 4.0
    s.dvelocity_n[3], s.dvelocity_e[3] = 5.0, 6.0
    for name, value in state.items():
        setattr(s, name, value)
    sample.accel[:], sample.forward_speed = FORCE.tolist(), 12.0
    predict_velocity(s, w, gains(gravity=G, rest_time_s=2.0, startup_time_s=3.0), sample)
    felt = FORCE / G - (0.02, -0.03, 0.0)
    return s, (dt_s * MATRIX @ felt)[:2]


def test_a_measured_velocity_takes_the_force_and_shows_the_heading():
    s, (north, east) = stepped()
    assert (s.velocity_n, s.velocity_e) == pytest.approx((1.0 + north, 2.0 + east))
    assert (s.gained_n, s.gained_e) == pytest.approx((3.0 + north, 4.0 + east))
    # a heading error turns what is gained
    assert (s.dvelocity_n[3], s.dvelocity_e[3]) == pytest.approx((5.0 - east, 6.0 + north))
    assert s.age_s == pytest.approx(99.01)


@pytest.mark.parametrize(("rest_s", "shows"), [(1.99, True), (2.0, False)])
def test_at_rest_nothing_shows_the_heading(rest_s, shows):
    s, _ = stepped(rest_s=rest_s)
    assert (s.dvelocity_n[3] != 5.0) == shows
    assert (s.dvelocity_e[3] != 6.0) == shows


def test_a_bounded_velocity_shows_no_heading():
    s, (north, east) = stepped(aided=0.0, before=0.0)
    assert (s.velocity_n, s.velocity_e) == pytest.approx((1.0 + north, 2.0 + east))
    assert (s.gained_n, s.gained_e, s.dvelocity_n[3], s.dvelocity_e[3]) == (3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize("aided", [0.0, 1.0])
def test_another_kind_of_velocity_begins_anew_along_the_nose(aided):
    s, (north, east) = stepped(aided, 1.0 - aided, tilt_suspect=1.0, unused_variance=7.0)
    ahead = 12.0 / G * MATRIX[:2, 0]
    assert (s.velocity_n, s.velocity_e) == pytest.approx((ahead[0] + north, ahead[1] + east))
    assert (s.gained_n, s.gained_e) == pytest.approx((aided * north, aided * east))
    assert (s.dvelocity_n[3], s.dvelocity_e[3]) == pytest.approx((-aided * east, aided * north))
    assert (s.fixes_rejected, s.tilt_suspect, s.aided) == (MAX_REJECTED, 0.0, aided)
    assert s.unused_variance == 0.0
    g = gains()
    assert s.p_accel[0] == s.p_accel[2] == pytest.approx(aided * g.accel_variance)
    assert s.fix_lag_variance == pytest.approx(aided * g.fix_lag_variance)


@pytest.mark.parametrize(("age_s", "inflation"), [(2.99, 2.0), (5.99, 1.0625), (29.99, 1.0001)])
def test_the_start_inflates_by_the_fourth_power_of_its_share(age_s, inflation):
    s, _ = stepped(age_s=age_s)
    assert s.startup_inflation == pytest.approx(inflation)


# --- noise ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("age_s", "dt_s", "share"),
    [(99.0, 0.01, 0.01 / 4.0), (2.0, 0.01, 0.005), (0.0, 0.01, 1.0), (0.005, 0.01, 1.0)],
)
def test_levels_are_means_of_some_seconds_or_of_all_there_were(age_s, dt_s, share):
    s, *_ = known()
    s.age_s = age_s
    assert share_of_levels(s, gains(level_time_s=4.0), dt_s) == pytest.approx(share)


def test_second_differences_show_the_variance_of_white_noise():
    noise = RANDOM.normal(0.0, 0.3, (20_000, 3)) + 5.0
    last, step = [0.0] * 3, [0.0] * 3
    found = [jolt_of(last, step, row.tolist()) for row in noise]
    assert np.mean(found[2:]) == pytest.approx(0.09, rel=0.02)
    assert last == noise[-1].tolist()
    assert step == pytest.approx((noise[-1] - noise[-2]).tolist())
    ramp = [jolt_of(last, step, [float(i)] * 3) for i in range(5)]
    assert ramp[2:] == [0.0] * 3


def test_levels_follow_noise_and_turns():
    s, w, sample = known()
    rates, forces = RANDOM.normal(0.0, 0.2, (2, 4000, 3))
    s.gyro_bias[:] = [0.5, 0.0, -0.5]
    g = gains(level_time_s=8.0)
    for rate, force in zip(rates, forces, strict=True):
        sample.gyro[:] = (rate + np.array((0.5, 0.0, 0.5))).tolist()
        sample.accel[:] = (10.0 * force).tolist()
        predict_velocity(s, w, g, sample)
    # a density is a variance times the time between samples
    assert s.gyro_jitter == pytest.approx(0.01 * 0.04, rel=0.15)
    assert s.accel_jitter == pytest.approx(0.01 * 4.0, rel=0.15)
    assert s.turning == pytest.approx(3 * 0.04 + 1.0, rel=0.15)


def test_the_density_of_a_gyro_is_its_noise_its_scale_and_what_shakes_it():
    s, *_ = known()
    s.turning, s.gyro_jitter = 2.0, 3.0
    g = gains(gyro_noise=0.5, scale_noise=0.25, jitter_share=0.125)
    assert gyro_density(s, g) == pytest.approx(0.5 + 0.25 * 2.0 + 0.125 * 3.0)


# --- what only measured velocities show -----------------------------------------------------------


def test_covariances_with_the_heading_grow_with_those_of_the_gyro():
    s, w, _ = known()
    rows = RANDOM.normal(size=(2, 4))
    s.p_accel_x[:], s.p_accel_y[:] = rows.tolist()
    predict_shared(s, w, gains(), 0.1)
    step = np.eye(4)
    step[3, :3] = -0.1 * MATRIX[2]
    assert np.array((s.p_accel_x, s.p_accel_y)) == pytest.approx(rows @ step.T)


@pytest.mark.parametrize("field", ["accel x", "accel y", "lag"])
def test_what_is_not_constant_is_forgotten_up_to_what_is_usual(field):
    g = gains(accel_walk=2.0, accel_variance=1.0, fix_lag_walk=3.0, fix_lag_variance=1.0)
    for before in (0.99, 1.0):
        s, w, _ = known()
        s.p_accel[0] = s.p_accel[2] = s.fix_lag_variance = 5.0
        if field == "lag":
            s.fix_lag_variance = before
        else:
            s.p_accel[0 if field == "accel x" else 2] = before
        predict_shared(s, w, g, 0.1)
        found = (s.p_accel[0], s.p_accel[2], s.fix_lag_variance)
        grown = {"accel x": (0.2, 0, 0), "accel y": (0, 0.2, 0), "lag": (0, 0, 0.3)}[field]
        expected = [
            (before if grown[i] else 5.0) + (grown[i] if before < 1.0 else 0.0) for i in range(3)
        ]
        assert found == pytest.approx(tuple(expected))


def test_a_bias_of_the_accelerometer_moves_the_velocity_as_it_tilts():
    s, w, _ = known()
    names = ("dvelocity_accel_n", "dvelocity_accel_e", "dvelocity_lag", "dtilt_accel_n",
             "dtilt_accel_e", "dtilt_lag")  # fmt: skip
    rows = RANDOM.normal(size=(6, 2))
    for name, row in zip(names, rows, strict=True):
        getattr(s, name)[:] = row.tolist()
    predict_accel(s, w, 0.1)
    north, east, late, tilt_n, tilt_e, tilt_late = rows
    assert s.dvelocity_accel_n[:] == pytest.approx(north + 0.1 * (tilt_n - MATRIX[0, :2]))
    assert s.dvelocity_accel_e[:] == pytest.approx(east + 0.1 * (tilt_e - MATRIX[1, :2]))
    assert s.dvelocity_lag[:] == pytest.approx(late + 0.1 * tilt_late)


def test_a_tilt_from_a_resting_accelerometer_has_its_bias_in_it():
    s, w, _ = known()
    for name in ("dvelocity_n", "dvelocity_e", "dtilt_n", "dtilt_e"):
        getattr(s, name)[:] = [1.0] * 4
    for name in ("dvelocity_accel_n", "dvelocity_accel_e", "dvelocity_lag", "dtilt_lag"):
        getattr(s, name)[:] = [1.0] * 2
    s.unused_variance = 1.0
    forget_sensitivities(s, w)
    for name in ("dvelocity_n", "dvelocity_e", "dtilt_n", "dtilt_e"):
        assert getattr(s, name)[:] == [0.0] * 4
    for name in ("dvelocity_accel_n", "dvelocity_accel_e", "dvelocity_lag", "dtilt_lag"):
        assert getattr(s, name)[:] == [0.0] * 2
    assert s.unused_variance == 0.0
    assert s.dtilt_accel_n[:] == pytest.approx(MATRIX[0, :2])
    assert s.dtilt_accel_e[:] == pytest.approx(MATRIX[1, :2])
