"""A ratio counts once its excess has lasted."""

import math

import pytest

from h2nav.integrity.lasting import CLEAR_S, FORGET_S, Lasting


def fed(test: Lasting, ratio: float, seconds: float, start_s: float = 0.0) -> float | None:
    """Feeds a ratio at 10 Hz; the time at which the test was raised."""
    for i in range(round(10 * seconds) + 1):
        test.take(round((start_s + 0.1 * i) * 1e6), ratio)
        if test.is_raised:
            return 0.1 * i
    return None


@pytest.mark.parametrize(("ratio", "after_s"), [(1.5, 2.0), (2.0, 1.0), (3.0, 0.5)])
def test_it_is_raised_by_its_excess_over_time(ratio, after_s):
    assert fed(Lasting(), ratio, 10.0) == pytest.approx(after_s, abs=0.11)


def test_one_absurd_value_is_no_proof():
    test = Lasting()
    test.take(0, 0.5)
    test.take(100_000, 1e9)
    assert not test.is_raised


def test_a_ratio_below_one_never_raises_it():
    assert fed(Lasting(), 0.99, 1000.0) is None


def test_it_is_cleared_after_a_while_of_fine_ratios():
    test = Lasting()
    raised_s = fed(test, 3.0, 2.0)
    fine_s = 0.0
    while test.is_raised:
        fine_s += 0.1
        test.take(round((raised_s + fine_s) * 1e6), 0.5)
    assert fine_s == pytest.approx(CLEAR_S, abs=0.11)


def test_silence_keeps_it_for_a_while():
    test = Lasting()
    fed(test, 3.0, 2.0)
    test.take(10_000_000, math.nan)
    assert test.is_raised
    test.take(round((3.0 + FORGET_S) * 1e6), math.nan)
    assert not test.is_raised


def test_it_tells_since_when():
    test = Lasting()
    test.take(0, 0.5)
    test.take(5_000_000, 2.0)
    test.take(6_000_000, 2.0)
    test.take(7_000_000, 2.0)
    assert test.is_raised
    assert test.since_s(7_000_000) == pytest.approx(2.0)


@pytest.mark.parametrize(("pause_s", "counts"), [(2.0, True), (2.1, False)])
def test_a_single_value_behind_a_pause_neither_raises_nor_clears(pause_s, counts):
    test = Lasting()
    test.take(0, 0.9)
    test.take(round(1e6 * pause_s), 1.5 if counts else 1e9)
    assert test.is_raised == counts
    test = Lasting()
    raised_s = fed(test, 3.0, 2.0)
    for i in (1, 2):
        test.take(round(1e6 * (raised_s + i * pause_s)), 0.5)
    assert test.is_raised != counts


@pytest.mark.parametrize("ratio", [math.nan, 0.99])
def test_after_a_minute_of_silence_it_begins_anew(ratio):
    test, later_us = Lasting(), round(1e6 * (3.0 + FORGET_S))
    fed(test, 3.0, 2.0)
    test.take(later_us, ratio)
    assert not test.is_raised
    test.take(later_us + 100_000, 2.0)
    assert not test.is_raised
    assert test.since_s(later_us + 100_000) == 0.0
