"""Integers that stand for real numbers: their arithmetic with formats, ranges and error bounds.

A `FixedValue` is the text of an integer expression, the interval of that integer, the real number
that one stands for (its step), and how far integer times step may be from what exact arithmetic on
the same variables gives. Each operation here chooses shifts so that no result leaves 32 bits, and
adds what it rounds away to the bound.

Source: docs/design/007-one-kernel.md.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.errors import BadInput
from h2nav.translate import intervals
from h2nav.translate.intervals import Interval, exactly

_ATOM, _PRODUCT, _SUM, _SHIFT = 3, 2, 1, 0
_GUARD_BITS = 8  # that a sum keeps below the step of its target
_WORD = Interval(-(1 << 15), 1 << 15)  # second factor of `product`
_SQUARES = Interval(-1, 1 << 30)  # of `square_q28`
_MANTISSA_BITS = 15
_SHIFTS = Interval(-12, 31)  # of `shifted`
_EXACT = 1e-9  # a ratio of steps this near to a power of two is one


class Underivable(BadInput):
    """An expression without a form in integers of the declared formats."""


class Scale(NamedTuple):
    """A power of two known only when the kernel runs: the value is integer step 2^-fall."""

    fall: str  # a variable
    range: Interval  # of that variable


class FixedValue(NamedTuple):
    """One integer expression."""

    text: str
    level: int  # how tightly it binds
    range: Interval
    step: float
    error: float = 0.0  # largest distance from exact arithmetic, in real units
    scale: Scale | None = None

    def at(self, level: int) -> str:
        """The text, in parentheses where it binds less tightly than `level`."""
        return self.text if self.level >= level else f"({self.text})"

    @property
    def bits(self) -> int:
        """Width of the integer with its sign."""
        return self.range.bits

    @property
    def most(self) -> float:
        """Largest size of the real number."""
        return max(abs(self.range.lo), abs(self.range.hi)) * self.step

    def named(self, name: str) -> "FixedValue":
        """The same value, once it is in a variable."""
        return self._replace(text=name, level=_ATOM)


def variable(text: str, low: int, high: int, step: float) -> FixedValue:
    """A variable, or any text that needs no parentheses."""
    return FixedValue(text, _ATOM, Interval(low, high), step)


def number(value: float, step: float) -> FixedValue:
    """A constant, rounded to a step."""
    count = round(value / step)
    return FixedValue(str(count), _ATOM, exactly(count), step, abs(count * step - value))


def power_of(ratio: float) -> int | None:
    """The exponent of a ratio of two steps that is a power of two; None for others."""
    exponent = round(math.log2(ratio))
    return exponent if abs(ratio / 2.0**exponent - 1.0) < _EXACT else None


def scaled(value: FixedValue, factor: float) -> FixedValue:
    """The product with a positive constant: the step alone changes."""
    return value._replace(step=value.step * factor, error=value.error * factor)


def negated(value: FixedValue) -> FixedValue:
    """The opposite."""
    return value._replace(
        text=f"-{value.at(_ATOM)}", level=_PRODUCT, range=intervals.negate(value.range)
    )


def moved(value: FixedValue, places: int, *, rounds: bool = True) -> FixedValue:
    """The same real number with a step 2^places times as large."""
    if places == 0:
        return value
    if places < 0:
        text = f"{value.at(_SUM)} << {-places}"
        wide = intervals.shift_left(value.range, exactly(-places))
        return value._replace(text=text, level=_SHIFT, range=wide, step=value.step * 2.0**places)
    half = 1 << (places - 1)
    lifted = intervals.add(value.range, exactly(half))
    step = value.step * 2.0**places
    if rounds and lifted.fits(32):
        text = f"({value.at(_SUM)} + {half}) >> {places}"
        range_, error = intervals.shift_right(lifted, exactly(places)), 0.5 * step
    else:
        text = f"{value.at(_SUM)} >> {places}"
        range_, error = intervals.shift_right(value.range, exactly(places)), step - value.step
    return value._replace(
        text=text, level=_SHIFT, range=range_, step=step, error=value.error + error
    )


def _product_of_halves(a: Interval, b: Interval) -> Interval | None:
    """The result of `functions.product`; None where an intermediate leaves 32 bits."""
    high = intervals.multiply(intervals.shift_right(a, exactly(15)), b)
    low = intervals.multiply(Interval(0, 32767), b)
    whole = intervals.add(high, intervals.shift_right(low, exactly(15)))
    fits = all(part.fits(32) for part in (a, b, high, low, whole))
    return whole if fits else None


def multiplied(a: FixedValue, b: FixedValue, wanted: float | None = None) -> FixedValue:
    """The product, as fine as 32 bits allow, or as the wanted step needs."""
    if a.bits < b.bits:
        a, b = b, a
    scale = a.scale or b.scale
    if a.scale is not None and b.scale is not None:
        raise Underivable(f"{a.text} times {b.text}: both are scaled")
    direct = intervals.multiply(a.range, b.range)
    if not direct.fits(32) and not b.range.within(_WORD):
        b = moved(b, b.bits - 16)
        if not b.range.within(_WORD):
            b = moved(b, 1)
        direct = intervals.multiply(a.range, b.range)
    error = a.most * b.error + b.most * a.error
    if direct.fits(32):
        text = f"{a.at(_PRODUCT)} * {b.at(_ATOM)}"
        return FixedValue(text, _PRODUCT, direct, a.step * b.step, error, scale)
    a = _lifted(a, b, wanted)
    range_ = _product_of_halves(a.range, b.range)
    while range_ is None:
        a = moved(a, 1)
        range_ = _product_of_halves(a.range, b.range)
    step = a.step * b.step * 2.0**15
    text = f"product({a.text}, {b.text})"
    return FixedValue(text, _ATOM, range_, step, error + step, scale)


def _lifted(a: FixedValue, b: FixedValue, wanted: float | None) -> FixedValue:
    """The first factor of `product` shifted to the left where the result would be too coarse."""
    if wanted is None:
        return a
    # what is shifted later by a count that only the kernel knows keeps a bit free
    bits = 32 if a.scale is None and b.scale is None else 31
    places = math.ceil(math.log2(a.step * b.step * 2.0**15 / wanted) - _EXACT)
    while places > 0:
        range_ = _product_of_halves(moved(a, -places).range, b.range)
        if range_ is not None and range_.fits(bits):
            return moved(a, -places)
        places -= 1
    return a


def squared(a: FixedValue) -> FixedValue:
    """The square of a value of at most 30 bits, over 2^28."""
    if intervals.square(a.range).fits(32):
        text = f"{a.at(_ATOM)} * {a.at(_ATOM)}"
        error = 2.0 * a.most * a.error
        return FixedValue(text, _PRODUCT, intervals.square(a.range), a.step * a.step, error)
    if a.bits > 30:
        a = moved(a, a.bits - 30)
    step = a.step * a.step * 2.0**28
    error = 2.0 * a.most * a.error + 2.0 * step
    return FixedValue(f"square_q28({a.text})", _ATOM, _SQUARES, step, error)


def quotient(a: FixedValue, b: FixedValue) -> FixedValue:
    """The ratio of two values that are not negative, the first the smaller one; at most one."""
    if a.range.lo < 0 or b.range.lo < 0:
        raise Underivable(f"{a.text} / {b.text}: a quotient takes values that are not negative")
    exponent = power_of(a.step / b.step)
    if exponent is None:
        raise Underivable(f"{a.text} / {b.text}: their steps differ by no power of two")
    factor = 1.0
    if exponent > 0 and moved(a, -exponent).range.fits(32):
        a = moved(a, -exponent)
    elif exponent < 0 and moved(b, exponent).range.fits(32):
        b = moved(b, exponent)
    elif exponent < 0:  # or an integer may be larger than that of the larger value
        a = moved(a, -exponent)
    else:
        factor = 2.0**exponent
    text = b.text if b.range.lo > 0 else f"{b.at(_ATOM)} | 1"
    step = 2.0**-15 * factor
    error = step * (2.0 + 32768 * 5e-5)
    if b.range.lo > 0:
        error += (a.error + b.error) / (b.range.lo * b.step)
    else:
        error = 1.0  # a divisor of a few steps says nothing
    return FixedValue(f"ratio({a.text}, {text})", _ATOM, Interval(0, 32767), step, error)


def converted(value: FixedValue, step: float) -> FixedValue:
    """The value with a step that is a power of two times the wanted one, and not far from it."""
    if power_of(value.step / step) is not None:
        return value
    # factor M 2^-n of 15 digits
    n = _MANTISSA_BITS - 1 - math.floor(math.log2(value.step / step))
    mantissa = round(value.step / step * 2.0**n)
    wrong = abs(value.step / step * 2.0**n / mantissa - 1.0) * value.most
    exact = FixedValue(str(mantissa), _ATOM, exactly(mantissa), 1.0)
    made = multiplied(value._replace(step=1.0, error=0.0), exact, 2.0**n * 2.0**-_GUARD_BITS)
    unit = step * 2.0**-n
    rounding = made.error * unit
    return made._replace(step=made.step * unit, error=value.error + rounding + wrong)


def added(terms: Sequence[tuple[int, FixedValue]], wanted: float | None) -> FixedValue:
    """The sum of terms with their signs.

    Terms finer than the wanted step are summed with guard bits and rounded once; without a wanted
    step the sum is as fine as 32 bits allow.

    Args:
        terms: signs and values.
        wanted: step of the result.
    """
    terms = _unscaled(terms, wanted)
    if wanted is None:
        wanted_unit = min(value.step for _, value in terms)
        terms = [(sign, converted(value, wanted_unit)) for sign, value in terms]
        for places in range(40):
            made = _summed(terms, wanted_unit * 2.0**places)
            if made is not None:
                return made
        raise Underivable("a sum that no 32 bits hold")
    terms = [(sign, converted(value, wanted)) for sign, value in terms]
    fine = [(sign, value) for sign, value in terms if value.step < wanted * (1.0 - _EXACT)]
    rest = [(sign, value) for sign, value in terms if value.step >= wanted * (1.0 - _EXACT)]
    if len(fine) == 1 and fine[0][1].scale is None:
        sign, value = fine[0]
        rest.append((sign, moved(value, power_of(wanted / value.step) or 0)))
    elif fine:
        rest.append((1, _rounded_sum(fine, wanted)))
    whole = _summed(rest, wanted)
    if whole is None:
        raise Underivable(f"{' + '.join(value.text for _, value in rest)} may leave 32 bits")
    return whole


def _unscaled(
    terms: Sequence[tuple[int, FixedValue]], wanted: float | None
) -> Sequence[tuple[int, FixedValue]]:
    """The terms with one scale: where they have several, all of them are settled."""
    if len({value.scale for _, value in terms}) == 1:
        return terms
    plain = [value.step for _, value in terms if value.scale is None]
    step = min(plain) if plain else wanted
    if step is None:
        raise Underivable("a sum of differently scaled terms needs a declared format")
    settled_terms = []
    for sign, value in terms:
        if value.scale is not None:
            places = 0
            if wanted is None:
                # no finer than without a shift to the left, which limits what it takes
                least = -value.scale.range.lo
                places = max(0, math.ceil(math.log2(value.step * 2.0**least / step) - _EXACT))
            settled_terms.append((sign, settled(value, step * 2.0**places)))
        else:
            settled_terms.append((sign, value))
    return settled_terms


def _rounded_sum(terms: Sequence[tuple[int, FixedValue]], wanted: float) -> FixedValue:
    """The sum of terms finer than the wanted step, rounded to it once."""
    finest = min(value.step for _, value in terms)
    guard = min(power_of(wanted / finest) or 0, _GUARD_BITS)
    for bits in range(guard, -1, -1):
        made = _summed(terms, wanted * 2.0**-bits)
        if made is not None and intervals.add(made.range, exactly(1 << bits)).fits(32):
            return moved(made, bits)
    raise Underivable(f"{' + '.join(value.text for _, value in terms)} may leave 32 bits")


def _summed(terms: Sequence[tuple[int, FixedValue]], step: float) -> FixedValue | None:
    """The sum with this step; None where a partial sum leaves 32 bits."""
    ordered = sorted(terms, key=lambda term: term[0] < 0)
    text, range_, error = "", exactly(0), 0.0
    scale = next((value.scale for _, value in terms if value.scale is not None), None)
    for sign, value in ordered:
        if value.scale != scale:
            raise Underivable(f"{value.text}: terms of a sum have different scales")
        places = power_of(step / value.step)
        assert places is not None
        part = moved(value, places, rounds=False)
        if not part.range.fits(32):
            return None
        join = intervals.add if sign > 0 else intervals.subtract
        range_ = join(range_, part.range)
        if not range_.fits(32):
            return None
        error += part.error
        if not text:
            text = part.text if sign > 0 else f"-{part.at(_ATOM)}"
            first = part
        else:
            left = first.at(_SUM) if text == first.text else text
            text = f"{left} {'+' if sign > 0 else '-'} {part.at(_PRODUCT)}"
    level = first.level if len(ordered) == 1 and ordered[0][0] > 0 else _SUM
    return FixedValue(text, level, range_, step, error, scale)


def settled(value: FixedValue, step: float) -> FixedValue:
    """The value with exactly this step; a power of two that only the kernel knows is applied."""
    value = converted(value, step)
    places = power_of(step / value.step)
    assert places is not None
    if value.scale is None:
        return moved(value, places)
    fall, reach = value.scale
    span = intervals.add(reach, exactly(places))
    count = f"{fall} {'+' if places > 0 else '-'} {abs(places)}" if places else fall
    error = value.error * 2.0**-reach.lo + step
    if span.lo >= 0 and span.hi <= 31:
        range_ = intervals.shift_right(value.range, span)
        return FixedValue(f"{value.at(_SUM)} >> ({count})", _SHIFT, range_, step, error)
    if not span.within(_SHIFTS):
        count = f"clamp({count}, {_SHIFTS.lo}, {_SHIFTS.hi})"
    range_ = value.range.hull(Interval(-(1 << 30), 1 << 30))
    return FixedValue(f"shifted({value.text}, {count})", _ATOM, range_, step, error)


def limited(value: FixedValue, low: int, high: int) -> FixedValue:
    """The value moved into a declared range; unchanged if it is proved to be inside."""
    allowed = Interval(low, high)
    if value.range.within(allowed):
        return value
    if low == -high:
        text = f"limited({value.text}, {high})"
    else:
        text = f"clamp({value.text}, {low}, {high})"
    return value._replace(
        text=text, level=_ATOM, range=intervals.clamp(value.range, exactly(low), exactly(high))
    )


def compared(a: FixedValue, b: FixedValue) -> tuple[FixedValue, FixedValue]:
    """Two values with one step, for a comparison."""
    if a.range.lo == a.range.hi == 0:
        return a._replace(step=b.step), b
    if b.range.lo == b.range.hi == 0:
        return a, b._replace(step=a.step)
    coarse = max(a.step, b.step)
    a, b = converted(a, coarse), converted(b, coarse)
    for step in (min(a.step, b.step), max(a.step, b.step)):
        pair = [moved(value, power_of(step / value.step) or 0) for value in (a, b)]
        if all(value.range.fits(32) for value in pair):
            return pair[0], pair[1]
    raise Underivable(f"{a.text} and {b.text} have no common step")
