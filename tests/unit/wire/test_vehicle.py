"""What an autopilot reports of its vehicle."""

import math
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.readers import READERS
from h2nav.wire.refused import Refused
from h2nav.wire.vehicle import Airspeed, SystemTime, Vibration, firmware


def read(message):
    """The record of a message as it comes over a link."""
    (frame,) = Deframer().feed(Encoder(1, 1).encode(message))
    return READERS[frame.msg_id](decode(frame))


def test_vibration_has_levels_and_the_clips_of_each_accelerometer():
    message = mavlink.MAVLink_vibration_message(5, 1.5, 62.0, 30.25, 7, 0, 4_000_000_000)
    assert read(message) == Vibration((1.5, 62.0, 30.25), (7, 0, 4_000_000_000))


def test_a_level_that_is_no_number_says_nothing():
    message = mavlink.MAVLink_vibration_message(5, math.nan, math.inf, 3.0, 0, 0, 0)
    assert read(message) == Vibration((0.0, 0.0, 3.0), (0, 0, 0))


def airspeed(m_s, number=0, flags=mavlink.AIRSPEED_SENSOR_USING):
    return read(mavlink.MAVLink_airspeed_message(number, m_s, 32767, 2.4, flags))


def test_an_airspeed_is_that_of_a_healthy_first_sensor():
    assert airspeed(21.5) == Airspeed(21.5)
    assert airspeed(21.5, number=1) == Airspeed(None)
    assert airspeed(21.5, flags=mavlink.AIRSPEED_SENSOR_UNHEALTHY) == Airspeed(None)
    assert airspeed(math.nan) == Airspeed(None)
    assert airspeed(0.0) == Airspeed(None)
    with pytest.raises(Refused):
        airspeed(1e6)


def test_the_airspeed_of_a_display_is_an_estimate_and_not_read():
    assert mavlink.MAVLINK_MSG_ID_VFR_HUD not in READERS


def test_a_date_is_known_unknown_or_impossible():
    def dated(unix_us):
        return read(mavlink.MAVLink_system_time_message(unix_us, 1000))

    assert dated(1_795_000_000_250_000) == SystemTime(1_795_000_000.25)
    assert dated(0) == SystemTime(None)
    with pytest.raises(Refused, match="date_out_of_range"):
        dated(1_795_000_000_250_000_000)


@pytest.mark.parametrize(
    ("packed", "text"),
    [
        (0x040507FF, "4.5.7"),  # a release
        (0x04050700, "4.5.7 dev"),
        (0x01020340, "1.2.3 alpha"),
        (0x01020380, "1.2.3 beta"),
        (0xFF0A00C0, "255.10.0 rc"),
        (0x01020301, "1.2.3"),
    ],
)
def test_a_version_is_told_as_people_write_it(packed, text):
    assert str(firmware(SimpleNamespace(flight_sw_version=packed))) == text
