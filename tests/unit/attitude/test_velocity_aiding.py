"""Which outside velocity holds a filter, when, and what is kept of it: limits and closed forms."""

import math
from itertools import pairwise

import pytest

from h2nav.attitude.samples import VelocityFix
from h2nav.attitude.velocity_aided.velocity_aiding import PAST_LENGTH, VelocityAiding

S = 1_000_000
NOW_US = 100 * S


def fix(t_us=NOW_US, v_n=(3.0, -4.0, math.nan), sigma_m_s=0.2, **more):
    return VelocityFix(t_us, v_n, sigma_m_s, **more)


@pytest.mark.parametrize(
    ("offered", "is_taken"),
    [
        ({}, True),
        ({"t_us": NOW_US - 800_000}, True),
        ({"t_us": NOW_US - 800_001}, False),
        ({"t_us": NOW_US + 100_000}, True),
        ({"t_us": NOW_US + 100_001}, False),
        ({"sigma_m_s": 3.0}, True),
        ({"sigma_m_s": 3.001}, False),
        ({"sigma_m_s": math.nan}, False),
        ({"v_n": (599.9, -799.9, math.nan)}, True),
        ({"v_n": (600.0, -800.0, 0.0)}, False),
        ({"v_n": (math.nan, 0.0, 0.0)}, False),
    ],
)
def test_a_fix_is_good_new_and_neither_late_nor_early(offered, is_taken):
    aiding = VelocityAiding()
    assert aiding.offer(fix(**offered), NOW_US) is is_taken
    assert (aiding.waiting is not None) is is_taken


@pytest.mark.parametrize(
    ("later_us", "is_taken"),
    [(-1, False), (0, False), (49_999, False), (50_000, True), (200_000, True)],
)
def test_a_fix_is_at_least_a_twentieth_of_a_second_after_the_one_before(later_us, is_taken):
    aiding = VelocityAiding()
    assert aiding.offer(fix(NOW_US - 300_000), NOW_US)
    assert aiding.offer(fix(NOW_US - 300_000 + later_us), NOW_US) is is_taken


def offered(times_s):
    aiding = VelocityAiding()
    for t_s in times_s:
        assert aiding.offer(fix(round(t_s * S)), round(t_s * S))
    return aiding


@pytest.mark.parametrize(
    ("times_s", "until_s"),
    [
        ((10.0,), -math.inf),
        ((10.0, 10.2), -math.inf),
        ((10.0, 10.2, 10.4), 12.9),
        # each no later than 2.5 s after the one before
        ((10.0, 12.5, 15.0), 17.5),
        ((10.0, 12.5, 15.001), -math.inf),
        ((10.0, 10.2, 10.4, 12.901), -math.inf),
        ((10.0, 10.2, 10.4, 12.901, 13.1, 13.3), 15.8),
    ],
)
def test_three_fixes_in_a_row_hold_a_filter_for_a_time(times_s, until_s):
    aiding = offered(times_s)
    assert aiding.aided_until_us == pytest.approx(until_s * S)
    for t_us in (round(1e6 * times_s[-1]), 12_899_999, 12_900_000):
        is_held = t_us < until_s * S
        again = offered(times_s)
        assert (again.take(t_us, (0.0, 0.0)) is not None) is is_held
        assert again.take(t_us, (0.0, 0.0)) is None, "once"


def aided(gained_at, sigma_m_s=0.2, late_s=0.35, step_us=10_000):
    """A fix that is taken at 12 s, of a filter that remembers what it has gained."""
    aiding = VelocityAiding()
    for t_s in (11.0, 11.25, 11.5):
        aiding.offer(fix(round(t_s * S)), round(t_s * S))
    for t_us in range(10 * S, 12 * S, step_us):
        aiding.remember(t_us, gained_at(1e-6 * t_us))
    aiding.offer(fix(12 * S - round(late_s * S), sigma_m_s=sigma_m_s), 12 * S)
    return aiding.take(12 * S, gained_at(12.0))


@pytest.mark.parametrize("at_s", [11.65, 11.655, 11.6575])
def test_a_late_fix_is_compared_with_what_was_gained_until_then(at_s):
    """At a row of the past, and between two of them."""
    found = aided(lambda t_s: (0.3 * t_s, -0.7 * t_s), late_s=12.0 - at_s)
    assert found.v_n == (3.0, -4.0)
    assert found.gained == pytest.approx((0.3 * at_s, -0.7 * at_s))
    assert found.rate == pytest.approx((0.3, -0.7))
    backs_s = (0.0, 0.1, 0.2, 0.3)
    expected = [(0.3 * (at_s - back), -0.7 * (at_s - back)) for back in backs_s]
    assert [part for each in found.earlier for part in each] == pytest.approx(
        [part for each in expected for part in each]
    )
    assert found.period_s == pytest.approx(at_s - 11.5)


def test_a_rate_is_that_of_a_tenth_of_a_second():
    found = aided(lambda t_s: (t_s * t_s, 0.0))
    assert found.rate[0] == pytest.approx((11.65**2 - 11.55**2) / 0.1, abs=1e-3)


@pytest.mark.parametrize(("stated_m_s", "sigma_m_s"), [(0.04, 0.05), (0.06, 0.06), (2.0, 2.0)])
def test_no_receiver_is_better_than_five_centimetres_a_second(stated_m_s, sigma_m_s):
    found = aided(lambda t_s: (0.0, 0.0), sigma_m_s=stated_m_s)
    assert found.variance == pytest.approx(sigma_m_s**2)


def test_a_period_counts_for_as_long_as_a_filter_is_held():
    aiding = offered((10.0, 11.0, 12.0, 13.0))
    assert aiding.take(13 * S, (0.0, 0.0)).period_s == pytest.approx(1.0)
    assert offered((10.0, 20.0)).values()[2] == 2.5


def test_the_past_has_a_row_every_hundredth_of_a_second_and_reaches_the_oldest_fix():
    aiding = VelocityAiding()
    for t_us in range(0, 3 * S, 2500):
        aiding.remember(t_us, (1e-6 * t_us, 0.0))
    times_us = aiding.values()[6::3]
    assert len(times_us) == PAST_LENGTH
    assert {b - a for a, b in pairwise(times_us)} == {10_000.0}
    assert times_us[-1] - times_us[0] >= 1.1 * S  # .8 s old, and up to .3 s late
    aiding.remember(3 * S, None)
    assert aiding.values()[6:] == ()


def test_many_samples_are_remembered_as_one_by_one():
    one, many = VelocityAiding(), VelocityAiding()
    times_us = range(0, 100_000, 4000)
    rows = [(0.0 if 10 < i < 13 else 1.0, 0.1 * i, -0.2 * i) for i in range(len(times_us))]
    for t_us, (is_aided, *gained) in zip(times_us, rows, strict=True):
        one.remember(t_us, tuple(gained) if is_aided else None)
    many.remember_all(times_us, rows)
    assert many.values() == one.values()
    assert many.values()[6] == 52_000.0


def test_a_state_goes_on_as_what_it_was_taken_of():
    aiding, again = VelocityAiding(), VelocityAiding()
    aiding.remember(1, (0.5, 0.25))
    for t_s in (1.0, 1.2, 1.4):
        aiding.offer(fix(round(t_s * S), (1.0, 2.0, 3.0), 0.3, independent=False), round(t_s * S))
    assert aiding.removed_more_s(fix(removed_s=0.25)) == 0.25
    assert aiding.removed_more_s(fix(removed_s=0.1)) == pytest.approx(-0.15)
    again.remember(7, (9.0, 9.0))
    again.offer(fix(5), 5)
    again.load(aiding.values())
    assert again.values() == aiding.values()
    assert again.waiting == aiding.waiting
    assert again.removed_more_s(fix(removed_s=0.1)) == 0.0
    aiding.waiting = None
    again.load(aiding.values())
    assert again.values() == aiding.values()
    assert again.waiting is None


def test_what_is_expected_later_refuses_what_was():
    aiding = offered((10.0, 10.2))
    aiding.expect_after(11 * S)
    assert aiding.waiting is None
    assert not aiding.offer(fix(11 * S), 11 * S)
    assert aiding.offer(fix(11 * S + 50_000), 11 * S + 50_000)
    aiding.expect_after(10 * S)
    assert not aiding.offer(fix(11 * S), 11 * S)


def test_cleared_it_knows_no_fix():
    aiding = offered((10.0, 10.2, 10.4))
    aiding.remember(10 * S, (1.0, 1.0))
    aiding.clear()
    assert aiding.waiting is None
    assert aiding.values() == VelocityAiding().values()
