"""The autopilot's attitude, as it is read."""

import math
from types import SimpleNamespace

import pytest

from h2nav.maths.quaternion import from_euler
from h2nav.wire.attitude import ReportedAttitude, ahrs2, attitude
from h2nav.wire.refused import Refused


def fields(roll=0.1, pitch=-0.2, yaw=3.0, **others):
    return SimpleNamespace(roll=roll, pitch=pitch, yaw=yaw, **others)


def test_attitude_has_its_time():
    read = attitude(fields(time_boot_ms=12_345))
    assert read == ReportedAttitude(False, 12_345, from_euler(0.1, -0.2, 3.0))


def test_ahrs2_has_none():
    assert ahrs2(fields()) == ReportedAttitude(True, None, from_euler(0.1, -0.2, 3.0))


def test_a_yaw_from_0_to_360_deg_is_read():
    assert attitude(fields(yaw=2.0 * math.pi, time_boot_ms=0))


@pytest.mark.parametrize("name", ["roll", "pitch", "yaw"])
@pytest.mark.parametrize(
    ("value", "reason"),
    [(math.nan, "non_finite"), (-math.inf, "non_finite"), (90.0, "angle_out_of_range")],
)
def test_what_is_no_angle_is_refused(name, value, reason):
    for read in (attitude, ahrs2):
        with pytest.raises(Refused) as refusal:
            read(fields(**{name: value}, time_boot_ms=0))
        assert refusal.value.reason == reason
