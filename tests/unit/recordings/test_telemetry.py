"""The context of recorded telemetry says what its messages say, in our units and frames."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from replayed import TAKEOFF

from h2nav.errors import BadInput
from h2nav.integrity.findings import Severity
from h2nav.maths.quaternion import from_euler
from h2nav.recordings.context import Context
from h2nav.recordings.frame_tables import tables
from h2nav.recordings.recording import open_recording
from h2nav.recordings.rotations import quaternions
from h2nav.recordings.telemetry import MESSAGE_IDS, context_of, read_context
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.readers import READERS

START_US = 1_700_000_000_000_000
GUIDED, LAND = 4, 9


def context(path: Path) -> Context:
    recording = open_recording(path)
    arrivals = [t_ns for t_ns, _ in recording.received()]
    found = tables(recording, MESSAGE_IDS)
    return context_of(found, arrivals[0], arrivals[-1], recording.unix_offset_ns, {})


def recorded(path: Path, *messages: tuple[float, object], sender: int = 1) -> Path:
    """A telemetry log of messages at times in s."""
    encoder = Encoder(sender, 1)
    entries = [
        struct.pack(">Q", START_US + round(t_s * 1e6)) + encoder.encode(message)
        for t_s, message in messages
    ]
    path.write_bytes(b"".join(entries))
    return path


def beat(mode: int, *, armed: bool, autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA) -> object:
    base = mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
    base |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_QUADROTOR, autopilot, base, mode, 4, 3
    )


def test_samples_are_those_that_the_service_reads():
    deframer = Deframer()
    readings = [
        READERS[frame.msg_id](decode(frame))
        for _, data in open_recording(TAKEOFF).received()
        for frame in deframer.feed(data)
        if frame.msg_id == mavlink.MAVLINK_MSG_ID_RAW_IMU
    ]
    track = context(TAKEOFF).imus[0]
    assert track.source == "RAW_IMU"
    np.testing.assert_array_equal(track.w_b, [reading.w_b for reading in readings])
    np.testing.assert_array_equal(track.f_b, [reading.f_b for reading in readings])
    np.testing.assert_array_equal(track.m_b_ut, [reading.m_b_ut for reading in readings])
    np.testing.assert_array_equal(track.stamp_us, [reading.time for reading in readings])


def test_a_flight_has_its_imus_estimators_truth_receiver_and_times():
    found = context(TAKEOFF)
    assert [track.imu for track in found.imus] == [0, 1]
    assert [track.name for track in found.attitudes] == ["autopilot"]
    assert found.truth is not None
    assert found.duration_s == pytest.approx(40.0, abs=0.1)
    assert found.imus[0].t_s[0] >= 0.0
    assert found.imus[0].t_s[-1] <= found.duration_s
    assert found.gps[0].has_fix.all()
    assert [mode.name for mode in found.modes] == ["STABILIZE", "GUIDED"]
    assert [span.name for span in found.armed] == ["armed"]
    assert found.vehicle == "quadrotor"
    assert found.missing == ("no throttle",)


def test_attitudes_are_the_quaternions_of_their_angles():
    angles = np.random.default_rng(5).uniform(-3.0, 3.0, (50, 3))
    expected = np.array([from_euler(*row) for row in angles])
    same = np.sign((quaternions(angles) * expected).sum(axis=1, keepdims=True))
    np.testing.assert_allclose(same * quaternions(angles), expected, atol=1e-15)


def test_modes_and_arming_follow_the_heartbeats(tmp_path):
    beats = [beat(GUIDED, armed=False), beat(GUIDED, armed=True), beat(LAND, armed=True)]
    messages = [(float(t_s), beats[min(t_s // 2, 2)]) for t_s in range(7)]
    found = context(recorded(tmp_path / "beats.tlog", *messages))
    assert [(mode.name, mode.from_s, mode.to_s) for mode in found.modes] == [
        ("GUIDED", 0.0, 4.0),
        ("LAND", 4.0, 6.0),
    ]
    assert [(span.from_s, span.to_s) for span in found.armed] == [(2.0, 6.0)]


@pytest.mark.parametrize(("apart_s", "is_read"), [(1_000.0, True), (20_000.0, False)])
def test_a_few_messages_in_a_day_have_damaged_times(tmp_path, apart_s, is_read):
    """A review needed memory for every second of years."""
    beats = [(apart_s * i, beat(GUIDED, armed=True)) for i in range(20)]
    recording = open_recording(recorded(tmp_path / "x.tlog", *beats))
    if is_read:
        assert read_context(recording).duration_s == pytest.approx(19_000.0)
        return
    with pytest.raises(BadInput, match="20 messages within 106 h"):
        read_context(recording)


def test_texts_in_pieces_become_whole(tmp_path):
    text = "x" * 49 + "\u00e4"  # a character that the end of a chunk cuts in two
    pieces = [
        mavlink.MAVLink_statustext_message(4, b"alone"),
        mavlink.MAVLink_statustext_message(2, text.encode()[:50], id=7, chunk_seq=0),
        mavlink.MAVLink_statustext_message(2, text.encode()[50:] + b"rest", id=7, chunk_seq=1),
    ]
    messages = [(0.0, beat(GUIDED, armed=False)), *((1.0, piece) for piece in pieces)]
    found = context(recorded(tmp_path / "texts.tlog", *messages))
    assert [(said.text, said.severity) for said in found.said] == [
        ("alone", Severity.WARNING),
        (text + "rest", Severity.CRITICAL),
    ]


def test_wind_blows_to_where_the_air_moves(tmp_path):
    wind = mavlink.MAVLink_wind_message(90.0, 5.0, 0.0)  # from the east
    path = recorded(tmp_path / "wind.tlog", (0.0, beat(GUIDED, armed=False)), (1.0, wind))
    found = context(path)
    assert found.wind_n_m_s is not None
    np.testing.assert_allclose(found.wind_n_m_s.values, [[0.0, -5.0]], atol=1e-12)


def test_a_velocity_that_the_receiver_does_not_know_is_none(tmp_path):
    def fix(speed: int, course: int) -> object:
        return mavlink.MAVLink_gps_raw_int_message(
            0, 3, 470000000, 80000000, 5000, 1, 1, speed, course, 255
        )

    path = recorded(
        tmp_path / "gps.tlog",
        (0.0, beat(GUIDED, armed=False)),
        (1.0, fix(300, 9000)),
        (2.0, fix(65535, 9000)),
    )
    (receiver,) = context(path).gps
    np.testing.assert_allclose(receiver.v_n[0, :2], [0.0, 3.0], atol=1e-12)
    assert math.isnan(receiver.v_n[1, 0])
    assert np.isnan(receiver.satellites).all()
    np.testing.assert_allclose(receiver.latitude_deg, 47.0)


@pytest.mark.parametrize(
    ("autopilot", "sent"),
    [
        (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 658953.0),
        (mavlink.MAV_AUTOPILOT_PX4, struct.unpack("<f", struct.pack("<i", 658953))[0]),
    ],
)
def test_integer_parameters_are_what_was_set(tmp_path, autopilot, sent):
    def value(name: bytes, number: float, kind: int) -> object:
        return mavlink.MAVLink_param_value_message(name, number, kind, 2, 0)

    path = recorded(
        tmp_path / "set.tlog",
        (0.0, beat(GUIDED, armed=False, autopilot=autopilot)),
        (1.0, value(b"CAL_MAG0_ID", sent, mavlink.MAV_PARAM_TYPE_INT32)),
        (2.0, value(b"CAL_MAG0_XOFF", 0.25, mavlink.MAV_PARAM_TYPE_REAL32)),
    )
    assert context(path).parameters == {"CAL_MAG0_ID": 658953.0, "CAL_MAG0_XOFF": 0.25}


def test_another_sender_is_not_heard(tmp_path):
    wind = mavlink.MAVLink_wind_message(90.0, 5.0, 0.0)
    own = recorded(tmp_path / "own.tlog", (0.0, beat(GUIDED, armed=False)), sender=1)
    other = recorded(tmp_path / "other.tlog", (1.0, wind), sender=2)
    both = tmp_path / "both.tlog"
    both.write_bytes(own.read_bytes() + other.read_bytes())
    assert context(both).wind_n_m_s is None


def test_without_an_autopilot_it_says_what_is_missing(tmp_path):
    wind = mavlink.MAVLink_wind_message(90.0, 5.0, 0.0)
    found = context(recorded(tmp_path / "nobody.tlog", (0.0, wind), (1.0, wind)))
    assert found.imus == ()
    assert "no IMU samples" in found.missing
    assert any("heartbeats" in phrase for phrase in found.missing)
