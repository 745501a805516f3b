import math

import numpy as np
import pytest

from h2nav.maths import se2

TWISTS = (
    (0.3, -0.2, 0.0),
    (1.0, 0.5, 1e-3),
    (1.0, 0.5, 0.0101),
    (0.4, -2.0, 2.5),
    (2.0, 1.0, -3.0),
)


def test_a_quarter_circle_ends_ahead_and_beside():
    end = se2.exp((0.5 * math.pi, 0.0, 0.5 * math.pi))
    assert end == pytest.approx((1.0, 1.0, 0.5 * math.pi), abs=1e-15)


@pytest.mark.parametrize("twist", TWISTS)
def test_right_jacobian_is_the_derivative(twist):
    h = 1e-6
    back = se2.inverse(se2.exp(twist))
    columns = []
    for axis in np.eye(3):
        plus = se2.log(se2.compose(back, se2.exp(tuple(np.add(twist, h * axis)))))
        minus = se2.log(se2.compose(back, se2.exp(tuple(np.subtract(twist, h * axis)))))
        columns.append((np.array(plus) - minus) / (2.0 * h))
    np.testing.assert_allclose(se2.right_jacobian(twist), np.array(columns).T, atol=1e-8)


def test_wrap_puts_both_half_turns_on_plus_pi():
    assert se2.wrap(math.pi) == math.pi
    assert se2.wrap(-math.pi) == math.pi
