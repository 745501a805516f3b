"""Whom the field accuses: a gyro in other units, of another scale or axes; nobody else."""

import functools
import math

import numpy as np
import pytest

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.integrity.gyro_turns import GyroTurns, _nearest_rotation
from h2nav.integrity.kernel.memory import TURN_ROW
from h2nav.integrity.watch import Watch
from h2nav.maths.units import DEG

PERIOD_S = 0.02
BEGINS_S, ENDS_S, LASTS_S = 40.0, 75.0, 95.0
FIELD_N_UT = np.array([20.0, 1.5, 43.0])
FORCE = (0.0, 0.0, -9.8)


@functools.cache
def motion(seed, brisk, circles_rad_s=0.0):
    """Rates, rad/s, of sines without a common period, and the field in the body, uT.

    Args:
        circles_rad_s: a rate about z besides, while something acts.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, LASTS_S, PERIOD_S)
    sizes, speeds, phases = (
        rng.uniform(*ends, (3, 4)) for ends in ((0.1, 0.35), (0.2, 1.5), (0.0, 6.0))
    )
    waves = np.sin(speeds[:, :, None] * t + phases[:, :, None])
    w = brisk * (sizes[:, :, None] * waves).sum(axis=1).T
    w[(t >= BEGINS_S) & (t < ENDS_S), 2] += circles_rad_s
    m = np.empty_like(w)
    m[0] = FIELD_N_UT
    for i in range(1, len(t)):
        angle = np.linalg.norm(w[i]) * PERIOD_S
        axis = w[i] / max(np.linalg.norm(w[i]), 1e-9)
        old = m[i - 1]
        # by the opposite turn, since the body turns and the field does not
        m[i] = (
            old * math.cos(angle)
            - np.cross(axis, old) * math.sin(angle)
            + axis * (axis @ old) * (1.0 - math.cos(angle))
        )
    return t, w + rng.normal(0.0, 0.002, w.shape), m + rng.normal(0.0, 0.15, m.shape)


def errors(
    gyro=None, compass=None, *, brisk=1.0, seed=1, every=1, is_of_earth=True, circles_rad_s=0.0
):
    """(time, error, factor) after each row of such a flight."""
    t, w, m = motion(seed, brisk, circles_rad_s)
    acts = (t >= BEGINS_S) & (t < ENDS_S)
    w = w.copy() if gyro is None else gyro(w.copy(), acts)
    m = m.copy() if compass is None else compass(m.copy(), acts)
    watch, turns, found = Watch(), GyroTurns(), []
    for i, (rate, field) in enumerate(zip(w, m, strict=True)):
        shown = tuple(field) if i % every == 0 else None
        if watch.check(ImuSample(round(1e6 * t[i]), tuple(rate), FORCE, shown, False)) & TURN_ROW:
            turns.take(watch.memory, is_of_earth=is_of_earth)
            found.append((t[i], turns.error, turns.rate_factor))
    return found


def scaled(factor):
    def change(w, acts):
        w[acts] *= factor
        return w

    return change


def swapped(w, acts):
    w[acts] = w[acts][:, [1, 0, 2]]
    return w


def zero_moves(w, acts):
    w[acts] += np.array([3.0, -2.0, 4.0]) * DEG
    return w


def zero_is_off(w, acts):
    return w + np.array([8.0, -6.0, 9.0]) * DEG


def magnet(m, acts):
    m[acts] += np.array([12.0, -9.0, 8.0])
    return m


def iron(m, acts):
    return m + np.array([4.0, 3.0, -5.0])


def turned(m, acts):
    return m @ np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def frozen(m, acts):
    m[acts] = m[acts][0]
    return m


def dies(m, acts):
    m[acts] = FIELD_N_UT + np.random.default_rng(3).normal(0.0, 0.15, m[acts].shape)
    return m


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("brisk", [0.1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize(
    ("gyro", "compass"),
    [
        (None, None),
        (zero_moves, None),
        (zero_is_off, iron),
        (None, magnet),
        (None, turned),
        (None, frozen),
        (scaled(1.03), None),
    ],
)
def test_a_sound_gyro_is_not_accused(gyro, compass, brisk, seed):
    assert not [text for text in errors(gyro, compass, brisk=brisk, seed=seed) if text[1]]


@pytest.mark.parametrize("circles", [2, 4])
def test_a_compass_that_was_frozen_while_a_plane_circled_accuses_no_gyro(circles):
    circles_rad_s = circles * math.tau / (ENDS_S - BEGINS_S)

    def noisy(m, acts):
        return frozen(m + np.random.default_rng(3).normal(0.0, 0.8, m.shape), acts)

    found = errors(None, noisy, brisk=0.1, circles_rad_s=circles_rad_s)
    assert not [x for x in found if x[1]]


@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize(
    ("factor", "after_s", "text"),
    [
        (1.15, 20.0, "gyro's scale is off by 15 %"),
        (0.8, 20.0, "gyro's scale is off by 20 %"),
        (180.0 / math.pi, 10.0, "gyro's rates are far too large"),
    ],
)
def test_another_scale_is_named_and_ends(factor, after_s, text, every):
    found = errors(scaled(factor), every=every)
    told = [(t_s, error) for t_s, error, _ in found if error is not None]
    assert BEGINS_S < told[0][0] < BEGINS_S + after_s
    assert {error.kind for _, error in told} == {Kind.GYRO_SCALE}
    assert text in {error.text for _, error in told}
    assert told[-1][0] < ENDS_S + 9.0
    assert found[-1][1:] == (None, 1.0)


def test_rates_of_another_scale_are_multiplied_by_its_inverse_until_it_ends():
    found = errors(scaled(1.25))
    factors = [factor for t_s, _, factor in found if BEGINS_S + 20.0 < t_s < ENDS_S]
    assert factors == pytest.approx([0.8] * len(factors), abs=0.03)
    assert {factor for t_s, _, factor in found if not BEGINS_S < t_s < ENDS_S + 9.0} == {1.0}


def test_rates_that_are_far_off_are_not_corrected():
    assert {factor for _, _, factor in errors(scaled(180.0 / math.pi))} == {1.0}


@pytest.mark.parametrize("seed", [1, 2])
def test_other_axes_are_named_and_end(seed):
    found = errors(swapped, seed=seed)
    told = [(t_s, error) for t_s, error, _ in found if error is not None]
    assert BEGINS_S < told[0][0] < BEGINS_S + 25.0
    assert {error.text for _, error in told} == {"gyro contradicts field"}
    assert told[-1][0] < ENDS_S + 9.0


def test_axes_that_never_agreed_are_nobodys():
    t, _, _ = motion(1, 1.0)
    assert not [x for x in errors(lambda w, _: swapped(w, np.ones(len(t), bool))) if x[1]]


def test_a_compass_that_follows_no_turn_accuses_no_gyro_that_it_has_never_followed():
    found = errors(None, lambda m, _: dies(m, np.ones(len(m), bool)), brisk=3.0, is_of_earth=False)
    assert not [x for x in found if x[1]]


def test_rates_in_other_units_are_named_in_calm_flight_too():
    found = errors(scaled(180.0 / math.pi), brisk=0.1)
    told = [(t_s, error.text) for t_s, error, _ in found if error is not None]
    assert BEGINS_S < told[0][0] < BEGINS_S + 10.0
    assert {text for _, text in told} == {"gyro's rates are far too large"}
    assert told[-1][0] < ENDS_S + 18.0


def test_the_alarm_is_that_of_the_imu():
    turns = GyroTurns()
    assert turns.alarms(Sensor(SensorKind.IMU, 2), 0) == []
    found = next(error for _, error, _ in errors(scaled(1.3)) if error is not None)
    turns.error, turns._since_us = found, 1_000_000
    (alarm,) = turns.alarms(Sensor(SensorKind.IMU, 2), 3_500_000)
    assert alarm.notice == f"IMU 2: {found.text}"
    assert (alarm.severity, alarm.since_s, alarm.degrades) == (Severity.ERROR, 2.5, True)


def test_the_nearest_rotation():
    angle = 0.7
    turn = [math.cos(angle), -math.sin(angle), 0.0, math.sin(angle), math.cos(angle), 0.0, 0, 0, 1]
    assert _nearest_rotation([1.2 * x for x in turn]) == pytest.approx(turn)
    assert _nearest_rotation([0.0, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]) is None
