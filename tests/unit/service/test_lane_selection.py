"""Which lane is sent: hysteresis, and what is no cause."""

import itertools
import math

import pytest

from h2nav.service.lane_selection import Condition, LaneSelection, Switch, SwitchCause

STEP_NS = 50_000_000
GOOD = Condition(True, False, 0.1, 0.1)
BAD = Condition(True, False, math.inf, 0.1)
SILENT = Condition(True, True, 0.1, 0.1)


def first_switch(*lanes, until_s=60.0):
    """When the lanes, always so, lead to a switch, and to which; None for none."""
    selection = LaneSelection()
    conditions = dict(enumerate(lanes))
    for t_ns in range(0, round(until_s * 1e9), STEP_NS):
        switch = selection.look(t_ns, 0, conditions)
        if switch is not None:
            return t_ns * 1e-9, switch
    return None


def test_a_bad_lane_is_left_at_once():
    assert first_switch(BAD, GOOD) == (0.0, Switch(1, SwitchCause.BAD))


def test_a_silent_lane_is_left_when_no_other_message_of_its_imu_came():
    at_s, switch = first_switch(SILENT, GOOD)
    assert switch == Switch(1, SwitchCause.SILENT)
    assert at_s == pytest.approx(0.1)


def test_a_failing_test_has_to_last():
    at_s, switch = first_switch(GOOD._replace(ratio=1.5), GOOD)
    assert switch == Switch(1, SwitchCause.WORSE)
    assert at_s == pytest.approx(0.5)


DEG = math.pi / 180.0


@pytest.mark.parametrize(
    ("sent_deg", "other", "is_left"),
    [
        (12.1, GOOD._replace(sigma_rad=6.0 * DEG), True),
        (11.9, GOOD._replace(sigma_rad=3.0 * DEG), False),
        (40.0, GOOD._replace(sigma_rad=20.1 * DEG), False),
        (40.0, GOOD._replace(sigma_rad=3.0 * DEG, ratio=0.6), False),
        (40.0, GOOD._replace(sigma_rad=3.0 * DEG, field_ratio=1.1), False),
        (40.0, GOOD._replace(sigma_rad=3.0 * DEG, field_ratio=math.nan), True),
    ],
)
def test_an_attitude_that_is_unsure_for_five_seconds_is_left_for_a_surer_one(
    sent_deg, other, is_left
):
    """Three compasses on steel: the one that was sent took a minute to be right in the air."""
    found = first_switch(GOOD._replace(sigma_rad=sent_deg * DEG), BAD, other)
    assert found == ((pytest.approx(5.0), Switch(2, SwitchCause.UNSURE)) if is_left else None)


def test_an_attitude_that_is_outvoted_for_five_seconds_is_left():
    outvoted = GOOD._replace(is_outvoted=True)
    at_s, switch = first_switch(outvoted, GOOD._replace(sigma_rad=0.1), GOOD)
    assert (at_s, switch) == (pytest.approx(5.0), Switch(2, SwitchCause.OUTVOTED))
    assert first_switch(outvoted, BAD, SILENT) is None


def test_a_test_that_comes_and_goes_does_not_keep_an_attitude_that_is_outvoted():
    selection, switches = LaneSelection(), []
    for number in range(200):
        ratio = 1.2 if number % 8 < 4 else 0.8
        outvoted = GOOD._replace(is_outvoted=True, ratio=ratio)
        switch = selection.look(number * STEP_NS, 0, {0: outvoted, 1: GOOD, 2: GOOD})
        switches += [(number * STEP_NS * 1e-9, switch)] if switch else []
    assert switches[0] == (pytest.approx(5.0), Switch(1, SwitchCause.OUTVOTED))


def test_a_compass_whose_test_comes_and_goes_does_not_keep_an_attitude_that_is_unsure():
    selection, switches = LaneSelection(), []
    for number in range(200):
        field_ratio = 1.2 if number % 40 < 20 else 0.8
        unsure = GOOD._replace(sigma_rad=16.0 * DEG, field_ratio=field_ratio)
        switch = selection.look(number * STEP_NS, 0, {0: unsure, 1: GOOD})
        switches += [(number * STEP_NS * 1e-9, switch)] if switch else []
    assert switches[0] == (pytest.approx(5.0), Switch(1, SwitchCause.UNSURE))


def test_after_a_switch_every_patience_begins_anew():
    selection = LaneSelection()
    unsure, disturbed = GOOD._replace(sigma_rad=13.0 * DEG), GOOD._replace(field_ratio=1.2)
    for number in range(101):
        field_ratio = 1.2 if number > 70 else 0.1
        lanes = {0: unsure._replace(field_ratio=field_ratio), 1: GOOD}
        switch = selection.look(number * STEP_NS, 0, lanes)
    assert switch == Switch(1, SwitchCause.UNSURE)
    left = [selection.look(n * STEP_NS, 1, {0: GOOD, 1: disturbed}) for n in range(101, 142)]
    assert left == [None] * 40 + [Switch(0, SwitchCause.COMPASS)]


def test_only_a_lane_that_may_be_left_is_left():
    ratios = (0.1, 0.9, 1.0, 1.5, math.inf, math.nan)
    flags = (False, True)
    left = {False: 0, True: 0}
    for ratio, field, noise in itertools.product(ratios, ratios, (0.0, 9.0)):
        for silent, shaken, wrong in itertools.product(flags, flags, flags):
            lane = Condition(True, silent, ratio, field, noise, shaken, wrong)
            assert lane._replace(is_outvoted=True).may_be_left
            left[lane.may_be_left] += first_switch(lane, GOOD, until_s=3.0) is not None
    assert left[False] == 0
    assert left[True] > 100


def test_a_ratio_that_comes_and_goes_is_no_cause():
    selection = LaneSelection()
    for number in range(1000):
        ratio = 3.0 if number % 10 < 9 else 0.5
        lanes = {0: GOOD._replace(ratio=ratio), 1: GOOD}
        assert selection.look(number * STEP_NS, 0, lanes) is None


@pytest.mark.parametrize(
    "other",
    [
        GOOD._replace(ratio=0.8),
        GOOD._replace(ratio=1.1),
        GOOD._replace(may_follow=False),
        SILENT,
        BAD,
    ],
)
def test_one_that_is_not_clearly_better_or_not_there_does_not_take_over(other):
    assert first_switch(GOOD._replace(ratio=1.5), other) is None


def test_a_better_lane_is_no_cause_by_itself():
    assert first_switch(GOOD._replace(ratio=0.9), GOOD._replace(ratio=0.0)) is None


def test_of_others_only_one_whose_field_has_been_tested_is_known_to_turn_less():
    turning = GOOD._replace(ratio=1.2, turn_ratio=1.2)
    tested = GOOD._replace(ratio=0.55, turn_ratio=0.4)
    _, switch = first_switch(turning, GOOD, tested)
    assert switch == Switch(2, SwitchCause.WORSE)


def test_the_best_of_the_others_takes_over():
    _, switch = first_switch(BAD, GOOD._replace(ratio=0.8), GOOD._replace(ratio=0.6))
    assert switch.lane == 2


def test_of_two_that_pass_well_the_more_certain_one_takes_over():
    """Whose accelerometer is off by 60 mg knows its tilt to 3 deg, and passes as well."""
    unsure = GOOD._replace(ratio=0.05, sigma_rad=0.06)
    _, switch = first_switch(BAD, unsure, GOOD._replace(ratio=0.45, sigma_rad=0.002))
    assert switch.lane == 2


def test_a_certain_one_that_barely_passes_does_not_take_over():
    _, switch = first_switch(BAD, GOOD._replace(sigma_rad=0.06), GOOD._replace(ratio=0.9))
    assert switch.lane == 1


def test_a_compass_that_is_off_is_left_for_one_that_sees_north():
    disturbed = GOOD._replace(field_ratio=1.5)
    at_s, switch = first_switch(disturbed, GOOD._replace(field_ratio=0.8), GOOD)
    assert switch == Switch(2, SwitchCause.COMPASS)
    assert at_s == pytest.approx(2.0)


@pytest.mark.parametrize("field_ratio", [1.4, 0.6, math.nan])
def test_a_disturbance_that_all_compasses_see_is_no_cause(field_ratio):
    disturbed = GOOD._replace(field_ratio=1.5)
    assert first_switch(disturbed, GOOD._replace(field_ratio=field_ratio)) is None


def test_a_lane_that_is_shaken_is_left_for_a_calmer_one():
    shaken = GOOD._replace(noise_m_s2=4.0, is_shaken=True)
    others = (GOOD._replace(noise_m_s2=3.0, ratio=0.0), GOOD._replace(noise_m_s2=0.5))
    at_s, switch = first_switch(shaken, *others)
    assert switch == Switch(2, SwitchCause.NOISE)
    assert at_s == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("present", "other_noise"), [((4.0, True), 2.5), ((4.0, False), 0.1), ((0.0, True), 0.0)]
)
def test_noise_alone_or_that_of_all_is_no_cause(present, other_noise):
    noise, is_shaken = present
    shaken = GOOD._replace(noise_m_s2=noise, is_shaken=is_shaken)
    assert first_switch(shaken, GOOD._replace(noise_m_s2=other_noise)) is None


def test_a_compass_that_is_known_to_be_wrong_is_left_for_that_cause():
    wrong = GOOD._replace(compass_is_wrong=True, ratio=1.5)
    _, switch = first_switch(wrong, GOOD._replace(compass_is_wrong=True), GOOD)
    assert switch == Switch(2, SwitchCause.COMPASS)


def test_a_wrong_compass_is_kept_where_all_are_wrong():
    wrong = GOOD._replace(compass_is_wrong=True)
    assert first_switch(wrong, wrong) is None


@pytest.mark.parametrize(
    ("present", "other", "leaves"),
    [
        # clearly better is less than half
        (GOOD._replace(ratio=1.2), GOOD._replace(ratio=0.599), True),
        (GOOD._replace(ratio=1.2), GOOD._replace(ratio=0.6), False),
        (GOOD._replace(ratio=1.0), GOOD._replace(ratio=0.0), False),
        # where the turn of its field fails, the other one's must have been tested, too
        (GOOD._replace(ratio=1.2, turn_ratio=1.2), GOOD, False),
        (GOOD._replace(ratio=1.2, turn_ratio=1.2), GOOD._replace(turn_ratio=0.1), True),
        (GOOD._replace(ratio=1.2, turn_ratio=0.9), GOOD, True),
        (GOOD._replace(noise_m_s2=4.0, is_shaken=True), GOOD._replace(noise_m_s2=1.99), True),
        (GOOD._replace(noise_m_s2=4.0, is_shaken=True), GOOD._replace(noise_m_s2=2.0), False),
        # a compass sees north below half of the limit
        (GOOD._replace(field_ratio=1.01), GOOD._replace(field_ratio=0.499), True),
        (GOOD._replace(field_ratio=1.01), GOOD._replace(field_ratio=0.5), False),
        (GOOD._replace(field_ratio=1.0), GOOD._replace(field_ratio=0.0), False),
        # whom a lane is left for passes its own tests
        (BAD, GOOD._replace(ratio=0.999), True),
        (BAD, GOOD._replace(ratio=1.0), False),
    ],
)
def test_how_much_better_another_lane_has_to_be(present, other, leaves):
    assert (first_switch(present, other, until_s=3.0) is not None) is leaves


@pytest.mark.parametrize(
    ("present", "cause", "patience_ns"),
    [
        (BAD, SwitchCause.BAD, 0),
        (SILENT, SwitchCause.SILENT, 100_000_000),
        (GOOD._replace(ratio=1.5), SwitchCause.WORSE, 500_000_000),
        (GOOD._replace(noise_m_s2=4.0, is_shaken=True), SwitchCause.NOISE, 1_000_000_000),
        (GOOD._replace(field_ratio=1.5), SwitchCause.COMPASS, 2_000_000_000),
    ],
)
def test_each_cause_has_its_patience_and_begins_anew(present, cause, patience_ns):
    selection, lanes, start_ns = LaneSelection(), {0: present, 1: GOOD}, 10**12
    if patience_ns:
        assert selection.look(start_ns, 0, lanes) is None
        assert selection.look(start_ns + patience_ns - 1, 0, lanes) is None
        assert selection.look(start_ns + patience_ns - 1, 0, {0: GOOD, 1: GOOD}) is None
        start_ns += patience_ns
        assert selection.look(start_ns, 0, lanes) is None
    assert selection.look(start_ns + patience_ns, 0, lanes) == Switch(1, cause)


@pytest.mark.parametrize(
    ("others", "chosen"),
    [
        # below half of the limit the deviation decides, above it the ratio
        ([{"ratio": 0.5, "sigma_rad": 0.01}, {"ratio": 0.1, "sigma_rad": 0.02}], 1),
        ([{"ratio": 0.51, "sigma_rad": 0.01}, {"ratio": 0.1, "sigma_rad": 0.02}], 2),
        ([{"ratio": 0.2}, {"ratio": 0.1}], 1),  # of equals the first
        ([{"compass_is_wrong": True}, {"sigma_rad": 1.0}], 2),
        ([{"compass_is_wrong": True, "sigma_rad": 1.0}, {"compass_is_wrong": True}], 2),
    ],
)
def test_who_takes_over(others, chosen):
    _, switch = first_switch(BAD, *(GOOD._replace(**how) for how in others))
    assert switch.lane == chosen


@pytest.mark.parametrize(
    ("others", "chosen"),
    [
        ([{"field_ratio": 0.3}, {"field_ratio": 0.2, "sigma_rad": 1.0}], 2),
        ([{"field_ratio": 0.2}, {"field_ratio": 0.2}], 1),
    ],
)
def test_a_disturbed_compass_is_left_for_the_one_that_sees_north_best(others, chosen):
    present = GOOD._replace(field_ratio=1.5)
    _, switch = first_switch(present, *(GOOD._replace(**how) for how in others))
    assert switch == Switch(chosen, SwitchCause.COMPASS)


@pytest.mark.parametrize(
    ("how", "may"),
    [
        ({}, False),
        ({"ratio": 1.0}, False),
        ({"ratio": 1.01}, True),
        ({"field_ratio": 1.0}, False),
        ({"field_ratio": 1.01}, True),
        ({"field_ratio": math.nan}, False),
        ({"is_silent": True}, True),
        ({"is_shaken": True}, True),
        ({"compass_is_wrong": True}, True),
        ({"sigma_rad": 0.2095}, True),
        ({"noise_m_s2": 99.0, "sigma_rad": 0.2094, "may_follow": False}, False),
    ],
)
def test_a_lane_may_be_left_if_anything_is_wrong_with_it(how, may):
    assert GOOD._replace(**how).may_be_left is may
