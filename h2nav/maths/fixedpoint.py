"""Fixed-point numbers: integers that stand for value x 2^fraction_bits, never wrapped.

The annotations name the width of an argument; to Python they all are `int`.
"""

import math
from typing import TypeAlias

I16: TypeAlias = int
U16: TypeAlias = int
I32: TypeAlias = int


def clamp(x: int, lo: int, hi: int) -> int:
    """`x` moved into [lo, hi]."""
    return lo if x < lo else (min(x, hi))


def known(x: int, lo: int, hi: int) -> int:
    """`x`, of which a lemma of docs/fixed-point.md says that it lies in [lo, hi].

    The translator believes the bound where intervals alone are too coarse; it costs nothing in C.
    The tests at the extremes put a check in its place.
    """
    del lo, hi
    return x


def to_fixed(value: float, fraction_bits: int, lo: int, hi: int) -> int:
    """`value` x 2^fraction_bits, rounded half up and moved into [lo, hi].

    Args:
        value: any float; infinities go to the limit of their sign, NaN is refused.
        fraction_bits: bits after the binary point; negative for coarse units.

    Raises:
        ValueError: `value` is not a number.
    """
    scaled = value * 2.0**fraction_bits + 0.5
    if math.isnan(scaled):
        raise ValueError("not a number")
    if scaled >= hi + 1:
        return hi
    if scaled < lo:
        return lo
    floor = int(scaled)
    return floor - (floor > scaled)
