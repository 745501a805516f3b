"""Vertical motion by its sources, and the moments at which a descent ended: tables."""

import numpy as np
import pytest

from h2nav.recordings.context import Context, GpsTrack, Series, Span
from h2nav.reviews.vertical import GRID_S, Climb, climbs, contacts

T_S = GRID_S * np.arange(300)
ARMED = Context(armed=(Span(0.0, 30.0, ""),))
HIT = 150  # a place on the grid


def falling(speed_m_s, stopped_m_s=0.0, steps=1, place=HIT):
    """(N,) climb: level, from two seconds before `place` a descent that ends in some steps."""
    climb = np.where(np.arange(len(T_S)) < place, -speed_m_s, stopped_m_s)
    climb[: place - 20] = 0.0
    climb[place : place + steps] = np.linspace(-speed_m_s, stopped_m_s, steps + 1)[1:]
    return climb


def ends(*climb_m_s, context=ARMED):
    names = ("the estimator", "the barometer", "the GPS")
    sources = zip(names, climb_m_s, strict=False)
    return contacts(tuple(Climb(name, T_S, each) for name, each in sources), context)


@pytest.mark.parametrize(
    ("speed_m_s", "stopped_m_s", "steps", "is_contact"),
    [
        (2.1, 0.0, 1, True),
        (1.9, 0.0, 1, False),
        (5.0, 0.0, 2, True),
        (5.0, 0.0, 12, False),  # as thrust does it
        (8.0, 0.9, 1, True),
        (8.0, 1.1, 1, False),  # it flies on
        (3.0, 0.7, 1, True),
        (3.0, 0.8, 1, False),  # a quarter of it
        (3.0, -0.8, 1, False),
    ],
)
def test_a_descent_that_ends_at_once_and_stays_ended(speed_m_s, stopped_m_s, steps, is_contact):
    found = ends(falling(speed_m_s, stopped_m_s, steps))
    assert len(found) == is_contact
    for one in found:
        assert one.t_s == pytest.approx(GRID_S * HIT, abs=2.1 * GRID_S)
        assert one.speed_m_s == pytest.approx(speed_m_s)
        change = (speed_m_s + stopped_m_s) / (3.0 * GRID_S)
        assert one.stop_m_s2 == pytest.approx(change, rel=1e-6)
        assert (one.shown_by, one.denied_by) == (("the estimator",), ())


@pytest.mark.parametrize(
    ("speed_m_s", "up_m_s", "falls_m_s2", "steps", "is_contact"),
    [
        (10.0, 6.0, 9.81, 1, True),
        (10.0, 6.0, 1.0, 1, False),  # it climbs on
        (10.0, 6.0, 9.81, 12, False),  # as thrust does it
        (3.0, 1.0, 9.81, 1, False),
        (3.0, 1.6, 9.81, 1, True),
    ],
)
def test_what_rebounds_has_met_the_ground(speed_m_s, up_m_s, falls_m_s2, steps, is_contact):
    climb = falling(speed_m_s, up_m_s, steps)
    since_s = GRID_S * (np.arange(len(T_S)) - HIT - steps).clip(min=0.0)
    rebound = np.maximum(climb - falls_m_s2 * since_s, -up_m_s) * (since_s < 1.5)
    found = ends(np.where(since_s > 0.0, rebound, climb))
    assert any(one.speed_m_s == pytest.approx(speed_m_s) for one in found) == is_contact


@pytest.mark.parametrize(
    ("speed_m_s", "after_s", "sinks_m", "is_contact"),
    [
        (5.0, 0.9, 2.8, True),
        (5.0, 0.9, 3.4, False),
        (12.0, 0.9, 6.5, True),  # by 7.3 m the air misleads a barometer
        (12.0, 0.9, 8.5, False),
        (5.0, 3.0, 9.0, True),  # it has flown since
    ],
)
def test_what_sinks_further_has_not_met_the_ground(speed_m_s, after_s, sinks_m, is_contact):
    climb = falling(speed_m_s)
    first = HIT + round(after_s / GRID_S)
    climb[first : first + 20] = -sinks_m / 2.0
    found = ends(climb, climb)
    assert any(one.speed_m_s == pytest.approx(speed_m_s) for one in found) == is_contact


def test_only_while_it_is_armed():
    assert ends(falling(5.0), context=Context(armed=(Span(0.0, 14.0, ""),))) == []
    assert ends(falling(5.0), context=Context()) == []
    assert ends() == []


@pytest.mark.parametrize(
    ("other", "shown", "denied"),
    [
        (falling(5.0), ("the estimator", "the barometer"), ()),
        (falling(5.0, place=HIT + 3), ("the estimator", "the barometer"), ()),
        (falling(0.0), ("the estimator",), ("the barometer",)),
        (np.full(len(T_S), np.nan), ("the estimator",), ()),
    ],
)
def test_sources_agree_or_deny_or_are_silent(other, shown, denied):
    (found,) = ends(falling(5.0), other)
    assert (found.shown_by, found.denied_by) == (shown, denied)


@pytest.mark.parametrize(("far_m_s", "is_agreed"), [(12.5, True), (13.5, False)])
def test_speeds_agree_within_a_share(far_m_s, is_agreed):
    (found,) = ends(falling(10.0), falling(10.0), falling(far_m_s))
    assert found.speed_m_s == pytest.approx(10.0)
    assert ("the GPS" in found.shown_by) == is_agreed
    assert ("the GPS" in found.denied_by) != is_agreed


@pytest.mark.parametrize(("apart", "count"), [(28, 1), (50, 2)])
def test_contacts_close_together_are_the_fastest_of_them(apart, count):
    climb = falling(4.0)
    again = falling(6.0, place=HIT + apart)
    climb[HIT + apart - 20 :] = again[HIT + apart - 20 :]
    found = ends(climb)
    assert len(found) == count
    assert max(one.speed_m_s for one in found) == pytest.approx(6.0)


def receiver(v_down, has_fix=True):
    t_s = np.arange(0.0, 30.0, 0.2)
    v_n = np.zeros((len(t_s), 3))
    v_n[:, 2] = v_down
    unknown = np.full(len(t_s), np.nan)
    return GpsTrack(
        0, t_s, np.full(len(t_s), has_fix), unknown, unknown, unknown, v_n, unknown, unknown
    )


def test_every_source_is_a_climb_on_one_grid():
    grid = np.arange(0.0, 30.0, 0.1)
    context = Context(
        duration_s=30.0,
        climb_m_s=Series(grid, np.full(len(grid), 1.5)),
        baro_height_m=Series(grid, 2.0 * grid),
        gps=(receiver(-2.5), receiver(9.0)),
    )
    found = climbs(context)
    assert [one.name for one in found] == ["the estimator", "the barometer", "the GPS"]
    for one, speed in zip(found, (1.5, 2.0, 2.5), strict=True):
        assert one.t_s == pytest.approx(grid)
        assert one.climb_m_s[10:290] == pytest.approx(speed)
    assert np.isnan(found[1].climb_m_s[:2]).all()
    assert np.isnan(found[1].climb_m_s[-2:]).all()


@pytest.mark.parametrize(
    "gps", [(), (receiver(0.0),), (receiver(-2.5, has_fix=False),), (receiver(np.nan),)]
)
def test_a_receiver_that_shows_no_vertical_speed_is_no_source(gps):
    assert climbs(Context(duration_s=30.0, gps=gps)) == ()


@pytest.mark.parametrize(("gap_s", "is_known"), [(0.59, True), (0.65, False)])
def test_in_a_gap_nothing_is_known(gap_s, is_known):
    t_s = np.array([0.0, 0.2, 0.4, 0.4 + gap_s, 0.6 + gap_s])
    context = Context(duration_s=1.0, climb_m_s=Series(t_s, np.ones(5)))
    (found,) = climbs(context)
    assert np.isfinite(found.climb_m_s[6]) == is_known
    assert np.isfinite(found.climb_m_s[3])


def test_of_a_short_recording_nothing_is_known():
    context = Context(duration_s=0.4, baro_height_m=Series(T_S, T_S), armed=ARMED.armed)
    (found,) = climbs(context)
    assert np.isnan(found.climb_m_s).all()
    assert contacts((found,), context) == []
