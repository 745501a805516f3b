"""The sums behind all windows, in Python, against scipy and closed forms."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.integrity.kernel.memory import BEGUN, DUE, KEPT, ROW, THIN_ROW, Gains, Memory, Sample
from h2nav.integrity.kernel.windows import follow

MS = 1000.0


class Bench:
    """Samples at times that a test gives."""

    def __init__(self, delay_s=0.0):
        self.memory, self.gains, self.sample = Memory(), Gains(), Sample()
        self.gains.field_delay_s = delay_s

    def take(self, t_ms, rate=(0.0, 0.0, 0.0), force=(0.0, 0.0, 0.0), field=None):
        sample = self.sample
        sample.t_us = t_ms * MS
        sample.rate[:], sample.accel[:] = rate, force
        sample.mag[:] = field or (0.0, 0.0, 0.0)
        sample.has_mag = float(field is not None)
        return follow(self.memory, self.gains, sample)

    @property
    def turn(self):
        return Rotation.from_quat(np.roll(self.memory.q_sb, -1))


RANDOM = np.random.default_rng(6)
STEPS_MS = RANDOM.uniform(2.0, 20.0, 60)
RATES = RANDOM.normal(0.0, 1.0, (60, 3))
FORCES = RANDOM.normal((0.0, 0.0, -9.8), 2.0, (60, 3))


def test_turn_and_force_are_integrated_by_the_attitude_in_the_middle_of_each_step():
    bench = Bench()
    assert bench.take(7.0, (9.0,) * 3, (9.0,) * 3) & BEGUN
    turn, gained, path, t_ms = Rotation.identity(), np.zeros(3), 0.0, 7.0
    for step_ms, rate, force in zip(STEPS_MS, RATES, FORCES, strict=True):
        t_ms += step_ms
        dt_s = 1e-3 * step_ms
        assert not bench.take(t_ms, rate, force) & BEGUN
        gained = gained + dt_s * (turn * Rotation.from_rotvec(0.5 * dt_s * rate)).apply(force)
        turn = turn * Rotation.from_rotvec(dt_s * rate)
        path += dt_s * np.linalg.norm(rate)
    assert (bench.turn.inv() * turn).magnitude() == pytest.approx(0.0, abs=1e-6)
    assert bench.memory.gained_s == pytest.approx(gained)
    assert bench.memory.path_rad == pytest.approx(path)
    assert np.linalg.norm(bench.memory.q_sb) == pytest.approx(1.0)
    assert (bench.memory.turn_variance, bench.memory.gained_variance) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("step_ms", "begins"),
    [(300.0, False), (300.001, True), (0.001, False), (0.0, True), (-9.0, True)],
)
def test_a_gap_or_a_step_back_begins_anew(step_ms, begins):
    bench = Bench()
    for i in range(100):
        bench.take(10.0 * i, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (20.0, 0.0, 40.0))
    bench.take(1030.0, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    bits = bench.take(1030.0 + step_ms, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0))
    assert bool(bits & BEGUN) == begins
    memory = bench.memory
    if begins:
        assert bits & KEPT
        assert memory.q_sb[:] == [1.0, 0.0, 0.0, 0.0]
        assert memory.gained_s[:] == memory.began_gained_s[:] == [0.0] * 3
        assert (memory.path_rad, memory.fields, memory.slow_samples) == (0.0, 0.0, 0.0)
        assert (memory.is_running, memory.is_summing) == (1.0, 1.0)
    else:
        assert memory.path_rad > 0.0


def test_an_interrupted_strapdown_begins_anew():
    bench = Bench()
    bench.take(0.0)
    assert not bench.take(10.0) & BEGUN
    bench.memory.is_running = 0.0
    assert bench.take(20.0) & BEGUN
    assert not bench.take(30.0) & BEGUN


def test_moments_are_kept_every_50_ms_and_judged_every_200():
    bench = Bench()
    kept, due = [], []
    for t_ms in range(1000, 1500, 10):
        bits = bench.take(float(t_ms))
        kept += [t_ms] * bool(bits & KEPT)
        due += [t_ms] * bool(bits & DUE)
    assert kept == list(range(1000, 1500, 50))
    assert due == [1000, 1200, 1400]


@pytest.mark.parametrize(("step_ms", "is_slow"), [(25.0, False), (25.001, True)])
def test_slow_samples_miss_motion_by_their_second_differences(step_ms, is_slow):
    bench = Bench()
    for i, (rate, force) in enumerate(zip(RATES[:6], FORCES[:6], strict=True)):
        bench.take(i * step_ms, rate, force)
    # the first sample begins the strapdown: the second to the sixth are slow
    scale = (1e-3 * step_ms) ** 2 / 6.0 if is_slow else 0.0
    turned, gained = (
        scale * (np.diff(values[1:6], 2, axis=0) ** 2).sum() for values in (RATES, FORCES)
    )
    assert bench.memory.turn_variance == pytest.approx(turned)
    assert bench.memory.gained_variance == pytest.approx(gained)
    # white noise of a sixth of that: the variance of its integral
    noise = RANDOM.normal(0.0, 0.2, (4000, 3))
    long = Bench()
    for i, rate in enumerate(noise):
        long.take(30.0 * i, rate)
    assert long.memory.turn_variance == pytest.approx(4000 * 3 * (0.03 * 0.2) ** 2, rel=0.05)


EARTH = np.array((20.0, -5.0, 43.0))


@pytest.mark.parametrize("delay_s", [0.0, 0.04])
def test_a_row_is_the_mean_field_of_a_second_in_the_frame_of_the_start(delay_s):
    """A field that stands still in space, measured late by a body that turns."""
    bench = Bench(delay_s)
    rate = np.array((0.2, -0.3, 0.8))
    ended = []
    for i in range(205):
        t_s = 0.01 * i
        body = Rotation.from_rotvec((t_s - delay_s) * rate)
        field = tuple(body.inv().apply(EARTH)) if i % 2 == 0 else None
        bits = bench.take(10.0 * i, rate, (0.5, 0.0, -9.8), field)
        if bits & (ROW | THIN_ROW):
            ended.append((i, bits & (ROW | THIN_ROW)))
            memory = bench.memory
            field_s = np.array(memory.row_field_s)
            assert field_s / np.linalg.norm(field_s) == pytest.approx(EARTH / np.linalg.norm(EARTH))
            assert memory.row_norm == pytest.approx(np.linalg.norm(EARTH))
            assert np.linalg.norm(field_s) == pytest.approx(50 * np.linalg.norm(EARTH))
            # what the force gave in this second alone
            before = bench.gained if i > 100 else np.zeros(3)
            bench.gained = np.array(memory.gained_s)
            assert memory.row_force_s == pytest.approx(bench.gained - before)
    assert ended == [(100, ROW), (200, ROW)]


@pytest.mark.parametrize(("count", "bits"), [(3, ROW), (2, THIN_ROW), (0, THIN_ROW)])
def test_a_row_needs_three_fields(count, bits):
    bench = Bench()
    for i in range(100):
        found = bench.take(10.0 * i, field=(20.0, 0.0, 43.0) if 0 < i <= count else None)
        assert not found & (ROW | THIN_ROW)
    assert bench.take(1000.0) & (ROW | THIN_ROW) == bits
    if bits == THIN_ROW:
        assert bench.memory.row_norm == 0.0
    # the next one begins with nothing
    assert (bench.memory.fields, bench.memory.norms, bench.memory.sum_s[:]) == (0.0, 0.0, [0.0] * 3)


def test_while_the_field_is_frozen_no_row_is_summed():
    bench = Bench()
    bench.take(0.0)
    for i in range(1, 60):
        bench.take(10.0 * i, field=(20.0, 0.0, 43.0))
    bench.memory.field_frozen = 1.0
    assert not bench.take(600.0) & (ROW | THIN_ROW)
    bench.memory.field_frozen = 0.0
    bits = [bench.take(600.0 + 10.0 * i, field=(20.0, 0.0, 43.0)) for i in range(1, 112)]
    assert [i for i, found in enumerate(bits, 1) if found & ROW] == [101]
    assert math.isclose(bench.memory.row_norm, math.hypot(20.0, 43.0))
