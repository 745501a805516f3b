"""A field's corrections one by one: which field is used, and what it shows, at both sides."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import new_filter

from h2nav.attitude.velocity_aided.kernel.heading import (
    count_turn,
    doubt_offset,
    follow_offset,
    heading_contradicts,
    is_rejected,
    learn_field,
    measure_heading,
    rotate_field,
    set_jacobian,
    turn_heading,
    use_field,
    wrapped,
)
from h2nav.attitude.velocity_aided.kernel.start import find_in_air
from h2nav.attitude.velocity_aided.memory import (
    FIELD_USED,
    HEADING_LOST,
    MAX_REJECTED,
    Sample,
    State,
    Workspace,
)

DEG = math.pi / 180.0
NORM, DIP, DECLINATION = 0.5, 60.0 * DEG, 3.0 * DEG
NEVER = -1.0  # since a field was accepted
DOWN = np.array((0.0, 0.0, 1.0))
VARIANCE = (2.0 * DEG) ** 2  # of the heading


def gains(**changes):
    found = new_filter().kernel_gains
    for name, value in changes.items():
        setattr(found, name, value)
    return found


def known(attitude=None, given=1.0):
    """State, workspace and sample of a filter that knows attitude and field."""
    s, w, sample = State(), Workspace(), Sample()
    turned(s, w, attitude or Rotation.identity())
    s.mag_ref_norm, s.mag_ref_dip, s.declination, s.mag_ref_given = NORM, DIP, DECLINATION, given
    s.heading_variance, s.startup_inflation, s.age_s = VARIANCE, 1.0, 99.0
    s.p_xx = s.p_yy = s.p_zz = 1e-12
    s.mag_accepted_age_s, s.mag_age_s = 0.1, 0.1
    sample.dt_s = 0.01
    return s, w, sample


def turned(s, w, attitude):
    x, y, z, q_w = attitude.as_quat().tolist()
    s.q_nb[:] = [q_w, x, y, z]
    w.r_nb[:] = attitude.as_matrix().ravel().tolist()


def field(norm=NORM, dip=DIP, east_of_north=DECLINATION):
    """In NED."""
    flat = norm * math.cos(dip)
    return np.array(
        (
            flat * math.cos(east_of_north),
            flat * math.sin(east_of_north),
            norm * math.sin(dip),
        )
    )


def seen(s, w, ned):
    """What a compass on the vehicle shows of it."""
    return (np.reshape(w.r_nb[:], (3, 3)).T @ ned).tolist()


def used(s, w, sample, ned, g=None):
    sample.mag[:] = seen(s, w, ned)
    return use_field(s, w, g or gains(), sample)


def shown(w, ned):
    w.mag_ned[:] = ned.tolist()


# --- which field is used ----------------------------------------------------------------------


@pytest.mark.parametrize("axis", [None, 0, 1, 2])
def test_only_a_new_field_is_used(axis):
    s, w, sample = known()
    sample.mag[:] = field().tolist()
    s.mag_last[:] = sample.mag[:]
    if axis is not None:
        s.mag_last[axis] += 1e-6
    assert use_field(s, w, gains(), sample) == (0 if axis is None else FIELD_USED)
    assert s.mag_age_s == (0.1 if axis is None else 0.0)
    assert s.mag_last[:] == sample.mag[:]


def test_a_field_of_nothing_shows_nothing():
    s, w, sample = known()
    s.mag_last[:] = [1.0, 0.0, 0.0]
    assert used(s, w, sample, np.zeros(3)) == 0
    assert s.mag_accepted_age_s == 0.1


@pytest.mark.parametrize(
    ("norm", "dip_deg", "is_used"),
    [
        (1.0, 60.0, True), (1.099, 60.0, True), (1.101, 60.0, False), (0.901, 60.0, True),
        (0.899, 60.0, False), (1.0, 69.9, True), (1.0, 70.1, False), (1.0, 50.1, True),
        (1.0, 49.9, False),
    ],
)  # fmt: skip
@pytest.mark.parametrize("accepted_age_s", [0.1, NEVER])
def test_a_field_has_to_be_like_its_reference(norm, dip_deg, is_used, accepted_age_s):
    s, w, sample = known()
    s.mag_accepted_age_s = accepted_age_s
    result = used(s, w, sample, field(norm * NORM, dip_deg * DEG))
    assert result == (FIELD_USED if is_used else 0)
    assert s.mag_accepted_age_s == (0.0 if is_used else accepted_age_s)
    assert (s.mag_new_s > 0.0) is not is_used


def test_where_the_heading_is_lost_any_field_gives_it_and_teaches_nothing():
    s, w, sample = known()
    s.mag_accepted_age_s = HEADING_LOST
    assert used(s, w, sample, field(2.0 * NORM, 20.0 * DEG, 50.0 * DEG)) == FIELD_USED
    assert s.heading_turned == pytest.approx(-47.0 * DEG)
    assert (s.mag_accepted_age_s, s.mag_disturbance, s.mag_offset_s) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("witnessed", [0.0, 1.0])
def test_the_first_field_is_the_reference_and_gives_the_heading_unless_velocities_have(witnessed):
    s, w, sample = known(Rotation.from_euler("ZYX", (0.7, 0.2, -0.3)), given=0.0)
    s.mag_ref_norm, s.mag_accepted_age_s, s.heading_witnessed = 0.0, NEVER, witnessed
    s.heading_unknown = 1.0
    assert used(s, w, sample, field(east_of_north=5.0 * DEG)) == FIELD_USED
    assert (s.mag_ref_norm, s.mag_ref_dip) == pytest.approx((NORM, DIP))
    assert s.innovation[2] == pytest.approx(-2.0 * DEG)
    assert s.heading_unknown == 0.0
    # a heading that is known is corrected by its share
    assert (s.heading_turned == pytest.approx(-2.0 * DEG)) is not bool(witnessed)


def test_a_heading_from_the_field_alone_turns_about_the_vertical_and_forgets():
    attitude = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
    s, w, _ = known(attitude)
    s.velocity_n, s.velocity_e, s.dtilt_n[:] = 1.0, 2.0, [1.0, 2.0, 3.0, 4.0]
    s.p_xh, s.p_yh, s.p_zh = 1.0, 2.0, 3.0
    rows = (s.p_accel_x, s.p_accel_y, s.p_offset_x, s.p_offset_y, s.p_offset_z)
    for row in rows:
        row[:] = [1.0, 2.0, 3.0, 4.0]
    g = gains()
    turn_heading(s, w, g, 0.9)
    expected = Rotation.from_rotvec((0.0, 0.0, 0.9)) * attitude
    assert np.reshape(w.r_nb[:], (3, 3)) == pytest.approx(expected.as_matrix())
    assert np.roll(s.q_nb[:], -1) == pytest.approx(expected.as_quat())
    assert (s.heading_turned, s.velocity_n, s.velocity_e) == (0.9, 0.0, 0.0)
    assert s.fixes_rejected == MAX_REJECTED
    assert s.dtilt_n[:] == [0.0] * 4
    assert (s.p_xh, s.p_yh, s.p_zh, s.heading_variance) == (0.0, 0.0, 0.0, g.heading_variance)
    assert all(row[:] == [1.0, 2.0, 3.0, 0.0] for row in rows)


@pytest.mark.parametrize("angle", [0.0, 3.1, -3.1, 3.2, -3.2, 6.0, -6.0, 9.0, -9.0])
def test_an_angle_within_half_a_turn(angle):
    assert wrapped(angle) == pytest.approx(math.remainder(angle, math.tau))


@pytest.mark.parametrize("clipped", [0.0, 1.0, 2.0])
def test_without_a_force_norm_and_dip_teach_nothing(clipped):
    s, w, sample = known(given=0.0)
    sample.clipped = clipped
    assert used(s, w, sample, field(1.02 * NORM, DIP + 2.0 * DEG)) == FIELD_USED
    assert (s.mag_ref_norm == NORM) is (clipped > 0.0)
    assert (s.mag_disturbance == 0.0) is (clipped > 0.0)


# --- the latency ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("learnt_s", "weight", "lag_s"),
    [(0.0, 0.0, 0.02), (0.06, 3.0, 0.04), (-0.9, 3.0, 0.0), (0.4, 3.0, 0.1), (0.06, 3e9, 0.06)],
)
def test_a_field_is_turned_back_by_its_latency_within_bounds(learnt_s, weight, lag_s):
    """The learnt latency and the expected one are weighted: here by 3."""
    attitude = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
    s, w, sample = known(attitude)
    s.mag_lag_num, s.mag_lag_den, s.mag_lag_expected = learnt_s * weight, weight, 0.02
    s.gyro_bias[:], s.field_offset[:] = [0.1, -0.2, 0.3], [0.02, 0.05, -0.04]
    sample.gyro[:], sample.mag[:] = [1.1, 0.8, -0.7], [0.2, -0.1, 0.4]
    rate = np.array((1.0, 1.0, -1.0))
    own = np.array(sample.mag[:]) - NORM * np.array(s.field_offset[:])
    found = rotate_field(s, w, gains(mag_lag_prior=3.0, mag_lag_limit=0.1), sample)
    assert found == pytest.approx(lag_s)
    change = attitude.apply(np.cross(rate, own))
    assert w.dtheta[:3] == pytest.approx(change)
    assert w.mag_ned[:] == pytest.approx(attitude.apply(own) - lag_s * change)


@pytest.mark.parametrize("lag_s", [0.0, 0.03, 0.08])
def test_the_latency_is_learnt_from_turns_in_pitch_and_roll(lag_s):
    """A field of `lag_s` ago has another size of its horizontal and its vertical part."""
    s, w, sample = known()
    g = gains(mag_lag_prior=1e-3, mag_lag_limit=0.1)
    drawn = np.random.default_rng(4)
    for _ in range(200):
        rate = drawn.normal(0.0, 1.0, 3)
        attitude = Rotation.from_rotvec(drawn.normal(0.0, 0.5, 3))
        turned(s, w, attitude)
        before = attitude * Rotation.from_rotvec(-lag_s * rate)
        sample.gyro[:], sample.mag[:] = rate.tolist(), before.inv().apply(field()).tolist()
        lag = rotate_field(s, w, g, sample)
        ned = np.array(w.mag_ned[:])
        flat, norm = float(np.hypot(*ned[:2])), float(np.linalg.norm(ned))
        s.innovation[2] = 0.0
        learn_field(s, w, g, norm, math.atan2(ned[2], flat), flat, 0.1, lag)
    assert s.mag_lag_num / s.mag_lag_den == pytest.approx(lag_s, abs=2e-3)


@pytest.mark.parametrize(
    ("changes", "learns"),
    [
        ({}, True),
        ({"aided": 0.0}, False),
        ({"mag_ref_given": 0.0}, False),
        ({"mag_accepted_age_s": NEVER}, False),
        ({"doubt": 1.05}, False),
        ({"doubt": 0.95}, True),
    ],
)
def test_turns_about_the_vertical_show_the_latency_where_something_else_holds_the_heading(
    changes, learns
):
    lag_s = 0.05
    s, w, _ = known()
    g = gains()
    s.aided = 1.0
    doubt = changes.pop("doubt", 0.5)
    s.p_offset[0] = s.p_offset[3] = s.p_offset[5] = doubt * g.offset_variance
    for name, value in changes.items():
        setattr(s, name, value)
    for number in range(400):
        # the heading by a late field lags behind the turn
        turn = 1.0 if number // 20 % 2 else -1.0
        ned = field()
        shown(w, ned)
        w.dtheta[:3] = (turn * np.array((-ned[1], ned[0], 0.0))).tolist()
        s.innovation[2] = -lag_s * turn
        learn_field(s, w, g, NORM, DIP, NORM * math.cos(DIP), 0.1, 0.0)
    assert (s.mag_lag_den > 1.0) is learns
    if learns:
        assert s.mag_lag_num / s.mag_lag_den == pytest.approx(lag_s, rel=0.01)


# --- reference and disturbance ----------------------------------------------------------------


@pytest.mark.parametrize("given", [0.0, 1.0])
def test_only_a_learnt_reference_follows_the_field(given):
    s, w, _ = known(given=given)
    ned = field(1.1 * NORM, DIP + 0.1)
    shown(w, ned)
    g = gains(mag_ref_time_s=9.9)
    learn_field(s, w, g, 1.1 * NORM, DIP + 0.1, float(np.hypot(*ned[:2])), 0.1, 0.0)
    share = 0.0 if given else 0.01
    assert s.mag_ref_norm == pytest.approx(NORM * (1.0 + 0.1 * share))
    assert s.mag_ref_dip == pytest.approx(DIP + 0.1 * share)


def test_the_disturbance_of_the_heading_is_as_large_as_that_of_norm_and_dip():
    """A bent field shows two of its three components."""
    s, w, _ = known()
    ned = field(1.06 * NORM, DIP + 0.08)
    flat = float(np.hypot(*ned[:2]))
    shown(w, ned)
    for _ in range(5000):
        learn_field(s, w, gains(level_time_s=2.0), 1.06 * NORM, DIP + 0.08, flat, 0.1, 0.0)
    cosine = math.cos(DIP + 0.08)
    expected = (0.06**2 + 0.08**2) / (2.0 * cosine**2)
    assert s.mag_disturbance == pytest.approx(expected, rel=0.06)


def test_means_of_a_given_reference_are_those_of_the_time_so_far_up_to_twenty_seconds():
    s, _, _ = known()
    for number in range(1, 101):
        follow_offset(s, 0.01 * number, -0.02 * number, 0.1)
    assert s.mag_offset_s == pytest.approx(10.0)
    assert s.mag_offset_norm == pytest.approx(0.01 * 50.5)
    assert s.mag_offset_dip == pytest.approx(-0.02 * 50.5)
    for _ in range(200):
        follow_offset(s, 0.0, 0.0, 0.1)
    assert s.mag_offset_s == pytest.approx(20.0, abs=0.11)
    before = s.mag_offset_norm
    for _ in range(200):
        follow_offset(s, 0.0, 0.0, 0.1)
    assert s.mag_offset_norm == pytest.approx(before * math.exp(-1.0), rel=0.02)


def test_means_of_a_learnt_reference_are_slow_from_the_start():
    s, _, _ = known(given=0.0)
    follow_offset(s, 0.1, -0.2, 1.0)
    assert (s.mag_offset_norm, s.mag_offset_dip) == pytest.approx((0.1 / 21.0, -0.2 / 21.0))
    assert s.mag_offset_s == 0.0


def steady(s, norm=1.5, dip_deg=60.0, seconds=20.0, turns=1.0, age_s=0.1, g=None):
    """Another field for so long, in which the vehicle turns so far; what is_rejected says last."""
    count = round(seconds / age_s)
    for number in range(count):
        angle = turns * math.tau * number / (count - 1)
        flat = norm * NORM * math.cos(dip_deg * DEG)
        s.mag_last[:] = [
            flat * math.cos(angle),
            -flat * math.sin(angle),
            norm * NORM * math.sin(dip_deg * DEG),
        ]
        said = is_rejected(s, g or gains(), norm * NORM, dip_deg * DEG, age_s)
        if said == 0.0:
            return (number + 1) * age_s
    return None


@pytest.mark.parametrize(
    ("seconds", "turns", "is_taken"),
    [(20.0, 3.0, True), (19.8, 3.0, False), (25.0, 1.0, False), (25.0, 2.5, True)],
)
def test_another_field_becomes_the_reference_after_time_and_turns(seconds, turns, is_taken):
    """Chords of the field in body axes count: it dips, so that a turn of 360 deg is less."""
    s, _, _ = known()
    s.mag_lag_num, s.mag_lag_den, s.p_xh = 1.0, 2.0, 3.0
    g = gains(mag_new_time_s=20.0 - 1e-6, mag_new_turn=math.tau)
    assert (steady(s, seconds=seconds, turns=turns, g=g) is not None) is is_taken
    if is_taken:
        assert (s.mag_ref_norm, s.mag_ref_dip) == pytest.approx((1.5 * NORM, DIP))
        assert (s.mag_ref_given, s.mag_new_s, s.mag_lag_num, s.mag_lag_den) == (0.0,) * 4
        assert (s.p_xh, s.heading_variance) == (0.0, g.heading_variance)
    else:
        assert (s.mag_ref_norm, s.mag_ref_given, s.p_xh) == (NORM, 1.0, 3.0)


@pytest.mark.parametrize(
    ("norm", "dip_deg", "is_same"),
    [
        (1.5, 60.0, True), (1.57, 60.0, True), (1.58, 60.0, False), (1.43, 60.0, True),
        (1.42, 60.0, False), (1.5, 64.9, True), (1.5, 65.1, False), (1.5, 55.1, True),
        (1.5, 54.9, False),
    ],
)  # fmt: skip
def test_another_field_has_to_be_steady_within_half_the_gates(norm, dip_deg, is_same):
    s, _, _ = known()
    s.mag_last[:] = [0.3, 0.0, 0.6]
    is_rejected(s, gains(), 1.5 * NORM, DIP, 0.1)
    s.mag_new_turn = 1.0
    assert is_rejected(s, gains(), norm * NORM, dip_deg * DEG, 0.3) == 1.0
    assert s.mag_new_s == pytest.approx(0.4 if is_same else 0.3)
    mean = 0.75 if is_same else 1.0
    assert s.mag_new_norm == pytest.approx(NORM * (1.5 + mean * (norm - 1.5)))
    assert s.mag_new_dip == pytest.approx(DIP + mean * (dip_deg - 60.0) * DEG)
    assert s.mag_new_turn == (1.0 if is_same else 0.0)


def test_a_field_like_the_reference_ends_the_count_of_another():
    s, _, _ = known()
    is_rejected(s, gains(), 1.5 * NORM, DIP, 0.1)
    assert is_rejected(s, gains(), NORM, DIP, 0.1) == 0.0
    assert s.mag_new_s == 0.0


@pytest.mark.parametrize(("angle", "counts"), [(0.34, False), (0.36, True)])
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_counts_once_it_is_more_than_noise(angle, counts, axis):
    s, _, _ = known()
    before = np.roll((0.6, 0.8, 0.0), axis)
    after = Rotation.from_rotvec(np.roll((0.0, 0.0, angle), axis)).apply(before)
    s.mag_new_from[:], s.mag_last[:] = before.tolist(), after.tolist()
    count_turn(s, 1.0)
    chord = 2.0 * math.sin(0.5 * angle)
    assert s.mag_new_turn == pytest.approx(chord if counts else 0.0)
    assert s.mag_new_from[:] == pytest.approx((after if counts else before).tolist())


# --- the heading by the field -----------------------------------------------------------------


@pytest.mark.parametrize("declination", [0.0, 0.4, -2.0])
def test_the_heading_depends_on_theta_by_the_tilt_that_it_has_made(declination):
    """Against what a small turn changes of the heading by the field."""
    s, w, _ = known()
    s.declination = declination
    drawn = np.random.default_rng(3)
    s.dtilt_n[:], s.dtilt_e[:] = (row.tolist() for row in drawn.normal(0.0, 1.0, (2, 4)))
    ned = field(east_of_north=declination)
    shown(w, ned)
    set_jacobian(s, w, gains())
    for i in range(4):
        # the tilt is off by dtilt_n north and dtilt_e east: the axis of that turn is (e, -n)
        tiny = 1e-6
        tilt = np.array((s.dtilt_e[i], -s.dtilt_n[i], float(i == 3)))
        bent = Rotation.from_rotvec(tiny * tilt).inv().apply(ned)
        change = (declination - math.atan2(bent[1], bent[0])) / tiny
        assert w.jacobian[i] == pytest.approx(change, rel=1e-3, abs=1e-3)


def test_the_heading_depends_on_the_offset_across_the_field():
    attitude = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
    s, w, _ = known(attitude)
    ned = field(east_of_north=0.5)
    shown(w, ned)
    set_jacobian(s, w, gains())
    for i in range(3):
        tiny = 1e-6
        left = ned - attitude.apply(np.eye(3)[i] * NORM * tiny)
        change = -(math.atan2(left[1], left[0]) - 0.5) / tiny
        # an offset that is still in the field turns the innovation the other way
        assert w.row_offset[i] == pytest.approx(-change, rel=1e-3, abs=1e-3)


@pytest.mark.parametrize(
    ("unforced_s", "factor"), [(0.0, 1.0), (0.9, 1.0), (1.5, 1.5), (30.0, 30.0)]
)
def test_the_noise_of_the_heading(unforced_s, factor):
    """Of the field, of what bends it, and of a tilt that is not known, by the slope of the dip."""
    s, w, _ = known()
    shown(w, field())
    s.mag_disturbance, s.startup_inflation = 0.02, 3.0
    s.extra_tilt_sigma, s.unforced_s = 0.05, unforced_s
    s.velocity_noise, s.gyro_jitter, s.turning = 4.0, 0.0, 0.0
    g = gains(mag_noise=1e-3, mag_correlation=2.0, gyro_noise=1e-6, jitter_share=0.0)
    slope = math.tan(DIP)
    expected = 1e-3 + 2.0 * 0.02 + slope**2 * (2.0 * math.sqrt(4e-6) + factor * 0.05**2)
    assert set_jacobian(s, w, g) == pytest.approx(3.0 * expected, rel=1e-6)


# --- a heading that contradicts ---------------------------------------------------------------


def contradicts(s, w, share, *, age_s=0.1, gate=9.0, at=None):
    """What is said of a heading that is off by so many times what is allowed, and by how much."""
    g = gains(mag_heading_gate=gate)
    shown(w, field())
    noise = set_jacobian(s, w, g)
    innovation = share * math.sqrt(9.0 * (noise + s.heading_variance)) if at is None else at
    return heading_contradicts(s, w, g, innovation, age_s)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "said"), [(0.99, 0.0), (1.01, 1.0)])
def test_a_heading_that_differs_by_three_deviations_contradicts(share, said, sign):
    s, w, _ = known()
    assert contradicts(s, w, sign * share) == said
    assert s.heading_rejected_s == pytest.approx(0.1 * said)


@pytest.mark.parametrize(
    ("changes", "gate", "said"),
    [
        ({}, 9.0, 1.0),
        ({}, 0.0, 0.0),
        ({"mag_ref_given": 0.0}, 9.0, 0.0),  # the learnt reference may be wrong instead
        ({"mag_ref_given": 0.0, "heading_witnessed": 1.0}, 9.0, 1.0),
    ],
)
def test_where_headings_are_compared(changes, gate, said):
    s, w, _ = known()
    for name, value in changes.items():
        setattr(s, name, value)
    assert contradicts(s, w, 2.0, gate=gate) == said


@pytest.mark.parametrize(("seconds", "is_lost"), [(20.0, False), (20.2, True)])
def test_a_contradiction_that_lasts_gives_the_heading_to_the_next_field(seconds, is_lost):
    s, w, _ = known()
    for _ in range(round(seconds / 0.2)):
        assert contradicts(s, w, 1.5, age_s=0.2) == 1.0
    assert (s.mag_accepted_age_s == HEADING_LOST) is is_lost
    assert (s.heading_rejected_s == 0.0) is is_lost


@pytest.mark.parametrize(
    ("left_deg", "jumps"), [(48.9, False), (49.1, True), (-48.9, False), (-49.1, True)]
)
@pytest.mark.parametrize("how", ["like its reference", "of another norm"])
def test_a_field_jumps_that_leaves_the_heading_faster_than_a_gyro_is_wrong(left_deg, jumps, how):
    """20 deg, two deviations, and in 0.1 s 2 deg of a zero and 23 of a gyro that turns backward."""
    s, w, sample = known()
    s.turning, s.mag_accepted_age_s = 4.0, 0.1
    s.heading_agreed, s.heading_turned = 25.0 * DEG, 30.0 * DEG  # by corrections
    norm = NORM if how == "like its reference" else 2.0 * NORM
    innovation = left_deg * DEG - 5.0 * DEG
    assert used(s, w, sample, field(norm, east_of_north=DECLINATION - innovation)) == 0
    assert bool(s.field_jumped) is jumps


@pytest.mark.parametrize(("age_s", "jumps"), [(0.9, True), (1.1, False)])
def test_a_field_that_was_not_seen_for_a_second_has_not_jumped(age_s, jumps):
    s, w, sample = known()
    s.mag_accepted_age_s = age_s
    used(s, w, sample, field(east_of_north=DECLINATION + 120.0 * DEG))
    assert bool(s.field_jumped) is jumps


@pytest.mark.parametrize(("changes", "is_lost"), [({}, False), ({"rest_s": 1.0}, True)])
def test_a_field_that_has_jumped_gives_no_heading_under_way(changes, is_lost):
    s, w, _ = known()
    s.field_jumped = 1.0
    for name, value in changes.items():
        setattr(s, name, value)
    for _ in range(102):
        assert contradicts(s, w, 1.5, age_s=0.2) == 1.0
    assert (s.mag_accepted_age_s == HEADING_LOST) is is_lost


def test_after_a_start_there_is_no_heading_that_a_field_could_leave():
    """As when a tilt is found anew, and the heading goes on."""
    s, w, sample = known()
    s.field_jumped, s.heading_agreed = -1.0, 0.0
    used(s, w, sample, field(east_of_north=DECLINATION + 120.0 * DEG))
    assert s.field_jumped == -1.0
    s.mag_age_s = 0.1
    used(s, w, sample, field())
    assert s.field_jumped == 0.0


@pytest.mark.parametrize("heading_sigma", [0.1, math.inf])
def test_after_an_attitude_found_in_the_air_no_field_has_jumped(heading_sigma):
    s, w, _ = known()
    s.field_jumped = 1.0
    find_in_air(s, w, gains(), 2.5, 0.1, heading_sigma)
    assert s.field_jumped == -1.0


def test_a_field_that_is_back_has_not_jumped():
    s, w, sample = known()
    s.field_jumped = 1.0
    assert used(s, w, sample, field(east_of_north=DECLINATION - 0.5 * DEG)) == FIELD_USED
    assert s.field_jumped == 0.0
    assert s.heading_agreed == pytest.approx(0.5 * DEG)


def test_while_velocities_show_the_heading_no_contradiction_takes_it_back():
    s, w, _ = known()
    s.heading_witnessed = 1.0
    for _ in range(300):
        assert contradicts(s, w, 1.5, age_s=0.2) == 1.0
    assert (s.mag_accepted_age_s, s.heading_rejected_s) == (0.1, 0.0)


@pytest.mark.parametrize(
    ("angle_deg", "deviation_deg", "witnessed", "given", "said"),
    [
        # a chord of 0.3 of the norm, of which half is horizontal: 34.9 deg
        (35.0, 15.0, 1.0, 1.0, 1.0),
        (-35.0, 15.0, 1.0, 1.0, 1.0),
        (34.8, 15.0, 1.0, 1.0, 0.0),
        # two deviations
        (40.0, 19.9, 1.0, 1.0, 1.0),
        (40.0, 20.1, 1.0, 1.0, 0.0),
        (40.0, 19.9, 0.0, 1.0, 0.0),
        (40.0, 19.9, 1.0, 0.0, 0.0),
    ],
)
def test_a_compass_that_is_turned_takes_no_heading_back_that_velocities_have_shown(
    angle_deg, deviation_deg, witnessed, given, said
):
    s, w, _ = known(given=given)
    s.heading_witnessed, s.heading_variance = witnessed, (deviation_deg * DEG) ** 2
    assert contradicts(s, w, 0.0, at=angle_deg * DEG) == said


@pytest.mark.parametrize(
    ("more_norm", "more_dip", "share", "is_opened"),
    [
        (0.0, 0.0, 0.98, True),
        (0.0, 0.0, 1.02, False),  # more than the third component of the bent field
        (0.0332, 0.0, 0.9, True),  # a third of what the bent one had
        (0.0334, 0.0, 0.9, False),
        (-0.0334, 0.0, 0.9, False),
        (0.0, 0.0332, 0.9, True),
        (0.0, 0.0334, 0.9, False),
        (0.0, -0.0334, 0.9, False),
    ],
)
@pytest.mark.parametrize(("norm", "dip"), [(0.1, 0.0), (0.06, -0.08)])
def test_a_sound_field_after_a_bent_one_opens_the_heading(
    more_norm, more_dip, share, is_opened, norm, dip
):
    s, w, _ = known()
    s.mag_offset_norm, s.mag_offset_dip = norm, dip
    g = gains(mag_heading_gate=9.0)
    shown(w, field((1.0 + more_norm) * NORM, DIP + more_dip))
    # what bends norm and dip by 0.1 turns the heading by as much of the horizontal part
    turned_2 = 0.1**2 / (2.0 * (math.cos(DIP) + 0.01) ** 2)
    innovation = share * 3.0 * math.sqrt(turned_2)
    said = heading_contradicts(s, w, g, innovation, 0.1)
    assert said == (0.0 if is_opened else 1.0)
    assert s.heading_variance == pytest.approx(VARIANCE + (turned_2 if is_opened else 0.0))


# --- what a heading corrects ------------------------------------------------------------------


@pytest.mark.parametrize("aided", [0.0, 1.0])
def test_a_heading_is_corrected_by_the_share_of_its_variance(aided):
    s, w, _ = known()
    s.aided = aided
    g = gains(mag_noise=0.1 * VARIANCE, mag_correlation=0.0, gyro_noise=0.0, jitter_share=0.0,
              offset_variance=0.0)  # fmt: skip
    shown(w, field())
    measure_heading(s, w, g, 1.0 * DEG, 0.1, 0.0)
    assert s.heading_variance == pytest.approx(0.5 * VARIANCE)
    assert s.heading_turned == pytest.approx(0.5 * DEG, rel=1e-3)


@pytest.mark.parametrize(
    ("given", "is_carried", "learns"),
    [(1.0, 1.0, True), (0.0, 1.0, False), (1.0, 0.0, False)],
)
def test_sizes_of_the_parts_of_a_given_field_show_its_offset(given, is_carried, learns):
    s, w, _ = known(given=given)
    s.aided = 1.0
    variance = 1e-2
    s.p_offset[0] = s.p_offset[3] = s.p_offset[5] = variance
    ned = field() + 0.05 * NORM * DOWN
    shown(w, ned)
    for _ in range(400):
        measure_heading(s, w, gains(mag_noise=1e3), 0.0, 1.0, is_carried)
        shown(w, ned - NORM * np.array(s.field_offset[:]))
    assert s.field_offset[2] == pytest.approx(0.05 if learns else 0.0, abs=4e-3)
    assert (s.p_offset[5] < 0.1 * variance) is learns
    assert (s.p_offset[0] < 0.1 * variance) is learns
    assert s.p_offset[3] == pytest.approx(variance, rel=0.1)  # east: across the field


@pytest.mark.parametrize(
    ("norm", "dip", "shown_s", "is_opened", "is_iron"),
    [
        # 8 times the variance of a calibration, by norm and dip together
        (2.84, 0.0, 2.0, True, True),
        (2.82, 0.0, 2.0, False, False),
        (2.84, 0.0, 1.9, False, False),
        (0.0, -2.84, 2.0, True, False),
        (2.1, 2.1, 2.0, True, False),
        (1.9, -2.0, 2.0, False, False),
    ],
)
def test_an_offset_that_norm_and_dip_show_is_doubted(norm, dip, shown_s, is_opened, is_iron):
    deviation = 0.02
    s, w, _ = known()
    s.mag_offset_norm, s.mag_offset_dip, s.mag_offset_s = norm * deviation, dip * deviation, shown_s
    s.iron_shown = 1.0  # of one that is known by now
    doubt_offset(s, w, gains(offset_variance=deviation**2))
    assert (s.mag_offset_s == 0.0) is is_opened
    if is_opened:
        assert s.p_offset[0] == pytest.approx((norm**2 + dip**2) * deviation**2)
        assert (s.mag_offset_norm, s.mag_offset_dip) == (0.0, 0.0)
    assert s.iron_shown == float(is_iron)


@pytest.mark.parametrize(("share", "is_opened"), [(0.99, True), (1.01, False)])
def test_an_offset_is_not_doubted_where_it_is_known_as_badly(share, is_opened):
    s, w, _ = known()
    s.mag_offset_norm, s.mag_offset_s = 0.1, 5.0
    s.p_offset[0], s.p_offset[3], s.p_offset[5] = (share * 0.01 * part for part in (0.5, 0.3, 0.2))
    doubt_offset(s, w, gains(offset_variance=0.02**2))
    assert (s.mag_offset_s == 0.0) is is_opened


def test_no_offset_is_doubted_where_none_is_looked_for():
    s, w, _ = known()
    s.mag_offset_norm, s.mag_offset_s = 0.1, 5.0
    doubt_offset(s, w, gains(offset_variance=0.0))
    assert s.mag_offset_s == 5.0


@pytest.mark.parametrize(
    ("changes", "learns"),
    [
        ({}, True),
        ({"rest_prior": 1.0}, False),
        ({"dt_s": 0.022}, True),
        ({"dt_s": 0.023}, False),
        ({"clipped": 2.0}, False),
    ],
)
def test_norm_and_dip_show_an_offset_while_fast_samples_carry_the_tilt_in_the_air(changes, learns):
    s, w, sample = known()
    s.aided = 1.0
    s.p_offset[0] = s.p_offset[3] = s.p_offset[5] = 1e-4
    for name, value in changes.items():
        setattr(sample, name, value)
    assert used(s, w, sample, field() + 0.01 * NORM * DOWN) == FIELD_USED
    assert (s.field_offset[2] > 1e-6) is learns
