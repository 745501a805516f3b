"""The turn of an attitude in integers, against scipy and at its limits."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from h2nav.attitude.integer.motion import MAX_DT_US, Q_LIMIT, propagate, rotation

ATTITUDES = list(Rotation.random(12, random_state=5))
GYRO, BIAS, CARRY = 1e-6 * 2.0**40, 0.5e-6 * 2.0**53, 0.5 * 2.0**30


def whole(values, unit):
    return [round(float(value) * unit) for value in values]


def as_integers(attitude):
    x, y, z, w = attitude.as_quat()
    return whole((w, x, y, z), 0.99975 * 2.0**29)


def attitude_of(q):
    return Rotation.from_quat(np.roll(np.array(q, float), -1))


def turned(attitude, rate, dt_us, bias=(0.0, 0.0, 0.0), carry=(0.0, 0.0, 0.0), steps=1):
    """The attitude after steps at a rate; what met a limit; and what is left to turn."""
    q, left, met = as_integers(attitude), whole(carry, CARRY), [0]
    for _ in range(steps):
        propagate(q, whole(bias, BIAS), left, whole(rate, GYRO), dt_us, met)
        assert max(map(abs, q)) <= Q_LIMIT
    size = np.linalg.norm(np.array(q) / 2.0**29)
    assert 0.9985 < size < 1.0
    return attitude_of(q), met[0] != 0, np.array(left) / CARRY


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_the_matrix_is_that_of_the_attitude(attitude):
    r = [0] * 9
    rotation(as_integers(attitude), r)
    assert np.reshape(r, (3, 3)) / 2.0**15 == pytest.approx(attitude.as_matrix(), abs=8e-4)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_no_entry_of_the_matrix_leaves_its_format(axis, sign):
    """Of an attitude whose axes are those of n, entries are one."""
    r = [0] * 9
    rotation(as_integers(Rotation.from_rotvec(sign * math.pi * np.eye(3)[axis])), r)
    assert max(map(abs, r)) <= 32767
    assert r[4 * axis] > 32700


@pytest.mark.parametrize("attitude", ATTITUDES)
@pytest.mark.parametrize(
    ("rate", "dt_us"),
    [
        ((0.5, -0.3, 0.2), 10_000),
        ((10.0, 12.0, -14.0), 2_500),
        ((-34.9, 0.0, 0.0), 1_000),
        ((0.0, 20.0, 20.0), MAX_DT_US),
        ((1e-4, -2e-4, 3e-4), 1_250),
    ],
)
def test_an_attitude_turns_by_the_rate(attitude, rate, dt_us):
    after, met, left = turned(attitude, rate, dt_us)
    rest = Rotation.from_rotvec(left)  # what a step cannot resolve is carried
    exact = attitude * Rotation.from_rotvec(1e-6 * dt_us * np.array(rate))
    large = float(np.linalg.norm(rate)) * dt_us * 1e-6
    assert (exact.inv() * after * rest).magnitude() < 6e-5 + 0.02 * large**3
    assert not met


def test_a_slow_turn_is_not_lost_by_rounding():
    """10^-4 rad/s for 20 s: a twelfth of what one step resolves."""
    rate = np.array((1e-4, -2e-4, 3e-4))
    after, _, _ = turned(ATTITUDES[0], rate, 10_000, steps=2000)
    assert (ATTITUDES[0].inv() * after).as_rotvec() == pytest.approx(20.0 * rate, abs=1e-4)


@pytest.mark.parametrize("axis", range(3))
def test_the_bias_is_taken_off(axis):
    bias = np.roll((0.15, 0.0, 0.0), axis)
    after, met, _ = turned(ATTITUDES[1], bias + 0.2 * np.eye(3)[0], 10_000, bias=bias, steps=50)
    assert (ATTITUDES[1].inv() * after).as_rotvec() == pytest.approx((0.1, 0.0, 0.0), abs=1e-4)
    assert not met


@pytest.mark.parametrize("axis", range(3))
def test_a_correction_to_come_is_turned_with_the_next_step_and_once(axis):
    carry = np.roll((0.03, 0.0, 0.0), axis)
    after, _, left = turned(ATTITUDES[2], (0.0, 0.0, 0.0), 10_000, carry=carry, steps=3)
    assert (ATTITUDES[2].inv() * after).as_rotvec() == pytest.approx(carry, abs=6e-5)
    assert np.abs(left).max() < 2e-5


@pytest.mark.parametrize(("rate", "meets"), [(34.98, False), (35.01, True), (1900.0, True)])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_rate_beyond_its_limit_counts_as_that_and_is_told(rate, meets, axis, sign):
    some = sign * np.roll((rate, 0.0, 0.0), axis)
    after, met, _ = turned(ATTITUDES[3], some, 1_000)
    assert met is meets
    expected = np.clip(some, -35.0, 35.0) * 1e-3
    assert (ATTITUDES[3].inv() * after).as_rotvec() == pytest.approx(expected, abs=6e-5)
