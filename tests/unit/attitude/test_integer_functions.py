"""The arithmetic that a 32-bit machine lacks, against the numbers that it stands for."""

import math
import random

import pytest

from h2nav.attitude.velocity_aided.integer.kernel.functions import (
    LARGEST_LOG_Q8,
    LONGEST,
    bits_of,
    length,
    limited,
    logarithm,
    mantissa,
    polar,
    power2,
    product,
    ratio,
    reciprocal,
    shifted,
)

# Every edge of a binary digit, and what lies between.
EDGES = sorted({(1 << n) + d for n in range(31) for d in (-1, 0, 1) if 0 < (1 << n) + d < 1 << 31})
_RNG = random.Random(20_261_122)
NUMBERS = EDGES + [_RNG.randrange(1, 1 << _RNG.randint(1, 31)) for _ in range(3000)]


@pytest.mark.parametrize(("x", "is_"), [(9, 5), (5, 5), (4, 4), (-5, -5), (-6, -5), (0, 0)])
def test_limited(x, is_):
    assert limited(x, 5) == is_


def test_product_is_that_of_the_whole_numbers():
    """Rounded down once: nothing is lost between its two halves."""
    for a in (x >> 1 for x in (*NUMBERS, *(-x for x in NUMBERS))):
        for b in (-32768, -12345, -1, 0, 1, 777, 32767):
            assert product(a, b) == a * b >> 15


@pytest.mark.parametrize("n", [*range(-12, 13), 20, 31])
def test_shifted_is_the_quotient_of_what_is_left_below_the_limit(n):
    """Its result then has at most 30 digits."""
    most = LONGEST if n >= 0 else LONGEST >> 4 if n >= -4 else LONGEST >> 12
    for x in (*NUMBERS, *(-x for x in NUMBERS)):
        if n >= 0:
            assert shifted(x, n) == x >> n
        else:
            assert shifted(x, n) == min(max(x, -most), most) << -n


def test_bits_of_counts_the_digits():
    assert bits_of(0) == 0
    assert all(bits_of(x) == x.bit_length() for x in NUMBERS)


def test_mantissa_keeps_the_first_15_digits():
    for x in NUMBERS:
        bits = x.bit_length()
        assert mantissa(x, bits) == (x << 15 >> bits)


def test_reciprocal_is_wrong_by_less_than_3_of_15_digits():
    for m in range(1 << 14, 1 << 15, 7):
        assert abs(reciprocal(m) - (1 << 29) / m) < 3


def test_ratio_is_the_quotient_in_q15():
    """Within 2^-13 of one, and never beyond 32767."""
    for b in NUMBERS:
        for a in (0, b // 3, b // 2, b - 1, b, b + 1):
            assert abs(ratio(a, b) - min(32768 * a / b, 32767)) <= 4
    assert ratio(5, 5) == ratio(6, 5) == 32767


def test_logarithm_is_wrong_by_at_most_0_017():
    worst = max(abs(logarithm(x) / 256 - math.log2(x)) for x in NUMBERS)
    assert worst <= 0.017


def test_power2_is_wrong_by_at_most_a_third_of_a_percent():
    """Besides the rounding down to a whole number; a fraction is nothing."""
    for exponent in range(LARGEST_LOG_Q8 + 1):
        exact = 2 ** (exponent / 256)
        assert -exact / 300 - 1.0 <= power2(exponent) - exact <= exact / 300
    assert power2(-1) == 0
    assert power2(LARGEST_LOG_Q8 + 1) == power2(LARGEST_LOG_Q8) <= LONGEST


def vectors():
    for _ in range(3000):
        size = 1 << _RNG.randint(1, 17)
        yield _RNG.randrange(1 - size, size), _RNG.randrange(1 - size, size)
    for size in (1, 1000, 131071):
        yield from ((x, y) for x in (-size, 0, size) for y in (-size, 0, size))


def test_polar_is_wrong_by_at_most_6_in_length_and_1_3e_4_in_angle():
    """The angle where the length is above 1000; a half turn may have either sign."""
    for x, y in vectors():
        result = [0, 0]
        polar(x, y, result)
        exact = math.hypot(x, y)
        assert abs(result[0] - exact) <= 6
        if exact > 1000:
            apart = result[1] / (1 << 28) - math.atan2(y, x)
            assert abs(math.remainder(apart, math.tau)) <= 1.3e-4


def test_length_is_wrong_by_at_most_12():
    """Of up to 1.4 times 2^17."""
    for x, y in vectors():
        assert abs(length(abs(x), y) - math.hypot(x, y)) <= 12
