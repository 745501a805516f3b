"""The pilot's sticks: which channels they are, and their share of the travel."""

import numpy as np
import pytest

from h2nav.recordings.context import Series
from h2nav.recordings.sticks import AXES, sticks_of

CHANNELS = {"roll": 1, "pitch": 2, "throttle": 3, "yaw": 4}  # of ArduPilot
MAP = {f"RC_MAP_{axis.upper()}": float(number) for axis, number in CHANNELS.items()}


def stick(axis, width_us, *, is_px4=False, **parameters):
    """What an axis shows while the others are in the middle."""
    widths_us = np.full((1, 4), 1500.0)
    widths_us[0, CHANNELS[axis] - 1] = width_us
    series = Series(np.zeros(1), widths_us)
    found = sticks_of(series, (MAP if is_px4 else {}) | parameters, is_px4=is_px4)
    return float(getattr(found, axis)[0])


@pytest.mark.parametrize(
    ("width_us", "share"),
    [(1000, -1.0), (1500, 0.0), (1750, 0.5), (2000, 1.0), (2300, 1.0), (700, -1.0), (1250, -0.5)],
)
def test_a_stick_of_the_usual_travel(width_us, share):
    for axis in ("roll", "pitch", "yaw"):
        assert stick(axis, width_us) == pytest.approx(share)
    assert stick("throttle", width_us) == pytest.approx(0.5 + 0.5 * share)


@pytest.mark.parametrize("width_us", [0, 699, 2301, 65_535])
def test_what_is_no_pulse_is_unknown(width_us):
    assert np.isnan(stick("roll", width_us))


def test_the_travel_of_each_side_is_the_autopilots_own():
    travel = {"RC1_MIN": 1100.0, "RC1_TRIM": 1400.0, "RC1_MAX": 1900.0}
    assert stick("roll", 1250, **travel) == pytest.approx(-0.5)
    assert stick("roll", 1650, **travel) == pytest.approx(0.5)
    assert stick("throttle", 1500, RC3_MIN=1100.0, RC3_MAX=1900.0) == pytest.approx(0.5)
    assert stick("throttle", 1300, RC3_MIN=1100.0, RC3_MAX=1900.0) == pytest.approx(0.25)


@pytest.mark.parametrize("reversal", [{"REV": -1.0}, {"REVERSED": 1.0}])
def test_a_reversed_channel_shows_the_other_side(reversal):
    roll = {f"RC1_{name}": value for name, value in reversal.items()}
    throttle = {f"RC3_{name}": value for name, value in reversal.items()}
    assert stick("roll", 1750, **roll) == pytest.approx(-0.5)
    assert stick("throttle", 1750, **throttle) == pytest.approx(0.25)


def test_px4s_pitch_is_positive_forward():
    assert stick("pitch", 1750, is_px4=True) == pytest.approx(-0.5)
    assert stick("roll", 1750, is_px4=True) == pytest.approx(0.5)


@pytest.mark.parametrize(("number", "is_known"), [(0, False), (1, True), (4, True), (5, False)])
@pytest.mark.parametrize(("prefix", "is_px4"), [("RCMAP_", False), ("RC_MAP_", True)])
def test_a_channel_that_was_not_recorded_makes_no_stick(prefix, is_px4, number, is_known):
    parameters = (MAP if is_px4 else {}) | {f"{prefix}YAW": float(number)}
    channels = Series(np.zeros(1), np.full((1, 4), 1500.0))
    assert (sticks_of(channels, parameters, is_px4=is_px4) is not None) is is_known


def test_without_channels_or_a_map_there_are_no_sticks():
    channels = Series(np.zeros(2), np.array([np.full(4, np.nan), np.full(4, 1500.0)]))
    assert sticks_of(None, {}, is_px4=False) is None
    assert sticks_of(channels, {}, is_px4=True) is None
    found = sticks_of(channels._replace(t_s=np.array([1.0, 2.0])), {}, is_px4=False)
    assert found.t_s.tolist() == [2.0]
    assert [getattr(found, axis).tolist() for axis in AXES] == [[0.0], [0.0], [0.0], [0.5]]
