"""Which velocity fixes are used in integers, and what they correct: at both sides."""

import math
from dataclasses import replace

import pytest
from velocity_flights import GAINS

from h2nav.attitude.velocity_aided.integer.gains import integer_gains, unpacked
from h2nav.attitude.velocity_aided.integer.kernel.fixes import (
    apply_fix,
    choose_fix,
    judge_fix,
    note_fix,
    weigh_force,
)
from h2nav.attitude.velocity_aided.integer.kernel.functions import logarithm
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.memory import (
    MAX_REJECTED,
    PERIODS,
    SETS,
    VELOCITY_USED,
    Sample,
    State,
)

Q24, Q28 = 2.0**24, 2.0**28


def gains(**limits):
    kernel = replace(GAINS.kernel, **limits)
    return integer_gains(GAINS._replace(kernel=kernel), "a test").gains


def known(g=None):
    s = State()
    reset(s, g or gains())
    s.age_us, s.log_startup_inflation, s.aided = 99_000_000, 0, 1
    return s


def waiting(s, north, east=0.0, period_s=0.2, variance=0.0):
    """A fix whose innovation waits for its frame, s."""
    s.fix_innovation_n, s.fix_innovation_e = round(north * Q24), round(east * Q24)
    s.fix_period_us, s.fix_variance = round(period_s * 1e6), max(round(variance * Q24), 1)


@pytest.mark.parametrize("wraps", [False, True])
def test_a_fix_is_compared_at_its_own_time(wraps):
    """Since then the accelerometer has gained velocity, and the fix was late by its latency."""
    s, sample = known(), Sample()
    offset = (1 << 28) - round(0.1 * Q24) if wraps else 0
    s.velocity_n, s.velocity_e = round(0.5 * Q24), round(-0.5 * Q24)
    s.gained_n = (round(0.3 * Q24) + offset) % (1 << 28)
    s.gained_e = (round(0.4 * Q24) + offset) % (1 << 28)
    sample.fix_gained_n, sample.fix_gained_e = offset % (1 << 28), round(0.5 * Q24)
    if wraps:
        sample.fix_gained_e = (round(0.5 * Q24) + offset) % (1 << 28)
    sample.fix_velocity_n, sample.fix_velocity_e = round(0.2 * Q24), round(-0.4 * Q24)
    s.fix_lag = round(0.1 * 2.0**30)
    sample.fix_accel_n, sample.fix_accel_e = round(0.2 * Q24), round(-0.3 * Q24)
    sample.fix_variance, sample.fix_period_us = 77, 200_000
    note_fix(s, sample)
    found = s.fix_innovation_n / Q24, s.fix_innovation_e / Q24
    assert found == pytest.approx((0.2 + 0.3 + 0.02 - 0.5, -0.4 - 0.1 - 0.03 + 0.5), abs=1e-3)
    assert (s.fix_variance, s.fix_period_us) == (77, 200_000)
    assert (s.fix_accel_n / 2.0**13, s.fix_accel_e / 2.0**13) == pytest.approx(
        (0.2, -0.3), abs=1e-3
    )


@pytest.mark.parametrize("rejected", [MAX_REJECTED - 1, MAX_REJECTED])
def test_after_five_rejections_in_a_row_the_velocity_starts_again(rejected):
    s, g = known(), gains()
    s.fixes_rejected, s.dvelocity_n[:] = rejected, [1] * 4
    waiting(s, 5.0)
    bits = judge_fix(s, g)
    restarts = rejected == MAX_REJECTED
    assert bits == (VELOCITY_USED if restarts else 0)
    assert s.velocity_n / Q24 == pytest.approx(5.0 if restarts else 0.0)
    assert (s.dvelocity_n[:] == [0] * 4) is restarts
    assert s.fixes_rejected == (0 if restarts else MAX_REJECTED)
    assert (s.fix_period_us, s.fix_span_us) == (0, 200_000)  # it waits no longer


@pytest.mark.parametrize(
    ("doubt_rad", "inflation", "suspect"),
    [(0.501, 1.0, 1), (0.499, 1.0, 0), (0.501, 9.8, 1), (0.501, 10.2, 0)],
)
def test_a_velocity_that_starts_again_suspects_a_tilt_that_is_doubted(
    doubt_rad, inflation, suspect
):
    s = known()
    s.fixes_rejected, s.extra_tilt_sigma = MAX_REJECTED, round(doubt_rad * Q28)
    s.log_startup_inflation = round(256.0 * math.log2(inflation))
    waiting(s, 1.0)
    judge_fix(s, gains())
    assert s.tilt_suspect == suspect


@pytest.mark.parametrize(
    ("period_s", "variance", "power", "inflation", "most"),
    [
        (0.2, 0.0, 0.0, 1.0, math.sqrt(0.04 / 0.2)),
        (0.1, 0.0, 0.0, 1.0, math.sqrt(0.04 / 0.1)),
        (0.2, 0.25, 0.0, 1.0, math.sqrt(0.2 + 0.25)),
        (0.2, 0.0, 0.3, 1.0, math.sqrt(0.2 + 0.3)),
        (0.2, 0.0, 0.0, 4.0, math.sqrt(4.0 * 0.2)),
    ],
)
def test_a_fix_within_five_deviations_is_used(period_s, variance, power, inflation, most):
    g = gains(fix_gate=25.0, fix_floor=0.04)
    for share, is_used in ((0.97, True), (1.03, False)):
        s = known(g)
        s.innovation_power, s.fixes_rejected = round(power * Q24), 2
        s.log_startup_inflation = round(256.0 * math.log2(inflation))
        size = 5.0 * share * most
        waiting(s, 0.6 * size, -0.8 * size, period_s, variance)
        assert judge_fix(s, g) == (VELOCITY_USED if is_used else 0)
        assert s.fixes_rejected == (0 if is_used else 3)
        assert (s.velocity_use == 2) is is_used


@pytest.mark.parametrize(
    ("rejected", "size", "is_doubted"),
    [(0, 0.39, True), (0, 0.41, False), (3, 1.56, True), (3, 1.64, False)],
)
def test_a_rejected_fix_doubts_the_tilt_as_far_as_a_tilt_explains_it(rejected, size, is_doubted):
    """A tilt error that grows the innovation within five fixes: up to 2 g in the fifth."""
    g = gains(fix_gate=1.01, fix_floor=1e-4)
    s = known(g)
    s.fixes_rejected, s.unused_variance = rejected, 1
    waiting(s, size * 0.2 * MAX_REJECTED)
    judge_fix(s, g)
    assert s.unused_variance == 0
    expected = min(size, 1.57) if is_doubted else 0.0
    assert s.extra_tilt_sigma / Q28 == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize(
    ("period_s", "age_s", "share"), [(0.2, 99.0, 0.05), (0.2, 1.0, 0.2), (5.0, 99.0, 1.0)]
)
def test_the_level_of_innovations_follows_over_its_time(period_s, age_s, share):
    g = gains(level_time_s=4.0)
    s = known(g)
    s.age_us, s.innovation_power = round(age_s * 1e6), round(0.5 * Q24)
    waiting(s, 0.3, 0.4, min(period_s, 4.1))
    judge_fix(s, g)
    assert s.innovation_power / Q24 == pytest.approx(0.5 + share * (0.25 - 0.5), rel=0.01)


@pytest.mark.parametrize(
    ("variance", "power", "density"),
    [(0.0, 0.0, 0.04), (0.25, 0.0, 0.04 + 0.05), (0.0, 0.1, 0.04 + 0.2), (0.0, 9.0, 1.5)],
)
def test_the_noise_of_a_fix(variance, power, density):
    g = gains(fix_floor=0.04, fix_correlation=2.0, fix_ceiling=1.5)
    s = known(g)
    s.innovation_power, s.fix_span_us = round(power * Q24), 200_000
    s.fix_variance, s.log_startup_inflation = max(round(variance * Q24), 1), 100
    choose_fix(s, g)
    assert s.log_velocity_noise / 256.0 == pytest.approx(math.log2(density), abs=0.02)
    # over the time between fixes, as far as the gain leaves it; inflated for colour and start
    kept = 1.0 - s.k_velocity_m / 2.0 ** (15 + s.k_velocity_s)
    expected = density / (0.2 * kept)
    inflated = 256.0 * math.log2(expected) + g.log_fix_inflation + 100
    assert s.log_noise == pytest.approx(inflated, abs=12)
    assert s.fix_noise > 0


@pytest.mark.parametrize("number", range(PERIODS))
def test_gains_are_those_for_the_time_between_fixes(number):
    g = gains()
    period_us = g.fix_periods_us[number]
    for period, row in ((period_us, number), (period_us + 1, min(number + 1, PERIODS - 1))):
        s = known(g)
        s.fix_span_us, s.fix_variance = period, 1
        choose_fix(s, g)
        place = SETS * row + s.gain_set
        found = (
            s.k_tilt_m / 2.0 ** (15 + s.k_tilt_s),
            s.k_velocity_m / 2.0 ** (15 + s.k_velocity_s),
        )
        expected = unpacked(g.k_fix_tilt[place]), unpacked(g.k_fix_velocity[place])
        assert found == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(
    ("age_s", "doubt_rad", "learns"),
    [(29.9, 0.0, False), (30.1, 0.0, True), (99.0, 0.0152, True), (99.0, 0.0154, False)],
)
def test_a_fix_teaches_a_bias_once_the_tilt_is_known(age_s, doubt_rad, learns):
    s = known()
    s.age_us, s.extra_tilt_sigma = round(age_s * 1e6), round(doubt_rad * Q28)
    s.k_velocity_m, s.k_velocity_s, s.log_noise = 1 << 14, 2, 0
    weigh_force(s, round(256.0 * math.log2(0.2)))
    assert (s.accel_learns > 32000) is learns
    assert (s.accel_learns == 0) is not learns


def test_vibration_is_not_learnt_as_a_bias():
    """What the force's noise gains over the loop's time counts as noise of the fixes."""
    s = known()
    s.k_velocity_m, s.k_velocity_s = 1 << 14, 2  # an eighth
    noise = 2.0**-10
    s.log_noise = logarithm(1 << 20) - (30 << 8)
    own = noise * 0.2 * (0.125 / 0.2) ** 2
    s.force_jitter = round(1.5 * own * 2.0**30)
    weigh_force(s, round(256.0 * math.log2(0.2)))
    assert s.accel_learns / 2.0**15 == pytest.approx(0.25, rel=0.03)


def test_the_constant_gain_of_a_fix():
    s = known()
    s.innovation_n, s.innovation_e = round(0.3 * Q24), round(-0.4 * Q24)
    s.k_tilt_m, s.k_tilt_s, s.k_velocity_m, s.k_velocity_s = 1 << 14, 3, 1 << 14, 1
    apply_fix(s)
    assert (s.velocity_n / Q24, s.velocity_e / Q24) == pytest.approx((0.075, -0.1), rel=1e-3)
    tilt = [part / 2.0**29 for part in s.correction[:]]
    assert tilt == pytest.approx([-0.4 / 16.0, -0.3 / 16.0, 0.0], rel=1e-3)
