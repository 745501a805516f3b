"""When the tilt is doubted and found again: just enough, and just too little."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.tilt import (
    carry_tilt,
    check_level,
    doubt_gap,
    doubt_rate,
    end_clipping,
    level,
    raise_tilt_sigma,
    restart_tilt,
)
from h2nav.attitude.velocity_aided.memory import (
    HEADING_LOST,
    MAX_REJECTED,
    ON_GROUND,
    RESTARTED,
    Sample,
    State,
    Workspace,
)

DEG = math.pi / 180.0
DT_S = 0.01
ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))


def gains(**changes):
    found = new_filter().kernel_gains
    for name, value in changes.items():
        setattr(found, name, value)
    return found


G = gains().gravity


def known(attitude=ATTITUDE):
    s, w, sample = State(), Workspace(), Sample()
    x, y, z, q_w = attitude.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    w.r_nb[:] = attitude.as_matrix().ravel().tolist()
    s.age_s, s.mag_accepted_age_s = 99.0, 0.1
    sample.dt_s = DT_S
    return s, w, sample


def attitude_of(s):
    return Rotation.from_quat(np.roll(s.q_nb[:], -1))


# --- clipped rates ----------------------------------------------------------------------------


def test_a_clipped_rate_is_doubted_by_its_difference_from_the_rates_before():
    s, _, sample = known()
    s.gyro_lp[:], sample.gyro[:] = [1.0, -2.0, 3.0], [4.0, 2.0, 3.0]
    for _ in range(3):
        doubt_rate(s, sample)
    assert s.clipped_s == pytest.approx(3 * DT_S)
    assert s.clipped_angle == pytest.approx(3 * DT_S * 5.0)


@pytest.mark.parametrize(
    ("later", "ends"),
    [
        ((9.0, -9.0, 1.0), (True, True, False)),
        ((9.0, -8.92, 1.0), (True, False, False)),  # it moves: not at the end of its range
        ((9.1, -9.0, 1.0), (False, False, False)),  # another one is larger now
    ],
)
def test_an_axis_is_at_its_end_while_its_rate_stays_the_largest(later, ends):
    s, _, sample = known()
    step = np.array((0.2, -0.3, 0.4))
    s.gyro_step[:], sample.gyro[:] = step.tolist(), [9.0, -9.0, 1.0]
    doubt_rate(s, sample)
    assert s.clipped_slope[:] == pytest.approx([20.0, -30.0, 0.0])
    assert s.clipped_rate[:] == [9.0, -9.0, 1.0]
    s.gyro_step[:], sample.gyro[:] = [5.0, 5.0, 5.0], list(later)
    doubt_rate(s, sample)
    expected = [slope if end else 0.0 for slope, end in zip((20.0, -30.0, 0.0), ends, strict=True)]
    assert s.clipped_slope[:] == pytest.approx(expected)
    assert s.clipped_rate[:] == [9.0, -9.0, 1.0]  # that where clipping began


@pytest.mark.parametrize(("share", "is_end"), [(0.995, True), (0.985, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_two_axes_may_be_at_the_same_end(share, is_end, sign):
    s, _, sample = known()
    s.gyro_step[:], sample.gyro[:] = [0.1, 0.1, 0.1], [sign * 9.0, 0.0, -sign * share * 9.0]
    doubt_rate(s, sample)
    assert (s.clipped_slope[2] != 0.0) is is_end


def clipped(s, sample, time_s, rates, slopes, angle):
    """A time of clipped samples at these rates, entered with these slopes."""
    s.clipped_s, s.clipped_angle = time_s, angle
    s.clipped_rate[:], s.clipped_slope[:] = list(rates), list(slopes)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("axis", range(3))
def test_what_a_rate_hid_beyond_its_range_is_a_parabola(sign, axis):
    """w = w_end + a t (1 - t/T) hides a T^2 / 6, and falls with a as it has risen."""
    s, w, sample = known()
    time_s, rise = 0.2, 30.0
    rates = np.roll((sign * 9.0, 1.0, 1.0), axis)
    slopes = np.roll((sign * rise, 0.0, 0.0), axis)
    clipped(s, sample, time_s, rates, slopes, angle=5.0)
    # half of a step below the end: it has fallen by `rise` for half a step
    sample.gyro[:] = (rates - np.roll((sign * 0.5 * DT_S * rise, 0.0, 0.0), axis)).tolist()
    s.extra_tilt_sigma, s.heading_variance = 0.02, 0.003
    hidden = sign * rise * time_s**2 / 6.0
    bits = end_clipping(s, w, gains(), sample)
    turned = ATTITUDE.inv() * attitude_of(s)
    assert turned.as_rotvec() == pytest.approx(np.roll((hidden, 0.0, 0.0), axis), abs=1e-4)
    assert bits == 0
    # half of that is doubted, for tilt and heading
    assert s.extra_tilt_sigma == pytest.approx(0.02 + 0.5 * abs(hidden))
    assert s.heading_variance == pytest.approx(0.003 + (0.5 * hidden) ** 2)
    assert (s.clipped_s, s.clipped_angle) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("time_s", "rise", "fall", "is_hidden"),
    [
        (0.24, 10.0, 10.0, True),
        (0.26, 10.0, 10.0, False),
        (0.24, 0.0, 10.0, False),  # not at the end of its range
        (0.24, -10.0, 10.0, False),
        (0.24, 10.0, -10.0, False),  # it goes on to rise
        (0.24, 10.0, 0.0, False),
    ],
)
def test_what_is_known_of_a_hidden_rotation_needs_both_slopes_and_a_short_time(
    time_s, rise, fall, is_hidden
):
    s, w, sample = known()
    clipped(s, sample, time_s, (9.0, 0.0, 0.0), (rise, 0.0, 0.0), angle=0.15)
    sample.gyro[:] = [9.0 - 0.5 * DT_S * fall, 0.0, 0.0]
    end_clipping(s, w, gains(), sample)
    angle = (ATTITUDE.inv() * attitude_of(s)).magnitude()
    hidden = time_s**2 * (rise + fall) / 12.0 if is_hidden else 0.0
    assert angle == pytest.approx(hidden, abs=1e-5)
    assert s.extra_tilt_sigma == pytest.approx(0.5 * hidden if is_hidden else 0.15)


@pytest.mark.parametrize(
    ("angle", "restarts", "levels"),
    [(0.19, False, False), (0.21, True, False), (0.59, True, False), (0.61, True, True)],
)
def test_clipped_samples_that_may_have_hidden_more_start_the_tilt_again(angle, restarts, levels):
    s, w, sample = known()
    sample.accel[:] = [0.0, 0.0, -G]
    clipped(s, sample, 1.0, (9.0, 0.0, 0.0), (0.0, 0.0, 0.0), angle)
    s.innovation_power = 1.0
    assert end_clipping(s, w, gains(), sample) == (RESTARTED if restarts else 0)
    assert (s.innovation_power == 0.0) is restarts
    down = attitude_of(s).as_matrix()[2]
    assert (down == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)) is levels
    assert (s.mag_accepted_age_s == HEADING_LOST) is levels


def test_without_a_force_no_level_is_taken():
    s, w, sample = known()
    clipped(s, sample, 1.0, (9.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    assert end_clipping(s, w, gains(), sample) == RESTARTED
    assert (ATTITUDE.inv() * attitude_of(s)).magnitude() == pytest.approx(0.0, abs=1e-9)


def test_the_bias_of_the_accelerometer_is_taken_off_the_force_of_a_level():
    s, w, sample = known()
    s.accel_bias[:] = [0.02, -0.03]
    sample.accel[:] = [0.02 * G, -0.03 * G, -G]
    clipped(s, sample, 1.0, (9.0, 0.0, 0.0), (0.0, 0.0, 0.0), 1.0)
    end_clipping(s, w, gains(), sample)
    assert attitude_of(s).as_matrix()[2] == pytest.approx((0.0, 0.0, 1.0), abs=1e-6)


# --- missing samples, missing forces ----------------------------------------------------------


@pytest.mark.parametrize("aided", [0.0, 1.0])
@pytest.mark.parametrize(("turning", "varied"), [(14.0 + 0.25, 0.25), (13.9, 0.0)])
def test_a_gap_is_doubted_by_the_change_of_the_rate_and_how_it_varied_before(
    aided, turning, varied
):
    s, _, sample = known()
    sample.aided, sample.dt_s = aided, 0.4
    s.gyro_bias[:], s.gyro_lp[:], s.turning = [1.0, 1.0, 1.0], [2.0, 3.0, 4.0], turning
    s.gyro_last[:], sample.gyro[:], s.gyro_step[:] = [0.1] * 3, [0.2, -0.1, 0.3], [9.0] * 3
    s.extra_tilt_sigma, s.gyro_jitter, s.unused_variance = 0.1, 0.5, 7.0
    g = gains(level_time_s=4.0)
    doubt_gap(s, g, sample)
    lost = 0.2 * math.sqrt(0.01 + 0.04 + 0.04 + varied)
    assert s.extra_tilt_sigma == pytest.approx(math.hypot(0.1, lost))
    assert s.unused_variance == 0.0
    if aided:
        assert s.gyro_jitter == pytest.approx(0.5 + lost**2 / 12.0)
        assert (s.gyro_last[:], s.gyro_step[:]) == (sample.gyro[:], [0.0] * 3)
        assert s.fixes_rejected == MAX_REJECTED
    else:
        assert (s.gyro_jitter, s.gyro_last[:], s.fixes_rejected) == (0.5, [0.1] * 3, 0.0)


def test_a_tilt_without_a_force_is_doubted_by_the_noise_of_the_gyro():
    s, _, sample = known()
    s.gyro_lp[:] = sample.gyro[:] = [0.0, 0.0, 0.0]
    g = gains(gyro_noise=1e-4, jitter_share=0.0, bias_inflation=1.0)
    s.extra_tilt_sigma = 0.01
    for _ in range(100):
        carry_tilt(s, g, sample)
    assert s.unforced_s == pytest.approx(1.0)
    assert s.extra_tilt_sigma == pytest.approx(math.sqrt(0.01**2 + 1e-4), rel=1e-3)


@pytest.mark.parametrize(("angle", "becomes"), [(0.1, 0.2), (0.3, 0.3), (1.56, 1.56), (1.6, 1.57)])
def test_a_doubt_only_grows_and_at_most_until_nothing_is_known(angle, becomes):
    s, *_ = known()
    s.extra_tilt_sigma, s.unused_variance = 0.2, 3.0
    raise_tilt_sigma(s, angle)
    assert (s.extra_tilt_sigma, s.unused_variance) == (becomes, 0.0)


# --- a force that contradicts the tilt --------------------------------------------------------


def off_by(angle_deg, size=1.0, axis=(0.6, 0.8, 0.0)):
    """A filter whose low-passed force contradicts its tilt by an angle; it has been steady."""
    s, w, sample = known()
    true = Rotation.from_rotvec(angle_deg * DEG * np.array(axis)) * ATTITUDE
    s.accel_lp[:] = true.inv().apply((0.0, 0.0, -size * G)).tolist()
    s.accel_bias[:] = [0.01, -0.02]
    for i in range(2):
        s.accel_lp[i] += G * s.accel_bias[i]
    s.steady_s = gains().rest_time_s
    return s, w, sample, true


@pytest.mark.parametrize(
    ("angle_deg", "prior", "suspect", "is_taken"),
    [
        (29.0, 0.0, 0.0, False),  # a steady turn may bank
        (30.0, 0.0, 0.0, True),
        (9.5, ON_GROUND, 0.0, False),
        (10.5, ON_GROUND, 0.0, True),
        (10.5, ON_GROUND - 1.0, 0.0, False),
        (10.5, ON_GROUND + 1.0, 0.0, True),
        (29.0, ON_GROUND, 1.0, False),
        (30.0, 0.0, 1.0, True),
        (175.0, 0.0, 0.0, True),
    ],
)
def test_a_force_of_size_g_that_contradicts_the_tilt_sets_it(angle_deg, prior, suspect, is_taken):
    s, w, sample, true = off_by(angle_deg)
    sample.rest_prior, s.tilt_suspect = prior, suspect
    assert check_level(s, w, gains(), sample) == (RESTARTED if is_taken else 0)
    if is_taken:
        assert attitude_of(s).as_matrix()[2] == pytest.approx(true.as_matrix()[2], abs=1e-6)
        assert s.extra_tilt_sigma == 0.1
        assert s.mag_accepted_age_s == HEADING_LOST
    assert s.tilt_suspect == 0.0


@pytest.mark.parametrize(
    ("size", "is_taken"), [(1.048, True), (1.0495, False), (0.9495, True), (0.948, False)]
)
def test_only_a_force_within_five_percent_of_g_is_gravity(size, is_taken):
    s, w, sample, _ = off_by(60.0, size)
    assert (check_level(s, w, gains(), sample) == RESTARTED) is is_taken


@pytest.mark.parametrize(("suspect", "is_taken"), [(0.0, False), (1.0, True)])
def test_a_force_has_to_be_steady_unless_fixes_contradict_the_tilt(suspect, is_taken):
    s, w, sample, _ = off_by(60.0)
    s.steady_s -= 1e-6
    s.tilt_suspect = suspect
    assert (check_level(s, w, gains(), sample) == RESTARTED) is is_taken


@pytest.mark.parametrize("angle_deg", [5.0, 90.0, 150.0, 177.0])
def test_a_level_is_the_smallest_turn(angle_deg):
    s, w, _, true = off_by(angle_deg)
    force = true.inv().apply((0.0, 0.0, -5.0))
    level(s, w, *force.tolist(), 5.0)
    assert attitude_of(s).as_matrix() == pytest.approx(true.as_matrix(), abs=1e-6)
    assert np.reshape(w.r_nb[:], (3, 3)) == pytest.approx(true.as_matrix(), abs=1e-6)


def test_upside_down_any_horizontal_axis_will_do():
    s, w, _, _ = off_by(0.0)
    force = ATTITUDE.inv().apply((0.0, 0.0, 5.0))
    level(s, w, *force.tolist(), 5.0)
    matrix = attitude_of(s).as_matrix()
    assert matrix @ force == pytest.approx((0.0, 0.0, -5.0), abs=0.02)
    assert np.linalg.norm(s.q_nb[:]) == pytest.approx(1.0)


def test_a_tilt_that_starts_again_keeps_bias_and_heading():
    s, w, _ = known()
    s.gyro_bias[:], s.mag_accepted_age_s = [0.1, 0.2, 0.3], 0.5
    s.heading_variance = 0.02
    names = ("turning", "innovation_power", "innovation_mean_n", "innovation_mean_e",
             "innovation_variance", "age_s", "tilt_suspect", "steady_s")  # fmt: skip
    for name in names:
        setattr(s, name, 1.0)
    s.dtilt_n[:] = s.dvelocity_e[:] = [1.0] * 4
    restart_tilt(s, w, gains(), 2.0)
    nose = ATTITUDE.as_matrix()[:, 0]
    assert (s.velocity_n, s.velocity_e) == pytest.approx((2.0 * nose[0], 2.0 * nose[1]))
    assert [getattr(s, name) for name in names] == [0.0] * len(names)
    assert s.dtilt_n[:] == s.dvelocity_e[:] == [0.0] * 4
    assert s.fixes_rejected == MAX_REJECTED
    assert s.gyro_bias[:] == [0.1, 0.2, 0.3]
    assert (s.mag_accepted_age_s, s.heading_variance) == (0.5, 0.02)


@pytest.mark.parametrize("how", ["clipping", "level"])
def test_the_velocity_that_starts_again_is_that_along_the_nose(how):
    s, w, sample, _ = off_by(60.0)
    sample.forward_speed = 2.0 * G
    if how == "level":
        check_level(s, w, gains(), sample)
    else:
        clipped(s, sample, 1.0, (9.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.3)
        end_clipping(s, w, gains(), sample)
    nose = attitude_of(s).as_matrix()[:, 0]
    assert (s.velocity_n, s.velocity_e) == pytest.approx((2.0 * nose[0], 2.0 * nose[1]))
