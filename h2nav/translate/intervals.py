"""Intervals of Python integers: the possible results of bounded operands."""

from typing import NamedTuple


class Interval(NamedTuple):
    """All integers from `lo` to `hi`, both included."""

    lo: int
    hi: int

    def hull(self, other: "Interval") -> "Interval":
        """The smallest interval that holds both."""
        if self.lo <= other.lo and other.hi <= self.hi:
            return self  # most are joined with what they hold already
        return Interval(min(self.lo, other.lo), max(self.hi, other.hi))

    def within(self, other: "Interval") -> bool:
        """True when every value of this interval is one of `other`."""
        return other.lo <= self.lo and self.hi <= other.hi

    def fits(self, bits: int) -> bool:
        """True when a two's complement word of `bits` holds every value."""
        return -(1 << (bits - 1)) <= self.lo and self.hi < 1 << (bits - 1)

    @property
    def bits(self) -> int:
        """Width of the narrowest two's complement word that holds every value."""
        return max((self.lo if self.lo >= 0 else ~self.lo).bit_length(), self.hi.bit_length()) + 1


INT16 = Interval(-(1 << 15), (1 << 15) - 1)
UINT16 = Interval(0, (1 << 16) - 1)
INT32 = Interval(-(1 << 31), (1 << 31) - 1)
INT64 = Interval(-(1 << 63), (1 << 63) - 1)


def exactly(value: int) -> Interval:
    """The interval of one value."""
    return Interval(value, value)


def _hull_of(*values: int) -> Interval:
    return Interval(min(values), max(values))


def add(a: Interval, b: Interval) -> Interval:
    """Sum."""
    return Interval(a.lo + b.lo, a.hi + b.hi)


def subtract(a: Interval, b: Interval) -> Interval:
    """Difference."""
    return Interval(a.lo - b.hi, a.hi - b.lo)


def multiply(a: Interval, b: Interval) -> Interval:
    """Product of two independent factors."""
    return _hull_of(a.lo * b.lo, a.lo * b.hi, a.hi * b.lo, a.hi * b.hi)


def square(a: Interval) -> Interval:
    """Product of a value with itself."""
    ends = _hull_of(a.lo * a.lo, a.hi * a.hi)
    return Interval(0, ends.hi) if a.lo <= 0 <= a.hi else ends


def shift_left(a: Interval, n: Interval) -> Interval:
    """Product with 2^n."""
    return multiply(a, Interval(1 << n.lo, 1 << n.hi))


def shift_right(a: Interval, n: Interval) -> Interval:
    """Quotient by 2^n, rounded towards minus infinity."""
    return _hull_of(a.lo >> n.lo, a.lo >> n.hi, a.hi >> n.lo, a.hi >> n.hi)


def bit_and(a: Interval, b: Interval) -> Interval:
    """Bitwise and; exact for masks 0 and -1 (all bits), a bound by the non-negative side else."""
    for value, mask in ((a, b), (b, a)):
        if mask.lo >= -1 and mask.hi <= 0:
            return value.hull(exactly(0))
    if a.lo >= 0 and b.lo >= 0:
        return Interval(0, min(a.hi, b.hi))
    if a.lo >= 0 or b.lo >= 0:
        return Interval(0, a.hi if a.lo >= 0 else b.hi)
    return _words(a, b)


def bit_or(a: Interval, b: Interval) -> Interval:
    """Bitwise or; exact for masks 0 and -1."""
    for value, mask in ((a, b), (b, a)):
        if mask.lo >= -1 and mask.hi <= 0:
            return value.hull(exactly(-1))
    return _words(a, b)


def bit_xor(a: Interval, b: Interval) -> Interval:
    """Bitwise exclusive or; exact for masks 0 and -1."""
    for value, mask in ((a, b), (b, a)):
        if mask.lo >= -1 and mask.hi <= 0:
            return value.hull(invert(value))
    return _words(a, b)


def _words(a: Interval, b: Interval) -> Interval:
    """Every value of the word that holds both operands (non-negative when both are)."""
    top = 1 << (max(a.bits, b.bits) - 1)
    return Interval(0 if a.lo >= 0 and b.lo >= 0 else -top, top - 1)


def invert(a: Interval) -> Interval:
    """Bitwise complement."""
    return Interval(~a.hi, ~a.lo)


def negate(a: Interval) -> Interval:
    """Opposite."""
    return Interval(-a.hi, -a.lo)


def magnitude(a: Interval) -> Interval:
    """Absolute value."""
    if a.lo >= 0:
        return a
    return negate(a) if a.hi <= 0 else Interval(0, max(-a.lo, a.hi))


def clamp(x: Interval, lo: Interval, hi: Interval) -> Interval:
    """The value moved into [lo, hi]."""
    return Interval(min(max(x.lo, lo.lo), hi.lo), min(max(x.hi, lo.hi), hi.hi))
