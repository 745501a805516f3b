"""Corrections that are possible are mixed."""

import math

import pytest

from h2nav.attitude.samples import SensorCorrection
from h2nav.integrity.correction import mixed


def correction(rate, force, turn, sigma):
    return SensorCorrection(
        (rate, 0.0, 0.0),
        (0.0, force, 0.0),
        (turn, 0.0, -turn),
        (sigma,) * 3,
        (sigma,) * 2,
        sigma,
        sigma,
    )


def test_one_correction_stays_what_it_is():
    one = correction(0.1, 0.2, 0.3, 0.4)
    found = mixed([3.0], [one])
    for part, same in zip(found, one, strict=True):
        assert part == pytest.approx(same)


def test_corrections_that_differ_leave_unknown_by_how_much():
    found = mixed([1.0, 3.0], [correction(0.0, 0.0, 0.0, 0.1), correction(0.4, 0.8, 0.2, 0.1)])
    assert found.rate_b == pytest.approx((0.3, 0.0, 0.0))
    assert found.force_b == pytest.approx((0.0, 0.6, 0.0))
    assert found.turn_n == pytest.approx((0.15, 0.0, -0.15))
    apart = math.sqrt(3.0) / 4.0  # deviation of a number that is 0 or 1, in three of four cases
    assert found.rate_sigma_b == pytest.approx((math.hypot(0.1, 0.4 * apart), 0.1, 0.1))
    assert found.force_sigma_b == pytest.approx((0.1, math.hypot(0.1, 0.8 * apart)))
    assert found.tilt_sigma_rad == pytest.approx(math.hypot(0.1, 0.2 * apart))
    assert found.heading_sigma_rad == pytest.approx(math.hypot(0.1, 0.2 * apart))
