"""When the heading by which an autopilot flew is said to be wrong: just enough, and too little."""

import math

import numpy as np
import pytest
from known_evidence import KnownEvidence, imu_track, receiver_track

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import AttitudeTrack, Context, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.heading_fit import Headings, longest_off
from h2nav.reviews.receiver import moves_of
from h2nav.reviews.standstill import NEVER
from h2nav.reviews.subjects.flown_heading import FLOWN_HEADING, look

G = 9.80665
DEG = math.pi / 180.0
END_S, HZ = 60.0, 25.0
T_S = np.arange(0.0, END_S, 1.0 / HZ)
FIX_S = np.arange(0.0, END_S, 0.2)
SWING_M_S = 3.0


def speed(t_s, size=SWING_M_S):
    """To and fro, north and east at rates of their own."""
    zero = 0.0 * t_s
    return size * np.stack((np.sin(0.9 * t_s), np.sin(0.6 * t_s), zero), axis=-1)


def rotated(heading_rad):
    """(N, 4) level attitudes."""
    half, zero = 0.5 * heading_rad, 0.0 * heading_rad
    return np.stack((np.cos(half), zero, zero, np.sin(half)), axis=-1)


def found_in(
    off_deg=60.0,
    lasts=(0.0, END_S),
    rate_hz=25.0,
    size=SWING_M_S,
    noise_m_s=0.05,
    turn_deg_s=0.0,
    late_s=0.0,
    led_m_s2=0.0,
    lifted=(0.0, END_S),
    has_fix=True,
):
    """What is found of a level vehicle pushed to and fro, whose autopilot's heading is off."""
    heading = turn_deg_s * DEG * T_S
    step = 1e-3
    pushed = (speed(T_S + step, size) - speed(T_S - step, size)) / (2.0 * step)
    c, s = np.cos(heading), np.sin(heading)
    f_b = np.stack(
        (c * pushed[:, 0] + s * pushed[:, 1], c * pushed[:, 1] - s * pushed[:, 0], 0.0 * c - G),
        axis=1,
    )
    track = imu_track(T_S, (0.0, 0.0, turn_deg_s * DEG), f_b)
    noise = np.random.default_rng(3).normal(0.0, noise_m_s, (len(FIX_S), 3))
    led = led_m_s2 * FIX_S[:, None] * (1.0, 0.0, 0.0)
    fixes = receiver_track(FIX_S, speed(FIX_S - late_s, size) + noise + led, has_fix)
    first, after = np.searchsorted(T_S, lasts)
    wrong = np.zeros(len(T_S))
    wrong[first:after] = off_deg * DEG
    flown = AttitudeTrack("EKF3", T_S, rotated(heading + wrong))
    armed = (Span(0.0, END_S, ""),)
    return look(
        KnownEvidence(
            {
                parts.unharmed: Context(attitudes=(flown,), armed=armed),
                parts.soundest: track,
                parts.moves: moves_of(fixes),
                parts.rate_hz: rate_hz,
                parts.lifted: (Span(*lifted, ""),),
                parts.rests: {0: NEVER},
            }
        )
    )


def test_a_receiver_that_never_had_a_fix_shows_no_heading():
    assert not found_in(has_fix=False)


def test_what_is_told():
    (found,) = found_in()
    assert (found.kind, found.severity, found.unit) == (FLOWN_HEADING, Severity.WARNING, "deg")
    assert found.size == pytest.approx(60.0, abs=1.0)
    assert found.text == "the autopilot's heading is off by 60 deg"
    assert found.from_s == pytest.approx(0.0, abs=0.5)
    assert found.to_s == pytest.approx(END_S, abs=2.5)


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        ({"off_deg": 0.0}, False),
        ({"off_deg": 32.0}, True),
        ({"off_deg": 28.0}, False),
        ({"off_deg": -32.0}, True),
        ({"off_deg": 180.0}, True),
        # with an attitude of ours, headings are compared in flight
        ({"rate_hz": 46.0}, False),
        # who hardly moves shows no heading, nor does a receiver of more noise than motion
        ({"size": 0.4}, False),
        ({"noise_m_s": 2.0}, False),
        # nor one that is led away, which a tilt explains
        ({"size": 0.4, "led_m_s2": 0.6}, False),
        ({"led_m_s2": 0.6}, True),
        # which is the vehicle's, however it turns, and however late the receiver is
        ({"turn_deg_s": 40.0}, True),
        ({"turn_deg_s": 40.0, "off_deg": 0.0}, False),
        ({"late_s": 0.3}, True),
        ({"late_s": 0.3, "off_deg": 0.0}, False),
        # in the air, and for long enough
        ({"lifted": (0.0, 9.0)}, False),
        ({"lifted": (0.0, 20.0)}, True),
        ({"lasts": (20.0, 24.0)}, False),
        ({"lasts": (20.0, 30.0)}, True),
    ],
)
def test_when_it_is_told(how, is_told):
    assert bool(found_in(**how)) == is_told


@pytest.mark.parametrize(
    ("off_deg", "sigma_deg", "at_s", "windows"),
    [
        ((40.0, 40.0, 40.0), 5.0, (5, 7, 9), 3),
        ((40.0, 40.0), 5.0, (5, 7), None),
        ((40.0, 20.0, 40.0, 40.0), 5.0, (5, 7, 9, 11), None),
        ((40.0, 40.0, 40.0), 10.5, (5, 7, 9), None),
        ((40.0, 40.0, 40.0), 9.5, (5, 7, 9), 3),
        # either way it is no error of one sign, unless it is half a turn
        ((40.0, -40.0, 40.0), 5.0, (5, 7, 9), None),
        ((170.0, -170.0, 170.0), 5.0, (5, 7, 9), 3),
        # windows with nothing between them
        ((40.0, 40.0, 40.0), 5.0, (5, 11, 17), None),
        ((40.0, 40.0, 40.0), 5.0, (5, 10, 15), 3),
        # the longest
        ((40.0,) * 3 + (0.0,) + (50.0,) * 4, 5.0, range(5, 21, 2), 4),
    ],
)
def test_which_windows_are_one_error(off_deg, sigma_deg, at_s, windows):
    known = Headings(
        np.array(at_s, float), np.array(off_deg) * DEG, np.full(len(off_deg), sigma_deg * DEG)
    )
    off = longest_off(known)
    assert (off and off.windows) == windows


def test_without_samples_or_a_receiver_nothing_is_found():
    known = {parts.unharmed: Context(), parts.rate_hz: 25.0, parts.soundest: None}
    assert look(KnownEvidence(known | {parts.moves: None})) == []
