"""The first attitude of the filter in integers, and that after a gap: at both sides."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from velocity_flights import GAINS

from h2nav.attitude.integer.motion import rotation
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel.start import (
    align,
    begin_anew,
    reset,
    restart,
    resume,
)
from h2nav.attitude.velocity_aided.integer.memory import (
    AGE_MAX_US,
    ALIGNED,
    MAX_REJECTED,
    RESTARTED,
    Sample,
    State,
)

DEG = math.pi / 180.0
FIELD_N = np.array((0.35, 0.0, 0.6))  # in units of 64 uT
ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))
Q28 = 2.0**28


def gains(**limits):
    kernel = replace(GAINS.kernel, **limits)
    return integer_gains(GAINS._replace(kernel=kernel), "a test").gains


def known(g=None):
    s = State()
    reset(s, g or gains())
    return s


def sampled(attitude=ATTITUDE, field=FIELD_N, **how):
    """At rest in this attitude."""
    u = Sample()
    u.accel[:] = [round(part * 2.0**20) for part in attitude.inv().apply((0.0, 0.0, -1.0))]
    if field is not None:
        u.mag[:] = [round(part * 2.0**14) for part in attitude.inv().apply(field)]
        u.has_mag = 1
    for name, value in how.items():
        setattr(u, name, value)
    return u


def attitude_of(s):
    return Rotation.from_quat(np.roll(np.array(s.q_nb[:], float), -1))


def error(s, attitude=ATTITUDE):
    return (attitude_of(s) * attitude.inv()).magnitude()


# --- the first --------------------------------------------------------------------------------


@pytest.mark.parametrize("strength", [0.5, 1.0, 2.2])
def test_one_sample_with_a_field_gives_the_attitude(strength):
    s, g = known(), gains()
    assert align(s, g, sampled(field=strength * FIELD_N)) == ALIGNED | RESTARTED
    assert error(s) < 2e-3
    assert (s.age_us, s.heading_reset, s.field_silence_us) == (0, 0, 0)
    assert s.extra_tilt_sigma / Q28 == pytest.approx(0.1)
    assert s.heading_variance == g.heading_variance
    assert s.fixes_rejected == MAX_REJECTED


@pytest.mark.parametrize("clipped", [1, 2])
def test_a_sample_without_a_force_gives_none(clipped):
    s = known()
    assert align(s, gains(), sampled(clipped=clipped)) == 0
    assert s.age_us == -1


@pytest.mark.parametrize("has_force", [False, True])
def test_a_force_of_zero_shows_no_vertical(has_force):
    s, u = known(), sampled()
    if not has_force:
        u.accel[:] = [0, 0, 0]
    assert (align(s, gains(), u) != 0) is has_force


@pytest.mark.parametrize(("steps", "gives"), [(24, False), (25, True)])
def test_without_a_field_it_waits_a_quarter_of_a_second_and_the_nose_points_north(steps, gives):
    s, g = known(), gains()
    bits = [align(s, g, sampled(field=None, dt_us=10_000)) for _ in range(steps)]
    assert bits == [0] * (steps - 1) + [ALIGNED | RESTARTED if gives else 0]
    if gives:
        found = attitude_of(s).as_matrix()
        assert found[2] == pytest.approx(ATTITUDE.as_matrix()[2], abs=1e-3)
        assert found[1, 0] == pytest.approx(0.0, abs=1e-3)
        assert found[0, 0] > 0.5
        assert (s.heading_reset, s.field_silence_us) == (1, AGE_MAX_US)


@pytest.mark.parametrize(("pitch_deg", "north"), [(44.0, 0), (46.0, 2), (90.0, 2), (-90.0, 2)])
def test_of_a_vehicle_on_its_tail_the_belly_points_north(pitch_deg, north):
    """Its nose has hardly a direction."""
    attitude = Rotation.from_euler("ZYX", (0.7, pitch_deg * DEG, 0.0))
    s = known()
    assert align(s, gains(), sampled(attitude, None, dt_us=250_000)) == ALIGNED | RESTARTED
    found = attitude_of(s).as_matrix()
    assert found[2] == pytest.approx(attitude.as_matrix()[2], abs=2e-3)
    assert found[1, north] == pytest.approx(0.0, abs=2e-3)
    assert found[0, north] > 0.5


@pytest.mark.parametrize(("has_field", "share"), [(True, 4.0), (False, 4.0), (False, 0.5)])
def test_without_a_field_the_prior_of_the_vertical_bias_decides(has_field, share):
    g = gains()
    s = known(g)
    s.p_xz = s.p_yz = 7
    s.p_zz = before = round(share * g.vertical_bias_variance)
    align(s, g, sampled(field=FIELD_N if has_field else None, dt_us=250_000))
    is_lowered = share > 1.0 and not has_field
    assert s.p_zz == (g.vertical_bias_variance if is_lowered else before)
    assert (s.p_xz, s.p_yz) == ((0, 0) if is_lowered else (7, 7))


@pytest.mark.parametrize(
    ("declination_rad", "turned_rad", "reset_"),
    [(0.2, 0.2, 0), (-0.4, -0.4, 0), (1.99, 1.99, 0), (2.01, 2.0, 1), (-3.0, -2.0, 1)],
)
def test_the_heading_is_that_of_true_north_and_beside_a_pole_in_parts(
    declination_rad, turned_rad, reset_
):
    s = known()
    s.declination = round(declination_rad * Q28)
    align(s, gains(), sampled())
    assert s.correction[2] / 2.0**29 == pytest.approx(turned_rad, abs=1e-4)
    assert s.heading_reset == reset_  # the fields to come give the rest


def test_of_the_time_before_only_bias_latency_and_references_are_kept():
    s, g = known(), gains()
    kept = {"p_xx": 11, "p_accel": [1, 2, 3], "fix_lag": 4, "mag_ref_norm": 5, "mag_lag_num": 6}
    names = ("gained_n", "gained_e", "aided", "fix_period_us", "dfix_lag", "mag_new_us",
             "heading_rejected_us", "heading_witnessed", "rest_us", "clipped_angle", "velocity_n",
             "velocity_carry_n", "velocity_carry_e", "innovation_power", "p_xh",
             "phase")  # fmt: skip
    for name in names:
        setattr(s, name, 1)
    for name, value in kept.items():
        if isinstance(value, list):
            getattr(s, name)[:] = value
        else:
            setattr(s, name, value)
    s.dtheta[:], s.daccel[:], s.gyro_bias[:] = [1] * 4, [1] * 2, [7, 8, 9]
    u = sampled(gyro=[1 << 20, -(1 << 20), 1 << 19])
    align(s, g, u)
    assert {name: getattr(s, name) for name in names} == dict.fromkeys(names, 0) | {"phase": 1}
    assert s.dtheta[:] == [0] * 4
    assert s.daccel[:] == [0] * 2
    assert s.gyro_bias[:] == [7, 8, 9]
    for name, value in kept.items():
        found = getattr(s, name)
        assert (found[:] if isinstance(value, list) else found) == value
    # what is low-passed begins with the sample
    assert s.gyro_lp[:] == [1 << 23, -(1 << 23), 1 << 22]
    assert s.accel_lp[:] == [part << 4 for part in u.accel[:]]
    assert s.gyro_step[:] == s.accel_step[:] == [0] * 3


# --- after a gap, and after a doubt -----------------------------------------------------------


@pytest.mark.parametrize(
    ("prior", "is_aligned", "is_kept"),
    [(0, True, True), (1, True, False), (2, True, False), (3, True, False), (0, False, False)],
)
@pytest.mark.parametrize("reset_before", [0, 1])
def test_after_a_gap_in_the_air_the_attitude_is_kept_and_doubted(
    prior, is_aligned, is_kept, reset_before
):
    s, g = known(), gains()
    align(s, g, sampled())
    s.heading_reset = reset_before
    if not is_aligned:
        s.age_us = -1
    other = Rotation.from_euler("ZYX", (-1.0, -0.4, 0.5))
    bits = resume(s, g, sampled(other, rest_prior=prior))
    assert bits == (RESTARTED if is_kept else ALIGNED | RESTARTED)
    assert error(s, ATTITUDE if is_kept else other) < 2e-3
    doubt = s.extra_tilt_sigma / Q28
    assert doubt == pytest.approx(20.0 * DEG if is_kept else 0.1, rel=1e-3)
    if is_kept:
        # the next field gives the heading, whatever its dip, if one has before
        assert s.heading_reset == (2 if reset_before == 0 else 1)


def test_a_restart_forgets_the_attitude():
    s = known()
    align(s, gains(), sampled())
    s.saturations, s.mag_age_us = 3, 5
    restart(s)
    assert (s.age_us, s.mag_age_us, s.saturations) == (-1, 0, 3)


def matrix(s):
    r = [0] * 9
    rotation(s.q_nb, r)
    return r


@pytest.mark.parametrize(
    ("angle", "suspect", "source"),
    [(0.59, 0, None), (0.61, 0, "sample"), (0.0, 2, "mean"), (0.7, 2, "mean"), (0.3, 1, None)],
)
def test_the_tilt_is_taken_from_the_force_where_it_is_the_better_guess(angle, suspect, source):
    s, g = known(), gains()
    align(s, g, sampled())
    by_sample = Rotation.from_rotvec((0.9, 0.0, 0.0)) * ATTITUDE
    by_mean = Rotation.from_rotvec((0.0, -0.9, 0.0)) * ATTITUDE
    s.accel_lp[:] = [part << 4 for part in sampled(by_mean).accel[:]]
    s.clipped_angle, s.tilt_suspect, s.extra_tilt_sigma = round(angle * Q28), suspect, 99
    s.innovation_power = 1
    begin_anew(s, sampled(by_sample), matrix(s))
    expected = {None: ATTITUDE, "sample": by_sample, "mean": by_mean}[source]
    assert attitude_of(s).as_matrix()[2] == pytest.approx(expected.as_matrix()[2], abs=2e-3)
    assert (s.clipped_angle, s.tilt_suspect, s.innovation_power) == (0, 0, 0)
    assert s.heading_reset == (0 if source is None else 2)
    assert s.extra_tilt_sigma == (round(0.1 * Q28) if source == "mean" else 99)


def test_the_bias_of_the_accelerometer_is_taken_off_the_force():
    s, g = known(), gains()
    align(s, g, sampled())
    bias = 0.04
    s.accel_bias[:] = [round(bias / (2e6 / 2.0**27) * Q28), 0]
    u = sampled()
    u.accel[0] += round(bias * 2.0**20)
    s.accel_lp[:] = [part << 4 for part in u.accel[:]]
    for suspect, angle in ((2, 0.0), (0, 0.7)):
        s.tilt_suspect, s.clipped_angle = suspect, round(angle * Q28)
        begin_anew(s, u, matrix(s))
        found = attitude_of(s).as_matrix()[2]
        assert found == pytest.approx(ATTITUDE.as_matrix()[2], abs=2e-3)
