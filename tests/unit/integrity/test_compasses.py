"""Several compasses against each other: who differs, and who is wrong."""

import math

import pytest
from needs import DEG
from synthetic_imu import FIELD, FIELD_N

from h2nav.attitude.samples import EarthField
from h2nav.integrity.compasses import Compasses, Level
from h2nav.integrity.findings import Kind, Severity
from h2nav.maths import quaternion

TILTED = quaternion.from_euler(0.05, -0.03, 1.0)
QUARTER = quaternion.from_euler(0.0, 0.0, 90.0 * DEG)


def seen(turns_deg: list[float], q_nb=TILTED) -> dict[int, tuple[float, float, float]]:
    """The earth's field in body axes, in each compass turned about body z."""
    field_b = quaternion.rotate(quaternion.conjugate(q_nb), FIELD_N)
    return {
        number: quaternion.rotate(quaternion.from_euler(0.0, 0.0, turn * DEG), field_b)
        for number, turn in enumerate(turns_deg)
    }


def after(seconds: float, fields, level: Level) -> Compasses:
    compasses = Compasses()
    compasses.use_field(FIELD)
    for i in range(round(20 * seconds)):
        compasses.look(50_000 * i, fields, level)
    return compasses


@pytest.mark.parametrize("is_shown", [False, True])
def test_compasses_that_agree_are_not_spoken_of(is_shown: bool) -> None:
    compasses = after(10.0, seen([0.0, 8.0, -5.0]), Level(TILTED, 0.1, is_shown))
    assert compasses.alarms() == []
    assert not compasses.wrong
    assert not compasses.differ(0, 1)
    assert compasses.doubt_rad(0) == 0.0


def test_two_that_differ_on_the_ground_are_reported_and_open_the_heading() -> None:
    """Whatever heading the attitude has, which came from one of them."""
    level = Level(quaternion.multiply(QUARTER, TILTED), 0.1, False)
    compasses = after(5.0, seen([90.0, 0.0]), level)
    (alarm,) = compasses.alarms()
    assert (alarm.kind, alarm.is_decided) == (Kind.COMPASSES_DIFFER, False)
    assert alarm.severity is Severity.ERROR
    assert alarm.degrades
    assert alarm.sensor.numbers == (1, 2)
    assert compasses.differ(1, 0)
    assert alarm.size == pytest.approx(90.0, abs=10.0)
    assert all(compasses.doubt_rad(n) > 30.0 * DEG for n in (0, 1))


@pytest.mark.parametrize("turned", [0, 1, 2])
def test_of_three_the_one_that_is_alone_is_wrong(turned: int) -> None:
    turns = [90.0 if number == turned else 0.0 for number in range(3)]
    compasses = after(5.0, seen(turns), Level(TILTED, 0.1, False))
    assert compasses.wrong == {turned}
    (alarm,) = compasses.alarms()
    assert alarm.is_decided
    assert alarm.sensor.number == turned + 1
    assert [compasses.doubt_rad(n) > 0.0 for n in range(3)] == [n == turned for n in range(3)]


@pytest.mark.parametrize("turned", [0, 1])
def test_a_heading_that_velocities_have_shown_decides_between_two(turned: int) -> None:
    turns = [90.0 if number == turned else 0.0 for number in range(2)]
    compasses = after(5.0, seen(turns), Level(TILTED, 0.1, True))
    assert compasses.wrong == {turned}
    assert compasses.doubt_rad(1 - turned) == 0.0


def test_velocities_outvote_two_that_share_the_same_iron() -> None:
    compasses = after(5.0, seen([60.0, 60.0, 0.0]), Level(TILTED, 0.1, True))
    assert compasses.wrong == {0, 1}


def test_what_agrees_again_is_forgiven() -> None:
    compasses = after(5.0, seen([90.0, 0.0]), Level(TILTED, 0.1, True))
    for i in range(200):
        compasses.look(5_000_000 + 50_000 * i, seen([0.0, 0.0]), Level(TILTED, 0.1, False))
    assert not compasses.wrong
    assert compasses.alarms() == []


def test_a_field_that_stands_upright_says_nothing() -> None:
    fields = {0: (0.5, 0.0, 60.0), 1: (-0.5, 0.0, 60.0)}
    compasses = after(5.0, fields, Level(quaternion.IDENTITY, 0.1, False))
    assert compasses.alarms() == []
    assert math.isfinite(compasses.doubt_rad(0))


def test_in_a_flip_nothing_is_compared() -> None:
    compasses = after(10.0, seen([90.0, 0.0]), Level(TILTED, 5.0, False))
    assert compasses.alarms() == []


def test_of_two_the_one_that_does_not_fit_the_earths_norm_and_dip_is_wrong() -> None:
    compasses = Compasses()
    compasses.use_field(FIELD)
    for i in range(100):
        fits = {0: True, 1: False}
        compasses.look(50_000 * i, seen([0.0, 60.0]), Level(TILTED, 0.1, False), fits)
    assert compasses.wrong == {1}
    assert compasses.doubt_rad(0) == 0.0


def test_a_wrong_attitude_makes_no_difference_of_two_fields_that_are_one() -> None:
    """Upside down by a tilt that is off, small differences become large ones of heading."""
    upright = quaternion.from_euler(0.0, (90.0 - 62.0) * DEG, 0.0)
    compasses = after(10.0, seen([0.0, 6.0]), Level(upright, 0.1, False))
    assert compasses.alarms() == []


def test_fields_of_different_times_are_not_compared() -> None:
    """Of a vehicle that turns, levelled by a wrong attitude, 0.8 s apart."""
    compasses, wrong = Compasses(), quaternion.from_euler(70.0 * DEG, 0.0, 0.0)
    compasses.use_field(FIELD)
    for i in range(800):
        true = quaternion.from_euler(0.0, 0.0, 0.05 * i)
        fields = seen([0.0, 0.0], true)
        come = {n: fields[n] for n in (0, 1) if i % 32 == 16 * n}
        compasses.look(50_000 * i, come, Level(quaternion.multiply(true, wrong), 1.0, False))
        assert not compasses.alarms()


def test_fields_that_come_by_turns_are_compared() -> None:
    compasses, fields = Compasses(), seen([0.0, 90.0])
    compasses.use_field(FIELD)
    for i in range(200):
        come = {n: fields[n] for n in (0, 1) if i % 16 == n}
        compasses.look(50_000 * i, come, Level(TILTED, 0.1, False))
    assert compasses.alarms()


# --- what is just enough, and just too little --------------------------------------------------

STEP_US = 200_000
LEVEL = Level(quaternion.IDENTITY, 0.1, False)


def turned(turns_deg, dip_deg=60.0, norm_ut=50.0):
    """The fields of compasses on a vehicle that points to magnetic north."""
    level_ut, down_ut = norm_ut * math.cos(dip_deg * DEG), norm_ut * math.sin(dip_deg * DEG)
    return {
        number: (level_ut * math.cos(turn * DEG), -level_ut * math.sin(turn * DEG), down_ut)
        for number, turn in enumerate(turns_deg)
    }


def looked(turns_deg, dip_deg=60.0, seconds=4.0, level=LEVEL, knows_field=True, fits=None):
    compasses = Compasses()
    if knows_field:
        compasses.use_field(EarthField(50.0, dip_deg * DEG, 10.0 * DEG))
    for i in range(round(1e6 * seconds / STEP_US) + 1):
        compasses.look(STEP_US * i, turned(turns_deg, dip_deg), level, fits)
    return compasses


@pytest.mark.parametrize(
    ("dip_deg", "knows_field", "sound_deg", "apart_deg"),
    [
        (0.0, True, 19.5, 21.0),  # 20 deg at least
        (60.0, True, 24.0, 26.0),  # three deviations of two fields that iron turns by 5 %, level
        (80.0, True, 74.0, 78.0),  # and in space: 12.2 deg, at any dip
        (60.0, False, 29.5, 31.5),  # where the earth's field is not known
    ],
)
def test_two_differ_by_more_than_iron_of_calibrated_ones(
    dip_deg, knows_field, sound_deg, apart_deg
):
    for turn_deg, is_apart in ((sound_deg, False), (apart_deg, True), (-apart_deg, True)):
        compasses = looked((0.0, turn_deg), dip_deg, 60.0, knows_field=knows_field)
        assert compasses.differ(0, 1) is is_apart
        assert compasses.differ(1, 0) is is_apart
        half_rad = 0.5 * apart_deg * DEG if is_apart else 0.0
        assert compasses.doubt_rad(1) == pytest.approx(half_rad)


@pytest.mark.parametrize(
    ("how", "is_apart"),
    [
        ({"seconds": 1.8}, False),
        ({"seconds": 2.2}, True),
        ({"level": Level(quaternion.IDENTITY, 59.0 * DEG, False)}, True),
        ({"level": Level(quaternion.IDENTITY, 61.0 * DEG, False)}, False),
    ],
)
def test_a_difference_lasts_two_seconds_of_level_fields(how, is_apart):
    assert looked(**{"turns_deg": (0.0, 90.0)} | how).differ(0, 1) is is_apart


@pytest.mark.parametrize(("later_us", "is_apart"), [(100_000, True), (100_001, False)])
def test_fields_of_a_tenth_of_a_second_are_of_one_time(later_us, is_apart):
    compasses, fields = Compasses(), turned((0.0, 90.0))
    for i in range(20):
        for number in (0, 1):
            t_us = 2 * STEP_US * i + later_us * number
            compasses.look(t_us, {number: fields[number]}, LEVEL)
    assert compasses.differ(0, 1) is is_apart


def test_a_difference_follows_within_half_a_second():
    compasses = looked((0.0, 90.0))
    assert compasses.doubt_rad(0) == pytest.approx(45.0 * DEG)
    compasses.look(4_200_000, turned((0.0, 0.0)), LEVEL)
    # The mean of directions, of which the new one has a share of 0.2 s of 0.5 s.
    assert compasses.doubt_rad(0) == pytest.approx(0.5 * math.atan2(0.6, 0.4))


@pytest.mark.parametrize(("third_deg", "wrong"), [(16.5, {0}), (17.5, set())])
def test_two_agree_within_a_share_of_the_limit_where_a_third_differs(third_deg, wrong):
    """0.7 of 24.3 deg."""
    compasses = looked((120.0, 0.0, third_deg), seconds=5.0)
    assert compasses.wrong == wrong
    assert len(compasses.alarms()) == 1


def test_of_those_that_are_heard_no_more_nobody_is_alone():
    """The third has stopped: two that differ accuse nobody."""
    compasses, fields = Compasses(), turned((90.0, 0.0, 0.0))
    for i in range(30):
        heard = fields if i < 5 else {0: fields[0], 1: fields[1]}
        compasses.look(STEP_US * i, heard, LEVEL)
    assert compasses.wrong == set()
    assert [alarm.sensor.numbers for alarm in compasses.alarms()] == [(1, 2)]


@pytest.mark.parametrize(
    ("third_deg", "wrong"),
    [(-12.0, {0}), (9.9, {0}), (10.1, set()), (15.0, set()), (19.9, set()), (20.1, {1})],
)
def test_a_third_one_sides_with_the_nearer_of_two_that_differ(third_deg, wrong):
    """It differs from neither by more than the limit of 24 deg, or from one of them."""
    compasses = looked((30.0, 0.0, third_deg), seconds=5.0)
    assert compasses.wrong == wrong
    assert compasses.differ(0, 1)


@pytest.mark.parametrize("third_deg", [0.0, 8.0])
def test_one_that_was_alone_and_agrees_again_is_not_undecided_meanwhile(third_deg):
    """The other two differ by less than it, and it ends with them."""
    compasses = looked((30.0, 0.0, third_deg), seconds=5.0)
    assert compasses.wrong == {0}
    for i in range(1, 60):
        compasses.look(5_000_000 + STEP_US * i, turned((2.0, 0.0, third_deg)), LEVEL)
        assert [alarm.is_decided for alarm in compasses.alarms()] in ([True], [])
    assert compasses.alarms() == []


SHOWN = Level(quaternion.from_euler(0.0, 0.0, 10.0 * DEG), 0.1, True)


@pytest.mark.parametrize(
    ("turns_deg", "how", "text", "evidence"),
    [
        (
            (0.0, 90.0, 0.0),
            {},
            "compass 2 is off by 90 deg",
            "its heading differs by 90 deg from that of compass 1 and 3; those agree",
        ),
        (
            (0.0, 60.0),
            {"level": SHOWN},
            "compass 2 is off by 60 deg",
            "its heading differs by 60 deg from that of compass 1; velocities show which one is "
            "right",
        ),
        (
            (60.0, 0.0),
            {"fits": {0: False, 1: True}},
            "compass 1 is off by 60 deg",
            "its heading differs by 60 deg from that of compass 2; its norm or dip is not the "
            "earth's",
        ),
        (
            (0.0, 90.0),
            {"fits": {0: False, 1: False}},
            "compasses differ by 90 deg",
            "nothing shows yet which of them is wrong",
        ),
        (
            (0.0, 90.0),
            {"fits": {0: None, 1: True}},
            "compasses differ by 90 deg",
            "nothing shows yet which of them is wrong",
        ),
    ],
)
def test_who_is_wrong_is_told_with_the_proof(turns_deg, how, text, evidence):
    (alarm,) = looked(turns_deg, **how).alarms()
    assert (alarm.text, alarm.evidence, alarm.unit) == (text, evidence, "deg")
    is_open = text.startswith("compasses")
    assert alarm.severity is (Severity.ERROR if is_open else Severity.WARNING)
    assert (alarm.is_decided, alarm.degrades) == (not is_open, is_open)
    assert alarm.since_s == pytest.approx(3.8)


def test_of_three_the_largest_difference_is_told():
    (alarm,) = looked((0.0, 60.0, 100.0)).alarms()
    assert alarm.sensor.numbers == (1, 2, 3)
    assert alarm.size == pytest.approx(100.0)


@pytest.mark.parametrize(("off_deg", "is_right"), [(16.5, True), (17.5, False)])
def test_velocities_speak_for_a_compass_within_a_share_of_the_limit(off_deg, is_right):
    compasses = looked((off_deg, -20.0), seconds=10.0, level=SHOWN)
    assert compasses.wrong == ({1} if is_right else set())
