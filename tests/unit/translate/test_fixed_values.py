"""Expressions of integers keep their promises: range, step, and distance from exact arithmetic."""

import math
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.attitude.velocity_aided.integer.kernel import functions
from h2nav.maths.fixedpoint import clamp
from h2nav.translate import fixed_values as fixed
from h2nav.translate.fixed_values import FixedValue, Underivable, variable
from h2nav.translate.intervals import Interval

FUNCTIONS = {
    name: getattr(functions, name)
    for name in ("product", "ratio", "square_q28", "shifted", "limited")
} | {"clamp": clamp}
EXACT = settings(derandomize=True, deadline=None, max_examples=150)


@st.composite
def values(draw: Any, name: str, bits: int = 31, low: int | None = None) -> FixedValue:
    """A variable of some width, a step that is a power of two, and what it has not exactly."""
    most = 1 << draw(st.integers(1, bits - 1))
    least = draw(st.integers(-most, most - 1)) if low is None else low
    step = 2.0 ** -draw(st.integers(0, 30))
    error = draw(st.sampled_from([0.0, 0.5, 3.0])) * step
    return variable(name, least, most, step)._replace(error=error)


def cases(*terms: FixedValue) -> list[dict[str, tuple[int, float]]]:
    """Ends and middles of variables, each with the real numbers at the ends of its error."""
    found: list[dict[str, tuple[int, float]]] = [{}]
    for term in terms:
        numbers = {term.range.lo, (term.range.lo + 2 * term.range.hi) // 3, term.range.hi}
        off = (-term.error, term.error)
        found = [
            case | {term.text: (number, number * term.step + error)}
            for case in found
            for number in numbers
            for error in off
        ]
    return found


def result(made: FixedValue, case: dict[str, tuple[int, float]]) -> int:
    """What the text gives; it has to be in the range that is claimed."""
    given_integers = {name: number for name, (number, _) in case.items()}
    found = eval(made.text, {"__builtins__": {}}, FUNCTIONS | given_integers)
    assert made.range.lo <= found <= made.range.hi
    assert made.range.fits(32)
    return int(found)


def holds(made: FixedValue, exact: float, case: dict[str, tuple[int, float]]) -> None:
    away = abs(result(made, case) * made.step - exact)
    assert away <= made.error + 1e-9 * (abs(exact) + made.step), made


@EXACT
@given(a=values("a"), places=st.integers(-12, 12), rounds=st.booleans())
def test_a_move_loses_half_a_step_or_a_whole_one(a: FixedValue, places: int, rounds: bool) -> None:
    made = fixed.moved(a, places, rounds=rounds)
    assert made.step == a.step * 2.0**places
    lost = 0.0 if places <= 0 else 0.5 if ">>" in made.text and "+" in made.text else 1.0
    assert made.error - a.error <= lost * made.step
    assert made.error - a.error == pytest.approx(
        0.5 * made.step if lost == 0.5 else lost * (made.step - a.step)
    )
    if made.range.fits(32):
        for case in cases(a):
            holds(made, case["a"][1], case)


@EXACT
@given(a=values("a"), b=values("b"), wanted=st.sampled_from([None, 2.0**-10, 2.0**-30]))
def test_a_product(a: FixedValue, b: FixedValue, wanted: float | None) -> None:
    made = fixed.multiplied(a, b, wanted)
    # It is as fine as a word allows, or as is wanted.
    is_fine = made.range.bits > 16 or wanted is not None
    assert made.step == a.step * b.step or is_fine
    assert made.error <= a.most * b.error + b.most * a.error + 2.0**-14 * a.most * b.most
    for case in cases(a, b):
        # the product of two errors is of second order, and left out
        second = a.error * b.error
        holds(made._replace(error=made.error + second), case["a"][1] * case["b"][1], case)


@EXACT
@given(a=values("a"))
def test_a_square(a: FixedValue) -> None:
    made = fixed.squared(a)
    if made.text.startswith("square_q28"):
        wide = fixed.moved(a, max(a.bits - 30, 0))
        assert made.step == wide.step**2 * 2.0**28
        assert made.error == pytest.approx(2.0 * wide.most * wide.error + 2.0 * made.step)
        assert wide.bits == min(a.bits, 30)
    else:
        assert (made.step, made.error) == (a.step**2, pytest.approx(2.0 * a.most * a.error))
    for case in cases(a):
        holds(made._replace(error=made.error + a.error**2), case["a"][1] ** 2, case)


@EXACT
@given(a=values("a", low=0), b=values("b", low=40_000), apart=st.integers(-6, 6))
def test_a_quotient_of_the_smaller_by_the_larger(a: FixedValue, b: FixedValue, apart: int) -> None:
    step = a.step * 2.0**apart
    b = b._replace(step=step, error=2.0 * step, range=Interval(40_000, max(80_000, b.range.hi)))
    made = fixed.quotient(a, b)
    for case in cases(a, b):
        exact = case["a"][1] / case["b"][1]
        if 0.0 <= exact < 1.0:
            second = 2.0 * a.error * b.error / (b.range.lo * b.step) ** 2
            holds(made._replace(error=made.error + second), exact, case)


@pytest.mark.parametrize(("a", "b"), [(-1, 5), (0, -5)])
def test_a_quotient_takes_no_negative_values(a: int, b: int) -> None:
    with pytest.raises(Underivable, match="not negative"):
        fixed.quotient(variable("a", a, 10, 0.5), variable("b", b, 10, 0.5))


def test_a_divisor_that_may_be_nothing_is_one_and_says_nothing() -> None:
    made = fixed.quotient(variable("a", 0, 10, 0.5), variable("b", 0, 10, 0.5))
    assert (made.text, made.error) == ("ratio(a, b | 1)", 1.0)


@EXACT
@given(
    terms=st.lists(
        st.tuples(st.sampled_from([-1, 1]), values("x", bits=28)), min_size=1, max_size=4
    ),
    wanted=st.sampled_from([None, 2.0**-12, 2.0**-20, 3e-5]),
)
def test_a_sum(terms: list[tuple[int, FixedValue]], wanted: float | None) -> None:
    terms = [(sign, value.named(f"x{place}")) for place, (sign, value) in enumerate(terms)]
    try:
        made = fixed.added(terms, wanted)
    except Underivable:
        # the widest of the terms does not fit the wanted step
        assert wanted is not None
        assert sum(value.most for _, value in terms) >= 0.4 * wanted * 2.0**31
        return
    if wanted is not None:
        made = fixed.settled(made, wanted)
        assert fixed.power_of(made.step / wanted) == 0
    for case in cases(*(value for _, value in terms))[:60]:
        holds(made, sum(sign * case[value.text][1] for sign, value in terms), case)


@EXACT
@given(a=values("a", bits=29), ratio=st.floats(0.01, 100.0))
def test_a_conversion_keeps_the_value(a: FixedValue, ratio: float) -> None:
    made = fixed.converted(a, a.step * ratio)
    assert fixed.power_of(made.step / (a.step * ratio)) is not None
    assert made.error - a.error <= 2.0**-13 * a.most + 2.0 * made.step
    second = 2.0**-14 * a.error
    for case in cases(a):
        holds(made._replace(error=made.error + second), case["a"][1], case)


@EXACT
@given(a=values("a", bits=29), low=st.integers(0, 1 << 20), high=st.integers(0, 1 << 20))
def test_a_limit_is_left_out_where_it_is_proved(a: FixedValue, low: int, high: int) -> None:
    made = fixed.limited(a, -low, high)
    is_inside = a.range.lo >= -low and a.range.hi <= high
    assert (made is a) == is_inside
    for case in cases(a):
        assert result(made, case) == min(max(case["a"][0], -low), high)


@EXACT
@given(a=values("a", bits=20), b=values("b", bits=20))
def test_a_comparison_has_one_step(a: FixedValue, b: FixedValue) -> None:
    try:
        left, right = fixed.compared(a, b)
    except Underivable:
        assert abs(math.log2(a.step / b.step)) > 11
        return
    assert left.step == right.step
    for case in cases(a, b):
        holds(left, case["a"][1], case)
        holds(right, case["b"][1], case)


@pytest.mark.parametrize(
    ("low", "high", "text"),
    [
        (-5, 5, "limited(a, 5)"),
        (-5, 6, "clamp(a, -5, 6)"),
        (-9, 9, "a"),
        (-10, 9, "a"),
        (-8, 9, "clamp(a, -8, 9)"),
    ],
)
def test_a_limit_is_written_as_short_as_it_can_be(low: int, high: int, text: str) -> None:
    assert fixed.limited(variable("a", -9, 9, 1.0), low, high).text == text


@pytest.mark.parametrize(
    ("signs", "text"),
    [
        ((1, 1), "a + b"),
        ((1, -1), "a - b"),
        ((-1, 1), "b - a"),
        ((-1, -1), "-a - b"),
        ((-1,), "-a"),
        ((1,), "a"),
    ],
)
def test_a_sum_begins_with_what_is_added(signs: tuple[int, ...], text: str) -> None:
    terms = [(sign, variable(name, -9, 9, 1.0)) for sign, name in zip(signs, "ab", strict=False)]
    made = fixed.added(terms, None)
    assert made.text == text
    assert made.at(2) == (text if text == "a" else f"({text})")


def test_nothing_compares_with_every_step() -> None:
    nothing, other = fixed.number(0.0, 0.5), variable("b", -3, 3, 0.125)
    assert [one.step for one in fixed.compared(nothing, other)] == [0.125, 0.125]
    assert [one.step for one in fixed.compared(other, nothing)] == [0.125, 0.125]


@pytest.mark.parametrize(
    ("value", "count", "error"), [(1.0, 8, 0.0), (0.3, 2, 0.05), (-1.1, -9, 0.025)]
)
def test_a_constant_is_rounded_to_its_step(value: float, count: int, error: float) -> None:
    made = fixed.number(value, 0.125)
    assert (made.text, made.range) == (str(count), Interval(count, count))
    assert made.error == pytest.approx(error)


@EXACT
@given(
    a=values("a", bits=24),
    low=st.integers(-8, 12),
    width=st.integers(0, 12),
    places=st.integers(-6, 6),
)
def test_a_scale_is_applied_when_it_is_known(
    a: FixedValue, low: int, width: int, places: int
) -> None:
    scaled = a._replace(scale=fixed.Scale("n", Interval(low, low + width)))
    made = fixed.settled(scaled, a.step * 2.0**places)
    assert made.scale is None
    for n in {low, low + width}:
        for case in cases(a):
            exact = case["a"][1] * 2.0**-n
            if abs(exact) < made.step * 2.0**17:  # what is larger may be limited
                holds(made, exact, case | {"n": (n, 0.0)})
