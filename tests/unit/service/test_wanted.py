"""Which streams are wanted of an autopilot: a table of makes, vehicles and settings."""

from dataclasses import replace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.autopilot import Identity
from h2nav.service.requested_stream import WantedStream
from h2nav.service.settings import ServiceSettings
from h2nav.service.wanted import streams_wanted

ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
COPTER, PLANE = mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_TYPE_FIXED_WING


def wanted(make=ARDUPILOT, kind=COPTER, further=(), **sections):
    """The streams as texts: name, rate, other messages behind ``|``; ``?`` where optional."""
    settings = ServiceSettings()
    for name, changes in sections.items():
        settings = replace(settings, **{name: replace(getattr(settings, name), **changes)})
    found = streams_wanted(settings, Identity(1, 1, make, kind), further)
    return [
        "|".join(map(name_of, (one.message_id, *one.alternatives)))
        + f" {one.rate_hz:g}{'?' * one.is_optional}"
        for one in found
    ]


def name_of(message_id):
    return mavlink.mavlink_map[message_id].msgname


FIRST = "HIGHRES_IMU|RAW_IMU|SCALED_IMU|SCALED_IMU2|SCALED_IMU3 100"
FIXES, STATE, CLOCK = "GPS_RAW_INT 5", "EXTENDED_SYS_STATE 1", "SYSTEM_TIME 1"
LANES = ["SCALED_IMU2 100?", "SCALED_IMU3 100?"]
COMPARED = ["ATTITUDE 10?", "AHRS2 5?"]
SHAKEN = "VIBRATION 2?"
COMMON = [FIRST, FIXES, STATE, CLOCK, *LANES, "RAW_IMU 10?", *COMPARED, SHAKEN]


def without(*left_out):
    return [text for text in COMMON if text not in left_out]


def test_of_a_copter_with_ardupilot():
    assert wanted() == COMMON


def test_of_px4_no_message_whose_bias_is_removed_comes_first():
    first = "SCALED_IMU|HIGHRES_IMU|SCALED_IMU2|SCALED_IMU3 100"
    assert wanted(PX4) == [
        first,
        "HIGHRES_IMU 20",
        FIXES,
        STATE,
        CLOCK,
        *LANES,
        "ATTITUDE 10?",
        SHAKEN,
    ]


@pytest.mark.parametrize(
    ("sections", "expected"),
    [
        ({"autopilot": {"imu_rate_hz": 200.0}}, [text.replace(" 100", " 200") for text in COMMON]),
        ({"autopilot": {"compare_rate_hz": 4.0}},
         [text.replace("E 10?", "E 4?").replace("2 5?", "2 2?") for text in COMMON]),
        ({"autopilot": {"compare_rate_hz": 0.0}}, without(*COMPARED)),
        ({"autopilot": {"lanes": 1}}, without(*LANES, "RAW_IMU 10?")),
        ({"autopilot": {"lanes": 2}}, without("SCALED_IMU3 100?")),
        ({"autopilot": {"imu_message": "RAW_IMU", "lanes": 3}},
         ["RAW_IMU 100", *without(FIRST, "RAW_IMU 10?")]),
        ({"autopilot": {"imu_message": "RAW_IMU"}},
         ["RAW_IMU 100", *without(FIRST, *LANES, "RAW_IMU 10?")]),
        ({"autopilot": {"simulation_truth": True}},
         [FIRST, FIXES, STATE, CLOCK, "SIMSTATE 100", *COMMON[4:]]),
        ({"aiding": {"autopilot_velocity": True}},
         [FIRST, FIXES, STATE, CLOCK, "LOCAL_POSITION_NED 10", *COMMON[4:]]),
        ({"aiding": {"gps_velocity": False}}, COMMON),  # still for the declination
        ({"north": {"declination": "none"}}, COMMON),  # still for its velocity
        ({"aiding": {"gps_velocity": False}, "north": {"declination": "none"}}, without(FIXES)),
    ],
)  # fmt: skip
def test_a_setting_changes_what_it_is_for(sections, expected):
    assert wanted(**sections) == expected


def test_only_of_a_plane_the_airspeed_is_wanted():
    assert wanted(kind=PLANE) == [*COMMON[:-1], "AIRSPEED 4?", SHAKEN]
    assert wanted(kind=PLANE, aiding={"airspeed": False}) == COMMON


@pytest.mark.parametrize(("imu_rate_hz", "field_rate_hz"), [(50.0, 10), (100.0, 20), (400.0, 20)])
def test_a_field_is_lent_at_a_share_of_the_samples(imu_rate_hz, field_rate_hz):
    lent = wanted(PX4, autopilot={"imu_rate_hz": imu_rate_hz})[1]
    assert lent == f"HIGHRES_IMU {field_rate_hz}"


def test_streams_of_motion_come_before_what_is_optional():
    wheels = WantedStream(mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE, 20.0)
    assert wanted(further=(wheels,)) == [*COMMON[:4], "WHEEL_DISTANCE 20", *COMMON[4:]]
