"""The card of a crash: figures that were made, in the document and on the page."""

import math
import re

import numpy as np
import pytest
from made_flight import made_crash, page_of, text_of
from needs import DEG

from h2nav.recordings.context import Span
from h2nav.reviews.crash_card import crash_cards
from h2nav.reviews.document import document
from h2nav.reviews.impacts import Impact
from h2nav.reviews.last_seconds import BEFORE_S, last_seconds

BLOW = Impact(104.1, 112.0, 9.0, 2.0, 1.0, 1.0, 101.0, True, 6.7, ("the estimator", "the GPS"))


@pytest.fixture(scope="module")
def crashed():
    flight, analysis = made_crash()
    return flight, analysis._replace(impacts=(BLOW,))


def ended(flight, impacts=()):
    (found,) = last_seconds(flight, flight.findings, impacts)
    return found


def test_it_falls_as_it_was_made_to(crashed):
    found = ended(crashed[0], (BLOW,))
    assert (found.t_s, found.speed_m_s) == (104.0, 6.7)
    assert found.speed_by == ("the estimator", "the GPS")
    assert found.peak_m_s2 == pytest.approx(9.0 * 9.80665)
    assert found.fell_m == pytest.approx(20.0, abs=0.1)
    assert [one.before_s for one in found.before] == list(BEFORE_S)
    at = {one.before_s: one for one in found.before}
    # 20 m in 3 s.
    assert at[1.0].height_m == pytest.approx(20.0 / 3.0, abs=0.3)
    assert at[1.0].climb_m_s == pytest.approx(-20.0 / 3.0, abs=0.3)
    assert at[5.0].climb_m_s == pytest.approx(0.0, abs=0.1)
    assert at[2.0].pitch_rad - at[2.0].demanded_pitch_rad == pytest.approx(
        -60.0 * DEG * (1.0 - math.exp(-2.0)), abs=1.0 * DEG
    )
    assert at[3.0].motors == pytest.approx((1.0, 0.6, 0.15, 0.8))
    assert at[0.2].ground_speed_m_s > 1.0


@pytest.mark.parametrize(("t_s", "before_s"), [(0.1, []), (0.3, [0.2])])
def test_a_recording_may_begin_with_the_crash(crashed, t_s, before_s):
    flight = crashed[0]
    (lost, crash) = flight.findings
    (found,) = last_seconds(flight, (lost, crash._replace(from_s=t_s)), ())
    assert [one.before_s for one in found.before] == before_s


def test_what_was_not_recorded_is_unknown(crashed):
    flight = crashed[0]
    bare = flight._replace(
        estimates=None,
        context=flight.context._replace(
            attitudes=(), demand=None, motors=None, sticks=None, height_m=None, gps=(),
            baro_height_m=None, climb_m_s=None, modes=(), faults=(),
        ),
    )  # fmt: skip
    found = ended(bare)
    assert math.isnan(found.speed_m_s)
    assert math.isnan(found.fell_m)
    assert (found.attitude_by, found.mode, found.commanded_by) == ("", "", "")
    assert (found.sticks, found.reports, found.motors) == ({}, (), ())
    assert all(np.isnan(one[1:-1]).all() for one in found.before)


@pytest.mark.parametrize(("pitch_deg", "is_told"), [(-3.0, True), (None, False)])
def test_a_demand_is_told_of_both_axes(pitch_deg, is_told):
    last = {"before_s": 0.2, "roll_deg": 1.0, "pitch_deg": 2.0, "demanded_roll_deg": 5.0,
            "demanded_pitch_deg": pitch_deg, "motors_percent": []}  # fmt: skip
    unknown = dict.fromkeys(("height_m", "climb_m_s", "ground_speed_m_s"))
    crash = {"t_s": 1.0, "before": [unknown | last], "reports": [], "attitude_by": "EKF3",
             "commanded_by": "", "motors": []}  # fmt: skip
    card, _ = crash_cards([crash | dict.fromkeys(("speed_m_s", "fell_m", "peak_m_s2"))])
    assert ("; demanded +5 and −3 deg" in card) == is_told


@pytest.mark.parametrize(
    ("mode", "kind", "who"),
    [
        ("STABILIZE", 2, "pilot"),
        ("LOITER", 2, "pilot"),
        ("LOITER", 1, "autopilot"),  # a plane circles there
        ("POSCTL", 2, "pilot"),
        ("AUTO_MISSION", 2, "autopilot"),
        ("RTL", 1, "autopilot"),
    ],
)
def test_the_mode_tells_who_commanded(crashed, mode, kind, who):
    flight = crashed[0]
    context = flight.context._replace(modes=(Span(0.0, 112.0, mode),), vehicle_type=kind)
    assert ended(flight._replace(context=context)).commanded_by == who


def test_a_value_from_long_before_tells_nothing(crashed):
    flight = crashed[0]
    motors, kept = flight.context.motors, flight.context.motors.t_s < 102.3
    silent = motors._replace(t_s=motors.t_s[kept], pwm_us=motors.pwm_us[kept])
    found = ended(flight._replace(context=flight.context._replace(motors=silent)))
    known = [np.isfinite(one.motors).all() for one in found.before]
    assert known == [True, True, True, False, False, False]


def test_the_card_and_the_document_tell_the_same(crashed):
    (told,) = document(*crashed)["crashes"]
    assert told["sticks_percent"].keys() == {"roll", "pitch", "yaw", "throttle"}
    text = text_of(page_of(*crashed))
    card = text[text.index("The crash at 104.0 s") : text.index("Dashed violet")]
    assert "at 6.7 m/s downward, by the estimator, the GPS" in card
    assert "up to 20 m above that place" in card
    assert "the autopilot, in LAND; sticks in the last 2 s: roll" in card
    assert "battery: low" in card
    pitch = [
        f"{round(one['pitch_deg']):d}".replace("-", "\N{MINUS SIGN}") for one in told["before"]
    ]
    assert re.search(rf"pitch, deg {' '.join(pitch)} ", card)
