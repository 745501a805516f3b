"""The integer filter against the same equations in floats: what integer arithmetic costs."""

import math
from pathlib import Path

import numpy as np
import pytest
from agreement.constant_gain_flight import FIELD, Flight, Kernel, image_at

from h2nav.attitude.constant_gain.filter import fill_sample
from h2nav.attitude.constant_gain.gains import BIAS_UNIT
from h2nav.maths.quaternion import conjugate, from_euler, rotate

pytestmark = pytest.mark.thorough


@pytest.mark.parametrize(("rate_hz", "seconds", "limit_deg"), [(100, 240, 4e-3), (400, 40, 8e-3)])
def test_deviation_stays_within_the_sensors_resolution(
    tmp_path: Path, rate_hz: int, seconds: int, limit_deg: float
) -> None:
    flight = Flight(tmp_path, rate_hz, seed=1)
    found = flight.deviations_deg(seconds * rate_hz)
    assert flight.kernel.memory.saturations == 0
    assert math.sqrt(np.mean(found**2)) < limit_deg
    half = len(found) // 2
    # no drift: the second half is no worse than noise allows
    assert np.mean(found[half:]) < 2.0 * np.mean(found[:half]) + 1e-3


def test_a_resting_vehicle_shows_no_limit_cycle() -> None:
    """Exact, unchanging inputs: the integers settle to within two units of the vectors."""
    kernel = Kernel(image_at(100))
    q_bn = conjugate(from_euler(0.3, -0.2, 0.7))
    gravity = rotate(q_bn, (0.0, 0.0, 1.0))
    field = rotate(q_bn, (math.cos(FIELD.dip_rad), 0.0, math.sin(FIELD.dip_rad)))
    fill_sample(kernel.sample, (1e-3, -2e-3, 5e-4), gravity, field, 10000)
    memory, settled = kernel.memory, []
    for i in range(50_000):
        kernel.step()
        if i >= 40_000:
            settled.append([*memory.q_nb, *memory.gyro_bias])
    table = np.array(settled, dtype=float)
    q = table[:, :4] / np.linalg.norm(table[:, :4], axis=1)[:, None]
    assert math.degrees(2.0 * np.ptp(q, axis=0).max()) < 0.01
    assert np.ptp(table[:, 4:], axis=0).max() / BIAS_UNIT < 2e-6
    assert table[-1, 4:] / BIAS_UNIT == pytest.approx([1e-3, -2e-3, 5e-4], abs=1e-5)


def test_small_bias_is_not_lost_in_a_dead_band() -> None:
    """A bias that tilts by less than one unit of the vectors is still learnt, by the remainder."""
    kernel = Kernel(image_at(400))
    fill_sample(kernel.sample, (2e-5, 0.0, 0.0), (0.0, 0.0, 1.0), None, 2500)
    for _ in range(200_000):
        kernel.step()
    assert kernel.memory.gyro_bias[0] / BIAS_UNIT == pytest.approx(2e-5, abs=1e-5)
