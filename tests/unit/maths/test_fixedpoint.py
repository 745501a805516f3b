"""Fixed-point numbers."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from h2nav.maths.fixedpoint import clamp, to_fixed


@settings(derandomize=True, deadline=None)
@given(value=st.floats(-1.9, 1.9), bits=st.integers(0, 30))
def test_rounding_is_to_the_nearest(value: float, bits: int) -> None:
    fixed = to_fixed(value, bits, -(1 << 31), (1 << 31) - 1)
    assert abs(fixed * 2.0**-bits - value) <= 0.5 * 2.0**-bits


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.5, 1), (-0.5, 0), (1.5, 2), (-1.5, -1), (-2.49, -2), (1e300, 100), (-1e300, -100)],
)
def test_half_rounds_up_and_limits_hold(value: float, expected: int) -> None:
    assert to_fixed(value, 0, -100, 100) == expected


@pytest.mark.parametrize(("value", "expected"), [(math.inf, 7), (-math.inf, -8)])
def test_infinity_goes_to_the_limit(value: float, expected: int) -> None:
    assert to_fixed(value, 14, -8, 7) == expected


def test_what_is_not_a_number_is_refused() -> None:
    with pytest.raises(ValueError, match="not a number"):
        to_fixed(math.nan, 14, -8, 7)


def test_clamp() -> None:
    assert [clamp(x, -2, 3) for x in (-5, -2, 0, 3, 9)] == [-2, -2, 0, 3, 3]
