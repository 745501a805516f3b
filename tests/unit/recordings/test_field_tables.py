"""Each row of the column tables: what a message stores, and what it is in SI units."""

import math

import numpy as np
import pytest
from made_rows import MadeLog, MadeMessage, table

from h2nav.recordings import field_tables
from h2nav.recordings.columns import read
from h2nav.recordings.field_tables import FIELDS

NAN = math.nan
BY_NAME = {field.name: field for field in FIELDS}
FORTH, BACK = math.sqrt(0.5), 0.5 * math.pi  # a quaternion's part and angle of a quarter turn


def filled(kind, name, *messages):
    found = read(MadeLog(kind, *messages), (BY_NAME[name],))
    return found.values[name], found.origins.get(name)


def numbered(name, values, first=1):
    return {name.format(first + i): value for i, value in enumerate(values)}


Q = dict(zip(("q[0]", "q[1]", "q[2]", "q[3]"), (FORTH, FORTH, 0.0, 0.0), strict=True))
Q_D = {f"q_d[{i}]": value for i, value in enumerate(Q.values())}
RATES = {
    f"body_{axis}_rate": value
    for axis, value in zip(("roll", "pitch", "yaw"), (1.0, 2.0, 3.0), strict=True)
}
WINDS = {"windspeed_north": 3.0, "windspeed_east": -4.0}

SERIES = [
    ("dataflash", "demand", "ATT.DesRoll", {"DesRoll": 90.0, "DesPitch": -45.0, "DesYaw": 180.0},
     (BACK, -BACK / 2, 2 * BACK)),
    ("dataflash", "demand", "ATT.DesRoll", {"DesRoll": 90.0, "DesPitch": -45.0},
     (BACK, -BACK / 2, NAN)),
    ("dataflash", "demand", "ATT.RollIn", {"RollIn": 90.0, "PitchIn": -45.0, "NavYaw": 180.0},
     (BACK, -BACK / 2, 2 * BACK)),
    ("ulog", "demand", "vehicle_attitude_setpoint.q_d[0]", Q_D, (BACK, 0.0, 0.0)),
    ("ulog", "demand", "vehicle_attitude_setpoint.roll_body",
     {"roll_body": 0.1, "pitch_body": 0.2, "yaw_body": 0.3}, (0.1, 0.2, 0.3)),
    ("telemetry", "demand", "ATTITUDE_TARGET.q[0]", {**Q, "type_mask": 7}, (BACK, 0.0, 0.0)),
    ("telemetry", "demand", "NAV_CONTROLLER_OUTPUT.nav_roll",
     {"nav_roll": 90.0, "nav_pitch": -45.0}, (BACK, -BACK / 2, NAN)),
    ("dataflash", "demanded_rates", "RATE.RDes", {"RDes": 90.0, "PDes": 45.0, "YDes": -180.0},
     (BACK, BACK / 2, -2 * BACK)),
    ("dataflash", "demanded_rates", "RATE.RllDes",
     {"RllDes": 90.0, "PitDes": 45.0, "YawDes": -180.0}, (BACK, BACK / 2, -2 * BACK)),
    ("ulog", "demanded_rates", "vehicle_rates_setpoint.roll",
     {"roll": 1.0, "pitch": 2.0, "yaw": 3.0}, (1.0, 2.0, 3.0)),
    ("telemetry", "demanded_rates", "ATTITUDE_TARGET.body_roll_rate", {**RATES, "type_mask": 128},
     (1.0, 2.0, 3.0)),
    ("dataflash", "throttle", "CTUN.ThO", {"ThO": 0.5}, 0.5),
    ("dataflash", "throttle", "CTUN.ThrOut", {"ThrOut": 50}, 0.5),
    ("dataflash", "throttle", "CTUN.ThrO", {"ThrO": 500}, 0.5),
    ("ulog", "throttle", "vehicle_thrust_setpoint.xyz[2]", {"xyz[2]": -0.5}, 0.5),
    ("ulog", "throttle", "actuator_controls_0.control[3]", {"control[3]": 0.5}, 0.5),
    ("ulog", "throttle", "actuator_motors.control[0]", {"control[0]": 0.5}, 0.5),
    ("telemetry", "throttle", "VFR_HUD.throttle", {"throttle": 50}, 0.5),
    ("dataflash", "height_m", "CTUN.Alt", {"Alt": 12.5}, 12.5),
    ("dataflash", "height_m", "INAV.IAlt", {"IAlt": 12.5}, 12.5),
    ("ulog", "height_m", "vehicle_local_position.z", {"z": -12.5}, 12.5),
    ("telemetry", "height_m", "GLOBAL_POSITION_INT.relative_alt", {"relative_alt": 12_500}, 12.5),
    ("telemetry", "height_m", "VFR_HUD.alt", {"alt": 12.5}, 12.5),
    ("dataflash", "height_demand_m", "CTUN.DAlt", {"DAlt": 12.5}, 12.5),
    ("ulog", "height_demand_m", "vehicle_local_position_setpoint.z", {"z": -12.5}, 12.5),
    ("dataflash", "climb_m_s", "CTUN.CRt", {"CRt": 250}, 2.5),
    ("dataflash", "climb_m_s", "CTUN.CRt", {"CRt": 2.5}, 2.5),
    ("dataflash", "climb_m_s", "CTUN.CRate", {"CRate": 250}, 2.5),
    ("ulog", "climb_m_s", "vehicle_local_position.vz", {"vz": -2.5}, 2.5),
    ("telemetry", "climb_m_s", "VFR_HUD.climb", {"climb": 2.5}, 2.5),
    ("dataflash", "baro_height_m", "BARO.Alt", {"Alt": 12.5}, 12.5),
    ("dataflash", "baro_height_m", "CTUN.BarAlt", {"BarAlt": 12.5}, 12.5),
    ("ulog", "baro_height_m", "vehicle_air_data.baro_alt_meter", {"baro_alt_meter": 12.5}, 12.5),
    ("ulog", "baro_height_m", "sensor_combined.baro_alt_meter", {"baro_alt_meter": 12.5}, 12.5),
    ("ulog", "airborne", "vehicle_land_detected.landed", {"landed": [1, 0]}, [0.0, 1.0]),
    ("telemetry", "airborne", "EXTENDED_SYS_STATE.landed_state", {"landed_state": [0, 1, 2, 3, 4]},
     [0.0, 1.0, 1.0, 1.0]),
    *(("dataflash", "wind_n_m_s", f"{name}.VWN", {"VWN": 3.0, "VWE": -4.0}, (3.0, -4.0))
      for name in ("XKF2", "NKF2", "EKF2")),
    *(("ulog", "wind_n_m_s", f"{name}.windspeed_north", WINDS, (3.0, -4.0))
      for name in ("wind", "wind_estimate", "estimator_wind")),
    # A wind from the east blows to the west.
    ("telemetry", "wind_n_m_s", "WIND.speed", {"speed": 4.0, "direction": 90.0}, (0.0, -4.0)),
    ("telemetry", "wind_n_m_s", "WIND_COV.wind_x", {"wind_x": 3.0, "wind_y": -4.0}, (3.0, -4.0)),
    *(("dataflash", "current_a", f"{name}.Curr", {"Curr": value}, 12.5)
      for name in ("BAT", "CURR") for value in (12.5, 1250)),
    ("ulog", "current_a", "battery_status.current_a", {"current_a": [12.5, -1.0, 0.0]},
     [12.5, 0.0]),
    ("telemetry", "current_a", "SYS_STATUS.current_battery", {"current_battery": [1250, -1, 0]},
     [12.5, 0.0]),
    *(("dataflash", "board_v", f"{name}.Vcc", {"Vcc": value}, 5.25)
      for name in ("POWR", "CURR") for value in (5.25, 5250)),
    ("ulog", "board_v", "system_power.voltage5v_v", {"voltage5v_v": 5.25}, 5.25),
    ("telemetry", "board_v", "POWER_STATUS.Vcc", {"Vcc": 5250}, 5.25),
    ("dataflash", "load", "PM.Load", {"Load": 375}, 0.375),
    ("ulog", "load", "cpuload.load", {"load": 0.375}, 0.375),
    ("telemetry", "load", "SYS_STATUS.load", {"load": 375}, 0.375),
    *(("dataflash", "airspeed_m_s", f"{name}.Airspeed", {"Airspeed": 20.0}, 20.0)
      for name in ("ARSP", "ASP")),
    *(("ulog", "airspeed_m_s", f"{name}.true_airspeed_m_s", {"true_airspeed_m_s": 20.0}, 20.0)
      for name in ("airspeed_validated", "airspeed")),
    ("ulog", "motor_shares", "actuator_motors.control[0]",
     {f"control[{i}]": 0.1 * i if i < 6 else NAN for i in range(12)},
     (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, *[NAN] * 6)),
    ("dataflash", "motor_widths_us", "MOT.Mot1", numbered("Mot{}", range(1100, 1108)),
     tuple(range(1100, 1108))),
    ("dataflash", "motor_widths_us", "MOT.Mot1", {"Mot1": 1100, "Mot8": 1800},
     (1100, *[NAN] * 6, 1800)),
    *(("dataflash", "channels_us", f"RCIN.{name.format(1)}", numbered(name, range(1100, 1116)),
       tuple(range(1100, 1116))) for name in ("C{}", "Ch{}")),
    ("ulog", "channels_us", "input_rc.values[0]", numbered("values[{}]", range(1100, 1116), 0),
     tuple(range(1100, 1116))),
    ("telemetry", "channels_us", "RC_CHANNELS.chan1_raw",
     numbered("chan{}_raw", range(1100, 1116)), tuple(range(1100, 1116))),
    ("telemetry", "channels_us", "RC_CHANNELS_RAW.chan1_raw",
     numbered("chan{}_raw", range(1100, 1108)), tuple(range(1100, 1108))),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "name", "origin", "columns", "expected"), SERIES)
def test_a_series_in_its_unit(kind, name, origin, columns, expected):
    found, where = filled(kind, name, MadeMessage(origin.partition(".")[0], columns))
    assert where == origin
    values = expected if isinstance(expected, list) else [expected]
    np.testing.assert_allclose(found.values, values, atol=1e-12)


@pytest.mark.parametrize(
    ("kind", "name", "message", "columns"),
    [
        ("telemetry", "demand", "NAV_CONTROLLER_OUTPUT", {"nav_roll": 0.0, "nav_pitch": 0.0}),
        ("dataflash", "board_v", "POWR", {"Vcc": 0.0}),
        ("dataflash", "board_v", "CURR", {"Vcc": 0}),
        ("telemetry", "board_v", "POWER_STATUS", {"Vcc": 0}),
        ("dataflash", "motor_widths_us", "MOT", {"Mot1": 0, "Mot2": 0}),
        ("dataflash", "channels_us", "RCIN", {"C1": 0}),
        ("dataflash", "channels_us", "RCIN", {"Ch1": 0}),
        ("ulog", "channels_us", "input_rc", {"values[0]": 0}),
        ("telemetry", "channels_us", "RC_CHANNELS", numbered("chan{}_raw", [0] * 16)),
        ("telemetry", "channels_us", "RC_CHANNELS_RAW", numbered("chan{}_raw", [0] * 8)),
    ],
)
def test_zeros_throughout_are_a_message_that_is_not_filled(kind, name, message, columns):
    assert filled(kind, name, MadeMessage(message, columns)) == (None, None)
    first = next(iter(columns))
    found, _ = filled(kind, name, MadeMessage(message, {**columns, first: 5}))
    assert found is not None


@pytest.mark.parametrize(
    ("kind", "name", "message", "columns", "bound"),
    [
        ("dataflash", "height_m", "CTUN", ("Alt",), 50_000.0),
        ("dataflash", "height_m", "INAV", ("IAlt",), 50_000.0),
        ("dataflash", "height_demand_m", "CTUN", ("DAlt",), 50_000.0),
        ("dataflash", "baro_height_m", "BARO", ("Alt",), 50_000.0),
        ("dataflash", "baro_height_m", "CTUN", ("BarAlt",), 50_000.0),
        ("dataflash", "wind_n_m_s", "XKF2", ("VWN", "VWE"), 1_000.0),
        ("ulog", "wind_n_m_s", "wind", ("windspeed_north", "windspeed_east"), 1_000.0),
        ("dataflash", "airspeed_m_s", "ARSP", ("Airspeed",), 1_000.0),
        ("ulog", "airspeed_m_s", "airspeed", ("true_airspeed_m_s",), 1_000.0),
    ],
)
def test_what_no_vehicle_does_is_unknown(kind, name, message, columns, bound):
    rows = [0.0, bound, -bound, 1.001 * bound, -1.001 * bound]
    found, _ = filled(kind, name, MadeMessage(message, dict.fromkeys(columns, rows)))
    np.testing.assert_array_equal(found.values.reshape(len(found.t_s), -1)[:, 0], rows[:3])


# --- any number of each -----------------------------------------------------------------------


def esc(number, **values):
    return {f"esc[{number}].esc_{name}": value for name, value in values.items()}


ESC_4 = {
    f"{name}[{i}]": factor * (i + 1)
    for name, factor in (("rpm", 1000), ("current", 100), ("temperature", 10))
    for i in range(4)
}
SENSORS = {"onboard_control_sensors_present": 0xFFFF, "onboard_control_sensors_health": 0}
STATUS = {f"{name}_{what}[{i}]": 1 for name in ("gyro", "accel") for i in range(4)
          for what in ("healthy", "device_ids")}  # fmt: skip
STICKS = {"roll": 0.1, "pitch": -0.2, "yaw": 0.3, "throttle": -0.5}

# Format, field, messages with their columns, and of each record the values in the last row.
RECORDS = [
    ("dataflash", "batteries", "BAT", {"BAT": {"Volt": 12.5, "Curr": 3.5, "RemPct": 80}},
     [(0, 12.5, 3.5, 0.8)]),
    ("dataflash", "batteries", "CURR", {"CURR": {"Volt": 1250, "Curr": 350}},
     [(0, 12.5, 3.5, NAN)]),
    ("dataflash", "batteries", "CURR", {"CURR": {"Volt": 1250, "RemPct": 101}},
     [(0, 12.5, NAN, NAN)]),
    ("dataflash", "batteries", "BAT", {"BAT": {"Volt": 12.5, "RemPct": 100}},
     [(0, 12.5, NAN, 1.0)]),
    ("ulog", "batteries", "battery_status",
     {"battery_status": {"voltage_v": 12.5, "current_a": -1.0, "remaining": -1.0}},
     [(0, 12.5, NAN, NAN)]),
    ("ulog", "batteries", "battery_status",
     {"battery_status": {"voltage_v": 12.5, "current_a": 0.0, "remaining": 0.0}},
     [(0, 12.5, 0.0, 0.0)]),
    ("telemetry", "batteries", "SYS_STATUS",
     {"SYS_STATUS": {"voltage_battery": 12_500, "current_battery": 350, "battery_remaining": 80}},
     [(0, 12.5, 3.5, 0.8)]),
    ("telemetry", "batteries", "SYS_STATUS",
     {"SYS_STATUS": {"voltage_battery": [12_500, 65_535], "current_battery": -1,
                     "battery_remaining": -1}},
     [(0, NAN, NAN, NAN)]),
    ("telemetry", "batteries", "SYS_STATUS",
     {"SYS_STATUS": {"voltage_battery": [1, 65_534], "current_battery": 0,
                     "battery_remaining": 0}},
     [(0, 65.534, 0.0, 0.0)]),
    ("dataflash", "vibrations", "VIBE",
     {"VIBE": {"VibeX": 1.0, "VibeY": 2.0, "VibeZ": 3.0, "Clip": 4}}, [(0, (1.0, 2.0, 3.0), 4)]),
    ("dataflash", "vibrations", "VIBE",
     {"VIBE": {"VibeX": 1.0, "VibeY": 2.0, "VibeZ": 3.0, "Clip0": 4, "Clip1": 5, "Clip2": 6}},
     [(0, (1.0, 2.0, 3.0), 4), (1, (NAN, NAN, NAN), 5), (2, (NAN, NAN, NAN), 6)]),
    ("ulog", "vibrations", "vehicle_imu_status",
     {"vehicle_imu_status": {"accel_vibration_metric": 1.5,
                             **numbered("accel_clipping[{}]", (1, 2, 4), 0)}},
     [(0, (1.5,), 7)]),
    ("telemetry", "vibrations", "VIBRATION",
     {"VIBRATION": {"vibration_x": 1.0, "vibration_y": 2.0, "vibration_z": 3.0,
                    **numbered("clipping_{}", (4, 5, 6), 0)}},
     [(0, (1.0, 2.0, 3.0), 4), (1, (NAN, NAN, NAN), 5), (2, (NAN, NAN, NAN), 6)]),
    ("dataflash", "temperatures", "IMU", {"IMU": {"T": [45.0, -150.0]}}, [(0, -150.0)]),
    ("dataflash", "temperatures", "IMU", {"IMU": {"Temp": [45.0, 150.5]}}, [(0, NAN)]),
    ("ulog", "temperatures", "vehicle_imu_status",
     {"vehicle_imu_status": {"temperature_accel": 45.0}}, [(0, 45.0)]),
    ("ulog", "temperatures", "sensor_accel", {"sensor_accel": {"temperature": 45.0}}, [(0, 45.0)]),
    ("telemetry", "temperatures", "RAW_IMU, SCALED_IMU2, SCALED_IMU3",
     {"RAW_IMU": {"temperature": 4500}, "SCALED_IMU2": {"temperature": -4600},
      "SCALED_IMU3": {"temperature": 4700}},
     [(0, 45.0), (1, -46.0), (2, 47.0)]),
    ("dataflash", "escs", "ESC",
     {"ESC": {"RPM": 5000, "Curr": 3.5, "Temp": 45.0}}, [(1, 5000, 3.5, 45.0)]),
    ("dataflash", "escs", "ESC{1}",
     {f"ESC{n}": {"RPM": 1000 * n} for n in (1, 2, 16, 17)},
     [(1, 1000, NAN, NAN), (2, 2000, NAN, NAN), (16, 16_000, NAN, NAN)]),
    ("ulog", "escs", "esc_status",
     {"esc_status": {**esc(0, rpm=5000, current=3.5, temperature=45.0), **esc(1, rpm=0),
                     **esc(7, rpm=[7000, -1], current=-1.0, temperature=-1.0),
                     **esc(8, rpm=9000)}},
     [(1, 5000, 3.5, 45.0), (8, NAN, NAN, NAN)]),
    ("telemetry", "escs", "ESC_TELEMETRY_1_TO_4, ESC_TELEMETRY_5_TO_8, ESC_TELEMETRY_9_TO_12",
     {f"ESC_TELEMETRY_{n}_TO_{n + 3}": ESC_4 for n in (1, 5, 9)},
     [(4 * group + n, 1000 * n, n, 10 * n) for group in range(3) for n in (1, 2, 3, 4)]),
    ("dataflash", "heights", "CTUN, INAV, XKF1, NKF1, BARO, BAR2, BAR3, RFND",
     {"CTUN": {"Alt": 1.0, "CRt": 150}, "INAV": {"IAlt": 2.0}, "XKF1": {"PD": -3.0, "VD": -0.5},
      "NKF1": {"PD": -4.0, "VD": 0.5}, "BARO": {"Alt": 5.0, "CRt": 0.25}, "BAR2": {"Alt": 6.0},
      "BAR3": {"Alt": 7.0}, "RFND": {"Dist": 8.0, "Dist1": 9.0, "Dist2": 10.0}},
     [("estimator", 0, 1.0, 1.5), ("estimator", 0, 2.0, NAN), ("EKF3", 0, 3.0, 0.5),
      ("EKF2", 0, 4.0, -0.5), ("barometer", 0, 5.0, 0.25), ("barometer", 1, 6.0, NAN),
      ("barometer", 2, 7.0, NAN), ("rangefinder", 0, 8.0, NAN), ("rangefinder", 0, 9.0, NAN),
      ("rangefinder", 1, 10.0, NAN)]),
    ("ulog", "heights",
     "vehicle_local_position, estimator_local_position, vehicle_air_data, sensor_combined, "
     "distance_sensor",
     {"vehicle_local_position": {"z": -1.0, "vz": -0.5},
      "estimator_local_position": {"z": -2.0, "vz": 0.5},
      "vehicle_air_data": {"baro_alt_meter": 3.0}, "sensor_combined": {"baro_alt_meter": 4.0},
      "distance_sensor": {"current_distance": 5.0}},
     [("estimator", 0, 1.0, 0.5), ("EKF2", 0, 2.0, -0.5), ("barometer", 0, 3.0, NAN),
      ("barometer", 0, 4.0, NAN), ("rangefinder", 0, 5.0, NAN)]),
    ("telemetry", "heights", "GLOBAL_POSITION_INT, SCALED_PRESSURE, DISTANCE_SENSOR",
     {"GLOBAL_POSITION_INT": {"relative_alt": 1500, "vz": -250},
      "SCALED_PRESSURE": {"press_abs": 1013.25}, "DISTANCE_SENSOR": {"current_distance": 250}},
     [("estimator", 0, 1.5, 2.5), ("barometer", 0, 0.0, NAN), ("rangefinder", 0, 2.5, NAN)]),
    ("dataflash", "health", "IMU, MAG, BARO",
     {"IMU": {"GH": 1, "EG": 2, "AH": 0, "EA": 3}, "MAG": {"Health": 1}, "BARO": {"Health": 0}},
     [("gyro", 0, 1, 2), ("accelerometer", 0, 0, 3), ("compass", 0, 1, NAN),
      ("barometer", 0, 0, NAN)]),
    ("dataflash", "health", "IMU, BARO",
     {"IMU": {"GyHlt": 1, "ErrG": 2, "AcHlt": 0, "ErrA": 3}, "BARO": {"H": 1}},
     [("gyro", 0, 1, 2), ("accelerometer", 0, 0, 3), ("barometer", 0, 1, NAN)]),
    ("ulog", "health",
     "vehicle_imu_status, sensor_gyro, sensor_accel, sensor_mag, sensor_baro, sensor_combined",
     {"vehicle_imu_status": {"gyro_error_count": 1, "accel_error_count": 2},
      "sensor_gyro": {"error_count": 3}, "sensor_accel": {"error_count": 4},
      "sensor_mag": {"error_count": 5}, "sensor_baro": {"error_count": 6},
      "sensor_combined": {"accelerometer_timestamp_relative": [0, 2_147_483_647]}},
     [("gyro", 0, NAN, 1), ("accelerometer", 0, NAN, 2), ("gyro", 0, NAN, 3),
      ("accelerometer", 0, NAN, 4), ("compass", 0, NAN, 5), ("barometer", 0, NAN, 6),
      ("accelerometer", 0, 0, NAN)]),
    ("ulog", "health", "sensors_status_imu",
     {"sensors_status_imu": {**STATUS, "gyro_healthy[3]": 0, "accel_device_ids[1]": 0}},
     [("gyro", 0, 1, NAN), ("gyro", 1, 1, NAN), ("gyro", 2, 1, NAN), ("gyro", 3, 0, NAN),
      ("accelerometer", 0, 1, NAN), ("accelerometer", 2, 1, NAN), ("accelerometer", 3, 1, NAN)]),
    ("dataflash", "outputs", "RCOU", {"RCOU": numbered("C{}", range(1100, 1114))},
     [(0, (*range(1100, 1114), NAN, NAN))]),
    ("dataflash", "outputs", "RCOU", {"RCOU": numbered("Ch{}", range(1100, 1116))},
     [(0, tuple(range(1100, 1116)))]),
    ("dataflash", "outputs", "RCOU", {"RCOU": numbered("Chan{}", range(1100, 1116))},
     [(0, tuple(range(1100, 1116)))]),
    ("ulog", "outputs", "actuator_outputs",
     {"actuator_outputs": numbered("output[{}]", range(1100, 1116), 0)},
     [(0, tuple(range(1100, 1116)))]),
    ("telemetry", "outputs", "SERVO_OUTPUT_RAW",
     {"SERVO_OUTPUT_RAW": numbered("servo{}_raw", range(1100, 1116))},
     [(0, tuple(range(1100, 1116)))]),
    ("ulog", "pilot", "manual_control_setpoint", {"manual_control_setpoint": STICKS},
     [(0.1, 0.2, 0.3, 0.25)]),
    ("ulog", "pilot", "manual_control_setpoint",
     {"manual_control_setpoint": {"y": 0.1, "x": -0.2, "r": 0.3, "z": 0.25}},
     [(0.1, 0.2, 0.3, 0.25)]),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "name", "origin", "messages", "expected"), RECORDS)
def test_records_in_their_units(kind, name, origin, messages, expected):
    found, where = filled(kind, name, *(MadeMessage(*each) for each in messages.items()))
    assert where == origin
    rows = [
        tuple(
            value if isinstance(value, int | str) else value[-1]
            for column, value in each._asdict().items()
            if column != "t_s"
        )
        for each in found
    ]
    assert len(rows) == len(expected)
    for row, right in zip(rows, expected, strict=True):
        for value, known in zip(row, right, strict=True):
            if isinstance(known, str):
                assert value == known
            else:
                np.testing.assert_allclose(value, known, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "name", "message", "columns"),
    [
        ("ulog", "batteries", "battery_status", {"voltage_v": 0.0, "current_a": 1.0}),
        ("telemetry", "batteries", "SYS_STATUS",
         {"voltage_battery": 0, "current_battery": 1, "battery_remaining": 1}),
        ("telemetry", "batteries", "SYS_STATUS",
         {"voltage_battery": 65_535, "current_battery": 1, "battery_remaining": 1}),
        ("dataflash", "temperatures", "IMU", {"T": 0.0}),
        ("ulog", "escs", "esc_status", esc(0, rpm=0, current=1.0)),
        ("telemetry", "escs", "ESC_TELEMETRY_1_TO_4", {**ESC_4, **numbered("rpm[{}]", [0] * 4, 0)}),
        ("telemetry", "heights", "DISTANCE_SENSOR", {"current_distance": 0}),
        ("dataflash", "outputs", "RCOU", {"C1": 0}),
        ("telemetry", "health", "SYS_STATUS",
         {"onboard_control_sensors_present": 0, "onboard_control_sensors_health": 0xFFFF}),
    ],
)  # fmt: skip
def test_what_is_never_known_is_no_record(kind, name, message, columns):
    assert filled(kind, name, MadeMessage(message, columns)) == ((), None)


@pytest.mark.parametrize(
    ("bit", "kind", "number"),
    [
        (0x01, "gyro", 0),
        (0x20000, "gyro", 1),
        (0x02, "accelerometer", 0),
        (0x40000, "accelerometer", 1),
        (0x04, "compass", 0),
        (0x80000, "compass", 1),
        (0x08, "barometer", 0),
        (0x20, "GPS", 0),
    ],
)
def test_bits_of_the_autopilots_sensors(bit, kind, number):
    columns = {"onboard_control_sensors_present": [bit, bit, 0xFFFFFF],
               "onboard_control_sensors_health": [bit, 0xFFFFFF ^ bit, bit]}  # fmt: skip
    found, _ = filled("telemetry", "health", MadeMessage("SYS_STATUS", columns))
    (own,) = (one for one in found if (one.kind, one.number) == (kind, number))
    assert own.healthy.tolist() == [1.0, 0.0, 1.0]
    for other in found:
        if other is not own:
            np.testing.assert_array_equal(other.healthy, [NAN, NAN, 0.0])


# --- what a factor cannot convert -------------------------------------------------------------


@pytest.mark.parametrize(
    ("form", "columns", "expected"),
    [
        ("throttle_share", {"x": [0.0, 1.5]}, [0.0, 1.5]),
        ("throttle_share", {"x": [0.0, 1.6, NAN]}, [0.0, 0.016, NAN]),
        ("throttle_share", {"x": [50, -100]}, [0.5, -1.0]),
        ("throttle_share", {"x": [50, 101]}, [0.05, 0.101]),
        ("board_volts", {"x": [10.0, 10.0, NAN]}, [10.0, 10.0, NAN]),
        ("board_volts", {"x": [10.5, 5000.0, 5000.0]}, [0.0105, 5.0, 5.0]),
        ("is_in_time", {"x": [2_147_483_646, 2_147_483_647, -5]}, [1.0, 0.0, 1.0]),
        ("is_not_set", {"x": [0, 1, 2]}, [1.0, 0.0, 0.0]),
        ("is_off_ground", {"x": [0, 1, 2]}, [NAN, 0.0, 1.0]),
        ("used_airspeed", {"x": [20.0, 20.0], "U": [0, 1]}, [NAN, 20.0]),
        ("from_both_sides", {"x": [-1.0, 0.0, 1.0]}, [0.0, 0.5, 1.0]),
        ("magnitude", {"x": [-0.5, 0.5]}, [0.5, 0.5]),
        ("range_in_use", {"x": [0.0, 0.01, -1.0]}, [NAN, 0.01, NAN]),
        ("range_in_use", {"x": 5.0, "Orient": [24, 25, 26]}, [NAN, 5.0, NAN]),
        ("range_in_use", {"x": 5.0, "orientation": [24, 25, 26]}, [NAN, 5.0, NAN]),
        ("range_in_use", {"x": 5.0, "Stat": [3, 4, 5]}, [NAN, 5.0, NAN]),
        ("range_in_use", {"x": [1.9, 2.0, 8.0, 8.1], "min_distance": 2.0, "max_distance": 8.0},
         [NAN, 2.0, 8.0, NAN]),
        # Half a range says nothing.
        ("range_in_use", {"x": [1.9, 9.0], "min_distance": 2.0}, [1.9, 9.0]),
        # The standard atmosphere (ISO 2533): 0, 1000 and 5000 m.
        ("pressure_height", {"x": [1013.25, 898.746, 540.199, 0.0, -1.0]},
         [0.0, 1000.0, 5000.0, NAN, NAN]),
    ],
)  # fmt: skip
def test_a_form(form, columns, expected):
    found = getattr(field_tables, form)(table(columns), "x")
    np.testing.assert_allclose(found, expected, atol=0.5 if form == "pressure_height" else 1e-12)


@pytest.mark.parametrize("name", ["airspeed_source", "selected_airspeed_index"])
def test_an_airspeed_is_that_of_sensors_one_to_three(name):
    columns = {"x": 20.0, name: np.array([-1, 0, 1, 3, 4], np.int8)}
    found = field_tables.measured_airspeed(table(columns), "x")
    np.testing.assert_array_equal(found, [NAN, NAN, 20.0, 20.0, NAN])


def test_a_target_counts_where_its_mask_demands_it():
    """ATTITUDE_TARGET: bits 0 to 2 ignore a rate each, all are needed; bit 7 the attitude."""
    columns = {**Q, **RATES, "type_mask": [0, 1, 2, 4, 128, 64]}
    log = MadeLog("telemetry", MadeMessage("ATTITUDE_TARGET", columns))
    found = read(log, (BY_NAME["demand"], BY_NAME["demanded_rates"])).values
    np.testing.assert_allclose(found["demand"].t_s, [0.0, 0.1, 0.2, 0.3, 0.5])
    np.testing.assert_allclose(found["demanded_rates"].t_s, [0.0, 0.4, 0.5])


def test_angles_are_those_of_a_quaternion_of_length_one():
    lengths = np.array([0.96, 1.04, 0.94, 1.06, 0.0, NAN])
    found = field_tables.angles_of(table({name: part * lengths for name, part in Q.items()}), *Q)
    np.testing.assert_array_equal(np.isfinite(found[:, 2]), [True, True, *[False] * 4])


@pytest.mark.parametrize(
    ("direction", "north", "east"),
    [(0, -5, 0), (90, 0, -5), (180, 5, 0), (225, 5 * FORTH, 5 * FORTH)],
)
def test_a_wind_is_named_by_where_it_comes_from(direction, north, east):
    columns = table({"speed": 5.0, "direction": float(direction)})
    np.testing.assert_allclose(
        field_tables.wind_towards(columns, "speed", "direction"), [(north, east)], atol=1e-12
    )
