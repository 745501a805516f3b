import math

import pytest
from synthetic_imu import DENSITIES, FIELD

from h2nav.attitude.samples import ImuSample
from h2nav.attitude.two_stage.gains import design_two_stage
from h2nav.attitude.two_stage.memory import LEVELS
from h2nav.attitude.two_stage.trust import TrustLimits, kernel_gains, usable, usable_field

GOOD = ImuSample(0, (0.0, 0.0, 0.0), (0.0, 0.0, -9.8))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e9])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_single_impossible_number_makes_a_sample_unusable(bad: float, axis: int) -> None:
    vector = [0.1, 0.1, 0.1]
    vector[axis] = bad
    x, y, z = vector
    assert not usable(GOOD._replace(w_b=(x, y, z)))
    assert not usable(GOOD._replace(f_b=(x, y, z)))
    assert not usable_field((x, y, z))


def test_zero_rate_is_fine_but_zero_force_and_zero_field_are_dead_sensors() -> None:
    assert usable(GOOD)
    assert not usable(GOOD._replace(f_b=(0.0, 0.0, 0.0)))
    assert not usable_field((0.0, 0.0, 0.0))
    assert not usable_field(None)


def test_levels_begin_later_and_later_and_end_at_the_slowest() -> None:
    limits = TrustLimits(slowest_level=3)
    gains = design_two_stage(DENSITIES, 100.0, "test")
    g = kernel_gains(gains, FIELD, limits, mean_rate=True)
    starts = g.level_power
    assert starts[0] == 0.0
    assert starts[1] > limits.still_force_m_s2**2
    assert starts[1:4] == sorted(starts[1:4])
    assert starts[4:] == [math.inf] * (LEVELS - 4)


def test_a_file_with_few_levels_is_enough() -> None:
    gains = design_two_stage(DENSITIES, 100.0, "test")
    g = kernel_gains(gains._replace(levels=gains.levels[:1]), FIELD, TrustLimits(), mean_rate=True)
    assert all(map(math.isinf, g.level_power[1:]))
