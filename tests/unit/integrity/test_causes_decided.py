"""What an explanation decides, and what a filter is told: just enough and just too little."""

import math

import pytest

from h2nav.attitude.samples import SensorDoubt
from h2nav.integrity.causes import Cause, Explained, doubt_of
from h2nav.maths.units import DEG

GYRO, ACCEL, VELOCITY = Cause.GYRO, Cause.ACCELEROMETER, Cause.VELOCITY
CONTRADICTS = math.log(1000.0) + 1e-6


@pytest.mark.parametrize(
    ("odds", "is_suspicious", "is_contradiction"),
    [
        (99.0, False, False),
        (101.0, True, False),
        (999.0, True, False),
        (1001.0, True, True),
    ],
)
def test_odds_of_100_are_suspicious_and_of_1000_a_contradiction(
    odds, is_suspicious, is_contradiction
):
    found = Explained(math.log(odds), ((GYRO, 1.0),))
    assert found.is_suspicious is is_suspicious
    assert found.is_contradiction is is_contradiction
    assert found.decided is (GYRO if is_contradiction else None)
    assert (doubt_of(found) is not None) is is_suspicious


@pytest.mark.parametrize(
    ("shares", "is_seen", "decided", "probable"),
    [
        (((GYRO, 0.9991), (VELOCITY, 0.0009)), True, GYRO, GYRO),
        (((GYRO, 0.9989), (VELOCITY, 0.0011)), True, None, None),
        (((GYRO, 0.9991), (VELOCITY, 0.0009)), False, None, None),
        (((VELOCITY, 0.9991), (GYRO, 0.0)), True, VELOCITY, None),
        (((VELOCITY, 0.095), (ACCEL, 0.905)), True, None, ACCEL),
        (((VELOCITY, 0.095), (ACCEL, 0.905)), False, None, None),
        (((VELOCITY, 0.105), (ACCEL, 0.895)), True, None, None),
        # nothing else is possible
        (((VELOCITY, 0.081), (ACCEL, 0.91)), True, None, ACCEL),
        (((VELOCITY, 0.079), (ACCEL, 0.91)), True, None, None),
        (((VELOCITY, 0.08), (GYRO, 0.92)), True, None, None),
    ],
)
def test_a_cause_is_decided_or_an_accelerometer_probable(shares, is_seen, decided, probable):
    found = Explained(CONTRADICTS, shares, is_seen)
    assert (found.decided, found.probable) == (decided, probable)
    assert found.likeliest is max(shares, key=lambda one: one[1])[0]
    assert Explained(CONTRADICTS - 2e-6, shares, is_seen).probable is None


def test_what_is_not_among_the_causes_has_no_share():
    found = Explained(1.0, ((GYRO, 0.25),))
    assert (found.share(GYRO), found.share(VELOCITY)) == (0.25, 0.0)
    assert Explained().likeliest is None


@pytest.mark.parametrize(
    ("shares", "rate", "force"),
    [
        # (gyro, accelerometer, velocity): share over the root of it and of the velocity's
        ((0.25, 0.0, 0.0), 0.5, 0.0),
        ((0.0, 0.36, 0.0), 0.0, 0.6),
        ((0.6, 0.0, 0.4), 0.6, 0.0),
        ((0.0, 0.09, 0.91), 0.0, 0.09),
        ((0.1, 0.5, 0.4), 0.1 / math.sqrt(0.5), 0.5 / math.sqrt(0.9)),
    ],
)
def test_a_doubt_is_an_error_by_its_probability(shares, rate, force):
    found = Explained(
        50.0,
        tuple(zip((GYRO, ACCEL, VELOCITY), shares, strict=True)),
        rate_b=(0.01, -0.02, 0.03),
        force_b=(-0.4, 0.2, 9.0),
        tilt_rad=0.3,
        heading_rad=0.4,
    )
    doubt = doubt_of(found)
    assert doubt is not None
    assert doubt.rate_b == pytest.approx((0.01 * rate, 0.02 * rate, 0.03 * rate))
    assert doubt.force_b == pytest.approx((0.4 * force, 0.2 * force))
    # An attitude is opened where what has bent it is decided.
    assert (doubt.tilt_rad, doubt.heading_rad) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("cause", "is_bent"),
    [
        (GYRO, True),
        (Cause.ATTITUDE, True),
        (Cause.HEADING, False),
        (ACCEL, False),
        (VELOCITY, False),
    ],
)
def test_a_decided_gyro_or_attitude_has_bent_the_attitude(cause, is_bent):
    doubt = doubt_of(Explained(50.0, ((cause, 1.0),), tilt_rad=0.3, heading_rad=0.4))
    bent = (0.3, 0.4) if is_bent else (0.0, 0.0)
    assert doubt == SensorDoubt((0.0,) * 3, (0.0,) * 2, *bent)


@pytest.mark.parametrize(
    ("rate_deg_s", "share", "is_doubted"),
    [(4.49, 0.5, True), (4.51, 0.5, False), (4.51, 0.9991, True)],
)
def test_a_rate_beyond_three_failures_is_doubted_where_it_is_decided(rate_deg_s, share, is_doubted):
    along = rate_deg_s * DEG / math.sqrt(2.0)
    doubt = doubt_of(Explained(50.0, ((GYRO, share),), rate_b=(0.0, along, -along)))
    assert doubt is not None
    assert (doubt.rate_b[1] > 0.0) is is_doubted
