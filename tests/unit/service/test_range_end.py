"""Values at the end of a sensor's range, found without being told the range."""

import math

import numpy as np
import pytest
from needs import DEG, shared_data

from h2nav.attitude.samples import ImuSample
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.service.range_end import RangeEnds

LEVEL = (0.0, 0.0, -GRAVITY_M_S2)
MISSED = 2  # the third value of a row shows the end


def flags(rates, forces=None):
    ends = RangeEnds()
    forces = forces or [LEVEL] * len(rates)
    pairs = enumerate(zip(rates, forces, strict=True))
    return [ends.holds(ImuSample(10_000 * k, w, f)) for k, (w, f) in pairs]


def swing(limit_deg_s, count=400):
    """A swing of 600 deg/s about x, cut at a limit, while y moves; in counts of 1 mrad/s."""
    rates = []
    for number in range(count):
        x = 600.0 * DEG * math.sin(0.05 * number)
        x = min(max(x, -limit_deg_s * DEG), limit_deg_s * DEG)
        rates.append((round(x, 3), round(math.sin(0.13 * number), 3), 0.0))
    return rates


def test_a_gyro_at_its_end_is_found_in_the_third_sample_and_then_at_once():
    rates = swing(500.0)
    found = flags(rates)
    cut = [abs(x) >= 500.0 * DEG - 1e-3 for x, _, _ in rates]
    assert sum(cut) > 50
    missed = [
        k for k, (is_cut, is_found) in enumerate(zip(cut, found, strict=True)) if is_cut > is_found
    ]
    assert len(missed) == MISSED
    assert not any(is_found > is_cut for is_cut, is_found in zip(cut, found, strict=True))


def test_a_limit_where_no_range_ends_is_none():
    assert not any(flags(swing(400.0)))


def test_a_swing_within_the_range_is_never_cut():
    assert not any(flags(swing(2000.0)))


def test_a_steady_turn_about_one_axis_is_no_end():
    assert not any(flags([(250.0 * DEG, 0.0, 0.0)] * 500))


def test_an_end_that_is_exceeded_was_none():
    rates = [*swing(500.0), (0.0, 0.0, 550.0 * DEG), (600.0 * DEG, 0.1, 0.0), *swing(500.0)[30:40]]
    assert any(flags(rates)[:400])
    assert not any(flags(rates)[400:])


def test_an_accelerometer_at_its_end_is_found():
    sine = [math.sin(0.1 * number) for number in range(200)]
    forces = [(0.1 * s, 0.0, -GRAVITY_M_S2 * min(9.0 * abs(s), 8.0)) for s in sine]
    found = flags([(0.0, 0.0, 0.0)] * 200, forces)
    cut = [force[2] == -8.0 * GRAVITY_M_S2 for force in forces]
    assert sum(cut) - sum(found) == MISSED


@pytest.mark.parametrize(
    "trial",
    [
        "broad__07_undisturbed_fast_rotation_B",
        "broad__16_undisturbed_fast_translation_B",
        "broad__24_disturbed_tapping_A",
        "tumvi__room4",
        "uav_gpsins__thor_flight75",
    ],
)
def test_recordings_are_flagged_where_they_are_cut_and_nowhere_else(trial):
    data = np.load(shared_data(f"imu/{trial}.npz"))
    rates, forces = data["gyr"][:20_000], data["acc"][:20_000]
    for limit_deg_s in (math.inf, 1000.0, 500.0, 250.0):
        limit = limit_deg_s * DEG
        cut = (np.abs(rates) >= limit).any(axis=1)
        clipped = np.clip(rates, -limit, limit)
        found = np.array(
            flags(list(map(tuple, clipped.tolist())), list(map(tuple, forces.tolist())))
        )
        assert not (found & ~cut).any()
        axes_cut = (np.abs(rates) >= limit).any(axis=0).sum()
        assert (cut & ~found).sum() <= axes_cut * MISSED


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize(
    ("sensor", "limit"), [("gyro", 500.0 * DEG), ("accelerometer", 8.0 * GRAVITY_M_S2)]
)
def test_either_end_of_every_axis_is_found(sensor, limit, axis, sign):
    sine = [math.sin(0.1 * number) for number in range(200)]
    values = [[0.1 * math.cos(0.3 * number)] * 3 for number in range(200)]
    for value, s in zip(values, sine, strict=True):
        value[axis] = sign * limit * min(1.1 * abs(s), 1.0)
    still = [(0.0, 0.0, 0.0)] * 200
    found = flags(values, still) if sensor == "gyro" else flags(still, values)
    assert any(found)
    assert all(abs(value[axis]) == limit for value, at in zip(values, found, strict=True) if at)
