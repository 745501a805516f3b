"""When a velocity is refused, and what gives it back: just enough, and just too little."""

import math

import pytest

from h2nav.integrity.causes import DECIDED, Cause, Explained
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_refusal import VelocityRefusal
from h2nav.integrity.velocity_windows import Window

S = 1_000_000
DEG = math.pi / 180.0
BEGAN_US = 100 * S
FAILING = InnovationRatios(velocity_10s=1.5, turn_1s=0.2)
FINE = InnovationRatios(velocity_10s=0.9, turn_1s=0.2)


def window(tilt_deg, length_s=10.0):
    """The longest window, with a difference as such a tilt makes."""
    return Window(length_s, tilt_deg * DEG * 9.80665 * length_s, 1.0, 1.0, True)


SURE = math.log(DECIDED) + 1.0


def explained(share, *, odds=SURE, jumped_s=0.0, drift_m_s2=0.0):
    shares = ((Cause.VELOCITY, share),)
    return Explained(odds, shares, jumped_us=round(jumped_s * S), drift_m_s2=drift_m_s2)


def refused(shown=None):
    made = VelocityRefusal()
    made.begin(BEGAN_US, explained(0.95), shown)
    return made


def heard(made, until_s, long=None, ratios=FAILING, found=None, shown=None, every_us=S):
    """Hears it every second; after how many it is used again, None if it is not."""
    for t_us in range(BEGAN_US + every_us, BEGAN_US + round(until_s * S) + 1, every_us):
        if made.hear(t_us, long, ratios, found, shown):
            return (t_us - BEGAN_US) / S
    return None


def test_what_is_not_refused_is_not_heard():
    made = VelocityRefusal()
    assert not made.hear(BEGAN_US, None, InnovationRatios(), None, None)
    assert (made.since_us, made.shown) == (None, None)


@pytest.mark.parametrize(
    ("how", "after_s"),
    [
        # it has agreed within a harmless tilt for ten seconds
        ({"long": window(1.4)}, 11.0),
        ({"long": window(1.6)}, 121.0),
        ({"long": window(1.4, 2.0)}, 11.0),
        ({"long": window(1.4, 1.9)}, 121.0),
        # within its deviations for thirty
        ({"long": window(1.6), "ratios": FINE}, 31.0),
        ({"long": window(1.6), "ratios": FINE._replace(velocity_10s=1.0)}, 121.0),
        ({"long": window(1.6), "ratios": FINE._replace(velocity_10s=math.nan)}, 121.0),
        ({"long": None, "ratios": FINE}, 121.0),
        # it is improbable that it is false
        ({"found": explained(0.09)}, 1.0),
        ({"found": explained(0.11)}, 121.0),
        ({"found": explained(0.09, odds=math.log(DECIDED) - 0.1)}, 121.0),
        # nothing confirms the gyro any more
        ({"ratios": FAILING._replace(turn_1s=1.0)}, 1.0),
        ({"ratios": FAILING._replace(turn_1s=0.99)}, 121.0),
        ({"ratios": FAILING._replace(turn_1s=math.nan)}, 1.0),
    ],
)
def test_what_gives_it_back(how, after_s):
    made = refused()
    assert heard(made, 120.0, **how) == (after_s if after_s < 120.0 else None)
    if after_s > 120.0:
        assert made.since_us == BEGAN_US
        assert made.hear(BEGAN_US + 120 * S + 1, how.get("long"), FAILING, None, None)
    assert (made.since_us, made.shown) == (None, None)


def test_a_difference_in_between_counts_anew():
    made = refused()
    assert heard(made, 9.0, window(1.0)) is None
    assert not made.hear(BEGAN_US + 9 * S, window(2.0), FAILING, None, None)
    assert not made.hear(BEGAN_US + 19 * S, window(1.0), FAILING, None, None)
    assert made.hear(BEGAN_US + 19 * S + 1, window(1.0), FAILING, None, None)


def test_the_first_explanation_that_decides_it_is_shown():
    first, second = explained(0.99), explained(0.999)
    made = refused()
    heard(made, 1.0)
    assert made.shown is None
    heard(made, 1.0, shown=first)
    heard(made, 1.0, shown=second)
    assert made.shown is first
    assert refused(second).shown is second


def doubted(until_s=50.0):
    """One that was suspected, in a contradiction that is over."""
    made = VelocityRefusal()
    made.suspect(round(until_s * S))
    made.forget_contradiction()
    return made


BACK = explained(0.95, jumped_s=99.0)


@pytest.mark.parametrize(
    ("found", "t_s", "is_back"),
    [
        (BACK, 100.0, True),
        (explained(0.91, jumped_s=99.0), 100.0, True),
        (explained(0.89, jumped_s=99.0), 100.0, False),
        (BACK._replace(drift_m_s2=0.1), 100.0, False),
        # it was suspected in the five minutes before
        (BACK, 349.9, True),
        (BACK, 350.0, False),
    ],
)
def test_a_jump_may_be_the_way_back_of_one_that_was_suspected(found, t_s, is_back):
    made = doubted()
    made.begin(98 * S, explained(0.95), None)
    assert made.comes_back(round(t_s * S), found) == is_back
    assert made.since_us == (None if is_back else 98 * S)


def test_without_a_suspicion_or_while_that_lasts_nothing_comes_back():
    assert not VelocityRefusal().comes_back(100 * S, BACK)
    made = VelocityRefusal()
    made.suspect(50 * S)
    assert not made.comes_back(100 * S, BACK)


@pytest.mark.parametrize(("began_s", "is_back"), [(98.9, True), (99.0, False), (99.1, False)])
def test_the_jump_for_which_it_is_refused_is_no_way_back(began_s, is_back):
    made = doubted()
    made.begin(round(began_s * S), explained(0.95), None)
    assert made.comes_back(100 * S, BACK) == is_back


@pytest.mark.parametrize(("later_s", "is_same"), [(5.0, True), (5.1, False)])
def test_it_comes_back_once_although_windows_place_the_jump_differently(later_s, is_same):
    made = doubted()
    assert made.comes_back(100 * S, BACK)
    again = BACK._replace(jumped_us=BACK.jumped_us + round(later_s * S))
    assert made.comes_back(101 * S, again) == is_same


@pytest.mark.parametrize(("t_s", "is_suspected"), [(110.9, False), (111.0, True)])
def test_the_way_back_is_no_second_falsehood_while_a_window_shows_it(t_s, is_suspected):
    made = doubted()
    assert made.comes_back(100 * S, BACK)
    made.suspect(round(t_s * S))
    made.forget_contradiction()
    later = BACK._replace(jumped_us=round((t_s + 10.0) * S))
    # only a new suspicion has another way back
    assert made.comes_back(later.jumped_us, later) == is_suspected


def test_what_has_agreed_for_long_was_not_false():
    made = doubted()
    made.begin(BEGAN_US, explained(0.95), None)
    assert heard(made, 20.0, window(1.0)) == 11.0
    assert not made.comes_back(BEGAN_US + 20 * S, explained(0.95, jumped_s=119.0))


def test_what_is_heard_in_vain_keeps_its_way_back():
    made = doubted()
    made.begin(BEGAN_US, explained(0.95), None)
    assert heard(made, 20.0) is None
    assert made.comes_back(BEGAN_US + 20 * S, explained(0.95, jumped_s=119.0))
