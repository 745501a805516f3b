"""Velocity, its levels and gains in integers: just enough, and just too little."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.gains import integer_gains, unpacked
from h2nav.attitude.velocity_aided.integer.kernel.functions import logarithm
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.kernel.velocity import (
    accelerate,
    change_aiding,
    choose_bounded,
    correct_velocity,
    density,
    judge_bounded,
    level_share,
    raised,
    select_set,
    set_ease,
    set_frame_gains,
)
from h2nav.attitude.velocity_aided.integer.memory import MAX_REJECTED, SETS, Sample, State

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
MATRIX = ATTITUDE.as_matrix()
Q24 = 2.0**24
FRAME_S = 0.16


def gains(**limits):
    kernel = replace(GAINS.kernel, **limits)
    return integer_gains(GAINS._replace(kernel=kernel), "a test").gains


def known(g=None):
    s, sample = State(), Sample()
    reset(s, g or gains())
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [round(part * 2.0**29) for part in (q_w, x, y, z)]
    r = [0] * 9
    rotation(s.q_nb, r)
    s.age_us, s.frame_time, sample.dt_us, sample.parts = (
        99_000_000,
        round(FRAME_S * 2**17),
        10_000,
        1,
    )
    return s, sample, r


@pytest.mark.parametrize("aided", [0, 1])
def test_the_velocity_follows_the_force_and_rounding_is_carried(aided):
    s, sample, r = known()
    force = np.array((0.3, -0.2, -0.9))
    sample.aided, sample.accel[:] = aided, [round(part * 2.0**20) for part in force]
    for _ in range(500):
        accelerate(s, sample, r)
    gained = (5.0 * MATRIX @ force)[:2]
    assert [s.velocity_n / Q24, s.velocity_e / Q24] == pytest.approx(gained.tolist(), abs=1e-3)
    # a velocity turns with the heading's error; a bounded one is bounded in any direction
    turned = [-gained[1] / 2.0, gained[0] / 2.0] if aided else [0.0, 0.0]
    found = [s.dvelocity_n[3] / Q24, s.dvelocity_e[3] / Q24]
    assert found == pytest.approx(turned, abs=1e-3)
    since = [(part + (1 << 27)) % (1 << 28) - (1 << 27) for part in (s.gained_n, s.gained_e)]
    expected = gained if aided else [0.0, 0.0]
    assert [part / Q24 for part in since] == pytest.approx(list(expected), abs=1e-3)


@pytest.mark.parametrize("axis", range(2))
def test_a_known_bias_of_the_accelerometer_is_taken_off(axis):
    s, sample, r = known()
    bias = 0.02
    s.accel_bias[axis] = round(bias / (2e6 / 2.0**27) * 2.0**28)
    sample.accel[axis] = round(bias * 2.0**20)
    for _ in range(500):
        accelerate(s, sample, r)
    assert [s.velocity_n / Q24, s.velocity_e / Q24] == pytest.approx([0.0, 0.0], abs=1e-3)


@pytest.mark.parametrize("aided", [0, 1])
def test_bounded_and_measured_velocities_are_unrelated(aided):
    g = gains()
    s, sample, r = known(g)
    sample.aided, sample.forward_speed = aided, round(2.0 * 2.0**11)
    s.velocity_n = s.gained_n = s.gained_e = s.fix_period_us = s.tilt_suspect = 1
    s.dvelocity_n[:] = s.dtilt_e[:] = [1, 2, 3, 4]
    s.k_tilt_m = s.innovation_sum_n = s.innovation_sum_e = s.mag_held = s.mag_count = 5
    s.bias_walk[:], s.bias_moved[:], s.p_accel_x[:] = [1, 2, 3], [1, 2, 3], [1, 2, 3, 4]
    change_aiding(s, g, sample, r)
    nose = 2.0 * MATRIX[:2, 0]
    assert [s.velocity_n / Q24, s.velocity_e / Q24] == pytest.approx(nose.tolist(), abs=1e-3)
    assert (s.gained_n, s.gained_e, s.fix_period_us, s.tilt_suspect) == (0,) * 4
    assert (s.k_tilt_m, s.mag_held, s.mag_count, s.frame_time) == (0,) * 4
    assert (s.innovation_sum_n, s.innovation_sum_e) == (0, 0)
    # nothing shows yet how the biases move, or what they share
    assert s.bias_walk[:] == s.bias_moved[:] == [0] * 3
    assert s.p_accel_x[:] == [0] * 4
    assert (s.phase, s.aided, s.fixes_rejected) == (1, aided, MAX_REJECTED)
    assert s.dvelocity_n[:] == [0] * 4
    assert s.dtilt_e[:] == [1, 2, 3, 0]  # a tilt by the biases stays
    assert s.p_accel[0] == s.p_accel[2] == (g.accel_variance if aided else 0)
    assert s.fix_lag_variance == (g.fix_lag_variance if aided else 0)


def test_what_was_learnt_of_bias_and_latency_is_kept_when_aiding_begins_again():
    g = gains()
    s, sample, r = known(g)
    sample.aided, s.p_accel[:], s.fix_lag_variance = 1, [7, 0, 8], 9
    change_aiding(s, g, sample, r)
    assert (s.p_accel[0], s.p_accel[2], s.fix_lag_variance) == (7, 8, 9)


def test_the_constant_gain_corrects_velocity_and_tilt():
    s, sample, r = known()
    sample.forward_speed = round(2.0 * 2.0**11)
    nose = 2.0 * MATRIX[:2, 0]
    north, east = 0.3, -0.4
    s.velocity_n, s.velocity_e = round((nose[0] - north) * Q24), round((nose[1] - east) * Q24)
    # of a frame, of which this is a sixteenth: 1/16 and 1/8
    s.k_tilt_m, s.k_tilt_s = 1 << 14, 3
    s.k_velocity_m, s.k_velocity_s = 1 << 14, 2
    before = s.velocity_n, s.velocity_e
    correct_velocity(s, sample, r)
    assert (s.velocity_n - before[0]) / Q24 == pytest.approx(0.3 / 128.0, rel=0.01)
    assert (s.velocity_e - before[1]) / Q24 == pytest.approx(-0.4 / 128.0, rel=0.01)
    # an innovation north turns about east, backward
    tilt = [part / 2.0**29 for part in s.correction[:]]
    assert tilt == pytest.approx([-0.4 / 256.0, -0.3 / 256.0, 0.0], rel=0.01)
    assert s.innovation_sum_n * 16 / Q24 == pytest.approx(0.3, abs=2e-3)
    assert s.innovation_sum_e * 16 / Q24 == pytest.approx(-0.4, abs=2e-3)


# --- levels -----------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "restarts"), [(2.99, False), (3.01, True)])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
def test_an_impossible_velocity_starts_the_tilt_again(size, restarts, direction):
    g = gains(impossible_velocity=9.0)
    s, sample, r = known(g)
    s.innovation_n, s.innovation_e = (round(size * part * Q24) for part in direction)
    assert judge_bounded(s, g, sample, r) == int(restarts)
    assert (s.age_us == 0) is restarts
    assert (s.frame_time == 0) is restarts


@pytest.mark.parametrize(("age_s", "share"), [(99.0, FRAME_S / 4.0), (2.0, FRAME_S / 2.0)])
def test_levels_are_those_of_the_time_so_far_or_of_their_own(age_s, share):
    g = gains(level_time_s=4.0, innovation_mean_time_s=9.0 * FRAME_S)
    s, sample, r = known(g)
    s.age_us = round(age_s * 1e6)
    s.innovation_n, s.innovation_e = round(0.3 * Q24), round(-0.4 * Q24)
    judge_bounded(s, g, sample, r)
    assert s.innovation_power / Q24 == pytest.approx(share * 0.25, rel=0.01)
    # about its slow mean
    assert s.innovation_variance / Q24 == pytest.approx(share * 0.25, rel=0.01)
    mean = [s.innovation_mean_n / Q24, s.innovation_mean_e / Q24]
    assert mean == pytest.approx([0.03, -0.04], rel=0.01)
    s.innovation_mean_n, s.innovation_mean_e = s.innovation_n, s.innovation_e
    before = s.innovation_variance
    judge_bounded(s, g, sample, r)
    assert s.innovation_variance == pytest.approx((1.0 - share) * before, rel=0.01)


def test_a_level_moves_by_its_share_and_stays_in_its_format():
    assert raised(1000, 3000, 1 << 14) == 2000
    assert raised(3000, 1000, 1 << 14) == 2000
    assert raised(0, (1 << 31) - 1, 32767) <= 1 << 29
    s, *_ = known()
    s.age_us = 50_000
    assert level_share(s, gains(), 160_000) / 2.0**15 == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(("level", "noise"), [(0.0, 0.1), (0.2, 0.5), (0.44, 0.98), (0.46, 1.0)])
def test_the_noise_of_the_velocity_is_that_of_its_innovations_within_bounds(level, noise):
    # the correlation is a time in units of 8 s
    correlation = round(2.0 / 8.0 * 2.0**15)
    found = density(round(0.1 * Q24), correlation, round(1.0 * Q24), round(level * Q24))
    assert found / Q24 == pytest.approx(noise, rel=1e-3)


# --- gains ------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(SETS - 1))
@pytest.mark.parametrize("by_age", [False, True])
def test_the_set_is_that_of_the_noises_and_stronger_at_the_start(number, by_age):
    g = gains()
    margin = 24 if by_age else 8  # of the logarithms
    for more, expected in ((-margin, number), (margin, number + 1)):
        s, *_ = known(g)
        wanted = g.log_set_bounds[number] + more
        if by_age:
            # omega0 falls as the start's factor over the age
            s.age_us = round(2.0 ** ((g.log_start_factor - wanted / 4.0) / 256.0))
            s.log_velocity_noise = 10_000
        else:
            s.age_us = 1 << 30
            select_set(s, g)
            s.log_velocity_noise = s.log_gyro_noise - wanted
        select_set(s, g)
        assert s.gain_set == expected


@pytest.mark.parametrize("name", ["turning", "gyro_jitter"])
def test_turns_and_jitter_are_noise_of_the_gyro(name):
    g = gains()
    s, *_ = known(g)
    select_set(s, g)
    quiet = s.log_gyro_noise
    setattr(s, name, 1 << 27)
    select_set(s, g)
    assert s.log_gyro_noise > quiet + 256


@pytest.mark.parametrize("frame_s", [0.02, 0.16, 0.24])
@pytest.mark.parametrize("number", [0, 5, SETS - 1])
def test_gains_of_a_frame_are_those_of_a_second_times_its_length(frame_s, number):
    g = gains()
    s, *_ = known(g)
    s.frame_time, s.gain_set = round(frame_s * 2**17), number
    set_frame_gains(s, g)
    found = s.k_tilt_m / 2.0 ** (15 + s.k_tilt_s), s.k_velocity_m / 2.0 ** (15 + s.k_velocity_s)
    expected = frame_s * unpacked(g.k_tilt[number]), frame_s * unpacked(g.k_velocity[number])
    assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("power", [0.0, 0.01, 0.5])
def test_the_noise_of_a_bounded_velocity(power):
    """That of its level, over the frame's time, eased at the start and inflated for its colour."""
    g = gains()
    s, *_ = known(g)
    s.innovation_power, s.innovation_variance = round(power * Q24), round(0.5 * power * Q24)
    s.log_startup_inflation = 300
    choose_bounded(s, g)

    def log_of(level):
        noise = density(g.velocity_floor, g.velocity_correlation, g.velocity_ceiling, level)
        return logarithm(noise) - (24 << 8)

    assert s.log_velocity_noise == log_of(s.innovation_power)
    k_velocity = s.k_velocity_m / 2.0 ** (15 + s.k_velocity_s)
    rate = math.log2((1.0 + k_velocity) / FRAME_S) * 256.0
    expected = log_of(s.innovation_variance) + g.log_bias_inflation + rate + 300
    assert s.log_noise == pytest.approx(expected, abs=10)


@pytest.mark.parametrize("age_share", [0.1, 0.5, 1.0, 2.0, 20.0])
def test_the_start_counts_by_the_fourth_power_of_its_age(age_share):
    g = gains()
    s, *_ = known(g)
    s.age_us = round(age_share * g.startup_time_us)
    set_ease(s, g)
    expected = 256.0 * math.log2(1.0 + age_share**-4)
    assert s.log_startup_inflation == pytest.approx(expected, abs=14)
