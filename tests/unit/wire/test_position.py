"""Positions and velocities at the limits of what a receiver or an estimator can mean."""

import math
from types import SimpleNamespace

import pytest

from h2nav.wire import position
from h2nav.wire.position import GpsFix, NoFix, NoOtherFix, Origin, OtherFix, Place
from h2nav.wire.refused import LATEST_USEC, Refused

FIX = {
    "time_usec": 5_000_000,
    "fix_type": 3,
    "lat": -353_600_000,
    "lon": 1_491_700_000,
    "alt": 584_000,
    "vel": 1_000,
    "cog": 9_000,
    "vel_acc": 200,
    "satellites_visible": 11,
}


def raw(**changes):
    return SimpleNamespace(**{**FIX, **changes})


def refusal(reader, message):
    with pytest.raises(Refused) as refused:
        reader(message)
    return refused.value.reason


def test_a_fix_is_in_si_units_with_its_course_from_north():
    fix = position.gps_raw_int(raw())
    assert fix.place == pytest.approx((-35.36, 149.17, 584.0))
    assert fix.v_n[:2] == pytest.approx((0.0, 10.0), abs=1e-12)  # 90 deg: east
    assert math.isnan(fix.v_n[2])
    assert (fix.time_us, fix.sigma_m_s, fix.satellites) == (5_000_000, 0.2, 11)


@pytest.mark.parametrize(
    ("changes", "field", "value"),
    [
        ({"vel": 65_535}, "v_n", None),
        ({"cog": 65_535}, "v_n", None),
        ({"vel_acc": 0}, "sigma_m_s", position.DEFAULT_SIGMA_M_S),
        ({"satellites_visible": 255}, "satellites", None),
        ({"satellites_visible": 254}, "satellites", 254),
        ({"time_usec": LATEST_USEC}, "time_us", LATEST_USEC),
        ({"time_usec": LATEST_USEC + 1}, "time_us", 0),
    ],
)
def test_what_a_receiver_does_not_know_is_unknown(changes, field, value):
    assert getattr(position.gps_raw_int(raw(**changes)), field) == value


@pytest.mark.parametrize("fix_type", [0, 1, 2])
def test_a_fix_in_the_plane_is_none(fix_type):
    assert position.gps_raw_int(raw(fix_type=fix_type, lat=2**31 - 1)) == NoFix()
    assert position.gps2_raw(raw(fix_type=fix_type)) == NoOtherFix()


def test_a_second_receiver_is_read_like_the_first():
    assert isinstance(position.gps2_raw(raw()), OtherFix)
    assert isinstance(position.gps2_raw(raw()).fix, GpsFix)
    assert refusal(position.gps2_raw, raw(cog=36_001)) == "gps_course_out_of_range"


@pytest.mark.parametrize(
    ("just", "beyond", "reason"),
    [
        ({"lat": -900_000_000}, {"lat": -900_000_001}, "gps_position_out_of_range"),
        ({"lon": 1_800_000_000}, {"lon": 1_800_000_001}, "gps_position_out_of_range"),
        ({"alt": 100_000_000}, {"alt": 100_000_001}, "gps_position_out_of_range"),
        ({"cog": 36_000}, {"cog": 36_001}, "gps_course_out_of_range"),
    ],
)
def test_a_fix_is_somewhere_on_earth_and_goes_somewhere(just, beyond, reason):
    assert isinstance(position.gps_raw_int(raw(**just)), GpsFix)
    assert refusal(position.gps_raw_int, raw(**beyond)) == reason


def test_places_of_an_estimator_and_of_the_start_have_the_same_limits():
    assert position.global_position(raw()) == pytest.approx((-35.36, 149.17, 584.0))
    assert refusal(position.global_position, raw(lat=900_000_001)) == "position_out_of_range"
    home = SimpleNamespace(latitude=0, longitude=-1_800_000_000, altitude=-400)
    assert position.origin(home) == Origin(Place(0.0, -180.0, pytest.approx(-0.4)))
    home.longitude -= 1
    assert refusal(position.origin, home) == "position_out_of_range"


@pytest.mark.parametrize("bad", [1000.1, -1000.1, math.nan, math.inf])
@pytest.mark.parametrize("axis", ["vx", "vy", "vz"])
def test_an_estimated_velocity_is_that_of_an_aircraft(axis, bad):
    message = SimpleNamespace(time_boot_ms=7, vx=1000.0, vy=-1000.0, vz=0.0)
    assert position.local_position(message) == (7000, (1000.0, -1000.0, 0.0))
    setattr(message, axis, bad)
    assert refusal(position.local_position, message) == "velocity_out_of_range"
