"""The integer filter against the same equations in floats: what integer arithmetic costs."""

import math

import numpy as np
import pytest
from agreement.constant_gain_reference import ConstantGainReference, rotation

from h2nav.attitude.constant_gain.filter import fill_sample
from h2nav.attitude.constant_gain.gains import (
    BIAS_UNIT,
    ConstantIntegerGains,
    constant_gains,
    integer_gains,
)
from h2nav.attitude.constant_gain.kernel.step import reset, update
from h2nav.attitude.constant_gain.memory import Sample, State
from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import EarthField
from h2nav.maths.quaternion import conjugate, from_euler, rotate

pytestmark = pytest.mark.thorough

FIELD = EarthField(50.0, math.radians(60.0), 0.0)
DENSITIES = SensorDensities(1e-3, 2e-5, 0.3, 5.0, 9.80665, FIELD)


def image_at(rate_hz: int) -> ConstantIntegerGains:
    return integer_gains(constant_gains(DENSITIES, rate_hz, 1.0), "test")


def started() -> State:
    fresh = State()
    reset(fresh)
    return fresh


def angle_deg(p: np.ndarray, q: np.ndarray) -> float:
    q = q * np.sign(p @ q)
    return math.degrees(4.0 * math.asin(min(1.0, 0.5 * float(np.linalg.norm(p - q)))))


def deviations(rate_hz: int, seconds: float, moving: float, seed: int) -> np.ndarray:
    """Angle between both filters, deg, at every tenth sample of one flight."""
    rng = np.random.default_rng(seed)
    image, dt = image_at(rate_hz), 1.0 / rate_hz
    assert image.gains.boost == 3
    h = np.array([math.cos(FIELD.dip_rad), 0.0, math.sin(FIELD.dip_rad)])
    memory, sample, q = started(), Sample(), np.array([1.0, 0.0, 0.0, 0.0])
    reference, found = None, []
    for i in range(int(seconds * rate_hz)):
        t = i * dt
        w = moving * np.array(
            [0.8 * math.sin(0.7 * t), 0.6 * math.cos(0.45 * t), 0.5 * math.sin(0.31 * t + 1.0)]
        )
        x, y, z = 0.5 * dt * w
        q = np.array([[1, -x, -y, -z], [x, 1, z, -y], [y, -z, 1, x], [z, y, -x, 1]]) @ q
        q /= np.linalg.norm(q)
        r = rotation(q)
        rate = w + np.array([2e-3, -1e-3, 1.5e-3]) + rng.normal(0.0, 2e-3, 3)
        gravity = r.T @ [0.0, 0.0, 1.0] + rng.normal(0.0, 0.01, 3)
        field = r.T @ h + rng.normal(0.0, 0.01, 3) if i % 2 else None
        dt_us = round(1e6 * dt) if i else 0
        fill_sample(
            sample, tuple(rate), tuple(gravity), None if field is None else tuple(field), dt_us
        )
        update(memory, image.gains, sample)
        if memory.age_us <= 0:
            boost_s = 1e-6 * (1 << image.gains.boost_shift)
            reference = ConstantGainReference(image.rounded, memory.q_nb, boost_s)
        elif reference is not None:
            reference.update(rate, gravity, field, dt)
            if i % 10 == 0:
                q_nb = np.array(memory.q_nb, dtype=float)
                found.append(angle_deg(q_nb / np.linalg.norm(q_nb), reference.q))
    assert memory.saturations == 0
    assert np.abs(np.array(memory.gyro_bias) / BIAS_UNIT - reference.bias).max() < 2e-5  # type: ignore[union-attr]
    return np.array(found)


@pytest.mark.parametrize(("rate_hz", "seconds", "limit_deg"), [(100, 240, 4e-3), (400, 40, 8e-3)])
def test_deviation_stays_within_the_sensors_resolution(
    rate_hz: int, seconds: float, limit_deg: float
) -> None:
    found = deviations(rate_hz, seconds, moving=1.0, seed=1)
    assert math.sqrt(np.mean(found**2)) < limit_deg
    half = len(found) // 2
    # no drift: the second half is no worse than noise allows
    assert np.mean(found[half:]) < 2.0 * np.mean(found[:half]) + 1e-3


def test_a_resting_vehicle_shows_no_limit_cycle() -> None:
    """Exact, unchanging inputs: the integers settle to within two units of the vectors."""
    image, memory, sample = image_at(100), started(), Sample()
    q_bn = conjugate(from_euler(0.3, -0.2, 0.7))
    gravity = rotate(q_bn, (0.0, 0.0, 1.0))
    field = rotate(q_bn, (math.cos(FIELD.dip_rad), 0.0, math.sin(FIELD.dip_rad)))
    fill_sample(sample, (1e-3, -2e-3, 5e-4), gravity, field, 10000)
    settled = []
    for i in range(50_000):
        update(memory, image.gains, sample)
        if i >= 40_000:
            settled.append([*memory.q_nb, *memory.gyro_bias])
    table = np.array(settled, dtype=float)
    q = table[:, :4] / np.linalg.norm(table[:, :4], axis=1)[:, None]
    assert math.degrees(2.0 * np.ptp(q, axis=0).max()) < 0.01
    assert np.ptp(table[:, 4:], axis=0).max() / BIAS_UNIT < 2e-6
    assert table[-1, 4:] / BIAS_UNIT == pytest.approx([1e-3, -2e-3, 5e-4], abs=1e-5)


def test_small_bias_is_not_lost_in_a_dead_band() -> None:
    """A bias that tilts by less than one unit of the vectors is still learnt, by the remainder."""
    image, memory, sample = image_at(400), started(), Sample()
    fill_sample(sample, (2e-5, 0.0, 0.0), (0.0, 0.0, 1.0), None, 2500)
    for _ in range(200_000):
        update(memory, image.gains, sample)
    assert memory.gyro_bias[0] / BIAS_UNIT == pytest.approx(2e-5, abs=1e-5)
