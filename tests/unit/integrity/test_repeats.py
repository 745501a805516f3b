"""Values that come again: honest ones of several resolutions and rates, and frozen ones."""

import numpy as np
import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.kernel.memory import FORCE_FROZEN, GYRO_FROZEN, STUCK_AXIS, UNSEEN_TURN
from h2nav.integrity.watch import Watch

MILLI_G = 9.80665e-3
GYRO_COUNT, FORCE_COUNT = 1e-3, MILLI_G
FLOATS = (1e-9, 1e-9)
INTEGERS = (GYRO_COUNT, FORCE_COUNT)


def stream(hz, seconds, noise, counts, seed=1):
    """Values of an IMU: at rest for 20 s, then turning and shaken, in whole counts.

    Args:
        hz: samples a second.
        seconds: in all.
        noise: of gyro and force in motion, in their counts of the integers.
        counts: resolution of gyro and force.
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    t_s = np.arange(round(seconds * hz)) / hz
    moves = (t_s >= 20.0)[:, None]
    # slow turns of some seconds, as of a vehicle that circles
    turns = np.stack([0.02 * np.sin(0.3 * t_s), 0.02 * np.cos(0.2 * t_s), 0.2 + 0.0 * t_s], 1)
    level = np.tile((0.0, 0.0, -9.80665), (len(t_s), 1))
    shaken = np.where(moves, noise, 0.02 * noise)
    gyro = moves * turns + GYRO_COUNT * shaken * rng.normal(size=(len(t_s), 3))
    force = level + FORCE_COUNT * shaken * rng.normal(size=(len(t_s), 3))
    return t_s, np.round(gyro / counts[0]) * counts[0], np.round(force / counts[1]) * counts[1]


def watched(t_s, gyro, force):
    """The bits that accuse a sensor, of every sample."""
    watch = Watch()
    t_us = np.round(1e6 * t_s).astype(int).tolist()
    samples = map(ImuSample, t_us, *(zip(*each.T.tolist(), strict=True) for each in (gyro, force)))
    return np.fromiter(map(watch.check, samples), int, len(t_us)) & ~UNSEEN_TURN


@pytest.mark.parametrize("counts", [FLOATS, INTEGERS, (4 * GYRO_COUNT, 8 * FORCE_COUNT)])
@pytest.mark.parametrize("noise", [0.1, 0.5, 2.0, 10.0])
@pytest.mark.parametrize("hz", [10, 40, 200])
def test_honest_values_are_not_accused(hz, noise, counts):
    assert not watched(*stream(hz, 60.0 if hz == 200 else 200.0, noise, counts)).any()


@pytest.mark.parametrize("seed", range(5))
def test_a_vehicle_that_goes_and_stops_is_not_accused(seed):
    """Whole counts of a sensor without noise: in motion they change, at rest they never do."""
    rng = np.random.default_rng(seed)
    parts, at = [], 0.0
    for _ in range(12):
        parts.append((np.zeros(800), np.full(800, at)))
        n = int(rng.integers(100, 900))
        swing = 0.3 * np.sin(np.arange(n) / rng.uniform(5.0, 60.0))
        parts.append((swing, at + 3.0 * swing))
    turn, push = (np.concatenate(column) for column in zip(*parts, strict=True))
    gyro = np.round(np.stack([0.5 * turn, turn, 0.2 * turn], 1) / GYRO_COUNT) * GYRO_COUNT
    force = np.stack([push, 0.1 * push, 0.02 * push - 9.8], 1)
    force = np.round(force / FORCE_COUNT) * FORCE_COUNT
    assert not watched(np.arange(len(turn)) / 100.0, gyro, force).any()


@pytest.mark.parametrize(
    ("hz", "noise", "counts", "within_s"),
    [
        (100, 10.0, FLOATS, 0.15),
        (40, 10.0, FLOATS, 0.4),
        (10, 10.0, FLOATS, 3.0),
        (100, 10.0, INTEGERS, 0.4),
        (40, 10.0, INTEGERS, 1.0),
        (100, 1.0, INTEGERS, 1.5),
    ],
)
@pytest.mark.parametrize(
    ("which", "bits"),
    [("gyro", GYRO_FROZEN), ("force", FORCE_FROZEN), ("imu", GYRO_FROZEN | FORCE_FROZEN)],
)
def test_a_frozen_sensor_is_found(hz, noise, counts, within_s, which, bits):
    t_s, gyro, force = stream(hz, 120.0, noise, counts)
    frozen = t_s >= 100.0
    for name, values in (("gyro", gyro), ("force", force)):
        if which in (name, "imu"):
            values[frozen] = values[frozen][0]
    found = watched(t_s, gyro, force)
    assert not found[~frozen].any()
    first = np.flatnonzero(found)[0]
    assert t_s[first] - 100.0 <= within_s
    assert set(found[first:].tolist()) == {bits}


@pytest.mark.parametrize(("counts", "bits"), [(FLOATS, GYRO_FROZEN), (INTEGERS, 0)])
def test_a_gyro_of_nothing_but_zeros_is_found_where_the_message_would_show_noise(counts, bits):
    t_s, gyro, force = stream(50, 60.0, 1.0, counts)
    found = watched(t_s, 0.0 * gyro, force)
    assert not found[: 3 * 50].any()
    assert set(found[4 * 50 :].tolist()) == {bits}


@pytest.mark.parametrize(("counts", "within_s"), [(FLOATS, 1.1), (INTEGERS, 5.0)])
@pytest.mark.parametrize("axis", range(6))
def test_a_stuck_axis_is_named(axis, counts, within_s):
    t_s, gyro, force = stream(100, 70.0, 10.0, counts)
    values, column = (gyro, axis) if axis < 3 else (force, axis - 3)
    values[6000:, column] = values[6000, column]
    found = watched(t_s, gyro, force)
    assert not found[:6000].any()
    first = np.flatnonzero(found)[0]
    assert found[first] == (axis + 1) * STUCK_AXIS
    assert 60.9 <= t_s[first] <= 60.0 + within_s


def test_a_lift_off_without_sideways_force_leaves_no_stuck_axis():
    """A constant x of whole counts, at rest and while only z shakes."""
    t_s, gyro, force = stream(100, 60.0, 10.0, INTEGERS)
    force[:, 0] = 0.0
    force[:, 1] = FORCE_COUNT
    assert not watched(t_s, gyro, force).any()


@pytest.mark.thorough
def test_the_bound_holds_for_runs_that_end_at_any_value_alike():
    """A million values that come again with a given probability each, as the bound assumes."""
    rng = np.random.default_rng(3)
    for probability in (0.0003, 0.01, 0.3, 0.9):
        change = rng.random(300_000) >= probability
        change[:3] = True
        gyro = np.cumsum(change) * GYRO_COUNT
        gyro = np.stack([0.1 + gyro % 1.0, 0.0 * gyro, 0.0 * gyro], 1)
        force = np.stack([0.0 * change, 0.0 * change, rng.normal(-9.8, 0.3, len(change))], 1)
        bits = watched(np.arange(len(change)) / 100.0, gyro, force)
        assert not (bits & (GYRO_FROZEN | FORCE_FROZEN)).any()


@pytest.mark.parametrize(
    ("stall", "later", "found"), [(0, 9, False), (0, 12, True), (8, 40, False)]
)
def test_rare_repeats_count_one_by_one_but_no_run_below_five_times_the_longest(stall, later, found):
    """A gyro that repeats one value in a thousand, and perhaps stalled once, stalls again."""
    n = 10_000
    rng = np.random.default_rng(4)
    gyro = 0.1 + 1e-6 * np.arange(2.0 * n)[:, None] * np.ones(3)
    force = rng.normal(-9.8, 0.3, gyro.shape)
    for i in range(500, n, 1_000):
        gyro[i] = gyro[i - 1]
    gyro[6_000 : 6_001 + stall] = gyro[6_000]
    gyro[n : n + later + 1] = gyro[n]
    bits = watched(np.arange(2.0 * n) / 100.0, gyro, force)
    assert not bits[:n].any()
    assert bits[n:].any() == found


@pytest.mark.parametrize("dither", [(0.5, 0.5, 0.0), (0.5, 0.0, 0.5)])
def test_an_axis_that_stays_at_one_count_after_a_landing_is_not_stuck(dither):
    """Others lie at the border of two counts, and go to and fro."""
    rng = np.random.default_rng(5)
    n = 4_000
    flown = (np.arange(n) < 3_000)[:, None]
    gyro = rng.normal(0.0, 50.0 * flown + 0.1, (n, 3)) + np.where(flown, 0.0, dither)
    force = rng.normal(0.0, 30.0 * flown + 0.1, (n, 3)) + np.where(flown, 0.0, dither)
    bits = watched(np.arange(n) / 25.0, np.round(gyro) * GYRO_COUNT, np.round(force) * FORCE_COUNT)
    assert not bits.any()


@pytest.mark.parametrize("gap_s", [0.5, 1.4])
def test_a_gap_in_the_samples_is_no_time_in_which_they_repeated(gap_s):
    """A stall of the link: the same values come some times before it and some times after it."""
    t_s, gyro, force = stream(100, 400.0, 3.0, FLOATS)
    gyro[39_000:39_008], force[39_000:39_008] = gyro[39_000], force[39_000]
    t_s[39_004:] += gap_s
    assert not watched(t_s, gyro, force).any()


def test_a_frozen_imu_stays_frozen_over_a_gap():
    t_s, gyro, force = stream(100, 40.0, 3.0, FLOATS)
    gyro[3000:3200], force[3000:3200] = gyro[3000], force[3000]
    t_s[3100:] += 1.4
    bits = watched(t_s, gyro, force)
    assert (bits[3050:3200] & GYRO_FROZEN).all()
    assert not bits[3200:].any()
