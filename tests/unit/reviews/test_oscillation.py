"""When a vehicle swings about its demand: just enough of it, and just too little."""

import math

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins, imu_track

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import AttitudeTrack, Context, Series, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.subjects.oscillation import OSCILLATION, look

DEG = math.pi / 180.0
END_S = 40.0
BEGAN_S = 15.0
T_S = np.arange(0.0, END_S, 0.02)
SAMPLES_S = np.arange(0.0, END_S, 0.01)


def swinging(t_s, hz, lasts_s):
    """A sine of which the root mean square is 1; 0 before and after."""
    swings = (t_s >= BEGAN_S - 1e-6) & (t_s < BEGAN_S + lasts_s)
    return math.sqrt(2.0) * np.sin(2.0 * math.pi * hz * (t_s - BEGAN_S)) * swings


def found_in(
    rms_deg_s=60.0,
    hz=2.0,
    lasts_s=12.0,
    beside_hz=4.0,
    beside=0.0,
    turns=1.0,
    asked=0.0,
    axis=0,
    armed=(0.0, END_S),
    rate_hz=100.0,
    drifts=0.0,
):
    """What is found of one axis.

    Args:
        beside: share of the rate's square at another frequency.
        turns: of the angle that belongs to the rate.
        asked: of that angle.
        drifts: by which attitude and demand wander, deg/s.
    """
    samples_s = np.arange(0.0, END_S, 1.0 / rate_hz)
    rate = math.sqrt(1.0 - beside) * swinging(samples_s, hz, lasts_s)
    rate += math.sqrt(beside) * swinging(samples_s, beside_hz, lasts_s)
    w_b = np.zeros((len(samples_s), 3))
    axes = np.atleast_1d(axis)
    w_b[:, axes] = rms_deg_s * DEG * rate[:, None]
    angle = rms_deg_s * DEG / (2.0 * math.pi * hz) * swinging(T_S, hz, lasts_s)
    attitude, demand = np.zeros((len(T_S), 2)), np.zeros((len(T_S), 3))
    wanders = drifts * DEG * T_S
    attitude[:, axes] = (turns * angle + wanders)[:, None]
    demand[:, axes] = (asked * angle + wanders)[:, None]
    half = 0.5 * attitude
    q_nb = np.column_stack(
        (np.cos(half).prod(axis=1), np.sin(half[:, 0]), np.sin(half[:, 1]), 0.0 * T_S)
    )
    context = Context(
        attitudes=(AttitudeTrack("EKF3", T_S, q_nb),),
        demand=Series(T_S, demand),
        armed=(Span(*armed, ""),),
    )
    return look(
        KnownEvidence(
            {
                parts.bins: flying_bins(END_S),
                parts.unharmed: context,
                parts.soundest_as_recorded: imu_track(samples_s, w_b),
            }
        )
    )


@pytest.mark.parametrize(("axis", "name"), [(0, "roll"), (1, "pitch")])
def test_what_is_told(axis, name):
    (found,) = found_in(axis=axis)
    assert (found.kind, found.severity, found.unit) == (OSCILLATION, Severity.WARNING, "deg/s")
    # from the middle of the first window of 6 s that is full of it, to the end of the last one
    assert found.from_s == pytest.approx(BEGAN_S + 2.0, abs=2.01)
    assert found.to_s == pytest.approx(BEGAN_S + 12.0, abs=2.01)
    assert found.size == pytest.approx(60.0 * np.sinc(2.0 / 20.0), abs=0.1)
    # means over a twentieth of a second take 2 % off
    assert found.text == f"{name} oscillated at 2.0 Hz by 59 deg/s"


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        ({"rms_deg_s": 46.5}, True),
        ({"rms_deg_s": 44.0}, False),
        ({"hz": 0.84}, True),
        ({"hz": 0.70}, False),
        ({"hz": 8.9, "rms_deg_s": 100.0}, True),
        ({"hz": 9.2, "rms_deg_s": 100.0}, False),
        # most of it at one frequency
        ({"beside": 0.25, "rms_deg_s": 80.0}, True),
        ({"beside": 0.35, "rms_deg_s": 80.0}, False),
        ({"beside": 0.35, "rms_deg_s": 80.0, "beside_hz": 2.15}, True),
        # its attitude turns with it, and nobody has asked for that
        ({"turns": 0.55}, True),
        ({"turns": 0.45}, False),
        ({"asked": 0.45}, True),
        ({"asked": 0.55}, False),
        ({"drifts": 5.0}, True),
        # in means of six seconds, twice
        ({"lasts_s": 4.0}, True),
        ({"lasts_s": 3.2}, False),
        # armed, or it is shaken by hand
        ({"armed": (0.0, BEGAN_S + 2.0)}, False),
        # sampled as often as that is judged by
        ({"rate_hz": 25.0}, True),
        ({"rate_hz": 19.0}, False),
    ],
)
def test_when_it_is_told(how, is_told):
    assert bool(found_in(**how)) == is_told


def test_the_axis_that_swings_first_is_told():
    both = [found_in(axis=0, lasts_s=8.0), found_in(axis=1, lasts_s=8.0)]
    assert [len(found) for found in both] == [1, 1]
    (found,) = found_in(axis=(0, 1), lasts_s=8.0)
    assert found.text.startswith("roll")


def test_without_samples_or_a_demand_nothing_is_found():
    track = imu_track(SAMPLES_S)
    known = {parts.bins: flying_bins(9.0), parts.unharmed: Context(),
             parts.soundest_as_recorded: track}  # fmt: skip
    for lacking in ({parts.bins: None}, {parts.soundest_as_recorded: None}, {}):
        assert look(KnownEvidence(known | lacking)) == []
