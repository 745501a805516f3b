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


G_M_S2 = 9.80665


@pytest.mark.parametrize(("seconds", "count"), [(9.9, 0), (10.0, 1), (20.0, 1), (20.1, 2)])
def test_a_window_is_ten_seconds_long(seconds, count):
    assert len(measured((0.0, 0.0, -9.7), seconds=seconds)) == count


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("excess_g", "is_one"), [(0.0599, True), (0.0601, False)])
def test_more_than_60_mg_is_no_bias(sign, excess_g, is_one):
    assert bool(measured((0.0, 0.0, -GRAVITY - sign * excess_g * G_M_S2))) is is_one


def test_the_share_is_that_of_the_most_probable_bias():
    """Least squares: the bias, the error of the scale and the anomaly, each by its deviation."""
    sigmas = (0.020 * G_M_S2, 0.005 * G_M_S2, 0.003)
    (found,) = measured((0.0, 0.0, -GRAVITY - 0.1))
    information = sum(sigma**2 for sigma in sigmas)
    assert found[2] == pytest.approx(-0.1 * sigmas[0] ** 2 / information, rel=1e-9)


def test_the_mean_of_the_forces_counts():
    rest = RestForce()
    for number in range(101):
        found = rest.add(number * STEP_US, (0.0, 0.0, -9.71 - 0.2 * (number % 2)), GRAVITY)
    # 50 of the 101 forces are 0.2 m/s^2 larger
    assert found[2] == pytest.approx(SHARE * (GRAVITY - (9.71 + 0.2 * 50 / 101)), rel=1e-9)
