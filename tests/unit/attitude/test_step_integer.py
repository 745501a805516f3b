"""What a sample adds to its frame in integers: rates, jitter, force and corrections."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.kernel.step import (
    STEP_MAX,
    drain,
    note_force,
    rates,
    weighed,
)
from h2nav.attitude.velocity_aided.integer.kernel.told import remove_fix_delay, set_place
from h2nav.attitude.velocity_aided.integer.memory import (
    GAINED_MASK,
    RATE_IS_FINE,
    Gains,
    Sample,
    State,
)

RAD_S = 1e-6 * 2.0**40  # a sample's rate
COARSE = 1e-6 * 2.0**31  # that of the sample before
FREE = 1e-6 * 2.0**29  # a rate less its bias
G8, G20 = 2.0**8, 2.0**20
Q14, Q26, Q28, Q30 = 2.0**14, 2.0**26, 2.0**28, 2.0**30


def sampled(gyro=(0.0, 0.0, 0.0), accel=(0.0, 0.0, -1.0), parts=1, is_held=0):
    u = Sample()
    u.gyro[:] = [round(part * RAD_S) for part in gyro]
    u.accel[:] = [round(part * G20) for part in accel]
    u.parts, u.is_held = parts, is_held
    return u


def noted(s, u):
    within, free = [0, 0, 0], [0, 0, 0]
    rates(s, u, within, free)
    return within, free


def test_a_rate_is_kept_within_its_limit_and_loses_its_bias():
    s = State()
    bias = (0.1, -0.05, 0.02)
    s.gyro_bias[:] = [round(part * 1e-6 * 2.0**52) for part in bias]
    within, free = noted(s, sampled((0.5, -1.5, 40.0)))
    assert np.array(within) / (0.5 * RAD_S) == pytest.approx((0.5, -1.5, 35.0), rel=1e-6)
    assert np.array(free) / FREE == pytest.approx((0.4, -1.45, 34.98), abs=1.0 / FREE)
    assert np.array(s.gyro_last[:]) / COARSE == pytest.approx((0.5, -1.5, 35.0), rel=2e-3)
    # the mean square over a frame of 16 samples, of which one is there
    assert s.turning_sum * 32 / FREE**2 == pytest.approx(0.4**2 + 1.45**2 + 34.98**2, rel=2e-3)


def test_a_rate_jitters_by_its_second_differences():
    s = State()
    for x in (0.0, 0.2, 0.4, 0.1):
        if x == 0.4:
            s.jitter_sum = 0
        noted(s, sampled((x, 0.0, -x)))
    # 0.4 after 0 and 0.2 is a straight line, 0.1 bends it by 0.5; about two axes
    assert s.jitter_sum == pytest.approx(2.0 * (0.5 * COARSE / 16.0) ** 2, rel=0.02)
    assert s.gyro_step[0] / COARSE == pytest.approx(-0.3, rel=0.01)
    held = s.jitter_sum
    noted(s, sampled((3.0, 0.0, 0.0), is_held=1))
    assert s.jitter_sum == held, "further parts of a sample are no samples"


@pytest.mark.parametrize(
    ("change", "shows"), [(0, 0), (1, RATE_IS_FINE), (2, 1), (-1, RATE_IS_FINE)]
)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_rate_is_fine_that_changes_by_one_unit(change, shows, axis):
    s, u = State(), Sample()
    u.parts = 1
    noted(s, u)
    s.rate_shows = 0
    u.gyro[axis] = change << 9
    noted(s, u)
    assert s.rate_shows == shows


@pytest.mark.parametrize(
    ("square", "parts", "counted"),
    [
        (1 << 24, 1, 1 << 24),
        ((1 << 24) + 1, 1, 1 << 24),
        (1000, 2, 4000),
        (1000, 8, 64_000),
        (1 << 24, 2, 1 << 26),
        (1 << 24, 3, 1 << 26),
    ],
)
def test_a_long_sample_counts_by_the_square_of_its_parts(square, parts, counted):
    assert weighed(square, parts) == counted


def test_a_force_jitters_by_its_second_differences():
    s = State()
    for z in (0.0, 1.0, 2.0, 3.0, 3.0):
        note_force(s, sampled(accel=(0.5 * z, -0.25 * z, z)))
    bent = 0.5**2 + 0.25**2 + 1.0
    # one at the first sample and one at the last
    assert s.force_sum / G8**2 == pytest.approx(2.0 * bent, rel=1e-3)
    assert s.accel_last[:] == [384, -192, 768]
    assert s.accel_step[:] == [0, 0, 0]
    note_force(s, sampled(accel=(2.5, -0.75, 3.0), parts=2))
    assert s.accel_step[:] == [256, 0, 0]
    assert s.force_sum / G8**2 == pytest.approx(2.0 * bent + 4.0, rel=1e-3)


# --- corrections -----------------------------------------------------------------------------


def test_a_correction_is_drained_in_steps_and_turned_with_the_body():
    attitude = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
    s, r = State(), [0] * 9
    x, y, z, w = attitude.as_quat().tolist()
    s.q_nb[:] = [round(part * 2.0**29) for part in (w, x, y, z)]
    rotation(s.q_nb, r)
    e = np.array((0.001, -0.002, 0.0015))  # half radians
    s.correction[:] = [round(part * Q30) for part in e]
    s.heading_turned = GAINED_MASK
    s.turn_carry[:] = [1000, 2000, 3000]
    drain(s, r)
    turned = np.array(s.turn_carry[:]) - (1000, 2000, 3000)
    assert turned / Q30 == pytest.approx(attitude.inv().apply(e), abs=2e-6)
    assert all(0 <= part < 1 << 11 for part in s.correction)
    assert s.heading_turned == pytest.approx(0.0015 * 2.0**19 - 1, abs=1)


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_step_corrects_by_four_degrees_at_most(sign):
    s, r = State(), [32767, 0, 0, 0, 32767, 0, 0, 0, 32767]
    s.correction[:] = [0, sign << 29, 0]
    drain(s, r)
    step = 2.0 * s.turn_carry[1] / Q30 * 180.0 / math.pi
    assert step == pytest.approx(sign * 3.93, abs=0.02)
    assert s.correction[1] == (sign << 29) - sign * (STEP_MAX << 11)


# --- what a program tells --------------------------------------------------------------------


@pytest.mark.parametrize("declination_deg", [0.0, 20.0, -150.0])
@pytest.mark.parametrize("down", [0.6, -0.3])
def test_a_field_of_a_model_becomes_the_reference(declination_deg, down):
    s = State()
    s.age_us, s.mag_new_us = -1, 7
    angle, flat = math.radians(declination_deg), 0.35
    parts = (flat * math.cos(angle), flat * math.sin(angle), down)
    set_place(s, Gains(), *(round(part * Q14) for part in parts))
    assert s.declination / Q28 == pytest.approx(angle, abs=3e-4)
    assert s.declination_cosine / Q14 == pytest.approx(math.cos(angle), abs=2e-3)
    assert s.declination_sine / Q14 == pytest.approx(math.sin(angle), abs=2e-3)
    assert s.mag_ref_horizontal / Q26 == pytest.approx(flat, abs=1e-3)
    assert s.mag_ref_down / Q26 == pytest.approx(down, abs=1e-3)
    assert s.mag_ref_norm / Q26 == pytest.approx(math.hypot(flat, down), abs=1e-3)
    assert (s.mag_ref_given, s.mag_new_us) == (1, 0)
    # An attitude that is not known yet is not turned.
    assert s.correction[2] == 0


@pytest.mark.parametrize(
    ("changes", "is_turned"),
    [({}, True), ({"aided": 1}, False), ({"heading_reset": 1}, False), ({"age_us": -1}, False)],
)
def test_a_declination_turns_a_heading_by_the_field(changes, is_turned):
    s = State()
    for name, value in changes.items():
        setattr(s, name, value)
    set_place(s, Gains(), round(0.3 * Q14), round(0.1 * Q14), round(0.5 * Q14))
    turned = math.atan2(0.1, 0.3) * 2.0**29 if is_turned else 0.0
    assert s.correction[2] == pytest.approx(turned, rel=1e-3)


def test_a_field_of_nothing_has_no_declination():
    s = State()
    set_place(s, Gains(), 0, 0, round(0.5 * Q14))
    assert (s.declination, s.correction[2]) == (0, 0)
    assert s.mag_ref_norm / Q26 == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize(
    ("lag_s", "before_s", "removed_s", "left_s", "kept_s"),
    [
        (0.2, 0.0, 0.15, 0.05, 0.15),
        (0.05, 0.15, 0.0, 0.2, 0.0),
        (0.05, 0.15, 0.25, -0.05, 0.25),  # too much was removed
        (0.2, 0.0, 0.6, -0.3, 0.5),  # half a second at most
        (0.2, 0.0, -0.1, 0.2, 0.0),
        (0.25, 0.2, 0.0, 0.3, 0.0),  # the filter's own limit
        (-0.1, 0.2, 0.0, 0.1, 0.0),
    ],
)
def test_a_removed_delay_is_no_longer_the_fixes(lag_s, before_s, removed_s, left_s, kept_s):
    s, g = State(), Gains()
    g.fix_lag_limit = round(0.3 * Q30)
    s.fix_lag, s.fix_removed = round(lag_s * Q30), round(before_s * Q30)
    remove_fix_delay(s, g, round(removed_s * Q30))
    assert s.fix_lag / Q30 == pytest.approx(left_s, abs=1e-8)
    assert s.fix_removed / Q30 == pytest.approx(kept_s, abs=1e-8)
