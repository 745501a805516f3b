"""Lemmas of the integer filter: `known` bounds are believed, here each is checked."""

import math
import random
from collections.abc import Callable, Iterator

import pytest

from h2nav.attitude.integer import motion, triad
from h2nav.attitude.integer.motion import MAX_DT_US
from h2nav.attitude.record import assign, row, rows, values
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.gains import integer_gains
from h2nav.attitude.velocity_aided.integer.kernel import (
    aiding,
    frame,
    functions,
    heading,
    start,
    step,
    theta,
    tilt,
    told,
    velocity,
)
from h2nav.attitude.velocity_aided.integer.memory import (
    FORCE_MAX,
    GAINED_MASK,
    VELOCITY_MAX,
    Gains,
    Sample,
    State,
)
from h2nav.files import gain_files

pytestmark = pytest.mark.thorough

MODULES = (
    triad, motion, functions, theta, aiding, tilt, velocity, heading, frame, told, start, step
)  # fmt: skip
BLOCK = 400
Maker = Callable[[random.Random, State, int], Sample]


def ranges(record_type: type) -> list[tuple[int, int]]:
    """Lowest and highest value of every number of a record."""
    return [found.range or (0, 0) for found in rows(record_type) for _ in range(found.length)]


ACCEL_RANGE = row(Sample, "fix_accel_n").range or (0, 0)
SAMPLE_RANGES, GAINS_RANGES = ranges(Sample), ranges(Gains)


def sample_of(numbers: list[int]) -> Sample:
    sample = Sample()
    assign(sample, Sample, numbers)
    return sample


def corners(rng: random.Random, _state: State, _number: int) -> Sample:
    """Every number at an end of its range."""
    return sample_of([rng.choice(ends) for ends in SAMPLE_RANGES])


def anything(rng: random.Random, _state: State, _number: int) -> Sample:
    """Every number anywhere in its range."""
    return sample_of([rng.randint(low, high) for low, high in SAMPLE_RANGES])


def small(rng: random.Random, _state: State, _number: int) -> Sample:
    """Magnitudes of every size, so that no logarithm is always large."""
    numbers = []
    for low, high in SAMPLE_RANGES:
        size = rng.randint(0, max(high, -low).bit_length())
        numbers.append(max(low, min(high, rng.randint(-(1 << size), 1 << size))))
    return sample_of(numbers)


def spin(rng: random.Random, memory: State, number: int) -> Sample:
    """Fastest turns, largest correction, force and field that agree with nothing."""
    u = _still(rng, memory)
    for i in range(3):
        u.gyro[i] = rng.choice(SAMPLE_RANGES[i])
        u.accel[i] = rng.choice((-FORCE_MAX, FORCE_MAX - 1, 0))
        u.mag[i] = rng.choice((-32768, 32767, 0))
    u.dt_us = MAX_DT_US
    u.has_mag = number & 1
    return u


def quiet(rng: random.Random, memory: State, number: int) -> Sample:
    """At rest for long, with every length of a step: variances become as small as they can."""
    u = _still(rng, memory)
    u.has_mag = number & 1
    u.rest_prior = 2
    u.dt_us = (0, 1, 10000, 12500)[number // 100 % 4]
    return u


def aided(rng: random.Random, memory: State, number: int) -> Sample:
    """Fixes: exact, far, with the least and the largest variance and period."""
    u = _still(rng, memory)
    u.aided = 1
    u.has_fix = int(number % rng.choice((1, 5, 20)) == 0)
    far = rng.choice((0, 100, 1 << 20, 1 << 26, VELOCITY_MAX))
    u.fix_velocity_n = rng.randint(-far, far)
    u.fix_gained_n = rng.choice((memory.gained_n, rng.randint(0, GAINED_MASK)))
    u.fix_velocity_e = rng.randint(-far, far)
    u.fix_gained_e = rng.choice((memory.gained_e, rng.randint(0, GAINED_MASK)))
    u.fix_accel_n = rng.choice((0, 1 << 20, rng.choice(ACCEL_RANGE)))
    u.fix_accel_e = rng.randint(*ACCEL_RANGE)
    u.fix_variance = rng.choice((1, 20000, 1 << 24))
    u.fix_period_us = rng.choice((1, 200000, 1 << 22))
    u.clipped = int(number % 100 > 90)
    return u


def thrust(rng: random.Random, memory: State, number: int) -> Sample:
    """One force and one rate for long: velocity and sensitivities reach their limits."""
    u = _still(rng, memory)
    u.accel[number // 100 % 3] = rng.choice((-1, 1)) * (FORCE_MAX - 1)
    u.gyro[number // 200 % 3] = 38482906
    u.dt_us = MAX_DT_US
    u.aided = number // 200 & 1
    return u


def weak(rng: random.Random, memory: State, number: int) -> Sample:
    """Next to no force and next to no field."""
    u = _still(rng, memory)
    for i in range(3):
        u.accel[i] = rng.randint(-3, 3)
        u.mag[i] = rng.randint(-3, 3)
    u.has_mag = number & 1
    return u


def circling(rng: random.Random, memory: State, number: int) -> Sample:
    """A coherent turn with a strong field, which teaches the latency all it can hold."""
    u = _still(rng, memory)
    angle = 0.2 * number
    u.gyro[2] = round(0.2 / 12500 * 2.0**40)
    u.dt_us = MAX_DT_US
    u.mag[0] = round(30000 * math.cos(angle))
    u.mag[1] = round(-30000 * math.sin(angle))
    u.has_mag = 1
    return u


def relaunched(rng: random.Random, memory: State, number: int) -> Sample:
    """Clipped turns that restart the frame, then the largest innovation for a whole one."""
    u = _still(rng, memory)
    part = number % 24
    u.clipped = int(part < 4)
    u.gyro[2] = 38482906 if part < 4 else 0
    u.aided = number // 24 & 1 if part < 4 else 0
    u.forward_speed = -32767 if part < 5 else 32767
    if part == 4:
        for i in range(2):
            u.accel[i] = rng.choice((-FORCE_MAX, FORCE_MAX - 1))
    u.dt_us = MAX_DT_US
    return u


def _still(rng: random.Random, _state: State) -> Sample:
    u = Sample(dt_us=10000, parts=1, fix_variance=1, fix_period_us=1)
    u.accel[2] = -(1 << 20)
    for i, field in enumerate((6400, 0, 11085)):
        u.mag[i] = field + rng.randint(-3, 3)
    return u


MAKERS: tuple[Maker, ...] = (
    quiet, corners, quiet, anything, circling, small, aided, spin, thrust, weak, aided, relaunched,
    quiet,
)  # fmt: skip


def blocks(rng: random.Random, count: int) -> Iterator[Maker]:
    """All makers, then any of them: each has to take over from what any other has left."""
    yield from MAKERS
    for _ in range(count - len(MAKERS)):
        yield rng.choice(MAKERS)


def corner_gains(rng: random.Random) -> Gains:
    """Gains at the ends of what is declared."""
    gains = Gains()
    assign(gains, Gains, [rng.choice(ends) for ends in GAINS_RANGES])
    return gains


def shipped_gains(name: str) -> Gains:
    return integer_gains(velocity_aided_gains(gain_files.load(name), name), name).gains


def watched_run(rng: random.Random, gains: Gains, count: int) -> None:
    """Runs blocks of samples, with restarts and new places between them."""
    memory = State()
    start.reset(memory, gains)
    for maker in blocks(rng, count):
        for number in range(BLOCK):
            take(memory, gains, maker(rng, memory, number))
        if rng.random() < 0.3:
            north, east, down = (rng.choice((-32768, 0, 6400, 32767)) for _ in range(3))
            told.set_place(memory, gains, north, east, down)
        for number in range(20):  # gaps
            start.resume(memory, gains, rng.choice((spin, corners, weak))(rng, memory, number))
            assign(memory, State, values(memory, State))
        for number in range(20):  # first attitudes from anything
            start.restart(memory)
            take(memory, gains, rng.choice((spin, corners, weak))(rng, memory, number))


def take(memory: State, gains: Gains, sample: Sample) -> None:
    step.update(memory, gains, sample)
    assign(memory, State, values(memory, State))  # refuses what is out of its range


@pytest.fixture
def _checked(monkeypatch: pytest.MonkeyPatch) -> None:
    def known(x: int, low: int, high: int) -> int:
        assert low <= x <= high, f"{x} outside {low}..{high}"
        return x

    for module in MODULES:
        if hasattr(module, "known"):
            monkeypatch.setattr(module, "known", known)


@pytest.mark.usefixtures("_checked")
def test_the_lemmas_hold_at_the_extremes() -> None:
    name = "multirotor_400hz"
    watched_run(random.Random(name), shipped_gains(name), 40)


@pytest.mark.usefixtures("_checked")
@pytest.mark.parametrize("seed", range(2))
def test_the_lemmas_hold_for_gains_at_the_ends_of_their_ranges(seed: int) -> None:
    rng = random.Random(seed)
    for _ in range(4):
        watched_run(rng, corner_gains(rng), 12)
