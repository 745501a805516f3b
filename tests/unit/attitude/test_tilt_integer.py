"""When the tilt is doubted and found again in integers: just enough, and just too little."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.kernel.tilt import (
    ask_force,
    doubt_gap,
    doubt_rate,
    find_rest_gain,
    judge_rest,
    level,
    raise_tilt_sigma,
    restart_tilt,
    watch_rest,
)
from h2nav.attitude.velocity_aided.integer.memory import (
    MAX_REJECTED,
    ON_GROUND,
    TURNABLE,
    Sample,
    State,
)
from h2nav.attitude.velocity_aided.units import BIAS_UNIT_RAD_S, HEADING_UNIT_RAD, TURN_UNIT

DEG = math.pi / 180.0
ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
DT_US = 10_000
# One of a rate in 2^-40 rad/us, of a low-passed one, and of the rate of the sample before.
RAD_S, LOWPASSED, COARSE = 1e-6 * 2.0**40, 0.5e-6 * 2.0**44, 1e-6 * 2.0**31
Q28 = 2.0**28


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
    s.age_us, s.heading_reset, sample.dt_us, sample.parts = 99_000_000, 0, DT_US, 1
    return s, sample, r


def whole(values, unit):
    return [round(value * unit) for value in values]


def attitude_of(s):
    return Rotation.from_quat(np.roll(np.array(s.q_nb[:], float), -1))


# --- rest -------------------------------------------------------------------------------------


def watched(rate=(0.0, 0.0, 0.0), force=(0.0, 0.0, -1.0), rest_gyro=1 << 12, rest_accel=1 << 12):
    """A sample of a vehicle that has rested; the limits are in units of the integers."""
    g = gains()
    g.rest_gyro, g.rest_accel, g.rest_lowpass_shift = rest_gyro, rest_accel, 4
    s, sample, _ = known(g)
    s.accel_lp[:] = whole((0.0, 0.0, -1.0), 2.0**24)
    sample.accel[:] = whole(force, 2.0**20)
    watch_rest(s, g, sample, whole(rate, 0.5 * RAD_S))
    return s


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rate_or_a_force_far_from_its_mean_is_no_rest(axis, sign):
    # 64 steps each: 2^-28 rad/us of the rate, 2^-9 g of the force
    rate, force = 64e6 * 2.0**-28, 64 * 2.0**-9
    for share, unsteady in ((0.98, 0), (1.03, -1)):
        some = np.roll((sign * share, 0.0, 0.0), axis)
        assert watched(rate=rate * some).unsteady == unsteady
        assert watched(force=force * some + (0.0, 0.0, -1.0)).unsteady == unsteady


@pytest.mark.parametrize("axis", range(3))
def test_means_follow_by_their_share(axis):
    some = np.roll((1.0, 0.0, 0.0), axis)
    s = watched(rate=0.16 * some, force=0.32 * some + (0.0, 0.0, -1.0))
    assert s.gyro_lp[:] == pytest.approx((0.01 * LOWPASSED * some).tolist(), abs=2)
    expected = 0.02 * some + (0.0, 0.0, -1.0)
    assert s.accel_lp[:] == pytest.approx((expected * 2.0**24).tolist(), abs=20)


@pytest.mark.parametrize(
    ("prior", "unsteady", "lp_deg_s", "rests", "is_steady"),
    [
        (2, 0, 0.0, True, True),
        (2, -1, 0.0, False, False),
        (0, 0, 0.0, False, True),  # it flies
        (3, 0, 0.0, True, True),
        (1, 0, 0.2, True, True),
        (1, 0, 30.0, False, False),  # beyond any bias
        (2, 0, 30.0, False, False),
        (1, 0, 4.0, False, True),  # a slow turn, where the sensors decide
        (2, 0, 4.0, True, True),
    ],
)
@pytest.mark.parametrize("axis", range(3))
def test_who_rests(prior, unsteady, lp_deg_s, rests, is_steady, axis):
    g = gains()
    s, sample, _ = known(g)
    s.frame_time, s.unsteady, sample.rest_prior = round(0.16 * 2**17), unsteady, prior
    s.p_xx = s.p_yy = s.p_zz = round((0.05 * DEG / BIAS_UNIT_RAD_S) ** 2 * Q28)
    s.gyro_lp[axis] = round(lp_deg_s * DEG * LOWPASSED)
    s.rest_us = s.steady_us = 500_000
    judge_rest(s, g, sample)
    assert s.rest_us == pytest.approx(660_000 if rests else 0, abs=10)
    assert s.steady_us == pytest.approx(660_000 if is_steady else 0, abs=10)
    assert s.unsteady == 0


@pytest.mark.parametrize(
    ("shows", "after", "is_doubted"), [(0, 0, True), (1, 0, False), (2, 2, False)]
)
def test_a_rate_that_never_changes_hides_a_bias(shows, after, is_doubted):
    """Of a step of 1 mrad/s, its deviation is a third of the root of three of that."""
    g = gains()
    s, sample, _ = known(g)
    s.rate_shows, s.frame_time = shows, round(0.16 * 2**17)
    s.p_xx = s.p_yy = s.p_zz = 1000
    judge_rest(s, g, sample)
    hidden = (1e-3 / math.sqrt(3.0) / BIAS_UNIT_RAD_S) ** 2 * Q28 if is_doubted else 1000
    assert [s.p_xx, s.p_yy, s.p_zz] == pytest.approx([hidden] * 3, rel=0.01)
    assert s.rate_shows == after
    s.p_xx = s.p_yy = s.p_zz = 1 << 27
    judge_rest(s, g, sample)
    assert (s.p_xx, s.p_yy, s.p_zz) == (1 << 27,) * 3  # and no more


@pytest.mark.parametrize(
    ("prior", "deg_s", "has_field", "learns"),
    [
        (TURNABLE, 0.09, True, False),  # a rotor turns it on its skids
        (TURNABLE, 0.11, True, True),  # a bias that is known less well
        (TURNABLE, 0.09, False, True),  # nothing else shows it
        (ON_GROUND, 0.09, True, True),
    ],
)
def test_on_the_ground_an_armed_vehicle_may_turn_about_the_vertical(
    prior, deg_s, has_field, learns
):
    s, sample, _ = known()
    r = whole(np.eye(3).ravel() * 0.999, 2.0**15)
    sample.rest_prior, s.heading_reset = prior, 0 if has_field else 1
    variance = round((deg_s * DEG / BIAS_UNIT_RAD_S) ** 2 * Q28)
    for axis in range(3):
        s.p_xx = s.p_yy = s.p_zz = variance
        s.rest_axis = axis
        s.gyro_lp[:] = whole((0.01 * DEG,) * 3, LOWPASSED)
        find_rest_gain(s, sample, r)
        assert s.rest_axis == (axis + 1) % 3
        assert (s.gain_inverse != 0) is (learns or axis < 2)


# --- clipped rates and gaps -------------------------------------------------------------------


def test_a_clipped_rate_is_doubted_by_its_difference_from_the_rates_before():
    g = gains()
    s, sample, _ = known(g)
    s.gyro_lp[:] = whole((1.0, -2.0, 3.0), LOWPASSED)
    sample.gyro[:] = whole((4.0, 2.0, 3.0), RAD_S)
    s.heading_variance = round(0.001 / HEADING_UNIT_RAD**2 * Q28)
    for _ in range(3):
        doubt_rate(s, g, sample)
    angle = 3 * 0.01 * 5.0
    assert s.clipped_angle / Q28 == pytest.approx(angle, rel=0.01)
    assert s.extra_tilt_sigma / Q28 == pytest.approx(angle, rel=0.01)
    # the heading has been turned as well
    variance = s.heading_variance / Q28 * HEADING_UNIT_RAD**2
    assert variance == pytest.approx(0.001 + angle**2, rel=0.02)


@pytest.mark.parametrize("aided", [0, 1])
@pytest.mark.parametrize(("turning", "varied"), [(14.25, 0.25), (13.0, 0.0)])
def test_a_gap_is_doubted_by_the_change_of_the_rate_and_how_it_varied_before(
    aided, turning, varied
):
    g = gains()
    s, sample, _ = known(g)
    sample.aided, sample.gap_us = aided, 400_000
    s.gyro_lp[:] = whole((1.0, 2.0, 3.0), LOWPASSED)
    s.turning = round(turning / TURN_UNIT)
    s.gyro_last[:] = whole((0.1, 0.1, 0.1), COARSE)
    s.gyro_step[:] = [5, 5, 5]
    sample.gyro[:] = whole((0.2, -0.1, 0.3), RAD_S)
    s.extra_tilt_sigma, s.unused_variance = round(0.1 * Q28), 7
    s.gyro_jitter, s.fix_period_us = 1000, 200_000
    doubt_gap(s, g, sample)
    lost = 0.2 * math.sqrt(0.01 + 0.04 + 0.04 + varied)
    assert s.extra_tilt_sigma / Q28 == pytest.approx(math.hypot(0.1, lost), rel=0.03)
    assert s.unused_variance == 0
    assert (s.fixes_rejected, s.fix_period_us) == ((MAX_REJECTED, 0) if aided else (0, 200_000))
    # within the time of the levels the loop corrects as much, by the jitter's share
    level_s, share = GAINS.kernel.level_time_s, GAINS.kernel.jitter_share
    more = share * lost**2 / (3.0 * level_s) * 2.0**36 if aided else 0.0
    assert s.gyro_jitter - 1000 == pytest.approx(more, rel=0.06)
    # the rate between both
    between = np.array(s.gap_gyro[:]) / RAD_S
    assert between == pytest.approx([0.15, 0.0, 0.2], abs=1e-3)
    assert s.gyro_step[:] == [0, 0, 0]
    assert s.gyro_last[:] == pytest.approx(whole((0.2, -0.1, 0.3), COARSE), abs=2)


@pytest.mark.parametrize(("angle", "becomes"), [(0.1, 0.2), (0.3, 0.3), (1.56, 1.56), (1.6, 1.57)])
def test_a_doubt_only_grows_and_at_most_until_nothing_is_known(angle, becomes):
    s, *_ = known()
    s.extra_tilt_sigma, s.unused_variance = round(0.2 * Q28), 3
    raise_tilt_sigma(s, round(angle * Q28))
    assert s.extra_tilt_sigma / Q28 == pytest.approx(becomes, rel=1e-4)
    assert s.unused_variance == 0


# --- a force that contradicts the tilt --------------------------------------------------------


def off_by(angle_deg, size=1.0, axis=(0.6, 0.8, 0.0)):
    """A filter whose low-passed force contradicts its tilt by an angle; it has been steady."""
    g = gains()
    s, sample, r = known(g)
    true = Rotation.from_rotvec(angle_deg * DEG * np.array(axis)) * ATTITUDE
    s.accel_lp[:] = whole(true.inv().apply((0.0, 0.0, -size)), 2.0**24)
    s.steady_us = g.rest_time_us
    return s, g, sample, r, true


@pytest.mark.parametrize(
    ("angle_deg", "prior", "suspect", "asks"),
    [
        (29.0, 0, 0, False),  # a steady turn may bank
        (30.0, 0, 0, True),
        (9.5, ON_GROUND, 0, False),
        (10.5, ON_GROUND, 0, True),
        (10.5, ON_GROUND - 1, 0, False),
        (10.5, ON_GROUND + 1, 0, True),
        (29.0, ON_GROUND, 1, False),
        (30.0, 0, 1, True),
        (120.0, 0, 0, True),
        (179.0, 0, 0, True),
    ],
)
def test_a_force_of_size_g_that_contradicts_the_tilt_asks(angle_deg, prior, suspect, asks):
    s, g, sample, r, _ = off_by(angle_deg)
    sample.rest_prior, s.tilt_suspect = prior, suspect
    ask_force(s, g, sample, r)
    assert s.tilt_suspect == (2 if asks else 0)


@pytest.mark.parametrize(
    ("size", "asks"), [(1.048, True), (1.0495, False), (0.9495, True), (0.948, False)]
)
def test_only_a_force_within_five_percent_of_g_is_gravity(size, asks):
    s, g, sample, r, _ = off_by(60.0, size)
    ask_force(s, g, sample, r)
    assert (s.tilt_suspect == 2) is asks


@pytest.mark.parametrize(("suspect", "asks"), [(0, False), (1, True)])
def test_a_force_has_to_be_steady_unless_fixes_contradict_the_tilt(suspect, asks):
    s, g, sample, r, _ = off_by(60.0)
    s.steady_us -= 1
    s.tilt_suspect = suspect
    ask_force(s, g, sample, r)
    assert (s.tilt_suspect == 2) is asks


@pytest.mark.parametrize("scale", [1.0, 1e-3, 15.0])
@pytest.mark.parametrize("angle_deg", [5.0, 60.0, 120.0])
def test_a_level_points_the_force_up_and_what_was_north_north(angle_deg, scale):
    s, _, _, r, true = off_by(angle_deg)
    s.mag_frame_us, s.mag_learn_us, s.correction[:] = 5, 6, [7, 8, 9]
    force = true.inv().apply((0.0, 0.0, -scale * 2.0**24))
    level(s, *(round(part) for part in force), r)
    found = attitude_of(s).as_matrix()
    assert found[2] == pytest.approx(true.as_matrix()[2], abs=1e-3)
    north, east, _ = found @ ATTITUDE.as_matrix()[0]
    assert north > 0.3
    assert east == pytest.approx(0.0, abs=1e-3)
    assert (s.heading_reset, s.mag_frame_us, s.mag_learn_us) == (2, 0, 0)
    assert s.correction[:] == [0, 0, 0]


def test_no_level_is_taken_from_no_force_or_one_along_the_nose():
    s, _, _, r, _ = off_by(60.0)
    before = s.q_nb[:]
    level(s, 0, 0, 0, r)
    nose = ATTITUDE.inv().apply((1.0, 0.0, 0.0))
    level(s, *whole(nose, 2.0**24), r)
    assert (s.q_nb[:], s.heading_reset) == (before, 0)


def test_a_tilt_that_starts_again_keeps_bias_and_heading():
    s, sample, r = known()
    s.gyro_bias[:], s.heading_variance = [11, 12, 13], 1 << 20
    names = ("turning", "innovation_power", "innovation_mean_n", "innovation_mean_e",
             "innovation_variance", "age_us", "tilt_suspect", "steady_us")  # fmt: skip
    for name in names:
        setattr(s, name, 1)
    s.dtilt_n[:] = s.dvelocity_e[:] = [1, 1, 1, 1]
    sample.forward_speed = round(2.0 * 2.0**11)
    restart_tilt(s, sample, r)
    nose = ATTITUDE.as_matrix()[:, 0]
    found = s.velocity_n / 2.0**24, s.velocity_e / 2.0**24
    assert found == pytest.approx((2.0 * nose[0], 2.0 * nose[1]), abs=1e-3)
    assert [getattr(s, name) for name in names] == [0] * len(names)
    assert s.dtilt_n[:] == s.dvelocity_e[:] == [0, 0, 0, 0]
    assert s.fixes_rejected == MAX_REJECTED
    assert (s.gyro_bias[:], s.heading_variance) == ([11, 12, 13], 1 << 20)
