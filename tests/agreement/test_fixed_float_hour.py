"""A whole hour at 400 Hz: the integer filter against the same equations in floats, compiled."""

import math
from pathlib import Path

import needs
import numpy as np
import pytest
from agreement.constant_gain_compiled import BIAS, MEMORY_SIZE, CompiledReference, Q
from agreement.constant_gain_flight import Flight, image_at
from agreement.constant_gain_reference import ConstantGainReference

from h2nav.attitude.kernel_files import CONSTANT_GAIN
from h2nav.attitude.native import compiled_step

RATE_HZ = 400
ROWS = 60 * RATE_HZ  # at a time


def test_compiled_reference_is_the_reference(tmp_path: Path) -> None:
    image = image_at(RATE_HZ)
    boost_s = 1e-6 * (1 << image.gains.boost_shift)
    compiled = CompiledReference(tmp_path, image.rounded, boost_s)
    table = Flight(tmp_path, RATE_HZ, seed=3).samples(ROWS)[:8000]
    table[100::700, 3:6] *= 1.5  # beyond the gates
    table[101::900, 6:9] *= 1.5
    start = np.array([1.0, 0.02, -0.03, 0.05])
    compiled.start(start)
    found = compiled.run(table)
    plain = ConstantGainReference(image.rounded, list(start), boost_s)
    for row in table:
        plain.update(row[:3], row[3:6], row[6:9] if row[9] else None, 1.0 / RATE_HZ)
    assert found[-1, Q] == pytest.approx(plain.q, abs=1e-10)
    assert found[-1, BIAS] == pytest.approx(plain.bias, abs=1e-11)
    assert compiled.memory.shape == (MEMORY_SIZE,)


def test_an_hour_at_400_hz_shows_no_drift(tmp_path: Path) -> None:
    if compiled_step(CONSTANT_GAIN) is None:
        needs.absent("the compiled kernels are not built")
    flight = Flight(tmp_path, RATE_HZ, seed=1)
    angles = np.concatenate([flight.deviations_deg(ROWS) for _ in range(60)])
    assert flight.kernel.memory.saturations == 0
    quarters = [math.sqrt(np.mean(part**2)) for part in np.array_split(angles, 4)]
    assert angles.max() < 6e-3
    assert math.sqrt(np.mean(angles**2)) < 3e-3
    assert max(quarters) < 1.5 * quarters[0]
