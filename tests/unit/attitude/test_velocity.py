"""Corrections by a velocity, bounded or measured: just enough, and just too little."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.velocity import (
    correct_by_fix,
    select_set,
    use_bounded_velocity,
    use_constant_gain,
    use_fix,
)
from h2nav.attitude.velocity_aided.memory import (
    FORCE_USED,
    MAX_REJECTED,
    PERIODS,
    RESTARTED,
    SETS,
    VELOCITY_USED,
    Sample,
    State,
    Workspace,
)

ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
NOSE = ATTITUDE.as_matrix()[:2, 0]
DT_S = 0.01


def gains(**changes):
    found = new_filter().kernel_gains
    for name, value in changes.items():
        setattr(found, name, value)
    return found


G = gains().gravity


def known():
    """State, workspace and sample of a filter in flight that has settled."""
    s, w, sample = State(), Workspace(), Sample()
    x, y, z, q_w = ATTITUDE.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    w.r_nb[:] = ATTITUDE.as_matrix().ravel().tolist()
    s.age_s, s.startup_inflation, s.mag_accepted_age_s = 1e3, 1.0, 0.1
    s.p_xx = s.p_yy = s.p_zz = 1e-12
    s.heading_variance = 1e-6
    s.velocity_noise, s.fix_period_s, s.k_velocity = 1.0, 0.2, 0.1
    sample.dt_s, sample.fix_period_s = DT_S, 0.2
    return s, w, sample


# --- a velocity that is bounded ---------------------------------------------------------------


@pytest.mark.parametrize(("size", "restarts"), [(2.999, False), (3.001, True)])
@pytest.mark.parametrize("direction", [(1.0, 0.0), (0.0, -1.0), (0.6, 0.8)])
def test_an_impossible_velocity_starts_the_tilt_again(size, restarts, direction):
    s, w, sample = known()
    s.velocity_n, s.velocity_e = (size * part for part in direction)
    bits = use_bounded_velocity(s, w, gains(impossible_velocity=9.0), sample)
    assert bits == (RESTARTED if restarts else FORCE_USED)
    assert (s.age_s == 0.0) is restarts
    if restarts:
        assert (s.velocity_n, s.velocity_e) == (0.0, 0.0)


def test_a_vehicle_that_flies_along_its_nose_is_held_there():
    s, w, sample = known()
    sample.forward_speed = 2.0 * G
    s.velocity_n, s.velocity_e = (2.0 * NOSE).tolist()
    use_bounded_velocity(s, w, gains(), sample)
    assert (s.velocity_n, s.velocity_e) == pytest.approx((2.0 * NOSE).tolist())
    assert s.innovation[:2] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert s.innovation_power == pytest.approx(0.0, abs=1e-12)


def test_an_innovation_turns_the_tilt_about_the_axis_across_it():
    s, w, sample = known()
    s.velocity_n = -0.1
    g = gains()
    use_bounded_velocity(s, w, g, sample)
    number = round(s.gain_set)
    assert s.k_tilt == g.k_tilt[number]
    assert s.innovation[:2] == pytest.approx([0.0, -0.1 * DT_S * g.k_tilt[number]])
    assert s.velocity_n == pytest.approx(-0.1 * (1.0 - DT_S * g.k_velocity[number]))
    turned = (Rotation.from_quat(np.roll(s.q_nb[:], -1)) * ATTITUDE.inv()).as_rotvec()
    assert turned == pytest.approx((*s.innovation[:2], 0.0), abs=1e-7)


@pytest.mark.parametrize(("age_s", "share"), [(99.0, DT_S / 4.0), (2.0, DT_S / 2.0)])
def test_levels_are_those_of_the_time_so_far_or_of_their_own(age_s, share):
    s, w, sample = known()
    s.age_s, s.velocity_n, s.velocity_e = age_s, -0.03, 0.04
    g = gains(level_time_s=4.0, innovation_mean_time_s=0.99)
    use_bounded_velocity(s, w, g, sample)
    assert s.innovation_power == pytest.approx(share * 0.05**2)
    assert (s.innovation_mean_n, s.innovation_mean_e) == pytest.approx((0.0003, -0.0004))
    assert s.innovation_variance == pytest.approx(share * 0.05**2)


@pytest.mark.parametrize(("power", "density"), [(0.2, 1.0 + 2.0 * 0.2), (0.6, 2.0)])
def test_the_noise_of_the_velocity_is_that_of_its_innovations_within_bounds(power, density):
    s, w, sample = known()
    s.innovation_power = power
    g = gains(level_time_s=1e9, velocity_floor=1.0, velocity_correlation=2.0, velocity_ceiling=2.0)
    use_bounded_velocity(s, w, g, sample)
    assert s.velocity_noise == pytest.approx(density, rel=1e-3)


def measured(variance_of_heading, age_s, **changes):
    """A bounded velocity that depends on the heading; what is left of the heading's variance."""
    s, w, sample = known()
    s.heading_variance, s.dvelocity_n[3] = variance_of_heading, 1.0
    s.mag_accepted_age_s, s.velocity_n = age_s, -0.01
    for name, value in changes.items():
        setattr(s, name, value)
    g = gains(field_silence_s=30.0, velocity_floor=1e-4, velocity_ceiling=1e-4)
    use_bounded_velocity(s, w, g, sample)
    return s.heading_variance, s.heading_turned


@pytest.mark.parametrize(
    ("age_s", "learns"), [(29.9, True), (30.1, False), (-1.0, False), (0.0, True)]
)
def test_without_a_field_a_bounded_velocity_teaches_no_heading(age_s, learns):
    variance, turned = measured(1.0, age_s)
    assert (variance < 0.99) is learns
    assert (abs(turned) > 1e-6) is learns


def test_without_a_field_for_as_long_as_a_gain_file_may_wait_for_one_it_is_used():
    s, w, sample = known()
    s.heading_variance, s.dvelocity_n[3], s.mag_accepted_age_s = 1.0, 1.0, -1.0
    use_bounded_velocity(s, w, gains(field_silence_s=1e9), sample)
    assert s.heading_variance < 1.0


@pytest.mark.parametrize(("dt_s", "keep_s"), [(0.01, 0.01), (0.4, 0.4), (0.6, 0.5)])
def test_a_long_step_corrects_no_more_than_half(dt_s, keep_s):
    s, w, sample = known()
    sample.dt_s, s.velocity_n = dt_s, -0.1
    g = gains()
    g.k_velocity[:], g.k_tilt[:] = [1.0] * SETS, [0.5] * SETS
    use_bounded_velocity(s, w, g, sample)
    assert s.velocity_n == pytest.approx(-0.1 * (1.0 - keep_s))
    assert s.innovation[1] == pytest.approx(-0.1 * 0.5 * keep_s)


# --- a velocity that is measured --------------------------------------------------------------


def fixed(s, sample, north, east=0.0, period_s=0.2, sigma_m_s=0.0):
    """A fix that differs by so much, in seconds."""
    sample.fix_velocity_n, sample.fix_velocity_e = (
        G * (s.velocity_n + north),
        G * (s.velocity_e + east),
    )
    sample.fix_period_s, sample.fix_variance = period_s, sigma_m_s**2


def test_a_fix_is_compared_at_its_own_time():
    """Since then the accelerometer has gained velocity, and the fix was late by its latency."""
    s, w, sample = known()
    s.velocity_n, s.velocity_e, s.gained_n, s.gained_e = 0.5, -0.5, 3.0, 4.0
    sample.fix_velocity_n, sample.fix_velocity_e = 0.2 * G, -0.4 * G
    sample.fix_gained_n, sample.fix_gained_e = 2.7, 4.1
    s.fix_lag_s, sample.fix_accel_n, sample.fix_accel_e = 0.1, 0.2, -0.3
    s.fixes_rejected = float(MAX_REJECTED)
    use_fix(s, w, gains(), sample)
    # velocity/g + gained since then + latency times acceleration
    expected = 0.2 + 0.3 + 0.02, -0.4 - 0.1 - 0.03
    assert (s.velocity_n, s.velocity_e) == pytest.approx(expected)


@pytest.mark.parametrize("rejected", [MAX_REJECTED - 1, MAX_REJECTED])
def test_after_five_rejections_in_a_row_the_velocity_starts_again(rejected):
    s, w, sample = known()
    s.fixes_rejected, s.dvelocity_n[:] = float(rejected), [1.0] * 4
    fixed(s, sample, 5.0)
    bits = use_fix(s, w, gains(), sample)
    restarts = rejected == MAX_REJECTED
    assert bits == (VELOCITY_USED if restarts else 0)
    assert s.velocity_n == pytest.approx(5.0 if restarts else 0.0)
    assert (s.dvelocity_n[:] == [0.0] * 4) is restarts
    assert s.fixes_rejected == (0.0 if restarts else MAX_REJECTED)


@pytest.mark.parametrize(
    ("doubt_rad", "inflation", "suspect"),
    [(0.51, 1.0, 1.0), (0.49, 1.0, 0.0), (0.51, 9.9, 1.0), (0.51, 10.1, 0.0)],
)
def test_a_velocity_that_starts_again_suspects_a_tilt_that_is_doubted(
    doubt_rad, inflation, suspect
):
    """At the start the low-passed force is older than the tilt and decides nothing."""
    s, w, sample = known()
    s.fixes_rejected, s.extra_tilt_sigma = float(MAX_REJECTED), doubt_rad
    s.startup_inflation = inflation
    fixed(s, sample, 1.0)
    use_fix(s, w, gains(), sample)
    assert s.tilt_suspect == suspect


@pytest.mark.parametrize(
    ("period_s", "sigma_m_s", "power", "inflation", "most"),
    [
        (0.2, 0.0, 0.0, 1.0, math.sqrt(0.04 / 0.2)),
        (0.1, 0.0, 0.0, 1.0, math.sqrt(0.04 / 0.1)),
        (0.2, 0.5 * G, 0.0, 1.0, math.sqrt(0.2 + 0.25)),
        (0.2, 0.0, 0.3, 1.0, math.sqrt(0.2 + 0.3)),
        (0.2, 0.0, 0.0, 4.0, math.sqrt(4.0 * 0.2)),
    ],
)
def test_a_fix_within_five_deviations_is_used(period_s, sigma_m_s, power, inflation, most):
    for share, is_used in ((0.99, True), (1.01, False)):
        s, w, sample = known()
        s.innovation_power, s.startup_inflation, s.fixes_rejected = power, inflation, 2.0
        size = 5.0 * share * most
        fixed(s, sample, 0.6 * size, -0.8 * size, period_s, sigma_m_s)
        bits = use_fix(s, w, gains(fix_gate=25.0, fix_floor=0.04), sample)
        assert bits == (FORCE_USED | VELOCITY_USED if is_used else 0)
        assert s.fixes_rejected == (0.0 if is_used else 3.0)
        assert s.fix_period_s == period_s


@pytest.mark.parametrize(
    ("rejected", "size", "is_doubted"),
    [
        # a tilt error that grows the innovation within five fixes: up to 2 g in the fifth
        (0, 0.399, True), (0, 0.401, False), (3, 1.599, True), (3, 1.601, False),
    ],
)  # fmt: skip
def test_a_rejected_fix_doubts_the_tilt_as_far_as_a_tilt_explains_it(rejected, size, is_doubted):
    s, w, sample = known()
    s.fixes_rejected, s.unused_variance = float(rejected), 1.0
    period_s = 0.2
    fixed(s, sample, size * period_s * MAX_REJECTED, period_s=period_s)
    use_fix(s, w, gains(fix_gate=1e-9), sample)
    assert s.unused_variance == 0.0
    expected = min(size, 1.57) if is_doubted else 0.0
    assert s.extra_tilt_sigma == pytest.approx(expected)


@pytest.mark.parametrize(
    ("period_s", "age_s", "share"), [(0.2, 99.0, 0.05), (0.2, 1.0, 0.2), (5.0, 99.0, 1.0)]
)
def test_the_level_of_innovations_follows_over_its_time(period_s, age_s, share):
    s, w, sample = known()
    s.age_s, s.innovation_power = age_s, 0.5
    fixed(s, sample, 0.03, 0.04, period_s)
    use_fix(s, w, gains(level_time_s=4.0), sample)
    assert s.innovation_power == pytest.approx(0.5 + share * (0.0025 - 0.5))


@pytest.mark.parametrize(
    ("sigma_m_s", "power", "unknown", "density"),
    [
        (0.0, 0.0, 0.0, 0.04),
        (0.5 * G, 0.0, 0.0, 0.04 + 0.2 * 0.25),
        (0.0, 0.1, 0.0, 0.04 + 2.0 * 0.1),
        (0.0, 9.0, 0.0, 1.5),
        (0.0, 0.0, 1.0, 1.5),  # with an unknown heading a velocity tilts the wrong way
    ],
)
def test_the_noise_of_a_fix(sigma_m_s, power, unknown, density):
    s, w, sample = known()
    s.innovation_power, s.heading_unknown = power, unknown
    fixed(s, sample, 0.0, 0.0, 0.2, sigma_m_s)
    g = gains(level_time_s=1e9, fix_floor=0.04, fix_correlation=2.0, fix_ceiling=1.5)
    use_fix(s, w, g, sample)
    assert s.velocity_noise == pytest.approx(density, rel=1e-3)


@pytest.mark.parametrize("number", range(PERIODS))
def test_gains_are_those_for_the_time_between_fixes(number):
    g = gains()
    period_s = g.fix_periods[number]
    for period, row in ((period_s, number), (period_s * 1.001, min(number + 1, PERIODS - 1))):
        s, w, sample = known()
        fixed(s, sample, 0.0, 0.0, period)
        use_fix(s, w, g, sample)
        place = SETS * row + round(s.gain_set)
        assert s.k_tilt == g.k_fix_tilt[place]
        assert s.k_velocity == g.k_fix_velocity[place]


# --- which gains ------------------------------------------------------------------------------


@pytest.mark.parametrize("number", range(SETS - 1))
@pytest.mark.parametrize("by_age", [False, True])
def test_the_set_is_that_of_the_noises_and_stronger_at_the_start(number, by_age):
    g = gains(gyro_noise=1e-6, scale_noise=0.0, jitter_share=0.0, start_factor=2.0)
    bound = g.set_bounds[number]
    assert list(g.set_bounds[: SETS - 1]) == sorted(g.set_bounds[: SETS - 1])
    for share, expected in ((0.999, number), (1.001, number + 1)):
        s, *_ = known()
        ratio = share * bound
        if by_age:
            s.age_s = 2.0 / ratio**0.25
            assert select_set(s, g, 1e30) == expected
        else:
            s.age_s = 1e9
            assert select_set(s, g, 1e-6 / ratio) == expected
        assert s.gain_set == expected


# --- what a fix corrects ----------------------------------------------------------------------


def after_fix(covariance, changes):
    """The bias after one fix that it explains, and its variance."""
    s, w, sample = known()
    s.p_accel[:] = list(covariance)
    s.dvelocity_accel_n[0] = s.dvelocity_accel_e[1] = 1.0
    s.k_velocity, s.fix_period_s = 0.1, 0.2
    for name, value in changes.items():
        setattr(s, name, value)
    correct_by_fix(s, w, gains(), sample, 1e-3, -1e-3, 1e-6)
    return s.accel_bias[0], s.accel_bias[1], s.p_accel[0]


@pytest.mark.parametrize(
    ("changes", "learns"),
    [
        ({}, True),
        ({"age_s": 29.9}, False),
        ({"age_s": 30.1}, True),
        ({"extra_tilt_sigma": 0.0152}, True),
        ({"extra_tilt_sigma": 0.0154}, False),
        # a bias that is known as badly is no other's
        ({"extra_tilt_sigma": 0.02, "p_accel": (1.9e-4, 0.0, 2.2e-4)}, True),
        ({"extra_tilt_sigma": 0.02, "p_accel": (1.9e-4, 0.0, 2.0e-4)}, False),
    ],
)
def test_a_fix_teaches_a_bias_once_the_tilt_is_known(changes, learns):
    changes = dict(changes)
    covariance = changes.pop("p_accel", (1e-6, 0.0, 1e-6))
    x, y, variance = after_fix(covariance, changes)
    assert (variance < 0.99 * covariance[0]) is learns
    assert (x > 1e-5, y < -1e-5) == (learns, learns)


def test_vibration_is_not_learnt_as_a_bias():
    """What the force's noise gains over the loop's time counts as noise of the fixes."""
    own = 1e-6 * 0.2 * (G * 0.1 / 0.2) ** 2
    quiet = after_fix((1e-6, 0.0, 1e-6), {"accel_jitter": 0.0})
    shaken = after_fix((1e-6, 0.0, 1e-6), {"accel_jitter": 1.5 * own})
    assert shaken[0] == pytest.approx(0.25 * quiet[0], rel=1e-3)


@pytest.mark.parametrize(("rest", "learns"), [(0.99, True), (1.0, False)])
def test_at_rest_no_fix_teaches_a_heading(rest, learns):
    s, w, sample = known()
    g = gains()
    s.heading_variance, s.dvelocity_n[3], s.rest_s = 1.0, 1.0, rest * g.rest_time_s
    correct_by_fix(s, w, g, sample, 0.1, 0.0, 1e-3)
    assert (s.heading_variance < 1.0) is learns
    assert (s.heading_turned != 0.0) is learns


@pytest.mark.parametrize(
    ("iron_shown", "age_s", "is_plain"), [(1.0, 0.9, True), (1.0, 1.1, False), (0.0, 0.9, False)]
)
def test_while_iron_turns_the_heading_fixes_count_as_they_are(iron_shown, age_s, is_plain):
    left = []
    for inflation in (1.0, 50.0):
        s, w, sample = known()
        s.heading_variance, s.dvelocity_n[3] = 1.0, 1.0
        s.iron_shown, s.mag_age_s = iron_shown, age_s
        fixed(s, sample, 0.0)
        use_fix(s, w, gains(fix_inflation=inflation), sample)
        left.append(s.heading_variance)
    assert (left[0] == pytest.approx(left[1])) is is_plain


def test_the_constant_gain_moves_sensitivities_and_states_alike():
    s, w, _ = known()
    drawn = np.random.default_rng(6)
    rows = drawn.normal(size=(4, 4))
    names = ("dtilt_n", "dvelocity_n", "dtilt_e", "dvelocity_e")
    for name, row in zip(names, rows, strict=True):
        getattr(s, name)[:] = row.tolist()
    s.velocity_n, s.velocity_e, s.extra_tilt_sigma = 0.3, -0.4, 0.2
    use_constant_gain(s, w, 0.01, -0.02, 0.1, 0.25, 1e-3, -2e-3)
    tilt_n, velocity_n, tilt_e, velocity_e = rows
    assert s.dtilt_n[:] == pytest.approx(tilt_n - 0.1 * velocity_n)
    assert s.dtilt_e[:] == pytest.approx(tilt_e - 0.1 * velocity_e)
    assert s.dvelocity_n[:] == pytest.approx(0.75 * velocity_n)
    assert s.dvelocity_e[:] == pytest.approx(0.75 * velocity_e)
    assert (s.velocity_n, s.velocity_e) == pytest.approx((0.3025, -0.405))
    assert s.extra_tilt_sigma == pytest.approx(0.2 * (1.0 - 0.125))
    assert s.innovation[:2] == pytest.approx([-0.002, -0.001])
    turned = (Rotation.from_quat(np.roll(s.q_nb[:], -1)) * ATTITUDE.inv()).as_rotvec()
    assert turned == pytest.approx((-0.002 - 0.002, -0.001 - 0.001, 0.0), abs=1e-7)
