"""15: MAVLink 1, and frames of a dialect that we do not know."""

import pytest
from daemon_process import the_log
from fault_flights import fault_flight
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from wire_frames import with_checksum

from h2nav.recordings.recording import open_recording

pytestmark = pytest.mark.thorough

UNKNOWN_ID = 54_321
CRC_EXTRA = 77


def unknown_frame(number: int) -> bytes:
    """A sound frame of an id that is in nobody's dialect."""
    payload = bytes(20)
    head = bytes([0xFD, len(payload), 0, 0, number % 256, 1, 1]) + UNKNOWN_ID.to_bytes(3, "little")
    return with_checksum(head + payload, CRC_EXTRA)


def last_counters(folder):
    return [fields for _, fields in open_recording(the_log(folder)).records("/deframer")][-1]


def test_frames_of_another_dialect_are_counted_and_cost_no_sample(tmp_path):
    with fault_flight(tmp_path) as flight:
        flight.until_state("active")
        before = len(flight.texts)
        for number in range(500):
            flight.vehicle.send_bytes(unknown_frame(number))
            flight.vehicle.fly(0.001)
        flight.until_more_samples()
        assert len(flight.texts) - before <= 1  # one hint at the most
        assert flight.daemon.stop() == 0
    assert last_counters(tmp_path / "logs")["unknown_id"] >= 500


def test_an_autopilot_that_speaks_mavlink_1_is_flown_with(tmp_path):
    with fault_flight(tmp_path) as flight:
        flight.vehicle.speaks_mavlink_1 = True
        flight.until_state("active")
        flight.until_more_samples()
        assert flight.daemon.stop() == 0
    counters = last_counters(tmp_path / "logs")
    assert counters["frames_v1"] >= 150
    assert counters["bad_crc"] == 0


@pytest.mark.parametrize("crc_extra", [0, 1])
def test_a_message_that_the_sender_has_changed_is_counted_and_never_used(tmp_path, crc_extra):
    """Another dialect may give RAW_IMU's id to other fields; its checksum then does not fit."""
    with fault_flight(tmp_path) as flight:
        del flight.vehicle.rates_hz["RAW_IMU"]
        raw_imu = mavlink.MAVLINK_MSG_ID_RAW_IMU.to_bytes(3, "little")
        head = bytes([0xFD, 26, 0, 0, 0, 1, 1]) + raw_imu
        frame = with_checksum(head + bytes(26), crc_extra)
        flight.until_state("no_imu")
        for _ in range(100):
            flight.vehicle.send_bytes(frame)
            flight.vehicle.fly(0.001)
        flight.until(lambda: len(flight.vehicle.messages("HEARTBEAT")) >= 3)
        assert flight.status["samples_used"] == 0
        assert flight.daemon.stop() == 0
    assert last_counters(tmp_path / "logs")["bad_crc"] >= 100
