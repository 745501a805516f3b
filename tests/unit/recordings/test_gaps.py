"""What recordings leave open or cut off: no file, half a record, values that mean unknown."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from made_logs import START_US, ULogWriter, dataflash, made_flight, ulog
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput
from h2nav.recordings.dataflash_tables import read_dataflash
from h2nav.recordings.opening import open_flight
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context
from h2nav.recordings.ulog import open_ulog
from h2nav.wire.codec import Encoder

FLIGHT = made_flight(duration_s=5.0, imus=1, rates_s=0.0, field_s=0.0)
TIMES = START_US + np.arange(0, 5_000_000, 100_000, dtype=np.int64)
BEAT = mavlink.MAVLink_heartbeat_message(
    mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 128, 0, 4, 3
)


def heard(path: Path, *messages: object):
    """The context of telemetry with a message each millisecond."""
    encoder = Encoder(1, 1)
    path.write_bytes(
        b"".join(
            struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i) + encoder.encode(message)
            for i, message in enumerate((BEAT, *messages))
        )
    )
    return read_context(open_recording(path))


def flown(path: Path, writer: ULogWriter):
    path.write_bytes(ulog(FLIGHT, extra=writer))
    return open_ulog(path).context()


def test_a_folder_is_no_recording(tmp_path: Path):
    with pytest.raises(BadInput, match=r"is not a file but a folder; .* 'h2nav fleet'"):
        open_flight(tmp_path)


def test_half_a_record_at_the_end_is_counted_once(tmp_path: Path):
    path = tmp_path / "log.bin"
    data = dataflash(FLIGHT)
    path.write_bytes(data)
    whole = dict(read_dataflash(path).notes)
    path.write_bytes(data[:-2])
    cut = dict(read_dataflash(path).notes)
    assert whole == {}
    assert cut == {"a record is cut off at the end": 1}
    path.write_bytes(data + b"\xa3")
    assert dict(read_dataflash(path).notes) == {"bytes that are no record": 1}


def test_a_battery_without_a_voltage_is_none(tmp_path: Path):
    def battery(millivolts: int, percent: int):
        told = (0, 0, 0, 0, millivolts, -1, percent, *[0] * 6)
        return heard(tmp_path / "log.tlog", mavlink.MAVLink_sys_status_message(*told)).batteries

    assert battery(0, 50) == ()
    assert battery(0xFFFF, 50) == ()
    (known,) = battery(12_000, -1)
    assert known.voltage_v[0] == pytest.approx(12.0)
    assert math.isnan(known.current_a[0])
    assert math.isnan(known.remaining[0])


def test_a_field_of_zeros_is_no_field(tmp_path: Path):
    def raw(field: tuple[int, int, int]):
        values = (0, 0, -1000, 1, 2, 3, *field)
        messages = [mavlink.MAVLink_raw_imu_message(i * 10_000, *values) for i in range(1, 4)]
        return heard(tmp_path / "log.tlog", *messages).imus[0].m_b_ut

    assert np.isnan(raw((0, 0, 0))).all()
    assert raw((100, 0, -300))[0] == pytest.approx((10.0, 0.0, -30.0))


def test_what_px4_does_not_know_is_negative(tmp_path: Path):
    writer = ULogWriter()
    fields = "float voltage_v;float current_a;float remaining"
    writer.add("battery_status", fields, TIMES, 16.0, -0.5, -1.0)
    (battery,) = flown(tmp_path / "log.ulg", writer).batteries
    assert battery.voltage_v[0] == 16.0
    assert np.isnan(battery.current_a).all()
    assert np.isnan(battery.remaining).all()


def test_px4s_batteries_are_those_with_a_voltage(tmp_path: Path):
    writer = ULogWriter()
    late = np.where(TIMES[5] > TIMES, np.nan, 12.0)  # measured later than reported
    for number, volts in enumerate((0.0, late, 15.0)):
        writer.add("battery_status", "float voltage_v", TIMES, volts, number=number)
    batteries = flown(tmp_path / "log.ulg", writer).batteries
    assert [(one.number, one.voltage_v[-1]) for one in batteries] == [(1, 12.0), (2, 15.0)]


def test_the_range_of_px4s_outputs_is_that_of_its_parameters(tmp_path: Path):
    def motors(**parameters: float):
        writer = ULogWriter()
        for name, value in parameters.items():
            writer.parameter(name, value)
        writer.parameter("MAV_TYPE", 2.0)
        pwm_us = np.full((len(TIMES), 16), 1500.0)
        writer.add("actuator_outputs", "float[16] output", TIMES, pwm_us)
        found = flown(tmp_path / "log.ulg", writer).motors
        return found.least_us, found.most_us

    assert motors() == (1000.0, 2000.0)
    assert motors(PWM_MIN=1075.0, PWM_MAX=1950.0) == (1075.0, 1950.0)
    assert motors(PWM_MAIN_MIN=1100.0, PWM_MIN=1075.0) == (1100.0, 2000.0)
