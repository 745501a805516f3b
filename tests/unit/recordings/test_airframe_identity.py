"""The same autopilot has the same id, whatever recorded it."""

import random
import struct

import numpy as np
import pytest
from made_logs import START_US, DataflashWriter, ULogWriter
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.airframe_identity import ardupilot_board
from h2nav.recordings.dataflash import open_dataflash
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context
from h2nav.recordings.ulog import open_ulog
from h2nav.wire.codec import Encoder

TEXT = "CubeOrange 002E0023 3433510D 38373934"
SERIAL = bytes.fromhex("23002E000D51333434393738")
PX4_UUID = "000600000000303736303532511100290025"


def telemetry(tmp_path, autopilot, *messages, lost=()):
    beat = mavlink.MAVLink_heartbeat_message(2, autopilot, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
    encoder = Encoder(7, 1)
    frames = [encoder.encode(message) for message in (beat, *messages)]
    path = tmp_path / "log.tlog"
    path.write_bytes(
        b"".join(
            struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i) + frame
            for i, frame in enumerate(frames)
            if i not in lost
        )
    )
    return read_context(open_recording(path))


def version(uid=0, uid2=b""):
    long = list(uid2.ljust(18, b"\0"))
    return mavlink.MAVLink_autopilot_version_message(
        0, 0, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, uid, long
    )


def test_ardupilot_in_telemetry_by_number_and_by_text(tmp_path):
    make = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    by_number = telemetry(tmp_path, make, version(uid2=SERIAL))
    assert by_number.uid == "002E0023-3433510D-38373934"
    assert by_number.system_id == 7
    by_text = telemetry(tmp_path, make, mavlink.MAVLink_statustext_message(6, TEXT.encode()))
    assert (by_text.uid, by_text.board) == (by_number.uid, "CubeOrange")


def test_ardupilots_log(tmp_path):
    writer = DataflashWriter()
    writer.add("MSG", "QZ", "TimeUS,Message", [START_US], [TEXT.encode()])
    path = tmp_path / "log.bin"
    path.write_bytes(writer.bytes())
    context = open_dataflash(path).context()
    assert (context.uid, context.board) == ("002E0023-3433510D-38373934", "CubeOrange")


def test_px4_in_telemetry_and_log(tmp_path):
    found = telemetry(tmp_path, mavlink.MAV_AUTOPILOT_PX4, version(uid2=bytes.fromhex(PX4_UUID)))
    assert found.uid == PX4_UUID
    writer = ULogWriter()
    writer.info("char[36] sys_uuid", PX4_UUID.encode())
    writer.add("cpuload", "float load", START_US + np.arange(9) * 1_000_000, 0.5)
    path = tmp_path / "log.ulg"
    path.write_bytes(writer.bytes())
    assert open_ulog(path).context().uid == PX4_UUID


def test_an_autopilot_without_an_id_has_none(tmp_path):
    assert telemetry(tmp_path, mavlink.MAV_AUTOPILOT_PX4, version()).uid == ""
    old = telemetry(tmp_path, mavlink.MAV_AUTOPILOT_PX4, version(uid=0x1234))
    assert old.uid == "0000000000001234"
    assert ardupilot_board(["PreArm: no 12345678 1234567", "EKF3 IMU0 is using GPS"]) == ("", "")


@pytest.mark.parametrize(("lost", "share"), [((), 0.0), ((2, 3, 7), 0.3)])
def test_frames_that_the_link_lost(tmp_path, lost, share):
    attitude = mavlink.MAVLink_attitude_message(0, 0, 0, 0, 0, 0, 0)
    found = telemetry(tmp_path, mavlink.MAV_AUTOPILOT_PX4, *[attitude] * 9, lost=lost)
    assert found.link_loss_share == pytest.approx(share)


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_a_recording_of_some_messages_alone_has_lost_no_more_than_its_streams(tmp_path, share):
    dice = random.Random(4)
    frames = []
    for number in range(1200):
        frames += [
            mavlink.MAVLink_attitude_message(20 * number, 0, 0, 0, 0, 0, 0),
            mavlink.MAVLink_raw_imu_message(0, *[0] * 9),
        ]
    left_out = [
        place for place, each in enumerate(frames) if each.get_type() == "RAW_IMU"
    ]  # whoever recorded it did not want them
    lost = {*left_out, *(place for place in range(len(frames)) if dice.random() < share)}
    found = telemetry(
        tmp_path, mavlink.MAV_AUTOPILOT_PX4, *frames, lost=[1 + each for each in lost]
    )
    assert found.link_loss_share == pytest.approx(share, abs=0.02)
