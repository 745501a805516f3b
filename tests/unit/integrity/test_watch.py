"""The compiled kernels of the watch: bit for bit what those in Python say and remember."""

import functools
import math
import operator
import random

import pytest

from h2nav.attitude.native import SWITCH, native_kernels
from h2nav.attitude.record import values
from h2nav.attitude.samples import ImuSample
from h2nav.integrity.kernel.memory import (
    BEGUN,
    DUE,
    FIELD_FROZEN,
    FORCE_FROZEN,
    GYRO_FROZEN,
    KEPT,
    ROW,
    STUCK_AXIS,
    THIN_ROW,
    Memory,
)
from h2nav.integrity.watch import Watch

UNIT = 9.80665e-3


def samples():
    """Floats, whole counts, a frozen IMU, a stuck axis, a gap, slow samples, a rare field."""
    rng = random.Random(11)
    t_us, held = 0, None
    for i in range(6000):
        t_us += 400_000 if i == 900 else 40_000 if 3000 < i < 3500 else 10_000
        w = [rng.gauss(0.2 * math.sin(0.01 * i), 0.05) for _ in range(3)]
        f = [rng.gauss(level, 0.3) for level in (0.0, 0.0, -9.8)]
        if i % 2000 > 1200:
            w, f = [round(1e3 * x) * 1e-3 for x in w], [round(x / UNIT) * UNIT for x in f]
        if 2400 < i < 2600:
            w[1] = 0.4
        if i % 1500 > 1400:
            w, f = held
        held = w, f
        field = None if i % 3 or 4000 < i < 4300 else (20.0 + w[0], rng.gauss(0.0, 0.1), 43.0)
        if 5000 < i < 5600:
            field = (20.0, 1.0, 43.0)
        yield ImuSample(t_us, tuple(w), tuple(f), field, i % 70 == 3)


def watched():
    """The bits of all checks, of what followed them, and the memory now and then."""
    watch, checked, followed, memories = Watch(), [], [], []
    for i, sample in enumerate(samples()):
        if i == 2000:
            watch.gains.field_delay_s = 0.03
        checked.append(watch.check(sample))
        if i % 100 < 95:
            x, y, z = sample.w_b
            followed.append(watch.follow((x - 0.01, y, z + 0.02)))
        if i % 50 == 0:
            memories.append(values(watch.memory, Memory))
    return checked, followed, memories


def test_the_compiled_kernels_say_and_remember_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    if native_kernels() is None:
        pytest.skip("the compiled kernels are absent or older than the Python ones")
    compiled = watched()
    monkeypatch.setenv(SWITCH, "forbid")
    assert compiled == watched()
    checked, followed, _ = compiled
    assert {0, FIELD_FROZEN, GYRO_FROZEN | FORCE_FROZEN, 2 * STUCK_AXIS} <= set(checked)
    assert functools.reduce(operator.or_, followed) == BEGUN | KEPT | ROW | THIN_ROW | DUE


@pytest.mark.parametrize(("is_told", "accused"), [(False, True), (True, False)])
def test_values_of_another_message_repeat_as_they_do_there(is_told, accused):
    """In floats nothing repeats itself; in counts most values of a hover are those before."""
    rng, watch, bits = random.Random(3), Watch(), 0
    for i in range(6000):
        w = [rng.gauss(level, 0.003) for level in (0.0, 0.0, 0.35)]
        f = [rng.gauss(level, 0.002) for level in (0.0, 0.0, -9.804)]
        if i == 3000 and is_told:
            watch.forget_values()
        if i >= 3000:
            w, f = [round(1e3 * x) * 1e-3 for x in w], [round(x / UNIT) * UNIT for x in f]
        bits |= watch.check(ImuSample(10_000 * i, tuple(w), tuple(f), None, False))
    assert bool(bits & FORCE_FROZEN) == accused
    assert not bits & GYRO_FROZEN


def test_a_sensor_that_freezes_after_a_change_of_message_is_frozen():
    rng, watch = random.Random(3), Watch()
    for i in range(6000):
        if i == 3000:
            watch.forget_values()
        if i < 5000:
            w = tuple(round(rng.gauss(0.2, 0.05), 3) for _ in range(3))
        f = tuple(round(rng.gauss(level, 0.3), 2) for level in (0.0, 0.0, -9.8))
        bits = watch.check(ImuSample(10_000 * i, w, f, None, False))
        assert bits == (GYRO_FROZEN if i > 5050 else 0) or 5000 <= i <= 5050
