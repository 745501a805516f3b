"""Each message that is read, as it comes over a link, and the record that it gives."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.quaternion import from_euler
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.imu import IMU_MESSAGES, RECORDED_IMU
from h2nav.wire.motion import WheelDistances
from h2nav.wire.position import EstimatedVelocity, Origin, OtherFix, Place
from h2nav.wire.questions import Command, ParameterList, ParameterRead, ParameterWrite
from h2nav.wire.readers import MOTION_READERS, READERS, message_name
from h2nav.wire.refused import LATEST_USEC, Refused, need_finite, need_time, need_within
from h2nav.wire.vehicle import (
    Airspeed,
    CommandAck,
    Heartbeat,
    LandedState,
    ParameterValue,
    StatusText,
    SystemTime,
    TimeSyncMessage,
    Vibration,
)

US = (3, 191)
NOTHING = (0.0,) * 5
PLACE = Place(47.0, 8.0, 500.0)
E7_MM = (470_000_000, 80_000_000, 500_000)


def read(message):
    """The record of a message."""
    (frame,) = Deframer().feed(Encoder(1, 1).encode(message))
    return READERS[frame.msg_id](decode(frame))


@pytest.mark.parametrize(
    ("message", "record"),
    [
        (mavlink.MAVLink_heartbeat_message(2, 3, 0x80, 0, 4, 3), Heartbeat(3, 2, True)),
        (mavlink.MAVLink_heartbeat_message(2, 3, 0x7F, 0, 4, 3), Heartbeat(3, 2, False)),
        (mavlink.MAVLink_extended_sys_state_message(0, 0), LandedState(None)),
        (mavlink.MAVLink_extended_sys_state_message(0, 1), LandedState(True)),
        (mavlink.MAVLink_extended_sys_state_message(0, 2), LandedState(False)),
        (mavlink.MAVLink_extended_sys_state_message(1, 4), LandedState(False)),
        (mavlink.MAVLink_statustext_message(4, b"PreArm: x"), StatusText("PreArm: x")),
        (mavlink.MAVLink_system_time_message(0, 7), SystemTime(None)),
        (mavlink.MAVLink_airspeed_message(0, 21.5, 0, 0.0, 0), Airspeed(21.5, False)),
        (mavlink.MAVLink_timesync_message(-5, 7), TimeSyncMessage(-5, 7, (0, 0))),
        (
            mavlink.MAVLink_vibration_message(1, 1.0, 2.0, 3.0, 4, 5, 6),
            Vibration((1.0, 2.0, 3.0), (4, 5, 6)),
        ),
        (mavlink.MAVLink_command_ack_message(511, 4, 0, 0, *US), CommandAck(511, 4, US)),
        (
            mavlink.MAVLink_attitude_message(9, 0.5, 0.25, -0.5, 1, 2, 3),
            ReportedAttitude(False, 9, from_euler(0.5, 0.25, -0.5)),
        ),
        (
            mavlink.MAVLink_ahrs2_message(0.5, 0.25, -0.5, 1.0, 2, 3),
            ReportedAttitude(True, None, from_euler(0.5, 0.25, -0.5)),
        ),
        (mavlink.MAVLink_global_position_int_message(1, *E7_MM, 2, 3, 4, 5, 6), PLACE),
        (mavlink.MAVLink_gps_global_origin_message(*E7_MM), Origin(PLACE)),
        (
            mavlink.MAVLink_home_position_message(*E7_MM, 1, 2, 3, [1, 0, 0, 0], 4, 5, 6),
            Origin(PLACE),
        ),
        (
            mavlink.MAVLink_local_position_ned_message(8, 9, 9, 9, 1.0, 2.0, 3.0),
            EstimatedVelocity(8_000, (1.0, 2.0, 3.0)),
        ),
        (
            mavlink.MAVLink_command_long_message(*US, 511, 0, 30.0, 1e5, *NOTHING),
            Command(511, 30.0, 1e5, US),
        ),
        (
            mavlink.MAVLink_command_int_message(*US, 0, 511, 0, 0, 30.0, 1e5, 3.0, 4.0, 5, 6, 7),
            Command(511, 30.0, 1e5, US),
        ),
        (
            mavlink.MAVLink_param_value_message(b"COMPASS_USE", 0.5, 9, 10, 1),
            ParameterValue("COMPASS_USE", 0.5),
        ),
        (
            mavlink.MAVLink_param_value_message(b"COMPASS_USE", math.inf, 9, 10, 1),
            ParameterValue("COMPASS_USE", None),
        ),
        (mavlink.MAVLink_param_request_list_message(*US), ParameterList(US)),
        (
            mavlink.MAVLink_param_request_read_message(*US, b"H2_ATT_HZ", -1),
            ParameterRead("H2_ATT_HZ", None, US),
        ),
        (mavlink.MAVLink_param_request_read_message(*US, b"", 0), ParameterRead("", 0, US)),
        (
            mavlink.MAVLink_param_set_message(*US, b"H2_ATT_HZ", 5.0, 9),
            ParameterWrite("H2_ATT_HZ", 5.0, US),
        ),
        (
            mavlink.MAVLink_param_set_message(*US, b"H2_ATT_HZ", math.nan, 9),
            ParameterWrite("H2_ATT_HZ", None, US),
        ),
        (
            mavlink.MAVLink_wheel_distance_message(6, 2, [1.0, 2.0, *[9.0] * 14]),
            WheelDistances(6, (1.0, 2.0)),
        ),
    ],
)  # fmt: skip
def test_a_message_gives_its_record(message, record):
    found = read(message)
    assert type(found) is type(record)
    assert found == pytest.approx(record) if isinstance(record, Place) else found == record


def test_a_second_receiver_has_its_own_message():
    raw = mavlink.MAVLink_gps2_raw_message(5, 3, *E7_MM, 1, 1, 250, 0, 12, 0, 0)
    found = read(raw)
    assert isinstance(found, OtherFix)
    assert found.fix.place == pytest.approx(PLACE)
    assert found.fix.v_n[:2] == pytest.approx((2.5, 0.0))
    assert (found.fix.time_us, found.fix.satellites) == (5, 12)


def test_messages_of_motion_are_read_too():
    assert {message_name(message_id) for message_id in MOTION_READERS} == {
        "ODOMETRY",
        "VISION_POSITION_ESTIMATE",
        "ATT_POS_MOCAP",
        "WHEEL_DISTANCE",
    }
    assert MOTION_READERS.keys() <= READERS.keys()


def test_each_message_has_the_name_of_the_dialect():
    assert message_name(mavlink.MAVLINK_MSG_ID_HIGHRES_IMU) == "HIGHRES_IMU"
    assert message_name(RECORDED_IMU) == "recorded IMU"
    assert RECORDED_IMU not in READERS  # what no link carries
    assert IMU_MESSAGES.keys() - READERS.keys() == {RECORDED_IMU}


@pytest.mark.parametrize(
    ("check", "values", "is_good"),
    [
        (need_finite, (0.0, -1e308), True),
        (need_finite, (0.0, math.inf), False),
        (need_finite, (math.nan, 0.0), False),
        (lambda reason, *of: need_within(reason, 2.0, *of), (2.0, -2.0), True),
        (lambda reason, *of: need_within(reason, 2.0, *of), (0.0, 2.0000001), False),
        (lambda reason, *of: need_within(reason, 2.0, *of), (-2.0000001, 0.0), False),
        (lambda reason, *of: need_within(reason, 2.0, *of), (math.nan,), False),
        (need_time, (LATEST_USEC,), True),
        (need_time, (LATEST_USEC + 1,), False),
    ],
)
def test_what_is_refused_is_refused_by_its_reason(check, values, is_good):
    if is_good:
        check("why", *values)
        return
    with pytest.raises(Refused) as refused:
        check("why", *values)
    assert (refused.value.reason, str(refused.value)) == ("why", "why")


def test_the_latest_time_is_the_year_2100():
    assert need_time("", LATEST_USEC) == 4_102_444_800 * 1_000_000


@pytest.mark.parametrize(
    ("autopilot", "vehicle", "is_autopilot", "is_station"),
    [
        (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR, True, False),
        (mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_TYPE_QUADROTOR, False, False),
        (mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_GCS, False, True),
        (mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_TYPE_GCS, False, True),
        (mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_TYPE_CAMERA, False, False),
    ],
)
def test_who_sends_a_heartbeat(autopilot, vehicle, is_autopilot, is_station):
    beat = read(mavlink.MAVLink_heartbeat_message(vehicle, autopilot, 0, 0, 4, 3))
    assert (beat.is_of_autopilot, beat.is_of_ground_station) == (is_autopilot, is_station)


@pytest.mark.parametrize(
    ("just", "beyond", "reason"),
    [
        (  # from 2010 ...
            mavlink.MAVLink_system_time_message(1_262_304_000_000_000, 0),
            mavlink.MAVLink_system_time_message(1_262_303_999_999_000, 0),
            "date_out_of_range",
        ),
        (  # ... to 2100
            mavlink.MAVLink_system_time_message(4_102_444_799_999_000, 0),
            mavlink.MAVLink_system_time_message(4_102_444_800_000_000, 0),
            "date_out_of_range",
        ),
        (
            mavlink.MAVLink_airspeed_message(0, 400.0, 0, 0.0, 0),
            mavlink.MAVLink_airspeed_message(0, 400.1, 0, 0.0, 0),
            "airspeed_out_of_range",
        ),
        (
            mavlink.MAVLink_airspeed_message(0, -400.0, 0, 0.0, 0),
            mavlink.MAVLink_airspeed_message(0, -math.inf, 0, 0.0, 0),
            "airspeed_out_of_range",
        ),
        (
            mavlink.MAVLink_timesync_message(1 << 62, -(1 << 62)),
            mavlink.MAVLink_timesync_message((1 << 62) + 1, 0),
            "clock_out_of_range",
        ),
        (
            mavlink.MAVLink_timesync_message(1, 1 << 62),
            mavlink.MAVLink_timesync_message(1, -(1 << 62) - 1),
            "clock_out_of_range",
        ),
    ],
)
def test_what_a_field_cannot_mean_is_refused(just, beyond, reason):
    read(just)
    with pytest.raises(Refused) as refused:
        read(beyond)
    assert refused.value.reason == reason
