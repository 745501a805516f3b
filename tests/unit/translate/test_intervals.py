"""Interval rules against every pair of values of small intervals."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.translate import intervals
from h2nav.translate.intervals import Interval

BOUND = st.integers(-40, 40)
RANGES = st.tuples(BOUND, BOUND).map(lambda ends: Interval(min(ends), max(ends)))


@pytest.mark.parametrize("name", ["int16", "uint16", "int32", "int64"])
def test_a_type_holds_what_the_machines_word_of_its_name_does(name: str) -> None:
    word = np.iinfo(name)
    assert getattr(intervals, name.upper()) == Interval(word.min, word.max)


def values(interval: Interval) -> range:
    return range(interval.lo, interval.hi + 1)


@pytest.mark.parametrize(
    ("rule", "operation"),
    [
        (intervals.add, lambda a, b: a + b),
        (intervals.subtract, lambda a, b: a - b),
        (intervals.multiply, lambda a, b: a * b),
        (intervals.bit_and, lambda a, b: a & b),
        (intervals.bit_or, lambda a, b: a | b),
        (intervals.bit_xor, lambda a, b: a ^ b),
    ],
)
@settings(derandomize=True, deadline=None, max_examples=60)
@given(a=RANGES, b=RANGES)
def test_no_result_leaves_the_interval(
    rule: Callable[[Interval, Interval], Interval],
    operation: Callable[[int, int], int],
    a: Interval,
    b: Interval,
) -> None:
    bound = rule(a, b)
    assert all(
        bound.lo <= operation(x, y) <= bound.hi for x in values(a)[::3] for y in values(b)[::3]
    )
    assert bound.lo <= operation(a.hi, b.hi) <= bound.hi


@settings(derandomize=True, deadline=None, max_examples=60)
@given(a=RANGES, low=st.integers(0, 4), high=st.integers(0, 4))
def test_shifts_and_single_values(a: Interval, low: int, high: int) -> None:
    n = Interval(min(low, high), max(low, high))
    for x in values(a):
        for count in values(n):
            assert intervals.shift_right(a, n).lo <= x >> count <= intervals.shift_right(a, n).hi
            assert intervals.shift_left(a, n).lo <= x << count <= intervals.shift_left(a, n).hi
        assert intervals.square(a).lo <= x * x <= intervals.square(a).hi
        assert intervals.magnitude(a).lo <= abs(x) <= intervals.magnitude(a).hi
        assert intervals.invert(a).lo <= ~x <= intervals.invert(a).hi


def test_width_of_words() -> None:
    assert Interval(-(1 << 31), (1 << 31) - 1).bits == 32
    assert Interval(0, 1 << 31).bits == 33
    assert Interval(-(1 << 31) - 1, 0).bits == 33
    assert not Interval(0, 1 << 31).fits(32)


def test_a_mask_of_ones_or_zeros_keeps_the_value_exactly() -> None:
    assert intervals.bit_and(Interval(-7, 9), Interval(-1, 0)) == Interval(-7, 9)
    assert intervals.bit_and(Interval(3, 9), Interval(-1, 0)) == Interval(0, 9)
