"""Since when velocities contradict, what has decided it, and when it is explained again."""

import math

import pytest

from h2nav.integrity.causes import DECIDED, NOTHING, SUSPECTED, Cause, Explained
from h2nav.integrity.contradiction import Contradiction

CONTRADICTING = Explained(odds=math.log(DECIDED) + 0.1)
SUSPICIOUS = Explained(odds=math.log(SUSPECTED) + 0.1)
S = 1_000_000


def fed(*explanations):
    """One explanation a second, from 10 s on."""
    made = Contradiction()
    for i, found in enumerate(explanations):
        made.take((10 + i) * S, found)
    return made


@pytest.mark.parametrize(
    ("explanations", "begun_us", "old_us"),
    [
        ((NOTHING, NOTHING), None, None),
        ((SUSPICIOUS, SUSPICIOUS), None, 14 * S),
        ((CONTRADICTING, CONTRADICTING), 10 * S, 14 * S),
        ((SUSPICIOUS, CONTRADICTING), 11 * S, 14 * S),
        ((NOTHING, CONTRADICTING, SUSPICIOUS), 11 * S, 15 * S),
    ],
)
def test_it_begins_with_the_first_explanation_that_finds_one(explanations, begun_us, old_us):
    made = fed(*explanations)
    assert made.explained == explanations[-1]
    assert made.is_due(0) is False
    assert made.begun_us == begun_us
    for t_us in (13 * S, 14 * S - 1, 14 * S, 15 * S - 1, 15 * S):
        assert made.is_old(t_us) == (old_us is not None and t_us >= old_us)


@pytest.mark.parametrize(
    ("explained", "t_us", "is_told", "is_young"),
    [
        (CONTRADICTING, 10 * S + 999_999, False, False),
        (CONTRADICTING, 11 * S, True, False),
        (CONTRADICTING, 10 * S + 699_999, False, True),
        (CONTRADICTING, 10 * S + 700_000, False, False),
        (SUSPICIOUS, 12 * S, False, False),
        (NOTHING, 12 * S, False, True),
    ],
)
def test_it_is_told_after_a_second_and_young_before(explained, t_us, is_told, is_young):
    made = fed(explained)
    assert (made.is_told(t_us), made.is_young(t_us)) == (is_told, is_young)


def test_an_old_one_is_explained_every_second_a_young_one_always():
    made = fed(CONTRADICTING)
    assert made.is_due(10 * S)
    made.take(14 * S, CONTRADICTING)
    assert made.is_due(14 * S)
    assert not made.is_due(14 * S + 1)
    made.take(16 * S, CONTRADICTING)
    assert not made.is_due(17 * S - 1)
    assert made.is_due(17 * S)
    made.forget()
    assert made.is_due(16 * S)


def test_the_cause_is_the_one_decided_most_often():
    made = fed(CONTRADICTING)
    assert made.decided is None
    assert made.shown(Cause.GYRO) is None
    first, second = CONTRADICTING._replace(step=1.0), CONTRADICTING._replace(step=2.0)
    made.decide(Cause.GYRO, first)
    made.decide(Cause.ACCELEROMETER, first)
    made.decide(Cause.ACCELEROMETER, second)
    assert made.decided is Cause.ACCELEROMETER
    assert made.shown(Cause.ACCELEROMETER) == second
    assert made.shown(Cause.GYRO) == first
    made.clear(Cause.ACCELEROMETER)
    made.clear(Cause.ACCELEROMETER)  # nothing is left of it
    assert made.decided is Cause.GYRO


def test_once_it_is_over_nothing_is_left_of_it():
    made = fed(CONTRADICTING)
    made.decide(Cause.GYRO, CONTRADICTING)
    made.forget()
    assert (made.explained, made.begun_us, made.decided) == (NOTHING, None, None)
    assert made.shown(Cause.GYRO) is None
    assert made.is_young(30 * S)
    assert not made.is_old(30 * S)
    made.take(30 * S, CONTRADICTING)
    assert made.begun_us == 30 * S
