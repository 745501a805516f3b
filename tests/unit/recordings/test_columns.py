"""The column tables: what each format stores comes out in the same unit, under the same name."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from made_logs import START_US, DataflashWriter, ULogWriter
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.quaternion import from_euler
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.autopilot_log import has_enough_samples
from h2nav.recordings.columns import Format, messages_of
from h2nav.recordings.context import Context
from h2nav.recordings.dataflash import open_dataflash
from h2nav.recordings.field_tables import FIELDS
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context
from h2nav.recordings.ulog import open_ulog
from h2nav.wire.codec import Encoder
from h2nav.wire.dialect import LAYOUTS
from h2nav.wire.position import GnssState

TIMES = START_US + np.arange(0, 10_000_000, 100_000, dtype=np.int64)
MOVES = np.linspace(0.0, 1.0, len(TIMES))


def dataflash(tmp_path: Path, writer: DataflashWriter) -> Context:
    path = tmp_path / "log.bin"
    path.write_bytes(writer.bytes())
    return open_dataflash(path).context()


def ulog(tmp_path: Path, writer: ULogWriter) -> Context:
    path = tmp_path / "log.ulg"
    path.write_bytes(writer.bytes())
    return open_ulog(path).context()


def telemetry(tmp_path: Path, *messages: mavlink.MAVLink_message) -> Context:
    encoder = Encoder(1, 1)
    kinds = (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    beat = mavlink.MAVLink_heartbeat_message(*kinds, 0, 0, mavlink.MAV_STATE_ACTIVE, 3)
    path = tmp_path / "log.tlog"
    path.write_bytes(
        b"".join(
            struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i) + encoder.encode(message)
            for i, message in enumerate((beat, *messages))
        )
    )
    return read_context(open_recording(path))


def parameter(name: str, value: float) -> mavlink.MAVLink_message:
    return mavlink.MAVLink_param_value_message(name.encode(), value, 9, 1, 0)


def test_every_message_of_telemetry_is_one_of_the_dialect():
    assert messages_of(Format.TELEMETRY, FIELDS) <= {layout.name for layout in LAYOUTS.values()}


def test_the_sticks_point_the_same_way_in_every_format(tmp_path: Path):
    """Right, nose up, right, a quarter of the throttle."""
    writer = DataflashWriter()
    names = np.array([b"RCMAP_ROLL", b"RCMAP_YAW", b"RC2_REVERSED", b"RC3_MIN", b"RC3_MAX"])
    values = [4.0, 1.0, 1.0, 1100.0, 1900.0]
    writer.add("PARM", "QNf", "TimeUS,Name,Value", np.full(5, START_US), names, values)
    writer.add("RCIN", "QHHHH", "TimeUS,C1,C2,C3,C4", TIMES, 1750, 1250, 1300, 2000)
    old = ULogWriter()
    fields = "float x;float y;float z;float r"
    old.add("manual_control_setpoint", fields, TIMES, -0.5, 1.0, 0.25, 0.5)
    new = ULogWriter()
    fields = "float roll;float pitch;float yaw;float throttle"
    new.add("manual_control_setpoint", fields, TIMES, 1.0, -0.5, 0.5, -0.5)
    widths = (2000, 1750, 1250, 1750, *[65535] * 14)
    channels = mavlink.MAVLink_rc_channels_message(0, 4, *widths, 255)
    for context in (
        dataflash(tmp_path, writer),
        ulog(tmp_path, old),
        ulog(tmp_path, new),
        telemetry(tmp_path, channels),
    ):
        assert context.sticks is not None
        found = [column[0] for column in context.sticks[1:]]
        assert found == pytest.approx([1.0, 0.5, 0.5, 0.25])


def test_parameters_that_are_no_numbers_are_none(tmp_path: Path):
    """A map of channels, and the function of an output."""
    widths = (2000, 1750, 1250, 1750, *[65535] * 14)
    context = telemetry(
        tmp_path,
        parameter("RCMAP_ROLL", math.nan),
        parameter("SERVO1_FUNCTION", math.inf),
        mavlink.MAVLink_rc_channels_message(0, 4, *widths, 255),
        mavlink.MAVLink_servo_output_raw_message(0, 0, 1500, 1600, 1700, 1800, 0, 0, 0, 0),
    )
    assert context.parameters == {}
    assert context.sticks is not None
    assert context.sticks.roll[0] == 1.0
    assert context.motors is not None
    assert context.motors.numbers == (1, 2, 3, 4)


def test_motors_are_those_of_the_first_port(tmp_path: Path):
    messages = [
        mavlink.MAVLink_servo_output_raw_message(0, port, 1500 + port, *[1600] * 7)
        for port in (1, 0, 1)
    ]
    context = telemetry(tmp_path, *messages)
    assert [(bank.number, bank.values[0, 0]) for bank in context.outputs] == [(0, 1500), (1, 1501)]
    assert context.motors is not None
    assert context.motors.pwm_us[:, 0].tolist() == [1500.0]


def test_sticks_of_px4_need_its_map_of_channels(tmp_path: Path):
    writer = ULogWriter()
    writer.add("input_rc", "uint16_t[18] values", TIMES, [2000, 1250, 1250, 1750, *[0] * 14])
    assert ulog(tmp_path, writer).sticks is None
    for axis, channel in (("ROLL", 1), ("PITCH", 2), ("THROTTLE", 3), ("YAW", 4)):
        writer.parameter(f"RC_MAP_{axis}", channel)
    found = ulog(tmp_path, writer).sticks
    assert found is not None
    assert [column[0] for column in found[1:]] == pytest.approx([1.0, 0.5, 0.5, 0.25])


def test_a_sensor_is_as_healthy_as_the_autopilot_says(tmp_path: Path):
    late = np.where(TIMES[50] <= TIMES, 2**31 - 1, 0)
    writer = DataflashWriter()
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,GH,AH"
    values = (0.0, 0.0, 0.0, 0.0, 0.0, -9.8, 7, 8)
    writer.add("IMU", "QBffffffIIBB", columns, TIMES, 1, *values, late == 0, 1)
    px4 = ULogWriter()
    px4.add("sensor_combined", "int32_t accelerometer_timestamp_relative", TIMES, late)
    fields = "uint32_t accel_error_count;uint32_t gyro_error_count"
    px4.add("vehicle_imu_status", fields, TIMES, 8, 7)
    both = mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    well = mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    status = mavlink.MAVLink_sys_status_message(both, both, well, *[0] * 10)
    gyro, accelerometer = dataflash(tmp_path, writer).health
    assert (gyro.kind, gyro.number, accelerometer.kind) == ("gyro", 1, "accelerometer")
    assert (gyro.healthy.tolist(), set(gyro.errors)) == ([1.0] * 50 + [0.0] * 50, {7.0})
    found = {(one.kind, one.number): one for one in ulog(tmp_path, px4).health[:2]}
    assert set(found["gyro", 0].errors) == {7.0}
    assert np.isnan(found["gyro", 0].healthy).all()
    timed = ulog(tmp_path, px4).health[-1]
    assert (timed.kind, timed.healthy.tolist()) == ("accelerometer", [1.0] * 50 + [0.0] * 50)
    assert {(one.kind, one.healthy[0]) for one in telemetry(tmp_path, status).health} == {
        ("gyro", 0.0),
        ("accelerometer", 1.0),
    }


def test_heights_of_every_source_point_up(tmp_path: Path):
    writer = DataflashWriter()
    writer.add("CTUN", "Qfh", "TimeUS,Alt,CRt", TIMES, 10.0, 250)
    writer.add("XKF1", "QBff", "TimeUS,C,PD,VD", TIMES, 1, -11.0, -2.5)
    writer.add("BARO", "QBff", "TimeUS,I,Alt,CRt", TIMES, 0, 12.0, 2.5)
    columns = "TimeUS,Instance,Dist,Stat,Orient"
    writer.add("RFND", "QBfBB", columns, TIMES, 0, 9.0, np.where(MOVES < 0.5, 4, 2), 25)
    px4 = ULogWriter()
    px4.add("vehicle_local_position", "float z;float vz", TIMES, -10.0, -2.5)
    px4.add("vehicle_air_data", "float baro_alt_meter", TIMES, 12.0)
    fields = "float current_distance;float min_distance;float max_distance;uint8_t orientation"
    px4.add("distance_sensor", fields, TIMES, np.where(MOVES < 0.5, 9.0, 50.0), 0.1, 20.0, 25)
    messages = (
        mavlink.MAVLink_global_position_int_message(0, 0, 0, 0, 10_000, 0, 0, -250, 0),
        mavlink.MAVLink_scaled_pressure_message(0, 1013.25, 0.0, 2000),
        mavlink.MAVLink_distance_sensor_message(0, 10, 2000, 900, 0, 0, 25, 0),
    )
    for context in (dataflash(tmp_path, writer), ulog(tmp_path, px4)):
        found = {track.kind: track for track in context.heights}
        assert (found["estimator"].height_m[0], found["estimator"].climb_m_s[0]) == (10.0, 2.5)
        assert found["barometer"].height_m[0] == 12.0
        down = found["rangefinder"].height_m
        assert (down[0], np.isnan(down[-1])) == (9.0, True)
    core = next(one for one in dataflash(tmp_path, writer).heights if one.kind == "EKF3")
    assert (core.number, core.height_m[0], core.climb_m_s[0]) == (1, 11.0, 2.5)
    wired = {one.kind: one.height_m[0] for one in telemetry(tmp_path, *messages).heights}
    assert wired == pytest.approx({"estimator": 10.0, "barometer": 0.0, "rangefinder": 9.0})


def test_the_load_of_the_processor_is_a_share(tmp_path: Path):
    writer = DataflashWriter()
    writer.add("PM", "QH", "TimeUS,Load", TIMES, 375)
    px4 = ULogWriter()
    px4.add("cpuload", "float load", TIMES, 0.375)
    status = mavlink.MAVLink_sys_status_message(0, 0, 0, 375, *[0] * 9)
    for context in (
        dataflash(tmp_path, writer),
        ulog(tmp_path, px4),
        telemetry(tmp_path, status),
    ):
        load = context.measured["load"]
        assert load is not None
        assert load.values[0] == pytest.approx(0.375)


def test_motors_of_px4_are_those_that_its_bank_drives(tmp_path: Path):
    """px4io is silent, the ESCs are on CAN, and the auxiliary pins hold still, in most rows."""
    writer = ULogWriter()
    writer.add("vehicle_status", "uint8_t vehicle_type", TIMES, 1)
    outputs = np.zeros((len(TIMES), 16))
    driven = outputs.copy()
    driven[:, :4] = 4000.0 + 2000.0 * MOVES[:, None] + np.arange(4)
    still = outputs.copy()
    still[:, :4] = (1450, 1008, 1000, 1500)
    writer.add("actuator_outputs", "float[16] output", TIMES[:-5], outputs[:-5])
    writer.add("actuator_outputs", "float[16] output", TIMES[:-3], driven[:-3], number=1)
    writer.add("actuator_outputs", "float[16] output", TIMES, still, number=2)
    motors = ulog(tmp_path, writer).motors
    assert motors is not None
    assert len(motors.t_s) == len(TIMES) - 3
    assert motors.share()[0] == pytest.approx([(4000 + i) / 8191 for i in range(4)])
    # A parameter names the outputs, whichever bank it is of.
    for output, number in ((1, 102), (2, 101), (3, 104), (4, 103)):
        writer.parameter(f"UAVCAN_EC_FUNC{output}", number)
    motors = ulog(tmp_path, writer).motors
    assert motors is not None
    assert motors.share()[0] == pytest.approx([(4000 + i) / 8191 for i in (1, 0, 3, 2)])


def test_a_pause_of_everything_is_a_silence(tmp_path: Path):
    quiet = (TIMES[40] > TIMES) | (TIMES[60] < TIMES)
    writer = DataflashWriter()
    writer.add("CTUN", "Qf", "TimeUS,Alt", TIMES[quiet], 10.0)
    writer.add("BARO", "Qf", "TimeUS,Alt", TIMES[quiet][::2], 10.0)
    (span,) = dataflash(tmp_path, writer).silent
    assert (span.from_s, span.to_s) == pytest.approx((3.9, 6.1))
    writer.add("BAT", "Qf", "TimeUS,Volt", TIMES[~quiet], 12.0)
    assert dataflash(tmp_path, writer).silent == ()


def test_the_estimator_that_flew_is_that_of_each_row(tmp_path: Path):
    writer = DataflashWriter()
    active = np.where(MOVES < 0.5, 0, 3)
    columns = "TimeUS,Roll,Pitch,Yaw,AEKF"
    writer.add("ATT", "QfffB", columns, TIMES, 1.0, 2.0, 3.0, active)
    assert [span.name for span in dataflash(tmp_path, writer).flown_by] == ["DCM", "EKF3"]


def test_fields_tell_where_they_come_from(tmp_path: Path):
    writer = DataflashWriter()
    writer.add("CURR", "Qff", "TimeUS,Volt,Curr", TIMES, 12.0, 3.0)
    origins = dataflash(tmp_path, writer).origins
    assert (origins["batteries"], origins["current_a"]) == ("CURR", "CURR.Curr")


# --- estimators and sensors -----------------------------------------------------------------------


def test_an_attitude_is_the_same_in_every_format_where_it_is_one(tmp_path: Path):
    """In degrees, as a quaternion of length 1, in radians; the last row is damaged."""
    angles = np.tile((0.2, -0.1, 1.5), (len(TIMES), 1))
    angles[-1] = np.nan
    q_nb = np.array([from_euler(*row) for row in angles])
    q_nb[-1] = 7.0
    writer = DataflashWriter()
    for name in ("ATT", "AHR2", "SIM"):
        writer.add(name, "Qfff", "TimeUS,Roll,Pitch,Yaw", TIMES, *np.degrees(angles).T)
    writer.add("XKQ1", "Qffff", "TimeUS,Q1,Q2,Q3,Q4", TIMES, *q_nb.T)
    writer.add("NKF6", "Qfff", "TimeUS,Roll,Pitch,Yaw", TIMES, *np.degrees(angles).T)
    px4 = ULogWriter()
    for name in ("vehicle_attitude", "estimator_attitude", "vehicle_attitude_groundtruth"):
        px4.add(name, "uint64_t timestamp_sample;float[4] q", TIMES, TIMES - 2000, q_nb)
    wired = [
        message
        for row in angles.tolist()
        for message in (
            mavlink.MAVLink_attitude_message(0, *row, 0, 0, 0),
            mavlink.MAVLink_ahrs2_message(*row, 0, 0, 0),
            mavlink.MAVLink_simstate_message(*row, *[0] * 8),
        )
    ]
    for context, names in (
        (dataflash(tmp_path, writer), ["autopilot", "EKF3 core 1", "EKF2 core 2", "AHRS2"]),
        (ulog(tmp_path, px4), ["EKF2", "EKF2 instance 1"]),
        (telemetry(tmp_path, *wired), ["autopilot", "autopilot's second (AHRS2)"]),
    ):
        assert [track.name for track in context.attitudes] == names
        assert context.truth is not None
        for track in (*context.attitudes, context.truth):
            assert len(track.t_s) == len(TIMES) - 1
            np.testing.assert_allclose(track.q_nb, q_nb[:-1], atol=1e-6)
    # As old as its samples.
    assert ulog(tmp_path, px4).attitudes[0].t_s[5] == pytest.approx(0.498)


def test_samples_of_an_imu_are_the_same_in_every_format(tmp_path: Path):
    """Of the second IMU, where a message tells; the field comes in gauss, in milligauss or not."""
    w_b, f_b, m_b_ut = (0.5, -0.25, 1.0), (1.0, 2.0, -9.0), (20.0, 1.0, 40.0)
    writer = DataflashWriter()
    columns = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,GH,AH"
    writer.add("IMU", "QBffffffBB", columns, TIMES, 1, *w_b, *f_b, 1, np.arange(len(TIMES)) > 0)
    integrals, combined, single = ULogWriter(), ULogWriter(), ULogWriter()
    fields = "float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt"
    deltas = (np.multiply(w_b, 0.01), np.multiply(f_b, 0.02), 10_000)
    fields += ";uint32_t delta_velocity_dt;uint32_t accel_device_id;uint32_t gyro_device_id"
    integrals.add("vehicle_imu", fields, TIMES, *deltas, 20_000, 11, 12, number=1)
    fields = "float[3] gyro_rad;float[3] accelerometer_m_s2;float gyro_integral_dt"
    combined.add("sensor_combined", fields, TIMES, w_b, f_b, 0.01)
    fields = "uint32_t accel_device_id;uint32_t gyro_device_id"
    combined.add("sensor_selection", fields, TIMES, 11, 12)
    for topic, values in (("sensor_gyro", w_b), ("sensor_accel", f_b)):
        single.add(topic, "float x;float y;float z", TIMES, *values, number=1)
    whole = [[round(x * 1000 / unit) for x in v] for v, unit in ((f_b, GRAVITY_M_S2), (w_b, 1.0))]
    second = mavlink.MAVLink_scaled_imu2_message(7, *whole[0], *whole[1], 200, 10, 400)
    gauss = np.divide(m_b_ut, 100.0)
    precise = mavlink.MAVLink_highres_imu_message(7000, *f_b, *w_b, *gauss, 0, 0, 0, 0, 0x1FF, id=1)
    own = [ulog(tmp_path, one) for one in (integrals, combined, single)]
    wired = [telemetry(tmp_path, one) for one in (second, precise)]
    for context, imu, count in (
        (dataflash(tmp_path, writer), 1, len(TIMES) - 1),
        *zip(own, (1, 0, 1), [len(TIMES)] * 3, strict=True),
        *((context, 1, 1) for context in wired),
    ):
        (track,) = context.imus
        assert (track.imu, len(track.t_s)) == (imu, count)
        np.testing.assert_allclose(track.w_b[0], w_b, atol=1e-6)
        np.testing.assert_allclose(track.f_b[0], f_b, atol=0.005)
    assert [context.imus[0].device_ids for context in own] == [(11, 12), (11, 12), (0, 0)]
    for context in wired:
        assert context.imus[0].stamp_us.tolist() == [7000]
        np.testing.assert_allclose(context.imus[0].m_b_ut, [m_b_ut], atol=1e-6)


def test_fields_of_a_compass_are_the_same_in_every_format(tmp_path: Path):
    """With their offsets under both names; one device of two; not in each row that repeats it."""
    columns = "TimeUS,I,MagX,MagY,MagZ,OfsX,OfsY,OfsZ,{0}X,{0}Y,{0}Z,Health"
    healthy = np.arange(len(TIMES)) != 3
    values = (1, 200, 10, 400, 50, -60, 70, 1, 2, 3, healthy)
    contexts = []
    for motor in ("MO", "MOfs"):
        writer = DataflashWriter()
        writer.add("MAG", "QBhhhhhhhhhB", columns.format(motor), TIMES, *values)
        contexts.append(dataflash(tmp_path, writer))
    px4 = ULogWriter()
    device = np.where(np.arange(len(TIMES)) == 3, 8, 7)
    fields = "float[3] magnetometer_ga;uint32_t device_id"
    px4.add("vehicle_magnetometer", fields, TIMES, (0.2, 0.01, 0.4), device, number=1)
    contexts.append(ulog(tmp_path, px4))
    for context in contexts:
        (track,) = context.compasses
        assert (track.compass, len(track.t_s)) == (1, len(TIMES) - 1)
        np.testing.assert_allclose(track.m_b_ut[0], (20.0, 1.0, 40.0), atol=1e-6)
        (statistics,) = context.compass_rows
        assert (statistics.compass, statistics.rows, statistics.changes) == (1, len(TIMES), 0)
    for context in contexts[:2]:
        np.testing.assert_allclose(context.compasses[0].offset_ut[0], (5.0, -6.0, 7.0))
        np.testing.assert_allclose(context.compasses[0].motor_ut[0], (0.1, 0.2, 0.3))
    assert contexts[2].compasses[0].device_id == 7
    old = ULogWriter()
    place = np.arange(len(TIMES))
    late_us = np.where(place < 50, TIMES[place // 2 * 2] - TIMES - 10_000, 2**31 - 1)
    fields = "float[3] gyro_rad;float[3] accelerometer_m_s2;float[3] magnetometer_ga"
    fields += ";int32_t magnetometer_timestamp_relative"
    values = (0.0, (0.0, 0.0, -9.8), (0.2, 0.01, 0.4), late_us)
    old.add("sensor_combined", fields, TIMES, *values)
    context = ulog(tmp_path, old)
    assert (context.compasses, context.compass_rows) == ((), ())
    assert np.isfinite(context.imus[0].m_b_ut[:, 0]).sum() == 25


def test_fixes_are_the_same_in_every_format(tmp_path: Path):
    """3 m/s east; the second is not on earth, the third has no velocity, the last is no fix.

    Of the last one the vertical velocity alone is impossible.
    """
    t_us, down = TIMES[:4], np.array((-1.5, -1.5, -1.5, 5_000.0))
    latitude, has_velocity, kind = [47.0, 100.0, 47.0, 47.0], [1, 1, 0, 1], [3, 3, 3, 1]
    speed = np.where(has_velocity, 3.0, 2_000.0)
    writer, powered = DataflashWriter(), "TimeUS,Instance,noisePerMS,jamInd,aPower,agcCnt,config"
    columns = "TimeUS,I,Status,GMS,GWk,NSats,Lat,Lng,Alt,Spd,GCrs,VZ"
    place = (latitude, 8.0, 500.0)
    values = (kind, 100_000_000, 2_300, 12, *place, speed, 90.0, down)
    writer.add("GPS", "QBBIHBLLefff", columns, t_us, 0, *values)
    writer.add("GPA", "QBfBI", "TimeUS,I,SAcc,VV,SMS", t_us, 0, 0.2, 1, t_us // 1000 - 50)
    writer.add("UBX1", "QBHBBHB", powered, t_us, 0, 80, 5, 0, 60, 0)
    beside = (np.zeros(4), speed, down, 0.2, 12, 1, 2, 80, 5, 60)
    fields = "uint8_t fix_type;{};float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
    fields += "float s_variance_m_s;uint8_t satellites_used;uint8_t jamming_state;"
    fields += "uint8_t spoofing_state;uint16_t noise_per_ms;uint16_t jamming_indicator;"
    fields += "uint16_t automatic_gain_control"
    new, old = ULogWriter(), ULogWriter()
    names = "double latitude_deg;double longitude_deg;double altitude_msl_m"
    fixes = (kind, *place, *beside, t_us - 50_000)
    new.add("sensor_gps", f"{fields.format(names)};uint64_t timestamp_sample", t_us, *fixes)
    names = "int32_t lat;int32_t lon;int32_t alt"
    fixes = (kind, np.multiply(latitude, 1e7), 80_000_000, 500_000, *beside)
    old.add("vehicle_gps_position", fields.format(names), t_us, *fixes)
    widths = np.where(has_velocity, 300, 65535)
    wired = [
        mavlink.MAVLink_gps_raw_int_message(
            0, each, round(north * 1e7), 80_000_000, 500_000, 0, 0, width, 9000, 12, vel_acc=200
        )
        for each, north, width in zip(kind, latitude, widths.tolist(), strict=True)
    ]
    logs = [dataflash(tmp_path, writer), ulog(tmp_path, new), ulog(tmp_path, old)]
    for context in (*logs, telemetry(tmp_path, *wired)):
        (track,) = context.gps
        assert track.has_fix.tolist() == [True, False, True, False]
        np.testing.assert_allclose(track.latitude_deg, latitude)
        assert (track.longitude_deg[0], track.altitude_m[0]) == pytest.approx((8.0, 500.0))
        assert np.isnan(track.v_n[2, :2]).all()
        np.testing.assert_allclose(track.v_n[[0, 1, 3], :2], [[0.0, 3.0]] * 3, atol=1e-9)
        assert (track.sigma_m_s[0], track.satellites[0]) == pytest.approx((0.2, 12))
    for context in logs:
        np.testing.assert_array_equal(context.gps[0].v_n[[0, 1, 3], 2], [-1.5, -1.5, np.nan])
        assert context.gps[0].power is not None
        assert context.gps[0].power.values[0].tolist() == [80.0, 60.0, 5.0]
    assert [None if one.gps[0].jamming is None else one.gps[0].jamming[0] for one in logs] == [
        None, 1, 1,
    ]  # fmt: skip


def test_a_receivers_time_is_read_at_its_fixes(tmp_path: Path):
    """GPS weeks of ArduPilot, today's and until 2014, and PX4's UTC; the last row is no fix."""
    t_us, kind = TIMES[:4], [3, 3, 3, 1]
    week, time_ms, unix_s = 2_300, 100_000_000, 1_707_104_782.0
    new, old, px4 = DataflashWriter(), DataflashWriter(), ULogWriter()
    place = (12, 47.0, 8.0, 500.0, 3.0, 90.0, 0.0)
    columns = "TimeUS,I,Status,GMS,GWk,NSats,Lat,Lng,Alt,Spd,GCrs,VZ"
    new.add("GPS", "QBBIHBLLefff", columns, t_us, 1, kind, time_ms, week, *place)
    columns = "TimeUS,Status,TimeMS,Week,NSats,Lat,Lng,Alt,Spd,GCrs,VZ"
    old.add("GPS", "QBIHBLLefff", columns, t_us, kind, time_ms, week, *place)
    fields = "uint8_t fix_type;double latitude_deg;double longitude_deg;double altitude_msl_m;"
    fields += "float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint64_t time_utc_usec"
    values = (kind, 47.0, 8.0, 500.0, 0.0, 3.0, 0.0, round(1e6 * unix_s))
    px4.add("sensor_gps", fields, t_us, *values)
    logs = [dataflash(tmp_path, new), dataflash(tmp_path, old), ulog(tmp_path, px4)]
    for context, number in zip(logs, (1, 0, 0), strict=True):
        (track,) = context.gps
        assert track.receiver == number
        assert track.clock is not None
        assert track.clock.values.tolist() == [unix_s] * 3


def test_a_receiver_that_tells_of_jamming_only_is_heard(tmp_path: Path):
    """PX4 until 1.13: `jamming_state` without `spoofing_state`."""
    path, writer = tmp_path / "log.ulg", ULogWriter()
    fields = "uint8_t fix_type;int32_t lat;int32_t lon;int32_t alt;float vel_n_m_s;"
    fields += "float vel_e_m_s;float vel_d_m_s;uint8_t jamming_state"
    place = (470_000_000, 80_000_000, 500_000)
    writer.add("vehicle_gps_position", fields, TIMES, 3, *place, 0.0, 3.0, 0.0, 3)
    path.write_bytes(writer.bytes())
    heard = {message for _, message in open_ulog(path).events() if isinstance(message, GnssState)}
    assert heard == {GnssState(0, jamming=3, spoofing=0)}


def test_of_two_receivers_the_first_that_knows_it_tells_the_date(tmp_path: Path):
    number = np.arange(len(TIMES)) % 2
    for week, other in ((2_300, 2_301), (0, 2_300)):
        columns = "TimeUS,I,Status,GMS,GWk"
        weeks = np.where(number, other, week)
        writer = DataflashWriter()
        times_ms = 100_000_000 + (TIMES - START_US) // 1000
        writer.add("GPS", "QBBIH", columns, TIMES, number, 3, times_ms, weeks)
        unix_s = dataflash(tmp_path, writer).start_unix_s
        assert unix_s == pytest.approx(315_964_800 + 2_300 * 604_800 + 100_000 - 18)


def test_texts_are_the_same_in_every_format(tmp_path: Path):
    """Up to their first zero; one that is empty then says nothing. Dataflash has no severities."""
    said = (("PreArm: \u00e4", 4), ("debug", 7), ("\0left", 2), ("cut\0left", 0))
    words = np.array([text.encode() for text, _ in said])
    writer, px4 = DataflashWriter(), ULogWriter()
    writer.add("MSG", "QZ", "TimeUS,Message", TIMES[:4], words)
    px4.add("cpuload", "float load", TIMES, 0.5)
    for place in (3, 0, 1, 2):
        px4.text(int(TIMES[place]), *said[place][::-1])
    wired = [mavlink.MAVLink_statustext_message(level, text.encode()) for text, level in said]
    for context, severities in (
        (dataflash(tmp_path, writer), [6, 6, 6]),
        (ulog(tmp_path, px4), [4, 6, 2]),
        (telemetry(tmp_path, *wired), [4, 6, 2]),
    ):
        assert [one.text for one in context.said] == ["PreArm: \u00e4", "debug", "cut"]
        assert [one.severity for one in context.said] == severities
    assert [one.t_s for one in ulog(tmp_path, px4).said] == pytest.approx([0.0, 0.1, 0.3])


# --- old logs in which only the GPS, or nothing, has a time ---------------------------------------


def of_2013(tmp_path: Path, gps: str, letters: str) -> Context:
    """Ten seconds of ATT and IMU at 50 Hz without times, upside down from 6 s on; GPS at 5 Hz."""
    t_us = START_US + np.arange(0, 10_000_000, 20_000, dtype=np.int64)
    writer = DataflashWriter()
    fixes = t_us[::10]
    values = (3,) if gps.startswith("Time") else (fixes // 1000, 3, 5, 1750)
    writer.add("GPS", letters, gps, fixes, *values)
    roll = np.where(t_us < START_US + 6_000_000, 0.0, 180.0)
    columns = "RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw"
    writer.add("ATT", "cccccCC", columns, t_us, 0, roll, 0, 0, 0, 90, 90)
    columns = "GyrX,GyrY,GyrZ,AccX,AccY,AccZ"
    writer.add("IMU", "ffffff", columns, t_us, 0.0, 0.0, 0.0, 0.0, 0.0, -9.8)
    writer.add("MOT", "hh", "Mot1,Mot2", t_us, 1500, 1600)
    return dataflash(tmp_path, writer)


@pytest.mark.parametrize(
    ("gps", "letters"), [("T,Status,TimeMS,Week", "IBIH"), ("Time,Status", "II")]
)
def test_rows_without_a_time_get_that_of_their_place(tmp_path: Path, gps: str, letters: str):
    context = of_2013(tmp_path, gps, letters)
    (track,) = context.attitudes
    assert context.duration_s == pytest.approx(10.0, abs=0.3)
    over = np.linalg.norm(track.q_nb[:, 1:3], axis=1) > 0.9
    assert track.t_s[over.argmax()] == pytest.approx(6.0, abs=0.05)
    assert np.ptp(np.diff(track.t_s)) < 0.02
    assert context.demand is not None
    assert context.demand.values[0] == pytest.approx([0.0, 0.0, np.pi / 2])
    assert [imu.is_timed for imu in context.imus] == [False]
    assert not has_enough_samples(context)
    assert any("place in the file" in phrase for phrase in context.missing)


def test_where_no_row_has_a_time_the_loops_count(tmp_path: Path):
    t_us = START_US + np.arange(0, 60_000_000, 100_000, dtype=np.int64)
    writer = DataflashWriter()
    writer.add("ATT", "ccC", "Roll,Pitch,Yaw", t_us, 100, 200, 300)
    writer.add("PM", "HH", "NLon,NLoop", t_us[::100], 1, 1000)
    (track,) = dataflash(tmp_path, writer).attitudes
    assert np.ptp(track.t_s) == pytest.approx(60.0, rel=0.1)


@pytest.mark.parametrize("name", ["airspeed_source", "selected_airspeed_index"])
def test_an_airspeed_is_one_where_a_sensor_has_measured_it(tmp_path, name):
    writer = ULogWriter()
    sources = np.repeat([1, 0, 3, 4, -1], len(TIMES) // 5)
    fields = f"float true_airspeed_m_s;int8_t {name}"
    writer.add("airspeed_validated", fields, TIMES, 20.0, sources)
    measured = ulog(tmp_path, writer).measured["airspeed_m_s"]
    at = np.searchsorted(measured.t_s, 1e-6 * (TIMES - START_US) - 1e-9)
    known = [
        index < len(measured.t_s)
        and abs(measured.t_s[index] - 1e-6 * (t - START_US)) < 1e-6
        and np.isfinite(measured.values[index])
        for index, t in zip(at, TIMES, strict=True)
    ]
    assert np.array_equal(known, (sources == 1) | (sources == 3))


def test_temperatures_of_imus(tmp_path: Path):
    new, old, writer = DataflashWriter(), DataflashWriter(), ULogWriter()
    new.add("IMU", "QBf", "TimeUS,I,T", TIMES, 0, 41.5)
    old.add("IMU", "Qf", "TimeUS,Temp", TIMES, 20.0)
    old.add("IMU2", "Qf", "TimeUS,Temp", TIMES, 41.5)
    writer.add("vehicle_imu_status", "float temperature_accel", TIMES, 41.5)
    raw = mavlink.MAVLink_raw_imu_message(0, *[0] * 9, id=0, temperature=4150)
    second = mavlink.MAVLink_scaled_imu2_message(0, *[0] * 9, temperature=4150)
    for context, imu in (
        (dataflash(tmp_path, new), 0),
        (dataflash(tmp_path, old), 1),
        (ulog(tmp_path, writer), 0),
        (telemetry(tmp_path, raw), 0),
        (telemetry(tmp_path, second), 1),
    ):
        track = context.temperatures[-1]
        assert (track.imu, track.temperature_degc[0]) == (imu, pytest.approx(41.5))
    cold = mavlink.MAVLink_raw_imu_message(0, *[0] * 9, id=0, temperature=0)
    assert telemetry(tmp_path, cold).temperatures == ()
