"""The accelerometer's bias along the force at rest."""

import math

import pytest

from h2nav.service.rest_force import LENGTH_US, MAX_BIAS_M_S2, SHARE, RestForce

GRAVITY = 9.81
STEP_US = 100_000


def measured(force, gravity=GRAVITY, seconds=10.0, moves_at_s=math.inf):
    """What is found at a constant force, of one window after another."""
    rest, found = RestForce(), []
    for i in range(round(seconds * 10.0) + 1):
        if i * 0.1 == moves_at_s:
            rest.interrupt()
        bias = rest.add(i * STEP_US, force, gravity)
        found += [] if bias is None else [bias]
    return found


def test_a_force_larger_than_gravity_is_a_bias_along_it():
    (found,) = measured((0.0, 0.0, -9.51))  # +0.3 m/s^2 along z
    assert found == pytest.approx((0.0, 0.0, 0.3 * SHARE))
    assert 0.9 < SHARE < 0.95  # the scale takes the rest


def test_it_is_along_the_force_wherever_that_is():
    lean = math.radians(12.0)
    up = (math.sin(lean), 0.0, -math.cos(lean))
    (found,) = measured(tuple((GRAVITY + 0.2) * part for part in up))
    assert found == pytest.approx(tuple(0.2 * SHARE * part for part in up))


def test_a_sound_accelerometer_has_none():
    (found,) = measured((0.0, 0.0, -9.7803), gravity=9.7803)
    assert found == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


def test_every_window_measures_anew():
    assert len(measured((0.0, 0.0, -9.7), seconds=30.5)) == 3


def test_a_vehicle_that_moves_measures_nothing():
    assert not measured((0.0, 0.0, -9.7), moves_at_s=5.0)
    assert LENGTH_US == 10_000_000


def test_no_sound_accelerometer_is_that_wrong():
    assert not measured((0.0, 0.0, -GRAVITY - 1.01 * MAX_BIAS_M_S2))
    assert measured((0.0, 0.0, -GRAVITY - 0.99 * MAX_BIAS_M_S2))
