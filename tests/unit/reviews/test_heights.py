"""When heights contradict each other: just enough of it, and just too little."""

import numpy as np
import pytest
from known_evidence import receiver_track

from h2nav.integrity.findings import Kind, Sensor, SensorKind, Severity
from h2nav.recordings.context import Context, Series, Span
from h2nav.reviews.heights import HEIGHT_LOST, Heights, detect_heights, heights
from h2nav.reviews.vertical import GRID_S, Climb

END_S, AT_S = 120.0, 60.0
T_S = np.arange(0.0, END_S, GRID_S)
NOTHING = np.full(len(T_S), np.nan)
LEVEL = np.full(len(T_S), 50.0)
# What all sources show: at its height at the time of what is wrong, where it neither climbs nor
# sinks.
FLIGHT = 30.0 * np.cos(2.0 * np.pi * (T_S - AT_S) / END_S)
FLOWN = (Span(5.0, 110.0, ""),)


def later(change, from_s=AT_S, over_s=0.0):
    """A change that begins at a time and lasts."""
    grown = np.clip((T_S - from_s) / max(over_s, 1e-6), 0.0, 1.0)
    return change * np.where(over_s > 0.0, grown, from_s - 1e-6 <= T_S)


def found_in(barometer=LEVEL, altitude=LEVEL, moved=LEVEL, estimate=LEVEL, climbed=LEVEL,
             speed=0.0 * LEVEL, armed=FLOWN, lifted=FLOWN):  # fmt: skip
    shown = (one + FLIGHT for one in (barometer, altitude, moved, estimate, climbed))
    known = Heights(T_S, *shown, speed**2 / 19.6)
    return detect_heights(known, Context(armed=armed), lifted)


def test_heights_that_agree_are_sound():
    assert found_in() == []
    assert found_in(altitude=NOTHING, moved=NOTHING, estimate=NOTHING, climbed=NOTHING) == []
    short = Heights(*(one[:30] for one in (T_S, *[LEVEL] * 6)))
    assert detect_heights(short, Context(armed=FLOWN), FLOWN) == []


# --- a step ---------------------------------------------------------------------------------------


def test_what_is_told_of_a_step():
    (found,) = found_in(LEVEL - later(20.0), estimate=NOTHING)
    assert (found.kind, found.sensor) == (Kind.BARO, Sensor(SensorKind.BAROMETER))
    assert (found.severity, found.unit) == (Severity.WARNING, "m")
    assert found.from_s == pytest.approx(AT_S, abs=0.4)
    assert found.to_s == pytest.approx(110.0)
    assert found.size == pytest.approx(20.0)
    assert found.text == f"the barometer stepped by -20 m at {found.from_s:.0f} s"
    assert found.evidence.startswith("GPS velocity and GPS altitude and the estimator's climb rate")


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        # 8 m against two
        ({"barometer": LEVEL + later(8.1)}, True),
        ({"barometer": LEVEL + later(7.9)}, False),
        ({"barometer": LEVEL + later(8.1), "moved": NOTHING}, True),
        ({"barometer": LEVEL + later(8.1), "altitude": NOTHING, "moved": NOTHING}, False),
        # 25 m against one alone
        ({"barometer": LEVEL + later(25.1), "altitude": NOTHING, "moved": NOTHING}, True),
        ({"barometer": LEVEL + later(24.9), "altitude": NOTHING, "moved": NOTHING}, False),
        ({"barometer": LEVEL + later(25.1), "climbed": NOTHING, "moved": NOTHING}, True),
        # of which nobody shows a part
        ({"barometer": LEVEL + later(12.0), "altitude": LEVEL + later(3.9)}, True),
        ({"barometer": LEVEL + later(12.0), "altitude": LEVEL + later(4.1)}, False),
        ({"barometer": LEVEL + later(12.0), "climbed": LEVEL + later(4.1)}, False),
        # of the air that it flies into, before or after
        ({"barometer": LEVEL + later(12.0), "speed": later(8.0)}, True),
        ({"barometer": LEVEL + later(12.0), "speed": later(9.5)}, False),
        ({"barometer": LEVEL + later(12.0), "speed": 9.5 - later(9.5)}, False),
        # at once
        ({"barometer": LEVEL + later(12.0, over_s=0.5)}, True),
        ({"barometer": LEVEL + later(12.0, over_s=2.5)}, False),
        # in flight
        ({"barometer": LEVEL + later(12.0, 4.0), "armed": (Span(6.0, 110.0, ""),)}, False),
        ({"barometer": LEVEL + later(12.0, 112.0)}, False),
        # a receiver that is silent just then leaves the estimator alone, which convicts nobody
        ({"barometer": LEVEL + later(30.0),
          "altitude": np.where(np.abs(T_S - AT_S) < 9.0, np.nan, LEVEL),
          "moved": np.where(np.abs(T_S - AT_S) < 9.0, np.nan, LEVEL)}, False),
    ],
)  # fmt: skip
def test_when_a_step_is_told(how, is_told):
    stepped = [one for one in found_in(**{"estimate": NOTHING, **how}) if "stepped" in one.text]
    assert bool(stepped) == is_told


def test_a_spike_is_no_step():
    spike = np.where(np.abs(T_S - AT_S) < 0.35, 40.0, 0.0)
    assert found_in(LEVEL + spike, estimate=NOTHING) == []


# --- a drift --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        # 25 m for ten seconds, slowly
        ({"barometer": LEVEL + later(25.5, 8.0, 92.0)}, True),
        ({"barometer": LEVEL + later(24.5, 8.0, 92.0)}, False),
        ({"barometer": LEVEL + later(26.0, 8.0, 92.0), "armed": (Span(5.0, 105.0, ""),)}, False),
        ({"barometer": LEVEL + later(26.0, 8.0, 88.0), "armed": (Span(5.0, 105.0, ""),)}, True),
        # velocity and altitude of the receiver show the same
        ({"barometer": LEVEL + later(30.0, 8.0, 92.0), "moved": LEVEL + later(14.0, 8.0, 92.0)},
         True),
        ({"barometer": LEVEL + later(30.0, 8.0, 92.0), "moved": LEVEL + later(16.0, 8.0, 92.0)},
         False),
        ({"barometer": LEVEL + later(30.0, 8.0, 92.0), "moved": NOTHING}, False),
    ],
)  # fmt: skip
def test_when_a_slow_drift_is_told(how, is_told):
    found = found_in(**{"estimate": NOTHING, "climbed": NOTHING, **how})
    assert any("was wrong by up to" in one.text for one in found) == is_told
    if is_told:
        assert found[0].size > 25.0


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        # 10 m within forty seconds, by medians of three
        ({"barometer": LEVEL + later(10.5, 50.0, 30.0)}, True),
        ({"barometer": LEVEL + later(9.5, 50.0, 30.0)}, False),
        ({"barometer": LEVEL + later(20.0, 20.0, 80.0)}, False),
        ({"barometer": LEVEL + later(22.5, 20.0, 80.0)}, True),
        ({"barometer": LEVEL + later(16.0, 50.0, 30.0), "moved": LEVEL + later(7.0, 50.0, 30.0)},
         False),
        ({"barometer": LEVEL + later(22.0, 50.0, 30.0), "moved": LEVEL + later(10.0, 50.0, 30.0)},
         True),
        ({"barometer": LEVEL + later(22.0, 50.0, 30.0), "moved": LEVEL + later(12.0, 50.0, 30.0)},
         False),
        ({"barometer": LEVEL + later(12.0, 50.0, 30.0), "armed": (Span(50.0, 80.0, ""),)}, False),
        ({"barometer": LEVEL + later(12.0, 50.0, 30.0), "altitude": NOTHING}, False),
    ],
)  # fmt: skip
def test_when_a_quick_drift_is_told(how, is_told):
    found = found_in(**{"estimate": NOTHING, "climbed": NOTHING, **how})
    assert any("drifted by" in one.text for one in found) == is_told


def test_since_when_it_drifted():
    (found,) = found_in(LEVEL - later(16.0, 50.0, 20.0), estimate=NOTHING, climbed=NOTHING)
    # from 15 % of it on
    assert found.from_s == pytest.approx(53.0, abs=0.6)
    assert found.size == pytest.approx(16.0)
    # the last window of forty seconds in which it changes by 10 m ends with what is 6 m of it
    assert found.to_s == pytest.approx(50.0 + 20.0 * 6.0 / 16.0 + 40.0, abs=2.0)
    assert found.text == f"the barometer drifted by -16 m from {found.from_s:.0f} s on"


# --- the estimate ---------------------------------------------------------------------------------


def lost(size_m=12.0, lasts_s=10.0, over_s=2.0, from_s=AT_S):
    """An estimate that runs away, with its climb rate, and comes back."""
    return LEVEL + later(size_m, from_s, over_s) - later(size_m, from_s + lasts_s, 0.0)


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        ({}, True),
        # 5 m, for a second
        ({"estimate": lost(5.2)}, True),
        ({"estimate": lost(4.8)}, False),
        ({"estimate": lost(lasts_s=2.2)}, True),
        ({"estimate": lost(lasts_s=1.6)}, False),
        # with a speed that runs away: a level that is set anew is none
        ({"climbed": lost(6.4)}, True),
        ({"climbed": lost(5.6)}, False),
        ({"climbed": LEVEL}, False),
        # while the receiver agrees with the barometer
        ({"altitude": LEVEL + later(5.5)}, True),
        ({"altitude": LEVEL + later(6.5)}, False),
        ({"altitude": NOTHING}, False),
        # in the air, after its first seconds
        ({"lifted": ()}, False),
        ({"lifted": (Span(54.0, 110.0, ""),)}, True),
        ({"lifted": (Span(68.0, 110.0, ""),)}, False),
        ({"armed": (Span(72.0, 110.0, ""),)}, False),
    ],
)
def test_when_a_lost_height_is_told(how, is_told):
    how = {"estimate": lost(), "climbed": lost(), "moved": NOTHING, **how}
    found = [one for one in found_in(**how) if one.kind == HEIGHT_LOST]
    assert bool(found) == is_told


def test_what_is_told_of_a_lost_height():
    (found,) = found_in(estimate=lost(), climbed=lost())
    assert (found.sensor, found.severity) == (Sensor(SensorKind.ESTIMATOR), Severity.WARNING)
    assert (found.from_s, found.to_s) == pytest.approx((60.9, 69.9), abs=0.11)
    assert found.size == pytest.approx(12.0)
    assert found.text == "the autopilot's height was off by up to 12 m"


# --- the grid -------------------------------------------------------------------------------------


def test_heights_are_put_on_one_grid():
    t_s = np.arange(0.0, END_S, 0.2)
    gps = receiver_track(t_s, (3.0, 4.0, np.nan))
    gps = gps._replace(altitude_m=100.0 + t_s, satellites=np.full(600, 6))
    climbs = (Climb("the GPS", T_S, np.full(len(T_S), 2.0)),
              Climb("the estimator", T_S, np.where(T_S < 9.0, np.nan, 1.0)))  # fmt: skip
    baro, own = Series(t_s, 3.0 * t_s), Series(t_s, -t_s)
    context = Context(baro_height_m=baro, height_m=own, gps=(gps,))
    known = heights(context, climbs, (Span(50.0, 99.0, ""),))
    inside = (T_S > 0.5) & (T_S < 49.9)
    assert known.barometer_m[inside] == pytest.approx(3.0 * T_S[inside])
    assert known.altitude_m[inside] == pytest.approx(100.0 + T_S[inside])
    assert known.estimate_m[inside] == pytest.approx(-T_S[inside])
    assert np.diff(known.moved_m[inside]) == pytest.approx(2.0 * GRID_S)
    assert np.diff(known.climbed_m[inside & (T_S > 9.5)]) == pytest.approx(GRID_S)
    assert np.isnan(known.climbed_m[T_S < 8.9]).all()
    assert known.blown_m[inside] == pytest.approx(25.0 / 19.613, rel=1e-4)
    doubted = (T_S > 50.1) & (T_S < 98.9)
    assert np.isnan(known.altitude_m[doubted]).all()
    assert np.isnan(known.moved_m[doubted]).all()
    assert np.isfinite(known.barometer_m[doubted]).all()
    assert heights(context._replace(baro_height_m=None), climbs) is None
    assert heights(context, ()) is None


@pytest.mark.parametrize(("satellites", "is_known"), [(6, True), (5, False)])
def test_few_satellites_show_no_altitude(satellites, is_known):
    t_s = np.arange(0.0, END_S, 0.2)
    gps = receiver_track(t_s, 0.0)._replace(satellites=np.full(len(t_s), satellites))
    context = Context(baro_height_m=Series(t_s, 0.0 * t_s), gps=(gps,))
    known = heights(context, (Climb("the estimator", T_S, 0.0 * T_S),))
    assert np.isfinite(known.altitude_m[50:500]).all() == is_known
    assert np.isnan(known.moved_m).all()
    assert np.isnan(known.estimate_m).all()
