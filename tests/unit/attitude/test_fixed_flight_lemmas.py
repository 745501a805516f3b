"""Lemmas of the flight filter in integers: `known` bounds are believed, here each is checked."""

import math
import random
from collections.abc import Callable, Iterator

import pytest

from h2nav.attitude.kernels import (
    fixed_flight,
    fixed_flight_doubt,
    fixed_flight_field,
    fixed_flight_place,
    fixed_flight_start,
    fixed_flight_theta,
    fixed_flight_velocity,
    fixed_motion,
    fixed_triad,
)
from h2nav.attitude.kernels import fixed_flight_layout as layout
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel import functions as fixed_functions
from h2nav.io import gain_files

MODULES = (
    fixed_triad,
    fixed_motion,
    fixed_functions,
    fixed_flight_theta,
    fixed_flight_doubt,
    fixed_flight_velocity,
    fixed_flight_field,
    fixed_flight_place,
    fixed_flight,
)
BLOCK = 400
Words = list[int]
Maker = Callable[[random.Random, Words, int], Words]


def corners(rng: random.Random, _state: Words, _number: int) -> Words:
    """Every word at an end of its range."""
    return [rng.choice(ends) for ends in layout.SAMPLE_RANGES]


def anything(rng: random.Random, _state: Words, _number: int) -> Words:
    """Every word anywhere in its range."""
    return [rng.randint(low, high) for low, high in layout.SAMPLE_RANGES]


def small(rng: random.Random, _state: Words, _number: int) -> Words:
    """Magnitudes of every size, so that no logarithm is always large."""
    words = []
    for low, high in layout.SAMPLE_RANGES:
        size = rng.randint(0, max(high, -low).bit_length())
        words.append(max(low, min(high, rng.randint(-(1 << size), 1 << size))))
    return words


def spin(rng: random.Random, state: Words, number: int) -> Words:
    """Fastest turns, largest correction, force and field that agree with nothing."""
    words = _still(rng, state)
    for i in range(3):
        words[fixed_motion.W_X + i] = rng.choice(layout.SAMPLE_RANGES[i])
        words[layout.A_X + i] = rng.choice((-layout.FORCE_MOST, layout.FORCE_MOST - 1, 0))
        words[layout.F_FIELD + i] = rng.choice((-32768, 32767, 0))
    words[fixed_motion.DT_US] = fixed_motion.MOST_DT_US
    words[layout.HAS_FIELD] = number & 1
    return words


def quiet(rng: random.Random, state: Words, number: int) -> Words:
    """At rest for long, with every length of a step: variances become as small as they can."""
    words = _still(rng, state)
    words[layout.HAS_FIELD] = number & 1
    words[layout.REST] = 2
    words[fixed_motion.DT_US] = (0, 1, 10000, 12500)[number // 100 % 4]
    return words


def aided(rng: random.Random, state: Words, number: int) -> Words:
    """Fixes: exact, far, with the least and the largest variance and period."""
    words = _still(rng, state)
    words[layout.IS_AIDED] = 1
    words[layout.HAS_FIX] = int(number % rng.choice((1, 5, 20)) == 0)
    far = rng.choice((0, 100, 1 << 20, 1 << 26, layout.S_MOST))
    for i in range(2):
        words[layout.FIX_V + i] = rng.randint(-far, far)
        words[layout.FIX_C + i] = rng.choice((state[layout.C_N + i], rng.randint(0, layout.C_MASK)))
    words[layout.FIX_VARIANCE] = rng.choice((1, 20000, 1 << 24))
    words[layout.FIX_PERIOD_US] = rng.choice((1, 200000, 1 << 22))
    words[layout.CLIPPED] = int(number % 100 > 90)
    return words


def thrust(rng: random.Random, state: Words, number: int) -> Words:
    """One force and one rate for long: velocity and sensitivities reach their limits."""
    words = _still(rng, state)
    words[layout.A_X + number // 100 % 3] = rng.choice((-1, 1)) * (layout.FORCE_MOST - 1)
    words[fixed_motion.W_X + number // 200 % 3] = 38482906
    words[fixed_motion.DT_US] = fixed_motion.MOST_DT_US
    words[layout.IS_AIDED] = number // 200 & 1
    return words


def weak(rng: random.Random, state: Words, number: int) -> Words:
    """Next to no force and next to no field."""
    words = _still(rng, state)
    for i in range(3):
        words[layout.A_X + i] = rng.randint(-3, 3)
        words[layout.F_FIELD + i] = rng.randint(-3, 3)
    words[layout.HAS_FIELD] = number & 1
    return words


def circling(rng: random.Random, state: Words, number: int) -> Words:
    """A coherent turn with a strong field, which teaches the latency all it can hold."""
    words = _still(rng, state)
    angle = 0.2 * number
    words[fixed_motion.W_Z] = round(0.2 / 12500 * 2.0**40)
    words[fixed_motion.DT_US] = fixed_motion.MOST_DT_US
    words[layout.F_FIELD] = round(30000 * math.cos(angle))
    words[layout.F_FIELD + 1] = round(-30000 * math.sin(angle))
    words[layout.HAS_FIELD] = 1
    return words


def relaunched(rng: random.Random, state: Words, number: int) -> Words:
    """Clipped turns that restart the frame, then the largest innovation for a whole one."""
    words = _still(rng, state)
    part = number % 24
    words[layout.CLIPPED] = int(part < 4)
    words[fixed_motion.W_Z] = 38482906 if part < 4 else 0
    words[layout.IS_AIDED] = number // 24 & 1 if part < 4 else 0
    words[layout.NOSE] = -32767 if part < 5 else 32767
    if part == 4:
        for i in range(2):
            words[layout.A_X + i] = rng.choice((-layout.FORCE_MOST, layout.FORCE_MOST - 1))
    words[fixed_motion.DT_US] = fixed_motion.MOST_DT_US
    return words


def _still(rng: random.Random, _state: Words) -> Words:
    words = [0] * layout.SAMPLE_SIZE
    words[layout.A_Z] = -(1 << 20)
    for i, field in enumerate((6400, 0, 11085)):
        words[layout.F_FIELD + i] = field + rng.randint(-3, 3)
    words[fixed_motion.DT_US] = 10000
    words[layout.FIX_VARIANCE] = words[layout.FIX_PERIOD_US] = 1
    return words


MAKERS: tuple[Maker, ...] = (
    quiet, corners, quiet, anything, circling, small, aided, spin, thrust, weak, aided, relaunched,
    quiet,
)  # fmt: skip


def blocks(rng: random.Random, count: int) -> Iterator[Maker]:
    """All makers, then any of them: each has to take over from what any other has left."""
    yield from MAKERS
    for _ in range(count - len(MAKERS)):
        yield rng.choice(MAKERS)


def corner_params(rng: random.Random) -> Words:
    """Parameters at the ends of what is declared."""
    return [rng.choice(ends) for ends in layout.PARAMS_RANGES]


def shipped_params(name: str) -> Words:
    return list(integer_gains(velocity_aided_gains(gain_files.load(name), name), name).params)


def watched_run(rng: random.Random, params: Words, count: int) -> None:
    """Runs blocks of samples, with restarts and new places between them."""
    state = [rng.choice((-(1 << 31), (1 << 31) - 1)) for _ in range(layout.STATE_SIZE)]
    fixed_flight_start.reset(state)
    fixed_flight_start.prepare(state, params)
    for maker in blocks(rng, count):
        for number in range(BLOCK):
            take(state, params, maker(rng, state, number))
        if rng.random() < 0.3:
            place = [rng.choice((-32768, 0, 6400, 32767)) for _ in range(3)]
            fixed_flight_place.set_place(state, params, place)
        for number in range(20):  # first attitudes from anything
            fixed_flight_start.restart(state)
            take(state, params, rng.choice((spin, corners, weak))(rng, state, number))


def take(state: Words, params: Words, sample: Words) -> None:
    fixed_flight.update(state, params, sample)
    for word, (low, high) in enumerate(layout.STATE_RANGES):
        assert low <= state[word] <= high, word


@pytest.fixture
def _checked(monkeypatch: pytest.MonkeyPatch) -> None:
    def known(x: int, low: int, high: int) -> int:
        assert low <= x <= high, f"{x} outside {low}..{high}"
        return x

    for module in MODULES:
        if hasattr(module, "known"):
            monkeypatch.setattr(module, "known", known)


@pytest.mark.usefixtures("_checked")
@pytest.mark.parametrize("name", ["handheld_100hz", "multirotor_400hz", "fixed-wing_50hz"])
def test_the_lemmas_hold_at_the_extremes(name: str) -> None:
    watched_run(random.Random(name), shipped_params(name), 40)


@pytest.mark.usefixtures("_checked")
@pytest.mark.parametrize("seed", range(4))
def test_the_lemmas_hold_for_parameters_at_the_ends_of_their_ranges(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(4):
        watched_run(rng, corner_params(rng), 12)
