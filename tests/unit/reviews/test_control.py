"""When control was lost: tables of attitudes that are just far, long and turning enough."""

import numpy as np
import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import AttitudeTrack, Context, Motors, Series, Span
from h2nav.reviews.control import control_errors, detect_control, without_touches
from h2nav.reviews.impacts import BIN_S, Bins, Impact

T_S = np.arange(0.0, 60.0, BIN_S)
FLIGHT = (Span(0.0, 60.0, ""),)
OUTPUTS = Motors((1, 2, 3, 4), T_S, np.full((len(T_S), 4), 1500.0), 1000.0, 2000.0)
CRASH = Impact(
    t_s=32.0,
    to_s=60.0,
    peak_g=20.0,
    peak_rad_s=5.0,
    tilt_rad=1.0,
    turned_rad=0.0,
    turned_s=31.5,
    is_crash=True,
)


def attitudes(roll_rad, t_s=T_S):
    half = 0.5 * np.broadcast_to(roll_rad, t_s.shape)
    return np.column_stack((np.cos(half), np.sin(half), 0.0 * half, 0.0 * half))


def between(from_s, length_s):
    """(N,) 1 in a time of this length, 0 elsewhere."""
    return ((T_S - from_s > -0.01) & (T_S - length_s < from_s - 0.01)).astype(float)


def bins(rate_rad_s=0.0):
    random = np.random.default_rng(1)
    shape = (len(T_S), 3)
    ones = np.ones(len(T_S))
    return Bins(
        T_S, np.tile([0.0, 0.0, -9.81], (len(T_S), 1)), random.normal(0.0, 0.05, shape), ones,
        0.1 * ones + rate_rad_s, 0.5 * ones,
    )  # fmt: skip


def context(roll_rad, demand_rad=0.0, **changes):
    track = AttitudeTrack("autopilot", T_S, attitudes(roll_rad))
    demand = np.column_stack((np.broadcast_to(demand_rad, T_S.shape), 0.0 * T_S, 0.0 * T_S))
    given = {"demand": Series(T_S, demand), "motors": OUTPUTS, "armed": FLIGHT}
    return Context(attitudes=(track,), **(given | changes))


def lost(roll_rad, rate_rad_s=0.0, impacts=(), lifted=FLIGHT, **changes):
    found = detect_control(bins(rate_rad_s), context(roll_rad, **changes), impacts, lifted)
    assert len(found) <= 1
    return found[0] if found else None


TURN = 150.0 * DEG * between(30.0, 1.0)


@pytest.mark.parametrize(
    ("tilt_deg", "length_s", "turns", "is_lost"),
    [
        (46.0, 5.0, 150.0, True),
        (44.0, 5.0, 150.0, False),
        (46.0, 1.2, 150.0, True),
        (46.0, 0.9, 150.0, False),
        (46.0, 5.0, 90.0, False),
        (46.0, 5.0, 110.0, True),
    ],
)
def test_without_an_impact_it_went_far_and_stayed(tilt_deg, length_s, turns, is_lost):
    found = lost(tilt_deg * DEG * between(30.0, length_s), (turns * DEG - 0.1) * between(30.0, 0.2))
    assert (found is not None) == is_lost
    if found:
        assert (found.kind, found.severity) == (Kind.LOSS_OF_CONTROL, Severity.CRITICAL)
        assert found.from_s == pytest.approx(30.0, abs=0.11)
        assert found.to_s == pytest.approx(29.9 + length_s, abs=0.11)
        assert found.size == pytest.approx(46.0)
        assert found.text == "roll +46 deg where +0 was demanded"
        assert "left its demand by more than 20 deg" in found.evidence
        assert "at most 46 deg" in found.evidence


@pytest.mark.parametrize(("to_s", "is_lost"), [(29.0, False), (60.0, True)])
def test_who_stands_on_the_ground_loses_nothing(to_s, is_lost):
    found = lost(60.0 * DEG * between(30.0, 5.0), TURN, lifted=(Span(0.0, to_s, ""),))
    assert (found is not None) == is_lost


@pytest.mark.parametrize(
    ("before_s", "above_m", "other_m", "is_lost"),
    [
        (0.4, 1.4, None, False),
        (0.4, 1.6, None, True),
        (0.6, 0.0, None, True),
        (0.4, 0.0, 1.6, True),  # one height denies it
        (0.4, None, None, True),
    ],
)
def test_what_lies_as_high_as_it_was_had_touched(before_s, above_m, other_m, is_lost):
    found = [lost(60.0 * DEG * between(30.0, 5.0), TURN)]
    crash = CRASH._replace(t_s=found[0].from_s + before_s)
    heights = [
        None if one is None else Series(T_S, np.where(crash.t_s > T_S, 5.0 + one, 5.0))
        for one in (above_m, other_m)
    ]
    made = Context(baro_height_m=heights[0], height_m=heights[1])
    assert without_touches(found, made, [crash]) == (found if is_lost else [])


def test_what_is_demanded_is_not_lost():
    roll_rad = 60.0 * DEG * between(30.0, 5.0)
    assert lost(roll_rad, TURN, demand_rad=roll_rad) is None
    assert lost(roll_rad, TURN, demand_rad=-roll_rad).size == pytest.approx(120.0)


def test_who_never_held_its_demand_has_lost_nothing():
    assert lost(60.0 * DEG, TURN) is None
    held = np.where(T_S < 29.2, 60.0 * DEG, 0.0) + 60.0 * DEG * between(30.0, 5.0)
    assert lost(held, TURN) is None
    held = np.where(T_S < 28.8, 60.0 * DEG, 0.0) + 60.0 * DEG * between(30.0, 5.0)
    assert lost(held, TURN) is not None


@pytest.mark.parametrize(("mode", "is_lost"), [("STABILIZE", True), ("acro", False)])
def test_a_mode_without_attitudes_asks_for_none(mode, is_lost):
    tumble = 60.0 * DEG * between(30.0, 5.0)
    assert (lost(tumble, TURN, modes=(Span(20.0, 50.0, mode),)) is not None) == is_lost
    assert lost(tumble, TURN, modes=(Span(0.0, 20.0, mode), Span(45.0, 60.0, mode))) is not None


def test_without_outputs_only_impacts_count():
    assert lost(60.0 * DEG * between(30.0, 5.0), TURN, motors=None) is None


@pytest.mark.parametrize(
    ("tilt_deg", "from_s", "length_s", "rate_deg_s", "is_lost"),
    [
        (21.0, 31.0, 1.0, 40.0, True),
        (19.0, 31.0, 1.0, 40.0, False),
        (21.0, 31.8, 0.2, 40.0, True),
        (21.0, 31.9, 0.1, 40.0, False),
        (21.0, 31.0, 1.0, 20.0, False),
        (21.0, 30.0, 1.5, 40.0, False),  # it came back
        (21.0, 30.0, 1.8, 40.0, True),  # by less than a blow's delay
        (21.0, 33.0, 1.0, 40.0, False),  # after the impact
    ],
)
def test_before_an_impact_less_is_enough(tilt_deg, from_s, length_s, rate_deg_s, is_lost):
    found = lost(
        tilt_deg * DEG * between(from_s, length_s), rate_deg_s * DEG - 0.1, (CRASH,), motors=None
    )
    assert (found is not None) == is_lost
    if found:
        assert found.from_s == pytest.approx(from_s, abs=0.11)
        assert found.text == "roll +21 deg where +0 was demanded"


def test_it_begins_where_the_vehicle_turns():
    found = lost(30.0 * DEG * between(25.0, 7.0), TURN, (CRASH,), motors=None)
    assert found.from_s == pytest.approx(30.0, abs=0.11)


def test_what_led_to_an_impact_is_told_once():
    found = lost(60.0 * DEG * between(30.0, 4.0), TURN, (CRASH,))
    assert found is not None


@pytest.mark.parametrize(("turned_deg", "is_lost"), [(200.0, True), (1.0, False)])
def test_without_a_demand_the_gyro_tells(turned_deg, is_lost):
    crash = CRASH._replace(turned_rad=turned_deg * DEG)
    found = lost(0.0, impacts=(crash,), demand=None)
    assert (found is not None) == is_lost
    if found:
        assert (found.from_s, found.to_s) == (31.5, 32.0)
        assert (found.size, found.text) == (pytest.approx(200.0), "it turned over by 200 deg")


def test_errors_are_angles_between_both_verticals():
    roll_rad, demand_rad = 0.3 * np.sin(T_S), 0.1 * np.cos(T_S)
    errors = control_errors(bins(), context(roll_rad, demand_rad))
    np.testing.assert_allclose(errors.roll_rad, np.interp(errors.t_s, T_S, roll_rad), atol=0.02)
    np.testing.assert_allclose(errors.roll_asked_rad, np.interp(errors.t_s, T_S, demand_rad))
    np.testing.assert_allclose(
        errors.size_rad, np.abs(errors.roll_rad - errors.roll_asked_rad), atol=1e-7
    )
    assert np.allclose(errors.pitch_rad, 0.0)
    assert errors.flies[10:-10].all()
    assert (errors.t_s[0], errors.t_s[-1]) == (0.0, pytest.approx(59.8))


@pytest.mark.parametrize(
    "changes",
    [
        {"demand": None},
        {"attitudes": ()},
        {"armed": ()},
        {"demand": Series(T_S[:1], np.zeros((1, 3)))},
        {"demand": Series(T_S, np.full((len(T_S), 3), np.nan))},
        {"demand": Series(T_S + 100.0, np.zeros((len(T_S), 3)))},
        {"attitudes": (AttitudeTrack("autopilot", T_S[:1], attitudes(0.0, T_S[:1])),)},
    ],
)
def test_without_both_there_are_no_errors(changes):
    assert control_errors(bins(), context(0.0)._replace(**changes)) is None
    assert control_errors(bins().part(np.zeros(len(T_S), bool)), context(0.0)) is None
