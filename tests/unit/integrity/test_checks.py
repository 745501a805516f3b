"""Vibration, clipping and turns by single samples, against closed forms."""

import math

import numpy as np
import pytest

from h2nav.integrity.kernel.checks import check, end_window, turn_of
from h2nav.integrity.kernel.memory import FIELD_FROZEN, Gains, Memory, Sample
from h2nav.integrity.kernel.repeats import GYRO, OF_COMPASS

REST = (0.0, 0.0, -9.8)


def sample(t_us, accel=REST, gyro=(0.0, 0.0, 0.0), **how):
    return Sample(t_us=float(t_us), gyro=[*gyro], accel=[*accel], **how)


def checked(samples):
    s = Memory()
    for one in samples:
        check(s, Gains(), one)
    return s


@pytest.mark.parametrize(("rate_hz", "axis"), [(50, 0), (100, 1), (200, 2)])
def test_the_vibration_is_the_deviation_of_white_noise_at_any_rate(rate_hz, axis):
    """The mean of some seconds; what is slower than 5 Hz is motion."""
    noise = np.random.default_rng(3).normal(0.0, 2.0, 2001)
    found, s = [], Memory()
    for i, size in enumerate(noise):
        accel = [*REST]
        accel[axis] += size
        check(s, Gains(), sample(i * 1e6 / rate_hz, accel))
        if s.samples == 0.0:
            found.append(s.vibration_m_s2)
    assert len(found) == 2000 // rate_hz
    assert np.sqrt(np.mean(np.square(found))) == pytest.approx(2.0, rel=0.05)


def test_a_slow_force_is_no_vibration_and_a_line_above_five_hertz_is():
    """A first-order high-pass: of a line of 2 m/s^2, in each second."""
    for frequency_hz in (0.5, 20.0):
        s = checked(
            sample(i * 1000, (2.0 * math.sin(2e-3 * math.pi * frequency_hz * i), 0.0, -9.8))
            for i in range(2001)
        )
        passed = frequency_hz / math.hypot(frequency_hz, 5.0)
        assert s.vibration_m_s2 == pytest.approx(math.sqrt(2.0) * passed, rel=0.03)


def test_a_first_force_begins_the_slow_one():
    s = checked([sample(0, (3.0, -4.0, 5.0))])
    assert s.slow_force == [3.0, -4.0, 5.0]
    assert s.squares == [0.0] * 3
    check(s, Gains(), sample(10_000, (4.0, -4.0, 5.0)))
    share = 1e4 / (1e4 + 1e6 / (10.0 * math.pi))
    assert s.slow_force[0] == pytest.approx(3.0 + share)
    assert s.squares == pytest.approx([1.0 - 0.5 * share, 0.0, 0.0])


def test_a_window_is_a_second_and_its_worst_axis_counts():
    s = Memory(squares=[4.0, 36.0, 9.0], samples=4.0, clipped=1.0, window_us=9e5)
    end_window(s)
    assert (s.vibration_m_s2, s.clipped_share) == (3.0, 0.25)
    assert (s.squares, s.samples, s.clipped, s.window_us) == ([0.0] * 3, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(("until_us", "share"), [(999_999, 0.0), (1_000_000, 0.3)])
def test_a_share_of_clipped_samples_is_that_of_a_second(until_us, share):
    times_us = [*range(0, 900_000, 100_000), until_us]
    s = checked(sample(t_us, clipped=float(i < 3)) for i, t_us in enumerate(times_us))
    assert s.clipped_share == pytest.approx(share)
    assert s.samples == (0.0 if share else 10.0)


@pytest.mark.parametrize(
    ("rate", "step_us", "turned"),
    [
        ((0.03, 0.0, 0.04), 50_000.0, 0.0),
        ((0.03, 0.0, 0.0401), 50_000.0, 0.05 * math.hypot(0.03, 0.0401)),
        ((1.0, -2.0, 2.0), 50_000.0, 0.15),
        ((1.0, -2.0, 2.0), 100_000.0, 0.3),
        ((1.0, -2.0, 2.0), 200_000.0, 0.3),  # of a longer step nothing more is known
    ],
)
def test_a_turn_counts_from_a_rate_on_that_is_no_bias(rate, step_us, turned):
    assert turn_of([*rate], step_us) == pytest.approx(turned)


def test_a_turn_adds_up_beside_a_field_unless_the_gyro_stands_still():
    s = checked(sample(i * 10_000, gyro=(0.0, 0.0, 1.0 + 0.01 * (i % 2))) for i in range(11))
    assert s.field_turned_rad == pytest.approx(0.1005)
    before = s.field_turned_rad
    check(s, Gains(), sample(110_000, gyro=(0.0, 0.0, 1.0)))
    assert s.still_us[0] == 10_000.0
    assert s.field_turned_rad == before


@pytest.mark.parametrize(("gap_us", "is_kept"), [(300_000, True), (300_001, False)])
def test_over_a_gap_nothing_is_known_of_runs(gap_us, is_kept):
    s = checked(sample(i * 10_000) for i in range(5))
    assert s.run[8] == 4.0  # of the whole IMU
    check(s, Gains(), sample(40_000 + gap_us))
    assert s.run[8] == (5.0 if is_kept else 1.0)
    assert s.step_us == (gap_us if is_kept else 0.0)
    assert s.t_us == 40_000 + gap_us


def test_a_frozen_field_is_told_and_remembered():
    s = checked([sample(0)])
    s.field, s.field_turned_rad, s.field_still_us = [1.0, 2.0, 3.0], 0.6, 2e6
    s.seen[OF_COMPASS], s.accused[9], s.run[9] = 99.0, 1.0, 5.0
    s.accused[GYRO] = 1.0
    bits = check(s, Gains(), sample(10_000, mag=[1.0, 2.0, 3.0], has_mag=1.0))
    assert bits & FIELD_FROZEN
    assert s.field_frozen == 1.0
    bits = check(s, Gains(), sample(20_000, mag=[1.0, 2.5, 3.0], has_mag=1.0))
    assert not bits & FIELD_FROZEN
    assert s.field_frozen == 0.0
