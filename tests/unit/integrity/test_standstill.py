"""When values of a sensor that stand still accuse it: just enough, and just too little."""

import math

import pytest

from h2nav.integrity.kernel.memory import (
    FORCE_FROZEN,
    GYRO_FROZEN,
    STUCK_AXIS,
    UNSEEN_TURN,
    Memory,
    Sample,
)
from h2nav.integrity.kernel.repeats import COMPASS, FORCE, GYRO, IMU, OF_COMPASS, OF_SENSOR
from h2nav.integrity.kernel.standstill import (
    field_is_frozen,
    is_fine,
    learn_count,
    never_changed,
    standstill,
    stuck_axis,
    unseen_turn,
)

GYRO_AT_REST, FORCE_AT_REST = 6, 6 + OF_SENSOR
STEP_US = 10_000.0


def sample(gyro=(0.0, 0.0, 0.0), accel=(0.0, 0.0, -9.8)):
    return Sample(gyro=[*gyro], accel=[*accel])


def running(**known):
    s = Memory(has_begun=1.0, step_us=STEP_US)
    for name, value in known.items():
        setattr(s, name, value)
    return s


@pytest.mark.parametrize(("rate", "turning"), [(0.0499, 0.0), (0.05, 1.0), (-0.05, 1.0)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_vehicle_turns_from_a_rate_on_that_is_no_bias(rate, turning, axis):
    s = running(turning=1.0)
    gyro = [0.0, 0.0, 0.0]
    gyro[axis] = rate
    standstill(s, sample(gyro))
    assert s.turning == turning


def test_changes_are_those_from_the_sample_before_and_the_usual_ones_their_mean():
    s = running(values=[0.1, -0.2, 0.3, 1.0, 2.0, -9.0], usual=[0.0] * 5 + [4.0], step_us=5e4)
    standstill(s, sample((0.2, -0.4, 0.3), (1.0, 1.5, -9.5)))
    assert s.change == pytest.approx([0.1, 0.2, 0.0, 0.0, 0.5, 0.5])
    assert s.values == [0.2, -0.4, 0.3, 1.0, 1.5, -9.5]
    # of about a second: 0.05 of the new one
    assert s.usual == pytest.approx([0.005, 0.01, 0.0, 0.0, 0.025, 3.825])
    assert s.jump == pytest.approx(0.3)
    assert s.count == pytest.approx([0.1, 0.5])
    s.step_us = 5e5
    standstill(s, sample((0.3, -0.4, 0.3), (1.0, 1.5, -9.5)))
    assert s.usual[0] == pytest.approx(0.8 * 0.005 + 0.2 * 0.1), "a fifth at most"


def test_of_the_first_sample_nothing_is_known():
    s = Memory()
    assert standstill(s, sample((1.0, 0.0, 0.0))) == 0
    assert (s.count, s.usual) == ([0.0, 0.0], [0.0] * 6)
    assert s.values[0] == 1.0


def test_the_resolution_is_the_smallest_difference_so_far():
    s = Memory(change=[0.3, 0.0, 0.2, 0.5, 0.4, 0.6])
    learn_count(s, 0)
    learn_count(s, 1)
    assert s.count == [0.2, 0.4]
    s.change[0], s.change[5] = 0.1, 0.7
    learn_count(s, 0)
    learn_count(s, 1)
    assert s.count == [0.1, 0.4]


def test_for_how_long_a_sensor_stands_still():
    s = running(still_us=[0.0, 5e3], values=[0.0] * 3 + [0.0, 0.0, -9.8])
    standstill(s, sample())
    assert s.still_us == [1e4, 1.5e4]
    standstill(s, sample((0.1, 0.0, 0.0)))
    assert s.still_us == [0.0, 2.5e4]
    standstill(s, sample((0.1, 0.0, 0.0), (0.0, 0.0, -9.7)))
    assert s.still_us == [1e4, 0.0]


@pytest.mark.parametrize(
    ("seen", "moves", "bits"),
    [
        # 5 repetitions so far and one that comes; odds of seen / 30 each, 1000 to 1 at least
        (30.0 * math.exp(7.1 / 6.0), True, UNSEEN_TURN),
        (30.0 * math.exp(6.9 / 6.0), True, 0),
    ],
)
def test_a_turn_may_be_unseen_where_the_gyro_is_suspicious(seen, moves, bits):
    s = running(still_us=[3e5, 0.0], jump=0.4)
    s.seen[GYRO_AT_REST] = seen
    s.run[GYRO] = 6.0
    assert unseen_turn(s, 1.0 if moves else 0.0) == bits
    assert s.unseen_rad == pytest.approx(0.12 if bits else 0.0)


def test_while_all_stands_still_the_imu_is_suspected():
    s = running(still_us=[3e5, 3e5], jump=0.4)
    s.seen[GYRO_AT_REST] = 1e5
    s.run[GYRO] = 9.0
    assert unseen_turn(s, 0.0) == 0
    s.seen[GYRO_AT_REST + 2 * OF_SENSOR] = 1e5
    s.run[IMU] = 9.0
    assert unseen_turn(s, 0.0) == UNSEEN_TURN


@pytest.mark.parametrize(
    ("known", "bits"),
    [
        # the force is no whole number of milli-g: its message would show a gyro's noise
        ({"still_us": [3.01e6, 0.0], "count": [0.0, 1.0]}, GYRO_FROZEN),
        ({"still_us": [2.99e6, 0.0], "count": [0.0, 1.0]}, 0),
        ({"still_us": [3.01e6, 0.0], "count": [1e-3, 1.0]}, 0),
        ({"still_us": [0.0, 3.01e6], "count": [1.0, 0.0]}, FORCE_FROZEN),
        ({"still_us": [0.0, 2.99e6], "count": [1.0, 0.0]}, 0),
        ({"still_us": [0.0, 3.01e6], "count": [1.0, 0.1]}, 0),
        ({"still_us": [3.01e6, 3.01e6], "count": [0.0, 0.0]}, GYRO_FROZEN),
    ],
)
def test_a_sensor_that_never_changed_is_frozen_after_three_seconds(known, bits):
    s = running(values=[0.0105, 0.0, 0.0, 0.0, 0.0, -9.8123], **known)
    assert never_changed(s) == bits
    s.values = [0.01, -0.002, 0.0, 0.0, 9.80665e-3, -9.80665]
    assert never_changed(s) == 0, "whole counts of a message of integers"


@pytest.mark.parametrize(("value", "fine"), [(0.0130009, 0), (0.0130011, 1), (-0.0005, 1)])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_value_is_fine_beyond_a_thousandth_of_a_count(value, fine, axis):
    s = Memory()
    s.values[3 + axis] = value
    assert is_fine(s, 3, 1e-3) == fine
    assert is_fine(s, 0, 1e-3) == 0


@pytest.mark.parametrize(("first", "axis"), [(0, 0), (0, 2), (3, 3), (3, 4)])
def test_an_axis_that_stands_still_while_the_others_move_is_named(first, axis):
    s = running(usual=[0.1] * 6)
    s.seen[axis] = 1e5
    for i in range(first, first + 3):
        s.change[i] = 0.0 if i == axis else 0.1
    found = [stuck_axis(s, first) for _ in range(120)]
    assert found[0] == 0
    assert found[-1] == axis + 1
    # for a second: what stands at the end of its range is not stuck
    assert found.index(axis + 1) == 99
    s.change[axis] = 0.1
    assert stuck_axis(s, first) == 0


def test_a_stuck_axis_is_told_above_the_bits():
    s = running()
    bits = []
    for i in range(400):
        x = 0.3 * math.sin(i)
        moving = x if i < 250 else s.values[1]
        bits.append(standstill(s, sample((x, moving, 0.1 * x), (x, x, x))))
    assert bits[-1] == 2 * STUCK_AXIS
    assert not any(bits[:250])


# --- the compass --------------------------------------------------------------------------------


def field_seen(seen, still_us, turned_rad, accused):
    s = running(
        field=[1.0, 2.0, 3.0], field_still_us=still_us - STEP_US, field_turned_rad=turned_rad
    )
    s.seen[OF_COMPASS + 1] = seen
    s.run[COMPASS], s.accused[COMPASS] = 1.0, accused
    return field_is_frozen(s, [1.0, 2.0, 3.0], 1.0)


@pytest.mark.parametrize(
    ("how", "frozen"),
    [
        ((31.0, 1.01e6, 0.51, 1.0), 1),
        ((31.0, 0.99e6, 0.51, 1.0), 0),
        ((31.0, 1.01e6, 0.49, 1.0), 0),
        ((31.0, 1.01e6, 0.51, 0.0), 0),
        # one that has hardly changed so far is given ten seconds
        ((29.0, 1.01e6, 0.51, 1.0), 0),
        ((29.0, 9.99e6, 0.51, 1.0), 0),
        ((29.0, 10.01e6, 0.51, 0.0), 1),
    ],
)
def test_a_field_that_stands_still_while_the_vehicle_turns_is_frozen(how, frozen):
    assert field_seen(*how) == frozen


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_field_that_changes_about_any_axis_is_alive(axis):
    s = running(field=[1.0, 2.0, 3.0], field_still_us=9e6, field_turned_rad=3.0)
    field = [1.0, 2.0, 3.0]
    field[axis] += 0.1
    assert field_is_frozen(s, field, 1.0) == 0
    assert (s.field, s.field_still_us, s.field_turned_rad) == (field, 0.0, 0.0)


def test_without_a_field_what_was_decided_stands():
    s = running(field_still_us=1e6)
    assert field_is_frozen(s, [0.0] * 3, 0.0) == 0
    s.field_frozen = 1.0
    assert field_is_frozen(s, [0.0] * 3, 0.0) == 1
    assert s.field_still_us == 1.02e6


def test_each_sensor_has_an_experience_of_its_own():
    s = running(values=[0.0] * 3 + [0.0, 0.0, -9.8])
    standstill(s, sample((0.01, 0.0, 0.0)))
    assert (s.seen[GYRO_AT_REST], s.seen[FORCE_AT_REST]) == (1.0, 0.0)
    assert s.run[FORCE] == 1.0
    standstill(s, sample((0.0, 0.0, 0.0), (0.0, 0.1, -9.8)))
    assert (s.seen[GYRO_AT_REST], s.seen[FORCE_AT_REST]) == (2.0, 1.0)
    assert (s.run[FORCE], s.longest[FORCE_AT_REST]) == (0.0, 1.0)
