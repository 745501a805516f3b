"""One step of the constant-gain kernel against vectors: gates, disagreement, gains, alignment."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.constant_gain.kernel.step import (
    ALIGN_TOLERANCE,
    align,
    boost_of,
    correct_bias,
    innovation,
    reset,
    restart,
    sane,
    step,
    update,
    watch,
    weighted,
)
from h2nav.attitude.constant_gain.memory import (
    ALIGNED,
    CONTRADICTED_LIMIT_US,
    DISAGREES,
    FIELD_USED,
    FORCE_USED,
    SATURATED,
    Gains,
    Sample,
    State,
)
from h2nav.attitude.integer.motion import BIAS_LIMIT, rotation

Q14, Q15, Q26, Q29, Q30 = (2.0**bits for bits in (14, 15, 26, 29, 30))
DIP = math.radians(60.0)
NORTH = np.array((math.cos(DIP), 0.0, math.sin(DIP)))
DOWN = np.array((0.0, 0.0, 1.0))
WEIGHT = 0.7  # of gravity; the rest is the field's
ATTITUDE = Rotation.from_euler("ZYX", (0.7, 0.2, -0.3))


def whole(values, unit):
    return [round(float(value) * unit) for value in values]


def gains(**changes):
    g = Gains()
    g.mag_n, g.mag_d = whole((NORTH[0], NORTH[2]), Q14)
    g.accel_weight, g.mag_weight_n, g.mag_weight_d = whole(
        (WEIGHT, (1.0 - WEIGHT) * NORTH[0], (1.0 - WEIGHT) * NORTH[2]), Q14
    )
    g.attitude_gain[:], g.bias_gain[:] = [4000, 300, 5000, -200, 6000], [2000, 100, 2500, -50, 3000]
    g.attitude_shift, g.bias_shift = 6, 10
    g.accel_tolerance = g.mag_tolerance = round(0.2 * Q26)
    g.dip_tolerance = round(0.2 * Q15)
    for name, value in changes.items():
        setattr(g, name, value)
    return g


def aligned(attitude=ATTITUDE, age_us=99_000_000):
    s, r = State(), [0] * 9
    x, y, z, w = attitude.as_quat().tolist()
    s.q_nb[:] = whole((w, x, y, z), Q29)
    s.age_us = age_us
    rotation(s.q_nb, r)
    return s, r


def sampled(gravity_n=DOWN, field_n=NORTH, attitude=ATTITUDE, has_field=True):
    """Vectors of n, as they are felt in this attitude."""
    u = Sample()
    u.gravity[:] = whole(attitude.inv().apply(gravity_n), Q14)
    if has_field:
        u.mag[:] = whole(attitude.inv().apply(field_n), Q14)
        u.has_mag = -1
    u.dt_us = 10_000
    return u


@pytest.mark.parametrize(
    ("square", "gate"), [(1.19, -1), (1.21, 0), (0.81, -1), (0.79, 0), (0.0, 0)]
)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_vector_is_sane_while_its_square_is_one_within_a_tolerance(square, gate, axis):
    parts = [0, 0, 0]
    parts[axis] = round(math.sqrt(square) * Q14)
    v = [7, 7, 7]
    assert sane(v, *parts, round(0.2 * Q26)) == gate
    assert v == (parts if gate else [0, 0, 0])


@pytest.mark.parametrize(
    ("age_us", "boost"), [(0, 3), (1023, 3), (1024, 2), (2048, 1), (3072, 0), (1 << 20, 0)]
)
def test_a_young_gain_is_halved_again_and_again(age_us, boost):
    s = State()
    s.age_us = age_us
    assert boost_of(s, gains(boost=3, boost_shift=10)) == boost


def disagreement(gravity_n, field_n, boost=0, **how):
    s, r = aligned()
    zeta = [0, 0, 0]
    used = innovation(s, how.pop("g", gains()), sampled(gravity_n, field_n, **how), r, zeta, boost)
    return np.array(zeta) / Q15, used, s


def turned(vector, angle, axis):
    return Rotation.from_rotvec(angle * np.array(axis)).apply(vector)


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.6, -0.64, 0.48)])
def test_a_disagreement_is_what_both_vectors_are_turned_by(axis):
    gravity, field = turned(DOWN, 0.1, axis), turned(NORTH, 0.1, axis)
    zeta, used, s = disagreement(gravity, field)
    expected = WEIGHT * np.cross(gravity, DOWN) + (1.0 - WEIGHT) * np.cross(field, NORTH)
    expected[2] = np.cross(field, NORTH)[2]
    assert zeta == pytest.approx(expected, abs=3e-4)
    assert used == FORCE_USED | FIELD_USED
    assert s.contradicted_us == 0


@pytest.mark.parametrize(
    ("dip_deg", "boost", "uses"),
    # the parts down differ by 0.2 of a unit
    [(42.5, 0, True), (41.0, 0, False), (85.0, 0, True), (41.0, 1, True)],
)
def test_a_fields_dip_is_judged_once_the_start_is_over(dip_deg, boost, uses):
    dip = math.radians(dip_deg)
    field = np.array((math.cos(dip), 0.0, math.sin(dip)))
    zeta, used, _ = disagreement(DOWN, field, boost)
    assert used == FORCE_USED | (FIELD_USED if uses else 0)
    assert bool(abs(zeta[1]) > 0.01) is uses


@pytest.mark.parametrize(
    ("gravity_deg", "field_deg", "contradicts"),
    [(31.0, 41.0, True), (29.0, 41.0, False), (31.0, 39.0, False), (80.0, 0.0, False)],
)
def test_both_vectors_contradict_beyond_30_and_40_degrees(gravity_deg, field_deg, contradicts):
    gravity = turned(DOWN, math.radians(gravity_deg), (1, 0, 0))
    field = turned(NORTH, math.radians(field_deg), (0, 1, 0))
    zeta, used, s = disagreement(gravity, field, boost=1)
    assert (used == 0) is contradicts
    assert (s.contradicted_us == 10_000) is contradicts
    assert bool(zeta.any()) is not contradicts


def test_without_a_field_a_force_contradicts_nothing():
    zeta, used, s = disagreement(turned(DOWN, 1.0, (1, 0, 0)), NORTH, has_field=False)
    assert used == FORCE_USED
    assert s.contradicted_us == 0
    assert zeta[2] == 0.0


@pytest.mark.parametrize(
    ("contradicted", "f_sane", "after"),
    [(-1, -1, 510_000), (0, -1, 0), (0, 0, 500_000), (-1, 0, 510_000)],
)
def test_contradictions_add_up_until_a_sample_agrees(contradicted, f_sane, after):
    s = State()
    s.contradicted_us = 500_000
    watch(s, 10_000, contradicted, f_sane)
    assert s.contradicted_us == after
    s.contradicted_us = CONTRADICTED_LIMIT_US - 1
    watch(s, 12_500, -1, -1)
    assert s.contradicted_us == CONTRADICTED_LIMIT_US + 1


def test_a_gain_couples_x_and_z():
    e, gain, z = [0, 0, 0], [4000, 300, 5000, -200, 6000], [10_000, -20_000, 15_000]
    weighted(gain, z, e)
    matrix = np.array(((4000, 0, 300), (0, 5000, 0), (-200, 0, 6000)))
    assert e == pytest.approx(matrix @ z / 2**15, abs=0.51)


def test_what_a_bias_does_not_resolve_is_carried():
    s, met = State(), [0]
    for _ in range(10):
        correct_bias(s, 1, 300, 10, met)
    assert s.gyro_bias[:] == [0, -2, 0]
    assert s.bias_carry[1] == 3000 - 2 * 1024
    correct_bias(s, 1, -1024 * 5 - s.bias_carry[1], 10, met)
    assert (s.gyro_bias[1], s.bias_carry[1], met) == (3, 0, [0])


@pytest.mark.parametrize("sign", [-1, 1])
def test_a_bias_stays_within_its_limit(sign):
    s, met = State(), [0]
    s.gyro_bias[2] = sign * (BIAS_LIMIT - 1)
    correct_bias(s, 2, -sign * 2048, 10, met)
    assert s.gyro_bias[2] == sign * BIAS_LIMIT
    assert met != [0]


def test_a_step_corrects_attitude_and_bias_by_their_gains():
    """The correction comes with the next turn, and the bias falls, in body axes."""
    s, r = aligned()
    gravity, field = turned(DOWN, 0.1, (0.6, 0.8, 0)), turned(NORTH, 0.1, (0.6, 0.8, 0))
    u = sampled(gravity, field)
    zeta = [0, 0, 0]
    innovation(s, gains(), u, r, zeta, 0)
    assert step(s, gains(), u) == FORCE_USED | FIELD_USED
    g = gains()
    of_attitude, of_bias = [0, 0, 0], [0, 0, 0]
    weighted(g.attitude_gain, zeta, of_attitude)
    weighted(g.bias_gain, zeta, of_bias)
    turn_b = ATTITUDE.inv().apply(of_attitude) * Q15 / 2**6
    # what is below the resolution of a turn was carried by the turn before
    assert s.turn_carry[:] == pytest.approx(turn_b, abs=8192 + 50, rel=1e-2)
    bias_b = -ATTITUDE.inv().apply(of_bias) * Q15 / 2**10
    assert s.gyro_bias[:] == pytest.approx(bias_b, abs=5, rel=1e-2)
    assert s.age_us == 99_010_000
    boosted, _ = aligned(age_us=0)
    step(boosted, gains(boost=1, boost_shift=20), u)
    assert boosted.gyro_bias[:] == pytest.approx(4.0 * bias_b, abs=20, rel=2e-2)


def test_a_rate_beyond_its_limit_is_counted():
    s, _ = aligned()
    u = sampled()
    u.gyro[1] = (1 << 31) - 1
    assert step(s, gains(), u) & SATURATED
    assert s.saturations == 1
    u.gyro[1] = 0
    assert not step(s, gains(), u) & SATURATED
    assert s.saturations == 1


# --- alignment -----------------------------------------------------------------------------------


@pytest.mark.parametrize("has_field", [True, False])
def test_a_first_attitude_is_that_of_both_vectors_or_points_north(has_field):
    attitude = ATTITUDE if has_field else Rotation.from_euler("ZYX", (0.0, 0.2, -0.3))
    s = State()
    reset(s)
    s.turn_carry[:], s.contradicted_us = [5, 5, 5], 9
    assert s.age_us == -1
    assert update(s, gains(), sampled(attitude=attitude, has_field=has_field)) == ALIGNED
    found = Rotation.from_quat(np.roll(np.array(s.q_nb[:], float), -1))
    assert (found * attitude.inv()).magnitude() < 2e-3
    assert (s.turn_carry[:], s.age_us, s.contradicted_us) == ([0, 0, 0], 0, 0)


@pytest.mark.parametrize(
    ("pitch_deg", "north"), [(58.0, (1, 0, 0)), (62.0, (0, 0, 1)), (-62.0, (0, 0, 1))]
)
def test_of_a_vehicle_on_its_tail_the_belly_points_north(pitch_deg, north):
    s = State()
    reset(s)
    attitude = Rotation.from_euler("ZYX", (0.0, math.radians(pitch_deg), 0.0))
    assert align(s, sampled(attitude=attitude, has_field=False)) == ALIGNED
    found = Rotation.from_quat(np.roll(np.array(s.q_nb[:], float), -1)).apply(north)
    assert math.atan2(found[1], found[0]) == pytest.approx(0.0, abs=1e-2)
    assert found[0] > 0.1


@pytest.mark.parametrize("share", [0.85, 1.13])
@pytest.mark.parametrize("of", ["gravity", "field"])
def test_no_attitude_comes_of_vectors_that_are_not_sane(share, of):
    """Squares of one within a quarter."""
    assert ALIGN_TOLERANCE / Q26 == 0.25
    s = State()
    reset(s)
    gravity, field = (DOWN * share, NORTH) if of == "gravity" else (DOWN, NORTH * share)
    assert align(s, sampled(gravity, field)) == 0
    assert s.age_us == -1
    sound = 0.88 if share < 1.0 else 1.11
    gravity, field = (DOWN * sound, NORTH) if of == "gravity" else (DOWN, NORTH * sound)
    assert align(s, sampled(gravity, field)) == ALIGNED


def test_a_field_along_the_vertical_gives_no_attitude():
    s = State()
    reset(s)
    assert align(s, sampled(DOWN, DOWN)) == 0
    assert s.age_us == -1


def test_after_a_second_of_contradictions_it_aligns_anew():
    s, _ = aligned()
    s.saturations, s.gyro_bias[0] = 3, 77
    gravity, field = turned(DOWN, 1.0, (1, 0, 0)), turned(NORTH, 1.0, (0, 1, 0))
    bits = [update(s, gains(), sampled(gravity, field)) for _ in range(101)]
    assert not any(bits[:100])
    assert bits[100] == DISAGREES
    assert (s.age_us, s.saturations) == (-1, 3)
    assert update(s, gains(), sampled()) == ALIGNED
    restart(s)
    assert s.age_us == -1
    assert s.gyro_bias[0] == 77
