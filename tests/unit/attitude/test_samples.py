"""What a filter is told: how it looks where time runs backward, and what holds by itself."""

import math

import pytest

from h2nav.attitude.samples import (
    TRUST_OF,
    EarthField,
    ImuSample,
    SensorDelays,
    SensorDoubt,
    SensorErrors,
    Trust,
    VehicleState,
    VelocityFix,
)

FIX = VelocityFix(7, (1.0, -2.0, 3.0), 0.2, False, 0.3, 0.1, 400.0)


@pytest.mark.parametrize(
    ("told", "backward"),
    [
        (EarthField(50.0, 1.0, 0.1), EarthField(50.0, 1.0, 0.1)),
        (SensorDelays(0.02, 0.1), SensorDelays(0.02, 0.1)),
        (VehicleState(False, 20.0, False, True), VehicleState(False, 20.0, True, True)),
        (FIX, FIX._replace(v_n=(-1.0, 2.0, -3.0))),
    ],
)
def test_backward_velocities_are_opposite_and_the_nose_trails(told, backward):
    assert told.backward() == backward


def test_what_is_not_said_is_unknown_or_nothing():
    nothing = (0.0, 0.0, 0.0)
    assert ImuSample(1, nothing, nothing)[3:] == (None, False)
    assert VehicleState() == (None, None, False, False)
    assert VelocityFix(1, nothing, 0.1)[3:6] == (True, 0.0, 0.0)
    assert math.isnan(VelocityFix(1, nothing, 0.1).altitude_m)
    assert SensorDelays() == (0.0, 0.0)
    assert SensorErrors(nothing)[1:] == (nothing, (0.0, 0.0), *[0.0] * 6)
    assert SensorDoubt() == (nothing, (0.0, 0.0), 0.0, 0.0, None)


def test_bits_are_the_trust_of_logs():
    """Logs of every version have these numbers."""
    names = ("ALIGNED", "CONVERGED", "FORCE_USED", "FIELD_USED", "YAW_REFERENCED", "REST",
             "VELOCITY_USED", "RESTARTED", "SATURATED")  # fmt: skip
    assert {name: int(Trust[name]) for name in names} == {
        name: 1 << bit for bit, name in enumerate(names)
    }
    assert TRUST_OF[5] is TRUST_OF[5]
    assert TRUST_OF[5] == Trust.ALIGNED | Trust.FORCE_USED
