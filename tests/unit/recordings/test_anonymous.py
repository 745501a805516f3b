"""Logs without place and identity: nothing of the old ones is left, the physics stays."""

import math
import struct

import numpy as np
import pytest
from made_logs import START_US, DataflashWriter, ULogWriter, dataflash, made_flight, ulog
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from signing_peer import Peer

from h2nav.files.earth_field import earth_field_at
from h2nav.log.recorder import Recorder
from h2nav.recordings.anonymous import Coordinates, Replacement, patterns_of, which_of
from h2nav.recordings.anonymous_check import remains
from h2nav.recordings.anonymous_frames import anonymise_frames, frame_facts
from h2nav.recordings.anonymous_logs import (
    anonymise_dataflash,
    anonymise_ulog,
    dataflash_facts,
    ulog_facts,
)
from h2nav.recordings.anonymous_place import difference, similar_place
from h2nav.recordings.dataflash import open_dataflash
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context
from h2nav.recordings.ulog import open_ulog
from h2nav.sim.vehicle import HOME
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

OLD = Coordinates(HOME.latitude_deg, HOME.longitude_deg)
NEW = Coordinates(OLD.latitude_deg + 1.25, 12.5)
BY = Replacement(OLD, NEW, 7, b"salt")
WEEK_S = 604_800
UID = "002E0023 3433510D 38373934"
UUID = "000600000000303736303532511100290025"
FLIGHT = made_flight(duration_s=12.0)


def metres(place, own):
    """North and east of its own origin."""
    north = math.radians(place[0] - own.latitude_deg)
    east = math.radians(place[1] - own.longitude_deg) * math.cos(math.radians(own.latitude_deg))
    return 6_371_000.0 * np.array([north, east])


def test_dataflash(tmp_path):
    writer = DataflashWriter()
    texts = [f"CubeOrange {UID}".encode(), b"script /home/alice/fly.lua failed, alice@example.org"]
    at = np.full(2, START_US)
    writer.add("MSG", "QZ", "TimeUS,Message", at, np.array(texts))
    names = np.array([b"STAT_FLTTIME", b"SIM_OPOS_LAT", b"ATC_RAT_RLL_P"])
    values = np.array([4711.0, OLD.latitude_deg, 0.135])
    writer.add("PARM", "QNf", "TimeUS,Name,Value", np.full(3, START_US), names, values)
    writer.add("CAND", "QQQ", "TimeUS,UID1,UID2", at, 2**60 + 5, 3)
    writer.add("FILE", "QNZ", "TimeUS,FileName,Data", at, b"/secret", b"a secret content")
    path, output = tmp_path / "old.bin", tmp_path / "new.bin"
    damage = b"owner: Alice Example"
    path.write_bytes(dataflash(FLIGHT, extra=writer) + damage)
    fixes, unix_s = dataflash_facts(path)
    counted = anonymise_dataflash(path, output, BY)
    data = output.read_bytes()
    assert len(data) == path.stat().st_size
    assert not remains(output, fixes, [UID.replace(" ", "-")])
    for word in (UID, "alice", "Alice", "example.org", "secret", "4711"):
        assert word.encode() not in data
    assert counted.places > 50
    assert counted.dropped == 2
    assert counted.other_bytes == len(damage)
    old, new = (open_dataflash(each).context() for each in (path, output))
    assert new.uid != old.uid
    assert len(new.uid) == len(old.uid)
    assert new.board == old.board == "CubeOrange"
    assert new.firmware == old.firmware
    assert new.parameters["STAT_FLTTIME"] == 0.0
    assert new.parameters["SIM_OPOS_LAT"] == pytest.approx(NEW.latitude_deg, abs=1e-4)
    assert new.parameters["ATC_RAT_RLL_P"] == old.parameters["ATC_RAT_RLL_P"]
    assert new.start_unix_s == pytest.approx(old.start_unix_s - 7 * WEEK_S)
    assert (new.imus[0].f_b == old.imus[0].f_b).all()
    for row in (0, -1):
        places = [(c.gps[0].latitude_deg[row], c.gps[0].longitude_deg[row]) for c in (old, new)]
        moved = metres(places[1], NEW) - metres(places[0], OLD)
        assert np.abs(moved).max() < 0.1
    assert unix_s is not None


def test_ulog(tmp_path):
    writer = ULogWriter()
    writer.info("char[36] sys_uuid", UUID.encode())
    writer.info("char[15] ver_sw_branch", b"alice/my-branch")
    writer.parameter("COM_FLIGHT_UUID", 4711.0)
    writer.text(START_US, 6, "logging to /fs/microsd/log/alice/x.ulg")
    t_us = START_US + np.arange(20) * 100_000
    home = [OLD.latitude_deg, OLD.longitude_deg]
    writer.add("home_position", "double lat;double lon", t_us, *home)
    writer.add("estimator_aid_src_gnss_pos", "double[2] observation", t_us, [home] * 20)
    path, output = tmp_path / "old.ulg", tmp_path / "new.ulg"
    path.write_bytes(ulog(FLIGHT, extra=writer))
    fixes, _ = ulog_facts(path)
    counted = anonymise_ulog(path, output, BY)
    data = output.read_bytes()
    assert len(data) == path.stat().st_size
    assert not remains(output, [OLD, *fixes], [UUID])
    for word in (UUID, "alice", "my-branch"):
        assert word.encode() not in data
    assert counted.places > 60
    assert counted.parameters == 1
    assert counted.other_bytes == 0
    old, new = (open_ulog(each).context() for each in (path, output))
    assert new.uid != old.uid
    assert len(new.uid) == len(UUID)
    assert new.firmware == old.firmware
    assert (new.imus[0].w_b == old.imus[0].w_b).all()
    assert new.gps[0].latitude_deg[0] == pytest.approx(NEW.latitude_deg, abs=0.01)


def telemetry(tmp_path, *frames):
    path = tmp_path / "old.tlog"
    stamp = 1_700_000_000_000_000
    entries = (struct.pack(">Q", stamp + 1000 * i) + frame for i, frame in enumerate(frames))
    path.write_bytes(b"".join(entries))
    return path


def messages():
    e7 = [round(value * 1e7) for value in OLD]
    texts = [f"CubeOrange {UID}".encode(), b"mission /home/alice/plan"]
    return [
        mavlink.MAVLink_heartbeat_message(2, 3, 0, 0, 4, 3),
        mavlink.MAVLink_gps_raw_int_message(1_700_000_000_000_000, 3, *e7, 100, 1, 1, 1, 1, 9),
        mavlink.MAVLink_global_position_int_message(5, *e7, 1, 1, 1, 1, 1, 1),
        mavlink.MAVLink_system_time_message(1_700_000_000_000_000, 5),
        *(mavlink.MAVLink_statustext_message(6, text) for text in texts),
        mavlink.MAVLink_param_value_message(b"STAT_FLTTIME", 4711.0, 9, 1, 0),
        mavlink.MAVLink_param_value_message(b"ATC_RAT_RLL_P", 0.125, 9, 1, 0),
        mavlink.MAVLink_command_long_message(1, 1, 16, 0, 0, 0, 0, 0, *OLD, 10),
        mavlink.MAVLink_command_long_message(1, 1, 511, 0, 32, 1e4, 0, 0, 3.0, 4.0, 0),
        mavlink.MAVLink_mission_item_int_message(1, 1, 0, 3, 16, 0, 1, 0, 0, 0, 0, *e7, 10.0),
        mavlink.MAVLink_file_transfer_protocol_message(0, 1, 1, b"alice".ljust(251, b"\0")),
        mavlink.MAVLink_adsb_vehicle_message(1, *e7, 0, 1, 1, 1, 1, b"N123AB", 1, 1, 0, 0),
        mavlink.MAVLink_autopilot_version_message(
            0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0x1122334455667788, list(range(1, 19))
        ),
        mavlink.MAVLink_attitude_message(5, 0.1, 0.2, 0.3, 0, 0, 0),
    ]  # fmt: skip


@pytest.mark.parametrize("version", [1, 2])
def test_telemetry(tmp_path, version):
    encoder = Encoder(1, 1)
    frames = [encoder.encode(message) for message in messages()]
    if version == 1:
        sender = mavlink.MAVLink(None, 1, 1)
        frames = [message.pack(sender, force_mavlink1=True) for message in messages()]
    path, output = telemetry(tmp_path, *frames), tmp_path / "new.tlog"
    fixes, unix_s = frame_facts(open_recording(path))
    assert unix_s == 1_700_000_000.0
    assert fixes[0] == pytest.approx(OLD, abs=1e-7)
    counted, signatures = anonymise_frames(open_recording(path), output, BY)
    data = output.read_bytes()
    assert not remains(output, [OLD, *fixes], [UID.replace(" ", "-")])
    for word in (b"alice", b"N123AB", struct.pack("<f", 4711.0), bytes(range(1, 19))):
        assert word not in data
    assert counted.dropped == 2
    assert signatures == 0
    new = read_context(open_recording(output))
    assert new.start_unix_s == pytest.approx(unix_s - 7 * WEEK_S)
    assert new.gps[0].latitude_deg[0] == pytest.approx(NEW.latitude_deg, abs=1e-6)
    assert new.parameters == {"STAT_FLTTIME": 0.0, "ATC_RAT_RLL_P": 0.125}
    # The last one has nothing to hide, and is as it was.
    assert data.endswith(frames[-1])


def test_commands_that_carry_no_place_stay_as_they_are(tmp_path):
    encoder = Encoder(1, 1)
    path = telemetry(tmp_path, *(encoder.encode(message) for message in messages()))
    anonymise_frames(open_recording(path), output := tmp_path / "new.tlog", BY)
    deframer = Deframer()
    frames = [f for _, d in open_recording(output).received() for f in deframer.feed(d)]
    commands = [decode(frame) for frame in frames if frame.msg_id == 76]
    assert commands[0].param5 == pytest.approx(NEW.latitude_deg, abs=1e-4)
    assert (commands[1].param2, commands[1].param5, commands[1].param6) == (1e4, 3.0, 4.0)


def test_signatures_are_dropped_and_counted(tmp_path):
    peer = Peer(b"k" * 32)
    path = telemetry(tmp_path, *(peer.raw() for _ in range(3)))
    counted, signatures = anonymise_frames(open_recording(path), tmp_path / "new.tlog", BY)
    assert signatures == 3
    deframer = Deframer()
    new = open_recording(tmp_path / "new.tlog")
    frames = [frame for _, data in new.received() for frame in deframer.feed(data)]
    assert len(frames) == 3
    assert not any(frame.signed for frame in frames)
    assert counted.dropped == 0


@pytest.mark.parametrize(
    "name", ["Lat", "lat", "lat_int", "HLat", "ref_lat", "latitude_deg", "x.lat"]
)
def test_names_of_latitudes(name):
    assert which_of(name) == "latitude"
    assert which_of("LatAcc") is None
    assert which_of("latency") is None
    assert which_of("Lng") == which_of("longitude") == which_of("home_lon") == "longitude"


@pytest.mark.parametrize(
    ("unix_us", "weeks"), [(0, 0), (10**15 - 1, 0), (10**15, 7), (1_700_000_000_000_000, 7)]
)
def test_the_time_of_a_clock_that_was_never_set_is_no_date(unix_us, weeks):
    assert BY.earlier_us(unix_us) == unix_us - weeks * WEEK_S * 10**6


def test_unknown_positions_stay_unknown():
    zeros = np.zeros(2, np.int32)
    assert (BY.moved("Lat", zeros) == 0).all()
    lost = np.array([2**31 - 1], np.int32)
    assert BY.moved("lon", lost)[0] == lost[0]
    nan = np.array([np.nan])
    assert np.isnan(BY.moved("latitude_deg", nan)[0])


def test_texts():
    assert BY.text(b"EKF3 IMU0 is using GPS") == b"EKF3 IMU0 is using GPS"
    assert BY.text(b"ArduCopter V4.5.7 (2a3dc4b7)") == b"ArduCopter V4.5.7 (2a3dc4b7)"
    text = f"home {OLD.latitude_deg:.6f} {OLD.longitude_deg:.5f}".encode()
    assert str(OLD.latitude_deg)[:6].encode() not in BY.text(text)
    assert BY.text(b"at 192.168.2.15") == b"at 000.000.0.00"
    one, other = BY.text(UID.encode()), BY.text(UID.encode())
    assert one == other != UID.encode()
    assert BY._replace(salt=b"x").text(UID.encode()) != one


@pytest.mark.parametrize("place", [OLD, Coordinates(53.7, 9.8), Coordinates(0.5, 32.0)])
def test_a_similar_place_and_date_have_the_same_field(place):
    found, weeks = similar_place(place, 1.7e9, range(1, 401), 5)
    assert 1 <= weeks <= 400
    fields = [
        earth_field_at(*each, 0.0, 1.7e9 - back * WEEK_S)
        for each, back in ((place, 0), (found, weeks))
    ]
    assert difference(*fields) < 3.0
    assert abs(found.latitude_deg - place.latitude_deg) >= 0.3
    assert np.linalg.norm(metres(found, place)) > 100_000.0
    other, _ = similar_place(place, 1.7e9, range(1, 401), 6)
    apart_m = [np.linalg.norm(metres(each, place)) for each in (found, other)]
    assert abs(apart_m[0] - apart_m[1]) > 1_000.0  # how far away the place is tells nothing


def test_a_place_for_a_date_that_stays_has_nearly_the_same_field():
    found, weeks = similar_place(OLD, 1.7e9, range(1), 5)
    assert weeks == 0
    assert difference(*(earth_field_at(*each, 0.0, 1.7e9) for each in (OLD, found))) < 6.0


def test_what_remains_is_told(tmp_path):
    path = tmp_path / "x"
    path.write_bytes(b"...." + patterns_of([OLD])[0] + b"...." + UID.encode())
    found = remains(path, [OLD], [UID.replace(" ", "-")])
    assert len(found) == 2
    assert "byte 4" in found[0]


def test_of_our_own_log_the_frames_are_left(tmp_path):
    encoder, start_ns = Encoder(1, 1), 1_700_000_000_000_000_000
    path, output = tmp_path / "old.mcap", tmp_path / "new.tlog"
    with Recorder.to_file(path, unix_offset_ns=start_ns) as recorder:
        recorder.attach("configuration.yaml", "application/yaml", b"link: {url: alice}")
        for number, message in enumerate(messages()):
            recorder.raw("udp", start_ns + number * 1_000_000, encoder.encode(message))
    counted, _ = anonymise_frames(open_recording(path), output, BY)
    assert b"alice" not in output.read_bytes()
    assert counted.dropped == 2
    new = read_context(open_recording(output))
    assert new.start_unix_s == pytest.approx(1_700_000_000.0 - 7 * WEEK_S)
    assert new.gps[0].latitude_deg[0] == pytest.approx(NEW.latitude_deg, abs=1e-6)
