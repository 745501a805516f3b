"""What is replaced in telemetry, message by message, and what stays: just enough and too little."""

import math
import struct

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.anonymous import Coordinates, Replacement
from h2nav.recordings.anonymous_frames import anonymise_frames, frame_facts
from h2nav.recordings.anonymous_logs import Counted
from h2nav.recordings.recording import open_recording
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

BY = Replacement(Coordinates(47.4, 8.5), Coordinates(45.4, 12.5), 7, b"salt")
UNIX_US = 1_700_000_000 * 10**6
WEEK_US = 604_800 * 10**6
LAT, LON, NEW_LAT, NEW_LON = 474_000_000, 85_000_000, 454_000_000, 125_000_000


def tlog(tmp_path, *messages, damage=b""):
    """A log with a message each millisecond."""
    encoder, path = Encoder(1, 1), tmp_path / "old.tlog"
    stamped = (
        struct.pack(">Q", UNIX_US + 1000 * i) + encoder.encode(message)
        for i, message in enumerate(messages)
    )
    path.write_bytes(b"".join(stamped) + damage)
    return open_recording(path)


def written(tmp_path, *messages, by=BY):
    """The new messages, and what was counted."""
    output = tmp_path / "new.tlog"
    counted, signatures = anonymise_frames(tlog(tmp_path, *messages), output, by)
    assert signatures == 0
    data, found, deframer = output.read_bytes(), [], Deframer()
    while data:
        size = 12 + data[9]
        found += [decode(frame) for frame in deframer.feed(data[8 : 8 + size])]
        data = data[8 + size :]
    return found, counted


def gps(lat=LAT, lon=LON, alt=500_000):
    return mavlink.MAVLink_gps_raw_int_message(1, 3, lat, lon, alt, 0, 0, 0, 0, 9)


def command(*params, number=16):
    return mavlink.MAVLink_command_long_message(1, 1, number, 0, *params)


@pytest.mark.parametrize(
    ("message", "fields", "places"),
    [
        (gps(), {"lat": NEW_LAT, "lon": NEW_LON, "alt": 500_000}, 2),
        (gps(0, 0), {"lat": 0, "lon": 0}, 0),
        (mavlink.MAVLink_global_position_int_message(7, LAT, LON, 1, 2, 3, 4, 5, 6),
         {"lat": NEW_LAT, "lon": NEW_LON, "alt": 1, "vz": 5, "time_boot_ms": 7}, 2),
        (command(1, 2, 3, 4, 47.4, 8.5, 47.4),
         {"param4": 4.0, "param5": 45.4, "param6": 12.5, "param7": 47.4}, 2),
        (command(47.4, 0, 0, 0, 53.0, 47.4, 0),
         {"param1": 47.4, "param5": 53.0, "param6": 47.4}, 0),
        (mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 0, 0, 0, 0, 0, 0, LAT, LON, 47.4),
         {"x": NEW_LAT, "y": NEW_LON, "z": 47.4}, 2),
        (mavlink.MAVLink_local_position_ned_message(1, 47.4, 8.5, 0, 0, 0, 0),
         {"x": 47.4, "y": 8.5}, 0),
        # From an origin at 0 deg they are the place.
        (mavlink.MAVLink_local_position_ned_message(1, 47.4 * 111_318.84502, 100.0, 0, 0, 0, 0),
         {"x": 45.4 * 111_318.84502, "y": 100.0}, 1),
        (mavlink.MAVLink_attitude_message(1, 0.4, 0.5, 0.6, 0, 0, 0), {"roll": 0.4, "yaw": 0.6}, 0),
    ],
)  # fmt: skip
def test_places_are_moved(tmp_path, message, fields, places):
    (found,), counted = written(tmp_path, message)
    for name, value in fields.items():
        assert getattr(found, name) == pytest.approx(value, rel=1e-6, abs=1)
    assert counted == Counted(places=places)


@pytest.mark.parametrize(
    ("unix_us", "back_us"), [(UNIX_US, 7 * WEEK_US), (10**15 - 1, 0), (5_000_000, 0), (0, 0)]
)
def test_dates_go_back_by_weeks(tmp_path, unix_us, back_us):
    message = mavlink.MAVLink_system_time_message(unix_us, 1234)
    (found,), counted = written(tmp_path, message)
    assert (found.time_unix_usec, found.time_boot_ms) == (unix_us - back_us, 1234)
    assert counted == Counted(dates=1 if back_us else 0)
    data = (tmp_path / "new.tlog").read_bytes()
    assert int.from_bytes(data[:8], "big") == UNIX_US - 7 * WEEK_US


@pytest.mark.parametrize(
    ("text", "stays"),
    [(b"EKF3 IMU0 is using GPS", True), (b"to /home/alice/log", False), (b"at 47.4012", False),
     (b"at 53.4012", True)],
)  # fmt: skip
def test_texts_name_nobody(tmp_path, text, stays):
    (found,), counted = written(tmp_path, mavlink.MAVLink_statustext_message(6, text))
    assert (found.text == text.decode()) is stays
    assert len(found.text) == len(text)
    assert counted == Counted(texts=0 if stays else 1)


def parameter(name, value):
    return mavlink.MAVLink_param_value_message(name, value, 9, 1, 0)


@pytest.mark.parametrize(
    ("name", "value", "becomes"),
    [
        (b"STAT_FLTTIME", 4711.0, 0.0),
        (b"BRD_SERIAL_NUM", -1.0, -1.0),
        (b"ATC_RAT_RLL_P", 0.25, 0.25),
        (b"SIM_OPOS_LAT", 47.5, 45.5),
        (b"COMPASS_DEC", 0.05, 0.0),  # the field at both places is not known
        (b"STAT_FLTTIME", math.nan, math.nan),
    ],
)
def test_parameters(tmp_path, name, value, becomes):
    (found,), counted = written(tmp_path, parameter(name, value))
    assert found.param_value == pytest.approx(becomes, nan_ok=True)
    assert found.param_id == name.decode()
    is_same = value == becomes or math.isnan(value)
    assert counted == Counted(parameters=0 if is_same else 1)


@pytest.mark.parametrize(
    ("message", "is_dropped"),
    [
        (mavlink.MAVLink_adsb_vehicle_message(1, LAT, LON, 0, 0, 0, 0, 0, b"A", 0, 0, 0, 0), True),
        (mavlink.MAVLink_terrain_report_message(LAT, LON, 0, 0, 0, 0, 0), True),
        (mavlink.MAVLink_log_entry_message(1, 1, 1, 1, 1), True),
        (mavlink.MAVLink_gps_inject_data_message(1, 1, 3, [1] * 110), True),
        (mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, [1] * 251), True),
        (mavlink.MAVLink_vibration_message(1, 1, 1, 1, 1, 1, 1), False),
        (mavlink.MAVLink_named_value_float_message(1, b"thing", 1.5), False),
    ],
)
def test_messages_about_others_and_their_bytes_are_left_out(tmp_path, message, is_dropped):
    found, counted = written(tmp_path, message)
    assert len(found) == (0 if is_dropped else 1)
    assert counted == Counted(dropped=1 if is_dropped else 0)
    if isinstance(message, mavlink.MAVLink_named_value_float_message):
        assert found[0].name == "thing"


def test_an_id_becomes_another_one_of_its_length(tmp_path):
    long = [*range(1, 13), *[0] * 6]
    message = mavlink.MAVLink_autopilot_version_message(
        1, 2, 3, 4, 5, [1] * 8, [2] * 8, [3] * 8, 7, 8, 99, uid2=long
    )
    (found, again), counted = written(tmp_path, message, message)
    assert found == again
    assert 0 not in found.uid2[:11]
    assert list(found.uid2[12:]) == [0] * 6
    assert list(found.uid2) != long
    assert found.uid not in (0, 99)
    assert (found.vendor_id, found.product_id, found.capabilities) == (7, 8, 1)
    assert counted == Counted(texts=4)


def test_what_is_no_frame_is_left_out_and_no_file_is_overwritten(tmp_path):
    recording, output = tlog(tmp_path, gps(), damage=b"Alice" * 9), tmp_path / "new.tlog"
    anonymise_frames(recording, output, BY)
    assert b"Alice" not in output.read_bytes()
    assert len(output.read_bytes()) == 8 + 12 + output.read_bytes()[9]
    with pytest.raises(Exception, match="exists"):
        anonymise_frames(recording, output, BY)


@pytest.mark.parametrize(
    ("lat", "lon", "is_fact"),
    [(LAT, LON, True), (0, 0, False), (0, LON, True), (900_000_000, -1_800_000_000, True),
     (900_000_001, LON, False), (LAT, 1_800_000_001, False)],
)  # fmt: skip
def test_a_fix_on_earth_is_a_fact(tmp_path, lat, lon, is_fact):
    fixes, unix_s = frame_facts(tlog(tmp_path, gps(lat, lon)))
    assert fixes == ([pytest.approx((lat / 1e7, lon / 1e7))] * 2 if is_fact else [])
    assert unix_s == pytest.approx(1_700_000_000)


def test_the_first_and_the_last_fix_of_the_receiver_come_first(tmp_path):
    fused = mavlink.MAVLink_global_position_int_message(7, 1, 1, 1, 2, 3, 4, 5, 6)
    found, _ = frame_facts(tlog(tmp_path, fused, gps(1, 2), gps(3, 4), gps(5, 6)))
    np.testing.assert_allclose(np.multiply(found, 1e7), [(1, 2), (5, 6), (1, 1), (1, 1)])
    path = tmp_path / "raw.bin"
    path.write_bytes(b"".join(Encoder(1, 1).encode(gps()) for _ in range(3)))
    assert frame_facts(open_recording(path))[1] is None  # its times are made up
