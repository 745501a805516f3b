"""Every landing has its vertical speed."""

import numpy as np
import pytest
from known_evidence import KnownEvidence, flying_bins
from reviewed_flights import DURATION_S, flight

from h2nav.recordings.context import Context, Series, Span
from h2nav.reviews import evidence as parts
from h2nav.reviews.analysis import analyse
from h2nav.reviews.subjects.touchdown import TOUCHDOWN, look
from h2nav.reviews.vertical import Climb

T_S = np.arange(0.0, DURATION_S, 0.1)


def touchdowns(height_m):
    series = Series(T_S, height_m)
    climb = Series(T_S, np.gradient(height_m, 0.1))
    found = analyse(flight(baro_height_m=series, climb_m_s=climb, gps=())).findings
    return [one for one in found if one.kind == TOUCHDOWN]


@pytest.mark.parametrize("speed_m_s", [0.6, 2.5])
def test_a_landing_has_the_speed_of_its_last_descent(speed_m_s):
    (found,) = touchdowns(np.clip(speed_m_s * (90.0 - T_S), 0.0, 10.0))
    assert found.size == pytest.approx(speed_m_s, abs=0.15)
    assert found.from_s == pytest.approx(90.0, abs=0.8)


def test_a_vehicle_that_stays_on_the_ground_does_not_land():
    assert not touchdowns(0.2 * np.sin(T_S))


def test_a_log_that_ends_in_the_air_has_no_landing():
    assert not touchdowns(np.clip(T_S - 30.0, 0.0, 20.0) - np.clip(T_S - 110.0, 0.0, None))
    # What descends to another height, and stays there, has not landed either.
    knots_s, heights_m = (30.0, 50.0, 100.0, 104.0, 106.0), (0.0, 20.0, 20.0, 10.5, 9.0)
    assert not touchdowns(np.interp(T_S, knots_s, heights_m))


@pytest.mark.parametrize(("driven", "at_s"), [(0.5, [88.0]), (0.1, [20.0, 88.0])])
def test_a_log_that_pauses_in_the_air_has_no_landing(driven, at_s):
    """From 20 m to 10 m at 20 s, and to the ground at 90 s; the log pauses at 30 s."""
    height_m = np.interp(T_S, (10.0, 20.0, 80.0, 90.0), (20.0, 10.0, 10.0, 0.0))
    climb = Climb("the estimator", T_S, np.gradient(height_m, 0.1))
    armed = (Span(0.0, 30.0, ""), Span(31.2, 100.0, ""))
    bins = flying_bins(120.0)
    bins.driven[(bins.t_s > 25.0) & (bins.t_s < 35.0)] = driven
    context = Context(baro_height_m=Series(T_S, height_m), armed=armed)
    found = look(
        KnownEvidence(
            {
                parts.vertical: (climb,),
                parts.recorded: context,
                parts.met: [],
                parts.crashes: [],
                parts.ending: parts.Ending(is_aloft=False, is_moving=False),
                parts.paused: (Span(30.0, 31.2, ""),),
                parts.bins: bins,
            }
        )
    )
    assert [one.from_s for one in found] == pytest.approx(at_s, abs=2.0)


@pytest.mark.parametrize(
    ("vehicle_type", "lands"), [(1, True), (2, True), (10, False), (12, False)]
)
def test_what_drives_or_dives_does_not_land(vehicle_type, lands):
    height_m = np.clip(2.5 * (90.0 - T_S), 0.0, 10.0)
    series, climb = Series(T_S, height_m), Series(T_S, np.gradient(height_m, 0.1))
    made = flight(baro_height_m=series, climb_m_s=climb, gps=(), vehicle_type=vehicle_type)
    assert any(one.kind == TOUCHDOWN for one in analyse(made).findings) == lands
