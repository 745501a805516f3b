"""When the wind has carried a vehicle off: just enough of it, and just too little."""

import math

import numpy as np
import pytest
from known_evidence import KnownEvidence, receiver_track

from h2nav.integrity.findings import Severity
from h2nav.recordings.context import Context, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.inertial import Attitudes
from h2nav.reviews.subjects.blown_away import BLOWN_AWAY, look

DEG = math.pi / 180.0
T_S = np.arange(0.0, 60.0, 0.2)
BEGAN_S = 20.0


def found_in(
    lean_deg=28.0,
    back_m_s=3.0,
    lasts_s=20.0,
    limits=None,
    sigma_deg=5.0,
    gains_s=0.0,
    lifted=(0.0, 60.0),
    has_fix=True,
    azimuth_deg=40.0,
):
    """What is found of a vehicle that leans into a direction and moves backward meanwhile."""
    begun = (BEGAN_S - 0.05 < T_S) & (BEGAN_S + lasts_s + 0.05 > T_S)
    azimuth = azimuth_deg * DEG
    ahead = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    speed = np.where(begun, -back_m_s, 0.0)
    gains = (BEGAN_S + 5.0 < T_S + 0.05) & (BEGAN_S + 5.0 + gains_s > T_S + 0.05)
    speed[gains] = 0.5
    half = 0.5 * lean_deg * DEG * begun
    # nose down, by an axis to the right of the direction
    q_nb = np.stack(
        (np.cos(half), np.sin(half) * ahead[1], -np.sin(half) * ahead[0], 0.0 * half), axis=1
    )
    sigma = np.full(len(T_S), sigma_deg * DEG)
    limits = {"ANGLE_MAX": 3000.0} if limits is None else limits
    return look(
        KnownEvidence(
            {
                parts.unharmed: Context(parameters=limits),
                parts.best: Attitudes(T_S, q_nb, 0.0 * sigma, sigma),
                parts.receivers: (receiver_track(T_S, speed[:, None] * ahead, has_fix),),
                parts.lifted: (Span(*lifted, ""),),
            }
        )
    )


def test_what_is_told():
    (found,) = found_in()
    assert (found.kind, found.severity, found.unit) == (BLOWN_AWAY, Severity.WARNING, "m/s")
    assert (found.from_s, found.to_s) == pytest.approx((20.0, 40.0))
    assert found.size == pytest.approx(3.0)
    assert found.text == "carried off at 3 m/s, leaning 28 deg against it"
    assert found.evidence == "for 20 s; by our attitude and the receiver's velocity"


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        # 85 % of the limit
        ({"lean_deg": 25.6}, True),
        ({"lean_deg": 25.4}, False),
        ({"lean_deg": 25.6, "limits": {"ATC_ANGLE_MAX": 30.0}}, True),
        ({"lean_deg": 25.4, "limits": {"ATC_ANGLE_MAX": 30.0}}, False),
        ({"lean_deg": 25.6, "limits": {"MPC_TILTMAX_AIR": 30.0}}, True),
        ({"lean_deg": 25.4, "limits": {"ANGLE_MAX": 0.0, "MPC_TILTMAX_AIR": 30.0}}, False),
        ({"limits": {}}, False),
        # and no less than any brakes with
        ({"lean_deg": 15.1, "limits": {"ANGLE_MAX": 1500.0}}, True),
        ({"lean_deg": 14.9, "limits": {"ANGLE_MAX": 1500.0}}, False),
        ({"back_m_s": 1.1}, True),
        ({"back_m_s": 0.9}, False),
        ({"back_m_s": -3.0}, False),
        ({"lasts_s": 8.0}, True),
        ({"lasts_s": 7.8}, False),
        ({"sigma_deg": 14.9}, True),
        ({"sigma_deg": 15.1}, False),
        ({"azimuth_deg": -130.0}, True),
        ({"lifted": (0.0, 28.1)}, True),
        ({"lifted": (0.0, 27.9)}, False),
        ({"has_fix": False}, False),
        # as far as it is known where it went
        ({"lasts_s": 12.0, "has_fix": np.abs(T_S - 26.0) > 1.7}, True),
        ({"lasts_s": 12.0, "has_fix": np.abs(T_S - 26.0) > 2.1}, False),
        # gusts let it gain ground in between
        ({"lasts_s": 12.0, "gains_s": 1.2}, True),
        ({"lasts_s": 12.0, "gains_s": 1.6}, False),
        ({"lasts_s": 7.8 + 1.2, "gains_s": 1.2}, True),
        ({"lasts_s": 8.0, "gains_s": 1.4}, False),
    ],
)
def test_when_it_is_told(how, is_told):
    assert bool(found_in(**how)) == is_told


def test_the_longest_time_is_told():
    (found,) = found_in(lasts_s=30.0, gains_s=10.0)
    assert (found.from_s, found.to_s) == pytest.approx((35.0, 50.0))
    (found,) = found_in(lasts_s=23.6, gains_s=6.0)
    assert (found.from_s, found.to_s) == pytest.approx((31.0, 43.6))


def test_without_an_attitude_or_a_receiver_nothing_is_found():
    none = {parts.unharmed: Context(), parts.best: None, parts.receivers: (1,)}
    assert look(KnownEvidence(none)) == []
    attitude = Attitudes(T_S, np.tile([1.0, 0.0, 0.0, 0.0], (len(T_S), 1)), T_S, T_S)
    assert look(KnownEvidence(none | {parts.best: attitude, parts.receivers: ()})) == []
