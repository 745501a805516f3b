"""Which of two gyros that differ a field shows to be right."""

import math
import random

import pytest

from h2nav.integrity.sensor_pairs import VOTING_WINDOW_S
from h2nav.integrity.turn_witness import TurnWitness
from h2nav.maths.quaternion import IDENTITY, conjugate, rotate, turned
from h2nav.maths.units import DEG

FIELD_UT = (20.0, 1.0, 42.0)  # north, east, down: a dip of 65 deg
TURN_DEG_S = 15.0


def swinging(t_s):
    """Turns to and fro, mostly about the vertical."""
    return 0.1 * math.sin(t_s), 0.1 * math.sin(0.7 * t_s), TURN_DEG_S * DEG * math.sin(0.25 * t_s)


def circling(_t_s):
    return 0.0, 0.0, TURN_DEG_S * DEG


def still(_t_s):
    return 0.0, 0.0, 0.0


def scaled(share):
    return lambda w: tuple(share * x for x in w)


def off(deg_s):
    return lambda w: (w[0], w[1], w[2] + deg_s * DEG)


def sound(w):
    return tuple(x + 0.2 * DEG for x in w)


class Flight:
    """Two gyros and one compass, window by window."""

    def __init__(self, first, second, turns, iron_ut=(0.0, 0.0, 0.0), seed=1):
        zero = 3 * (0.2 * DEG,)
        self.witness = TurnWitness(zero, zero)
        self._gyros, self._turns, self._iron_ut = (first, second), turns, iron_ut
        self._random = random.Random(seed)
        self._q_nb, self._number = IDENTITY, 100

    def fly(self, seconds, *, field_of=None, every=1):
        """The number of windows until one is named; None: nobody is."""
        for count in range(round(seconds / VOTING_WINDOW_S)):
            steps = 4
            rates = [
                self._turns((self._number + (i + 0.5) / steps) * VOTING_WINDOW_S)
                for i in range(steps)
            ]
            for w in rates:
                step_s = VOTING_WINDOW_S / steps
                self._q_nb = turned(self._q_nb, tuple(step_s * x for x in w))
            mean = tuple(sum(each) / steps for each in zip(*rates, strict=True))
            seen = rotate(conjugate(self._q_nb), FIELD_UT)
            noise = self._random.gauss
            field = tuple(x + b + noise(0.0, 0.7) for x, b in zip(seen, self._iron_ut, strict=True))
            field = field if field_of is None else field_of(field)
            self._number += 1
            rates = (gyro(mean) for gyro in self._gyros)
            self.witness.take(self._number, *rates, field if count % every == 0 else None)
            if self.witness.wrong is not None and self.witness.wrong[1] >= 1.0:
                return count + 1
        return None


@pytest.mark.parametrize("wrong", [0, 1])
@pytest.mark.parametrize("turns", [swinging, circling])
@pytest.mark.parametrize(
    ("fault", "every"), [(scaled(1.3), 1), (scaled(0.7), 3), (off(5.0), 1), (lambda w: w[::-1], 1)]
)
def test_the_one_that_turns_as_no_field_does_is_wrong(wrong, turns, fault, every):
    gyros = (fault, sound) if wrong == 0 else (sound, fault)
    flight = Flight(*gyros, turns, (1.0, -1.5, 1.0))
    assert flight.fly(30.0, every=every) is not None
    assert flight.witness.wrong[0] == wrong


@pytest.mark.parametrize("turns", [swinging, circling, still])
@pytest.mark.parametrize("iron_ut", [(0.0, 0.0, 0.0), (3.0, -2.0, 2.0)])
@pytest.mark.parametrize("seed", range(2))
def test_two_that_differ_by_their_biases_are_both_right(turns, iron_ut, seed):
    first, second = (lambda w: sound(off(0.3)(w))), (lambda w: sound(off(-0.3)(w)))
    flight = Flight(first, second, turns, iron_ut, seed)
    assert flight.fly(60.0) is None


@pytest.mark.parametrize(
    "field_of",
    [
        lambda field: (20.0, 1.0, 42.0),
        lambda field: (0.0, 0.0, 0.0),
        lambda field: tuple(-x for x in field),
        lambda field: (field[1], field[0], field[2]),
    ],
    ids=["frozen", "nothing", "reversed", "axes swapped"],
)
def test_a_compass_that_shows_neither_names_nobody(field_of):
    flight = Flight(scaled(1.3), sound, swinging)
    found = flight.fly(60.0, field_of=field_of)
    # A field that is reversed turns as the sound one does.
    assert found is None or flight.witness.wrong[0] == 0


def test_a_field_that_steps_names_nobody_until_the_step_is_past():
    flight = Flight(sound, scaled(1.3), circling)
    flight.fly(4.0)
    heading = rotate((math.cos(0.4), 0.0, 0.0, math.sin(0.4)), (1.0, 0.0, 0.0))
    c, s = heading[0], heading[1]
    flight.fly(20.0, field_of=lambda f: (c * f[0] - s * f[1], s * f[0] + c * f[1], f[2]))
    assert flight.witness.wrong is None or flight.witness.wrong[0] == 1


def test_what_was_turned_in_a_gap_counts_for_nobody():
    flight = Flight(scaled(1.3), sound, circling)
    for _ in range(20):
        found = flight.fly(2.4)
        assert found is None or flight.witness.wrong[0] == 0
        flight._number += 1
        flight._q_nb = turned(flight._q_nb, (0.0, 0.0, -1.0))
    assert found is not None
