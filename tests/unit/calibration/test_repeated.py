"""What a calibration has mended it finds mended: the next flight changes nothing."""

import numpy as np
import pytest

from h2nav.maths.units import MG_PER_UT
from tests.unit.calibration.repeated_flights import twice, written_again


@pytest.mark.parametrize(
    "seed", [*range(4), *(pytest.param(seed, marks=pytest.mark.thorough) for seed in range(4, 12))]
)
def test_calibrated_and_flown_again_nothing_is_written(seed):
    vehicle, first, second = twice(seed)
    assert first.changes
    assert written_again(first, second) == []
    own = vehicle.iron.offset_ut * MG_PER_UT
    for change in first.changes:
        if change.name.startswith("COMPASS_OFS"):
            off = change.new - own["XYZ".index(change.name[-1])]
            assert abs(off) < 3.0 * change.sigma
    has_shape = not np.array_equal(vehicle.iron.matrix, np.eye(3))
    assert has_shape or not any("DIA" in change.name for change in first.changes)
