"""Which field is used and what it shows, in integers: just enough, and just too little."""

import math
from dataclasses import replace

import pytest
from velocity_flights import GAINS

from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel.functions import logarithm
from h2nav.attitude.velocity_aided.integer.kernel.heading import (
    CONTRADICTS,
    count_turn,
    doubt_heading,
    find_errors,
    judge_field,
    judge_heading,
    learn_field,
    note_scatter,
    prepare_heading,
    turn_heading,
)
from h2nav.attitude.velocity_aided.integer.kernel.start import reset
from h2nav.attitude.velocity_aided.integer.kernel.told import set_place
from h2nav.attitude.velocity_aided.integer.memory import MAX_REJECTED, State
from h2nav.attitude.velocity_aided.units import HEADING_UNIT_RAD

DEG = math.pi / 180.0
NORM, DIP = 0.8, 60.0 * DEG  # in units of 64 uT
FIELD, REFERENCE, Q28, Q15 = 2.0**14, 2.0**26, 2.0**28, 2.0**15
AGE_US = 160_000


def gains(**limits):
    kernel = replace(GAINS.kernel, **limits)
    return integer_gains(GAINS._replace(kernel=kernel), "a test").gains


def shown(s, norm=1.0, dip_deg=60.0, heading_deg=0.0):
    """The field of a frame, as shares of the reference's norm."""
    flat, down = norm * NORM * math.cos(dip_deg * DEG), norm * NORM * math.sin(dip_deg * DEG)
    s.mag_horizontal, s.mag_norm = round(flat * FIELD), round(norm * NORM * FIELD)
    s.mag_ned[:] = [
        round(flat * math.cos(heading_deg * DEG) * FIELD),
        round(flat * math.sin(heading_deg * DEG) * FIELD),
        round(down * FIELD),
    ]
    s.mag_heading = round(heading_deg * DEG * Q28)
    s.mag_last[:] = s.mag_ned[:]
    s.mag_frame_us, s.mag_accepted = AGE_US, 0


def known(given=1, g=None):
    s = State()
    reset(s, g or gains())
    s.mag_ref_norm = round(NORM * REFERENCE)
    s.mag_ref_horizontal = round(NORM * math.cos(DIP) * REFERENCE)
    s.mag_ref_down = round(NORM * math.sin(DIP) * REFERENCE)
    s.mag_ref_given, s.heading_reset = given, 0
    s.declination_cosine, s.declination_sine = 1 << 14, 0
    shown(s)
    return s


# --- which field is used ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("norm", "dip_deg", "is_used"),
    [
        (1.0, 60.0, True), (1.099, 60.0, True), (1.101, 60.0, False), (0.901, 60.0, True),
        (0.899, 60.0, False), (1.0, 69.9, True), (1.0, 70.1, False), (1.0, 50.1, True),
        (1.0, 49.9, False), (1.0, -120.0, False), (1.0, -60.0, False),
    ],
)  # fmt: skip
@pytest.mark.parametrize("reset_", [0, 1])
def test_a_field_has_to_be_like_its_reference(norm, dip_deg, is_used, reset_):
    s = known()
    shown(s, norm, dip_deg)
    s.heading_reset = reset_
    judge_field(s, gains())
    assert s.mag_accepted == (1 if is_used else 0)
    assert s.mag_frame_us == (AGE_US if is_used else 0)
    assert s.mag_new_us == (0 if is_used else AGE_US)


def test_a_dip_on_the_other_side_of_the_vertical_is_another_one():
    s = known()
    s.mag_ned[2], s.mag_horizontal = -s.mag_ned[2], s.mag_horizontal
    judge_field(s, gains())
    assert s.mag_accepted == 0


def test_where_the_heading_is_lost_any_field_gives_it():
    s = known()
    shown(s, 0.5, 20.0)
    s.heading_reset = 2
    judge_field(s, gains())
    assert (s.mag_accepted, s.mag_frame_us) == (1, AGE_US)


def test_a_field_of_nothing_shows_nothing():
    s = known()
    shown(s, 0.0)
    judge_field(s, gains())
    assert (s.mag_accepted, s.mag_frame_us) == (0, 0)


def test_the_first_field_is_the_reference():
    s = known()
    s.mag_ref_norm = s.mag_ref_down = s.mag_ref_horizontal = 0
    shown(s, 1.2, -40.0)
    judge_field(s, gains())
    assert s.mag_accepted == 1
    found = [part / REFERENCE for part in (s.mag_ref_norm, s.mag_ref_horizontal, s.mag_ref_down)]
    expected = (1.0, math.cos(40.0 * DEG), -math.sin(40.0 * DEG))
    assert found == pytest.approx([1.2 * NORM * part for part in expected], abs=1e-4)


def steady(s, g, seconds, turn, dip_deg=30.0):
    """Another field for so long, in which the field turns in body axes by steps of 0.5 rad."""
    turned = 0.0
    for number in range(round(seconds * 1e6 / AGE_US)):
        shown(s, 1.15, dip_deg)
        if turned < turn - 1e-9:
            turned += 0.5
        angle = turned
        flat = 1.15 * NORM * FIELD
        s.mag_last[:] = [round(flat * math.cos(angle)), round(flat * math.sin(angle)), 0]
        judge_field(s, g)
        if s.mag_accepted:
            return (number + 1) * AGE_US * 1e-6
    return None


@pytest.mark.parametrize(
    ("seconds", "turn", "is_taken"),
    [(20.2, 7.0, True), (19.8, 7.0, False), (25.0, 6.0, False), (25.0, 7.0, True)],
)
def test_another_field_becomes_the_reference_after_time_and_turns(seconds, turn, is_taken):
    g = gains(mag_new_time_s=20.0, mag_new_turn=math.tau)
    s = known(g=g)
    s.mag_lag_num, s.mag_lag_den, s.p_xh, s.heading_variance = 1, 2, 3, 4
    assert (steady(s, g, seconds, turn) is not None) is is_taken
    if is_taken:
        assert s.mag_ref_norm / REFERENCE == pytest.approx(1.15 * NORM, rel=1e-3)
        assert s.mag_ref_down / s.mag_ref_norm == pytest.approx(0.5, abs=1e-3)
        assert s.mag_ref_horizontal / s.mag_ref_norm == pytest.approx(math.sqrt(0.75), abs=1e-3)
        assert (s.mag_ref_given, s.mag_new_us, s.mag_lag_num, s.mag_lag_den, s.p_xh) == (0,) * 5
        assert s.heading_variance == g.heading_variance
    else:
        assert (s.mag_ref_given, s.p_xh) == (1, 3)
        assert s.mag_ref_norm == round(NORM * REFERENCE)


@pytest.mark.parametrize(
    ("norm", "dip_deg", "is_same"),
    [
        (1.2, 60.0, True), (1.255, 60.0, True), (1.265, 60.0, False), (1.145, 60.0, True),
        (1.135, 60.0, False), (1.2, 64.9, True), (1.2, 65.1, False), (1.2, 55.1, True),
        (1.2, 54.9, False),
    ],
)  # fmt: skip
def test_another_field_has_to_be_steady_within_half_the_gates(norm, dip_deg, is_same):
    s, g = known(), gains()
    shown(s, 1.2, 60.0)
    judge_field(s, g)
    s.mag_new_turn = 1 << 16
    shown(s, norm, dip_deg)
    s.mag_frame_us = 3 * AGE_US
    judge_field(s, g)
    assert s.mag_new_us == (4 if is_same else 3) * AGE_US
    mean = 0.75 if is_same else 1.0
    assert s.mag_new_norm / REFERENCE == pytest.approx(NORM * (1.2 + mean * (norm - 1.2)), rel=1e-3)
    parts = s.mag_new_horizontal, s.mag_new_down
    for part, function in zip(parts, (math.cos, math.sin), strict=True):
        first, second = 1.2 * function(DIP), norm * function(dip_deg * DEG)
        expected = NORM * (first + mean * (second - first))
        assert part / REFERENCE == pytest.approx(expected, abs=1e-3)
    assert s.mag_new_turn == (1 << 16 if is_same else 0)


def test_a_field_like_the_reference_ends_the_count_of_another():
    s, g = known(), gains()
    shown(s, 1.2)
    judge_field(s, g)
    shown(s)
    judge_field(s, g)
    assert (s.mag_accepted, s.mag_new_us) == (1, 0)


@pytest.mark.parametrize(("angle", "counts"), [(0.34, False), (0.365, True)])
@pytest.mark.parametrize("axis", range(3))
def test_a_turn_counts_once_it_is_more_than_noise(angle, counts, axis):
    s = known()
    before, after = [0, 0, 0], [0, 0, 0]
    before[axis] = s.mag_norm
    after[axis] = round(s.mag_norm * math.cos(angle))
    after[axis - 1] = round(-s.mag_norm * math.sin(angle))
    s.mag_new_from[:], s.mag_last[:] = before, after
    count_turn(s)
    chord = 2.0 * math.sin(0.5 * angle)
    assert s.mag_new_turn / 2.0**16 == pytest.approx(chord if counts else 0.0, rel=0.01)
    assert s.mag_new_from[:] == (after if counts else before)


# --- what a field shows -----------------------------------------------------------------------


@pytest.mark.parametrize("norm", [0.92, 1.0, 1.07])
@pytest.mark.parametrize("dip_deg", [53.0, 60.0, 68.0])
def test_errors_of_norm_and_dip(norm, dip_deg):
    s, errors = known(), [0, 0]
    shown(s, norm, dip_deg)
    find_errors(s, errors)
    assert errors[0] / Q15 == pytest.approx(norm - 1.0, abs=2e-4)
    assert errors[1] / Q15 == pytest.approx(math.sin((dip_deg - 60.0) * DEG), abs=3e-4)


@pytest.mark.parametrize(
    ("newest", "error"),
    # of one field alone; where that is refused, of the mean
    [(1.06, 0.06), (0.94, -0.06), (1.093, 0.093), (1.12, 0.03), (0.88, 0.03)],
)
def test_the_newest_field_shows_the_scatter(newest, error):
    s = known()
    shown(s, 1.03)
    s.mag_last[:] = [0, round(newest * NORM * FIELD), 0]
    note_scatter(s, gains())
    # (n^2 - 1) / 2 instead of n - 1
    assert s.mag_one_error / Q15 == pytest.approx(error, abs=0.5 * error * error + 1e-3)


def learnt(norm, dip_deg, given=1, age_us=AGE_US, one=None):
    s, errors = known(given), [0, 0]
    g = gains(level_time_s=0.1, mag_ref_time_s=1.44)
    shown(s, norm, dip_deg)
    find_errors(s, errors)
    s.mag_one_error = errors[0] if one is None else round(one * Q15)
    for _ in range(80 if given else 1):
        learn_field(s, g, age_us, errors)
    return s


@pytest.mark.parametrize(("norm", "dip_deg"), [(1.06, 60.0), (1.0, 64.0), (0.95, 57.0)])
def test_the_disturbance_of_the_heading_is_as_large_as_that_of_norm_and_dip(norm, dip_deg):
    s = learnt(norm, dip_deg)
    more_dip = math.sin((dip_deg - 60.0) * DEG)
    cosine = math.cos(dip_deg * DEG)
    expected = ((norm - 1.0) ** 2 + more_dip**2) / (2.0 * cosine**2)
    assert s.mag_disturbance / 2.0**26 == pytest.approx(expected, rel=0.08)


def test_a_mean_hides_scatter_that_single_fields_show():
    s = learnt(1.0, 60.0, one=0.05)
    # by as much as the norm shows, the dip scatters
    expected = 2.0 * 0.05**2 / (2.0 * math.cos(DIP) ** 2)
    assert s.mag_disturbance / 2.0**26 == pytest.approx(expected, rel=0.08)


@pytest.mark.parametrize("given", [0, 1])
def test_only_a_learnt_reference_follows_the_field(given):
    s = learnt(1.05, 60.0, given)
    share = 0.0 if given else 0.1
    assert s.mag_ref_norm / REFERENCE == pytest.approx(NORM * (1.0 + 0.05 * share), rel=1e-4)
    flat = NORM * math.cos(DIP) * (1.0 + 0.05 * share)
    assert s.mag_ref_horizontal / REFERENCE == pytest.approx(flat, rel=1e-4)
    down = NORM * math.sin(DIP) * (1.0 + 0.05 * share)
    assert s.mag_ref_down / REFERENCE == pytest.approx(down, rel=1e-4)


# --- the heading by the field -----------------------------------------------------------------


@pytest.mark.parametrize(
    ("reset_", "error_deg", "turns", "after", "accepted"),
    [
        (1, 40.0, True, 0, 0),
        (1, -51.0, True, 0, 0),
        (1, 53.0, True, 1, 0),  # more than 0.9 rad at once: the rest with the next field
        (1, -53.0, True, 1, 0),
        (2, 40.0, True, 0, 3),
        (2, 53.0, True, 2, 3),
        (0, 40.0, False, 0, 2),
    ],
)
def test_the_first_field_gives_the_heading(reset_, error_deg, turns, after, accepted):
    s = known()
    shown(s, heading_deg=-error_deg)
    s.heading_reset, s.velocity_n = reset_, 77
    prepare_heading(s, gains())
    assert (s.heading_reset, s.mag_accepted) == (after, accepted)
    turned = s.heading_added / 2.0**29
    most = 0.9 if turns else 0.0
    assert turned == pytest.approx(max(min(error_deg * DEG, most), -most), abs=1e-4)
    assert s.velocity_n == (0 if turns else 77)
    if not turns:
        assert s.heading_innovation / Q28 == pytest.approx(error_deg * DEG, abs=1e-4)


def test_a_heading_from_the_field_alone_forgets():
    s, g = known(), gains()
    s.velocity_n = s.velocity_e = s.p_xh = s.p_yh = s.p_zh = 5
    s.dtilt_n[:] = s.dvelocity_e[:] = [1, 2, 3, 4]
    turn_heading(s, g, round(0.3 * Q28))
    assert s.heading_added / 2.0**29 == pytest.approx(0.3, abs=1e-6)
    assert (s.velocity_n, s.velocity_e, s.p_xh, s.p_yh, s.p_zh) == (0,) * 5
    assert s.dtilt_n[:] == s.dvelocity_e[:] == [0] * 4
    assert (s.fixes_rejected, s.heading_variance) == (MAX_REJECTED, g.heading_variance)


def contradicting(share, *, given=1, witnessed=0, gate=9.0, inflation=0, rejected_us=0):
    """A heading that is off by so many times what is allowed of a known noise."""
    g = gains(mag_heading_gate=gate)
    s = known(given)
    s.heading_witnessed, s.heading_rejected_us = witnessed, rejected_us
    s.log_startup_inflation, s.mag_accepted = inflation, 2
    noise = 0.01
    s.heading_noise, s.gain_variance, s.mag_disturbance = round(noise * 2.0**26), 0, 0
    s.heading_innovation = round(share * 3.0 * math.sqrt(noise) * Q28)
    judge_heading(s, g)
    return s


@pytest.mark.parametrize(
    ("share", "changes", "accepted"),
    [
        (0.97, {}, 2),
        (1.03, {}, CONTRADICTS),
        (-0.97, {}, 2),
        (-1.03, {}, CONTRADICTS),
        (1.03, {"gate": 0.0}, 2),
        (1.03, {"given": 0}, 2),  # the learnt reference may be wrong instead
        (1.03, {"given": 0, "witnessed": 1}, 0),
        (1.03, {"witnessed": 1}, 0),
        (1.03, {"inflation": 256}, CONTRADICTS),
        (1.03, {"inflation": 257}, 2),  # at the start
    ],
)
def test_a_heading_that_differs_by_three_deviations_contradicts(share, changes, accepted):
    s = contradicting(share, **changes)
    assert s.mag_accepted == accepted
    assert s.mag_frame_us == (AGE_US if accepted == 2 else 0)
    assert s.heading_rejected_us == (AGE_US if accepted == CONTRADICTS else 0)
    assert s.log_heading_noise == pytest.approx(-256 * math.log2(AGE_US * 1e-6), abs=8)


@pytest.mark.parametrize(("before_s", "is_lost"), [(19.8, False), (19.9, True)])
def test_a_contradiction_that_lasts_gives_the_heading_to_the_next_field(before_s, is_lost):
    s = contradicting(1.1, rejected_us=round(before_s * 1e6))
    assert s.heading_reset == (2 if is_lost else 0)
    assert (s.heading_rejected_us == 0) is is_lost


@pytest.mark.parametrize(
    ("error", "share", "is_opened"),
    [
        ((0.0, 0.0), 0.96, True),
        ((0.0, 0.0), 1.04, False),  # more than the third component of the bent field
        ((0.033, 0.0), 0.9, True),  # a third of what the bent one had
        ((0.034, 0.0), 0.9, False),
        ((-0.034, 0.0), 0.9, False),
        ((0.0, 0.033), 0.9, True),
        ((0.0, -0.034), 0.9, False),
    ],
)
@pytest.mark.parametrize(("norm", "dip"), [(0.1, 0.0), (0.06, -0.08)])
def test_a_sound_field_after_a_bent_one_opens_the_heading(error, share, is_opened, norm, dip):
    g = gains(mag_heading_gate=9.0)
    s = known()
    s.mag_offset_norm, s.mag_offset_dip = round(norm * 2.0**26), round(dip * 2.0**26)
    turned_2 = 0.1**2 / (2.0 * (math.cos(DIP) + 0.01) ** 2)
    s.heading_innovation = round(share * 3.0 * math.sqrt(turned_2) * Q28)
    s.heading_rejected_us, s.heading_variance = 5, 1000
    doubt_heading(s, g, [round(part * Q15) for part in error])
    assert (s.heading_rejected_us == 0) is is_opened
    opened = (s.heading_variance - 1000) / Q28 * HEADING_UNIT_RAD**2
    assert opened == pytest.approx(turned_2 if is_opened else 0.0, rel=0.02)


def test_the_noise_of_the_heading_is_that_of_field_and_tilt():
    """The tilt's deviation, times the slope of the dip."""
    s, g = known(), gains()
    s.log_gyro_noise = logarithm(1 << 20) - (40 << 8)
    s.log_velocity_noise = logarithm(1 << 20) - (14 << 8)
    prepare_heading(s, g)
    tilt = math.sqrt(2.0**-20 * 2.0**6)
    found = (s.heading_noise - g.mag_noise) / 2.0**26
    assert found == pytest.approx(2.0 * math.tan(DIP) ** 2 * tilt, rel=0.03)


@pytest.mark.parametrize("declination_deg", [0.0, 90.0, 180.0, 30.0])
def test_the_heading_depends_on_theta_by_the_tilt_that_it_has_made(declination_deg):
    s, g = known(), gains()
    angle = declination_deg * DEG
    s.declination_cosine = round(math.cos(angle) * 2.0**14)
    s.declination_sine = round(math.sin(angle) * 2.0**14)
    s.dtilt_n[:] = [1 << 20, 2 << 20, 3 << 20, 4 << 20]
    s.dtilt_e[:] = [5 << 20, -6 << 20, 7 << 20, -8 << 20]
    prepare_heading(s, g)
    slope = math.tan(DIP)
    expected = [
        slope * (math.sin(angle) * n - math.cos(angle) * e)
        for n, e in zip(s.dtilt_n[:], s.dtilt_e[:], strict=True)
    ]
    expected[3] += HEADING_UNIT_RAD * Q28
    assert s.jacobian[:] == pytest.approx(expected, abs=3e-4 * Q28 / 4.0, rel=1e-3)


@pytest.mark.parametrize(
    ("declination_deg", "fields_turn"),
    [(57.0, False), (58.0, True), (-57.0, False), (-58.0, True), (170.0, True)],
)
def test_a_place_turns_the_heading_by_a_radian_and_its_fields_by_the_rest(
    declination_deg, fields_turn
):
    g, angle = gains(), declination_deg * DEG
    s = known(g=g)
    s.age_us = 30_000_000
    flat, down = NORM * math.cos(DIP) * FIELD, NORM * math.sin(DIP) * FIELD
    parts = (flat * math.cos(angle), flat * math.sin(angle), down)
    set_place(s, g, *map(round, parts))
    assert s.declination == pytest.approx(angle * Q28, rel=1e-3)
    assert s.correction[2] == pytest.approx(max(-1.0, min(1.0, angle)) * 2.0**29, rel=1e-3)
    assert s.heading_reset == int(fields_turn)
