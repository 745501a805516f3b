"""What recordings say of the vehicle and its control: demands, outputs, height, supply, faults."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
from made_logs import START_US, DataflashWriter, ULogWriter, dataflash, made_flight, ulog
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.context import SUBSYSTEMS, Context
from h2nav.recordings.dataflash import open_dataflash
from h2nav.recordings.dataflash_errors import CONCERNED
from h2nav.recordings.recording import open_recording
from h2nav.recordings.telemetry import read_context
from h2nav.recordings.ulog import open_ulog
from h2nav.wire.codec import Encoder

FLIGHT = made_flight(duration_s=10.0, imus=1)
TIMES = START_US + np.arange(0, 10_000_000, 100_000, dtype=np.int64)
ONCE = np.array([START_US + 4_000_000], np.int64)
PWM = np.linspace(1100.0, 1900.0, len(TIMES))


def read_dataflash(tmp_path: Path, writer: DataflashWriter, *, old: bool = False) -> Context:
    path = tmp_path / "log.bin"
    path.write_bytes(dataflash(FLIGHT, old=old, extra=writer))
    return open_dataflash(path).context()


def settings(writer: DataflashWriter, t_us: np.ndarray, **values: float) -> None:
    names = np.array([name.encode() for name in values])
    times = np.full(len(values), t_us[0])
    writer.add("PARM", "QNf", "TimeUS,Name,Value", times, names, list(values.values()))


def test_a_dataflash_log_of_today(tmp_path: Path):
    writer = DataflashWriter()
    functions = {f"SERVO{i}_FUNCTION": f for i, f in ((1, 70), (2, 34), (3, 33), (4, 36), (5, 35))}
    settings(writer, TIMES, MOT_PWM_MIN=1000, MOT_PWM_MAX=2000, MOT_SPIN_MAX=0.95, **functions)
    settings(writer, ONCE, SERVO4_FUNCTION=0)
    writer.add("RATE", "Qfff", "TimeUS,RDes,PDes,YDes", TIMES, 10.0, -20.0, 30.0)
    outputs = (1500, PWM, PWM + 10, PWM + 20, PWM + 30, 0)
    writer.add("RCOU", "QHHHHHH", "TimeUS,C1,C2,C3,C4,C5,C6", TIMES, *outputs)
    writer.add("CTUN", "Qffffh", "TimeUS,ThO,Alt,DAlt,BAlt,CRt", TIMES, 0.4, 12.0, 13.0, 14.0, -250)
    writer.add("BARO", "QBf", "TimeUS,I,Alt", TIMES, 0, 11.5)
    battery = (0, 15.2, 9.5, 60)
    writer.add("BAT", "QBffB", "TimeUS,Inst,Volt,Curr,RemPct", TIMES, *battery)
    writer.add("POWR", "Qf", "TimeUS,Vcc", TIMES, 5.1)
    writer.add("VIBE", "QBfffI", "TimeUS,IMU,VibeX,VibeY,VibeZ,Clip", TIMES, 1, 3.0, 4.0, 5.0, 7)
    writer.add("ESC", "QBiff", "TimeUS,Instance,RPM,Curr,Temp", TIMES, 2, 5400, 3.5, 40.0)
    writer.add("ERR", "QBB", "TimeUS,Subsys,ECode", ONCE, 6, 1)
    context = read_dataflash(tmp_path, writer)
    assert context.vehicle_type == mavlink.MAV_TYPE_QUADROTOR
    assert context.motors is not None
    assert context.motors.numbers == (1, 2, 3, 4)
    # Channel 3 drives motor 1, channel 2 motor 2, channel 5 motor 3 and channel 4 motor 4.
    np.testing.assert_array_equal(context.motors.pwm_us[0], np.array([10, 0, 30, 20]) + 1100)
    assert (context.motors.least_us, context.motors.most_us) == (1000.0, pytest.approx(1950.0))
    assert context.motors.share()[-1] == pytest.approx([0.958, 0.947, 0.979, 0.968], abs=0.001)
    assert context.demanded_rates is not None
    assert context.demanded_rates.values[0] == pytest.approx(np.array([10.0, -20.0, 30.0]) * DEG)
    assert context.demand is not None
    assert context.demand.values.shape[1] == 3
    for series, value in (
        (context.height_m, 12.0),
        (context.height_demand_m, 13.0),
        (context.climb_m_s, -2.5),
        (context.baro_height_m, 11.5),
        (context.board_v, 5.1),
    ):
        assert series is not None
        assert series.values == pytest.approx(value)
    (battery_track,) = context.batteries
    assert (battery_track.voltage_v[0], battery_track.remaining[0]) == pytest.approx((15.2, 0.6))
    (vibration,) = context.vibrations
    assert (vibration.imu, vibration.level[0].tolist(), vibration.clipped[0]) == (1, [3, 4, 5], 7)
    assert [(esc.number, esc.rpm[0]) for esc in context.escs] == [(3, 5400.0)]
    (fault,) = context.faults
    assert (fault.subsystem, fault.code, fault.t_s) == ("battery", 1, pytest.approx(4.0))
    assert [one.text for one in context.occurrences] == ["armed", "took off"]
    (change,) = context.changes
    assert change == (pytest.approx(4.0), "SERVO4_FUNCTION", 36.0, 0.0)
    assert context.airborne is not None


def test_a_dataflash_log_of_2014(tmp_path: Path):
    writer = DataflashWriter()
    names = {"RC3_MIN": 1100, "RC3_MAX": 1900, "MOT_TCRV_ENABLE": 1, "MOT_TCRV_MXPCT": 93}
    parameters = np.array([name.encode() for name in names])
    at_start = np.full(len(names), START_US)
    writer.add("PARM", "INf", "TimeMS,Name,Value", at_start, parameters, list(names.values()))
    columns = "TimeMS," + ",".join(f"Ch{i + 1}" for i in range(8))
    # What an unused channel holds there is whatever was in memory.
    writer.add("RCOU", "I" + "h" * 8, columns, TIMES, *(PWM + i for i in range(4)), -8375, 9, 0, 1)
    writer.add(
        "CTUN", "Ihecefh", "TimeMS,ThrOut,Alt,BarAlt,DAlt,SAlt,CRt", TIMES, 400, 1.5, 1, 2, 0, 150
    )
    writer.add("CURR", "Ihhhf", "TimeMS,Volt,Curr,Vcc,CurrTot", TIMES, 1580, 1250, 4980, 3.0)
    context = read_dataflash(tmp_path, writer, old=True)
    assert context.motors is not None
    assert context.motors.numbers == (1, 2, 3, 4)
    assert context.motors.most_us == pytest.approx(1844.0)
    assert context.throttle is not None
    assert context.throttle.values[0] == pytest.approx(0.4)
    assert context.climb_m_s is not None
    assert context.climb_m_s.values[0] == pytest.approx(1.5)
    (battery,) = context.batteries
    assert (battery.voltage_v[0], battery.current_a[0]) == pytest.approx((15.8, 12.5))
    assert context.board_v is not None
    assert context.board_v.values[0] == pytest.approx(4.98)


def test_compasses_and_vibrations_are_those_of_their_messages(tmp_path: Path):
    writer = DataflashWriter()
    settings(writer, TIMES, COMPASS_USE2=0)
    for number, field in ((0, (200, 0, 450)), (1, (0, 0, 0))):
        writer.add("MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ", TIMES, number, *field)
    columns = "TimeUS,VibeX,VibeY,VibeZ,Clip0,Clip1"  # until 2020
    writer.add("VIBE", "QfffII", columns, TIMES, 3.0, 4.0, 5.0, 7, 8)
    path = tmp_path / "log.bin"
    path.write_bytes(writer.bytes())
    log = open_dataflash(path)
    assert log.unix_start_ns == 0  # without a receiver there is no date
    context = log.context()
    used, dead = context.compass_rows
    assert (used.compass, used.rows, used.changes) == (0, len(TIMES), 0)
    assert (used.is_zero, used.is_used) == (False, True)
    assert (dead.compass, dead.is_zero, dead.is_used) == (1, True, False)
    first, second = context.vibrations
    assert (first.imu, first.level[0].tolist(), first.clipped[0]) == (0, [3, 4, 5], 7)
    assert (second.imu, second.clipped[0]) == (1, 8)
    assert np.isnan(second.level).all()


def test_events_have_the_names_of_ardupilot(tmp_path: Path):
    # LogEvent of AP_Logger.h; 26, simple mode, is of no interest.
    told = {
        10: "armed",
        15: "auto armed",
        28: "took off",
        26: "",
        19: "GPS lost",
        21: "flip began",
        22: "flip ended",
        25: "home set",
        30: "autotune began",
        33: "autotune succeeded",
        34: "autotune failed",
        35: "",
        41: "fence on",
        42: "fence off",
        51: "parachute released",
        54: "motors stopped in an emergency",
        55: "emergency stop over",
        56: "motors interlocked",
        57: "motors released",
        60: "EKF height reset",
        61: "landing cancelled by the pilot",
        62: "EKF heading reset",
        67: "other GPS in use",
        17: "maybe landed",
        18: "landed",
        11: "disarmed",
    }
    writer = DataflashWriter()
    writer.add("EV", "QB", "TimeUS,Id", START_US + np.arange(len(told)) * 100_000, list(told))
    path = tmp_path / "log.bin"
    path.write_bytes(writer.bytes())
    found = open_dataflash(path).context().occurrences
    assert [(one.number, one.text) for one in found] == [pair for pair in told.items() if pair[1]]


def test_modes_have_the_names_of_px4(tmp_path: Path):
    # vehicle_status.nav_state, by NAVIGATION_STATE of vehicle_status.msg.
    told = {
        0: "MANUAL",
        1: "ALTCTL",
        2: "POSCTL",
        3: "AUTO_MISSION",
        4: "AUTO_LOITER",
        5: "AUTO_RTL",
        6: "POSITION_SLOW",
        7: "mode 7",
        8: "ALTITUDE_CRUISE",
        10: "ACRO",
        12: "DESCEND",
        13: "TERMINATION",
        14: "OFFBOARD",
        15: "STAB",
        16: "RATTITUDE",
        17: "AUTO_TAKEOFF",
        18: "AUTO_LAND",
        19: "AUTO_FOLLOW_TARGET",
        20: "AUTO_PRECLAND",
        21: "ORBIT",
        22: "AUTO_VTOL_TAKEOFF",
        23: "EXTERNAL1",
        30: "EXTERNAL8",
    }
    writer = ULogWriter()
    t_us = START_US + np.arange(len(told)) * 500_000
    writer.add("vehicle_status", "uint8_t nav_state", t_us, list(told))
    path = tmp_path / "log.ulg"
    path.write_bytes(writer.bytes())
    assert [span.name for span in open_ulog(path).context().modes][:-1] == [*told.values()][:-1]


@pytest.mark.parametrize(
    ("number", "kind"),
    [(1, "quadrotor"), (2, "fixed wing"), (3, "ground rover"), (4, "airship"), (9, "")],
)
def test_px4_without_a_type_of_mavlink_has_a_class_of_vehicle(
    tmp_path: Path, number: int, kind: str
):
    writer = ULogWriter()
    writer.add("vehicle_status", "uint8_t vehicle_type", TIMES, number)
    path = tmp_path / "log.ulg"
    path.write_bytes(writer.bytes())
    assert open_ulog(path).context().vehicle == kind


def test_a_log_of_px4(tmp_path: Path):
    flight = made_flight(duration_s=10.0, imus=1, rates_s=0.0, field_s=0.0)
    writer = ULogWriter()
    pitched = [math.cos(0.1), 0.0, math.sin(0.1), 0.0]
    writer.add("vehicle_attitude_setpoint", "float[4] q_d", TIMES, pitched)
    rates = (0.1, 0.2, 0.3)
    fields = "float roll;float pitch;float yaw"
    writer.add("vehicle_rates_setpoint", fields, TIMES, *rates)
    shares = np.full((len(TIMES), 12), np.nan)
    shares[:, :4] = 0.25
    shares[50:, 1] = np.nan
    writer.add("actuator_motors", "float[12] control", TIMES, shares)
    writer.add("vehicle_thrust_setpoint", "float[3] xyz", TIMES, [0.0, 0.0, -0.4])
    writer.add("vehicle_local_position", "float z;float vz", TIMES, -7.0, 1.5)
    supply = (16.0, 8.0, 0.5, np.where(ONCE[0] > TIMES, 0, 2))
    fields = "float voltage_v;float current_a;float remaining;uint8_t warning"
    writer.add("battery_status", fields, TIMES, *supply)
    fields = "bool fd_roll;bool fd_motor"
    writer.add("failure_detector_status", fields, TIMES, ONCE[0] <= TIMES, False)
    fields = "float accel_vibration_metric;uint32_t[3] accel_clipping"
    writer.add("vehicle_imu_status", fields, TIMES, 2.5, [1, 2, 3])
    path = tmp_path / "log.ulg"
    path.write_bytes(ulog(flight, extra=writer))
    context = open_ulog(path).context()
    assert context.demand is not None
    assert context.demand.values[0] == pytest.approx([0.0, 0.2, 0.0], abs=1e-6)
    assert context.demanded_rates is not None
    assert context.demanded_rates.values[0] == pytest.approx(rates)
    assert context.motors is not None
    assert context.motors.pwm_us[0] == pytest.approx(1250.0)
    assert math.isnan(context.motors.pwm_us[60, 1])
    assert context.throttle is not None
    assert context.throttle.values[0] == pytest.approx(0.4)
    assert context.height_m is not None
    assert context.climb_m_s is not None
    assert (context.height_m.values[0], context.climb_m_s.values[0]) == (7.0, -1.5)
    assert [(fault.subsystem, fault.text) for fault in context.faults] == [
        ("failsafe", "roll beyond its limit"),
        ("battery", "battery critically low"),
    ]
    (vibration,) = context.vibrations
    assert (vibration.level[0, 0], vibration.clipped[0]) == (2.5, 6.0)


def test_telemetry(tmp_path: Path):
    encoder = Encoder(1, 1)
    kinds = (mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA)
    pitched = [math.cos(0.1), 0.0, math.sin(0.1), 0.0]
    low = mavlink.MAV_BATTERY_CHARGE_STATE_LOW
    messages = [
        mavlink.MAVLink_heartbeat_message(*kinds, 128, 0, mavlink.MAV_STATE_CRITICAL, 3),
        mavlink.MAVLink_attitude_target_message(0, 0, pitched, 0.1, 0.2, 0.3, 0.5),
        mavlink.MAVLink_servo_output_raw_message(0, 0, 1500, 1600, 1700, 1800, 0, 0, 0, 0),
        mavlink.MAVLink_vfr_hud_message(0.0, 0.0, 0, 40, 120.0, -1.5),
        mavlink.MAVLink_global_position_int_message(0, 0, 0, 120000, 6500, 0, 0, 0, 0),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 0, 15200, 950, 60, *[0] * 6),
        mavlink.MAVLink_battery_status_message(0, 0, 0, 0, [0] * 10, 0, 0, 0, 0, charge_state=low),
        mavlink.MAVLink_power_status_message(5050, 0, 0),
        mavlink.MAVLink_vibration_message(0, 3.0, 4.0, 5.0, 7, 0, 0),
        mavlink.MAVLink_esc_telemetry_1_to_4_message(
            [40] * 4, [0] * 4, [350] * 4, [0] * 4, [0, 5400, 0, 0], [0] * 4
        ),
        mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR),
    ]
    path = tmp_path / "log.tlog"
    path.write_bytes(
        b"".join(
            struct.pack(">Q", 1_700_000_000_000_000 + 1000 * i) + encoder.encode(message)
            for i, message in enumerate(messages)
        )
    )
    context = read_context(open_recording(path))
    assert context.demand is not None
    assert context.demand.values[0] == pytest.approx([0.0, 0.2, 0.0], abs=1e-6)
    assert context.demanded_rates is not None
    assert context.demanded_rates.values[0] == pytest.approx([0.1, 0.2, 0.3])
    assert context.motors is not None
    assert context.motors.pwm_us[0] == pytest.approx([1500.0, 1600.0, 1700.0, 1800.0])
    assert context.height_m is not None
    assert context.climb_m_s is not None
    assert (context.height_m.values[0], context.climb_m_s.values[0]) == (6.5, -1.5)
    (battery,) = context.batteries
    assert (battery.voltage_v[0], battery.remaining[0]) == pytest.approx((15.2, 0.6))
    assert context.board_v is not None
    assert context.board_v.values[0] == pytest.approx(5.05)
    assert context.vibrations[0].clipped[0] == 7.0
    assert [(esc.number, esc.rpm[0], esc.current_a[0]) for esc in context.escs] == [(2, 5400, 3.5)]
    assert [(fault.subsystem, fault.text) for fault in context.faults] == [
        ("failsafe", "failsafe"),
        ("battery", "battery low"),
    ]
    assert context.airborne is not None
    assert context.airborne.values[0] == 1.0


def test_every_error_concerns_a_known_subsystem():
    assert set(CONCERNED.values()) <= set(SUBSYSTEMS)
