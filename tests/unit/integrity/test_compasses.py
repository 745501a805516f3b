"""Several compasses against each other: who differs, and who is wrong."""

import math

import pytest
from needs import DEG
from synthetic_imu import FIELD, FIELD_N

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
