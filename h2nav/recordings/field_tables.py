"""The column tables: where ArduPilot's logs, PX4's logs and telemetry store each quantity.

One row for each field and format; `h2nav.recordings.columns` reads them. Where a format spelled a
quantity differently over the years, the spelling of today comes first.

Sources: ArduPilot's LogStructure.h and Log.cpp of its libraries and vehicles, 2014 to 2026; PX4's
msg/*.msg, 2016 to 2026; the MAVLink common and ardupilotmega message definitions.
"""

from typing import Any

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import DEG
from h2nav.recordings.columns import Field, Form, LogColumn, Source, axes, column, series
from h2nav.recordings.context import (
    Array,
    Battery,
    Esc,
    HeightTrack,
    OutputBank,
    SensorHealth,
    Sticks,
    TemperatureTrack,
    VibrationTrack,
)
from h2nav.recordings.rotations import are_units, roll_pitch_heading
from h2nav.recordings.row_tables import Table
from h2nav.wire.position import FASTEST_M_S

MILLI, CENTI = 1e-3, 1e-2
HIGHEST_M = 50_000.0
MAX_OUTPUTS, MAX_ESCS = 16, 8
# Of DISTANCE_SENSOR, distance_sensor and RFND: it looks down.
HOTTEST_DEGC = 150.0
LOOKS_DOWN = mavlink.MAV_SENSOR_ROTATION_PITCH_270
RANGEFINDER_GOOD = 4  # RangeFinder::Status of RFND
# accelerometer_timestamp_relative without a value in time.
NO_SAMPLE = 2**31 - 1
# Widths of the ranges in which old logs stored volts without a unit.
MAX_BOARD_V = 10.0
MAX_TELEMETRY_V = 65.5349  # 65.535 means unknown
SEA_LEVEL_HPA = 1013.25
# AirspeedValidated.msg: 1 to 3 are sensors, -1 none, 0 ground speed less wind, 4 a model.
FIRST_AIRSPEED_SENSOR, LAST_AIRSPEED_SENSOR = 1, 3
NO_RATES, NO_ATTITUDE = 0b111, 0b1000_0000  # ATTITUDE_TARGET.type_mask: what is to be ignored


# --- what a factor cannot convert -------------------------------------------------------------


def hundredths(table: Table, name: str) -> Array:
    """A column whose whole numbers are hundredths in old logs, which state no unit."""
    values = table.numbers_or_nan(name)
    is_plain = name not in table or table.kind(name) == "f" or table.is_scaled(name)
    return values if is_plain else values * CENTI


def throttle_share(table: Table, name: str) -> Array:
    """A throttle: stored as a share, in percent or in thousandths over the years."""
    values = table.numbers(name)
    largest = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return values / (1.0 if largest <= 1.5 else 100.0 if largest <= 100.0 else 1000.0)


def board_volts(table: Table, name: str) -> Array:
    """The supply of ArduPilot's board: stored as volts or as millivolts over the years."""
    values = table.numbers(name)
    return values * (MILLI if np.nanmedian(values) > MAX_BOARD_V else 1.0)


def magnitude(table: Table, name: str) -> Array:
    """Without its sign: thrust points up, which is negative."""
    return np.abs(table.numbers(name))


def is_not_set(table: Table, name: str) -> Array:
    """1 where a flag is 0."""
    return np.asarray(table.integers(name) == 0, np.float64)


def is_in_time(table: Table, name: str) -> Array:
    """1 where the age of a sample is known: it came in time."""
    return np.asarray(table.integers(name) != NO_SAMPLE, np.float64)


def is_off_ground(table: Table, name: str) -> Array:
    """1 where MAV_LANDED_STATE is not on the ground; NaN where undefined."""
    states = table.integers(name)
    flies = (states != mavlink.MAV_LANDED_STATE_ON_GROUND).astype(np.float64)
    return np.where(states == mavlink.MAV_LANDED_STATE_UNDEFINED, np.nan, flies)


def angles_of(table: Table, *names: str) -> Array:
    """(N, 3) roll, pitch and heading of a quaternion; NaN where it is none."""
    q = table.numbers(*names)
    good = are_units(q)
    angles = np.full((len(q), 3), np.nan)
    angles[good] = roll_pitch_heading(q[good])
    return angles


def target_angles(table: Table, *names: str) -> Array:
    """The same of ATTITUDE_TARGET, where it demands an attitude."""
    is_demand = (table.integers("type_mask") & NO_ATTITUDE) == 0
    return np.where(is_demand[:, None], angles_of(table, *names), np.nan)


def target_rates(table: Table, *names: str) -> Array:
    """The rates of ATTITUDE_TARGET, where it demands any."""
    is_demand = (table.integers("type_mask") & NO_RATES) == 0
    return np.where(is_demand[:, None], table.numbers(*names), np.nan)


def wind_towards(table: Table, *names: str) -> Array:
    """(N, 2) velocity of the air, north and east, from its speed and where it comes from."""
    speed, direction = table.numbers(*names).T
    from_rad = np.radians(direction)
    return -np.stack((speed * np.cos(from_rad), speed * np.sin(from_rad)), axis=1)


def used_airspeed(table: Table, name: str) -> Array:
    """Where the autopilot uses it, if the log says so."""
    values = table.numbers(name)
    is_used = table.integers("U") != 0 if "U" in table else np.ones(len(values), np.bool_)
    return np.where(is_used & (np.abs(np.nan_to_num(values)) <= FASTEST_M_S), values, np.nan)


def measured_airspeed(table: Table, name: str) -> Array:
    """Where it is a sensor's, and not ground speed less wind or a model of the vehicle."""
    values = table.numbers(name)
    good = np.abs(np.nan_to_num(values)) <= FASTEST_M_S
    for column_name in ("airspeed_source", "selected_airspeed_index"):
        if column_name in table:
            source = table.integers(column_name)
            good &= (source >= FIRST_AIRSPEED_SENSOR) & (source <= LAST_AIRSPEED_SENSOR)
    return np.where(good, values, np.nan)


def range_in_use(table: Table, name: str) -> Array:
    """Of a rangefinder that looks down, within its range as far as the log tells it."""
    values = table.numbers(name)
    known = values > 0.0
    for column_name in ("Orient", "orientation"):
        if column_name in table:
            known &= table.integers(column_name) == LOOKS_DOWN
    if "Stat" in table:
        known &= table.integers("Stat") == RANGEFINDER_GOOD
    if "min_distance" in table and "max_distance" in table:
        known &= (values >= table.numbers("min_distance")) & (
            values <= table.numbers("max_distance")
        )
    return np.where(known, values, np.nan)


def from_both_sides(table: Table, name: str) -> Array:
    """-1 to 1 as 0 to 1."""
    return 0.5 + 0.5 * table.numbers(name)


def pressure_height(table: Table, name: str) -> Array:
    """Height in the standard atmosphere from a pressure in hPa."""
    pressure = table.numbers(name)
    ratio = np.where(pressure > 0.0, pressure, np.nan) / SEA_LEVEL_HPA
    return np.asarray(44_330.8 * (1.0 - ratio**0.190263))


def clips(table: Table, *names: str) -> Array:
    """The clip counts of the axes together."""
    return np.asarray(table.numbers(*names).sum(axis=1))


def row(table: Table, name: str) -> Array:
    """(N, 1) of a measure without axes."""
    return table.numbers(name)[:, None]


def system_bit(bit: int) -> Form:
    """Of SYS_STATUS: 1 where a sensor is healthy; NaN where there is none."""

    def form(table: Table, name: str) -> Array:
        is_present = table.integers("onboard_control_sensors_present") & bit
        is_healthy = table.integers(name) & bit
        return np.where(is_present != 0, (is_healthy != 0).astype(np.float64), np.nan)

    return form


def _numbered(name: str, count: int) -> tuple[str, ...]:
    return tuple(name.format(number + 1) for number in range(count))


# --- control and position: one series each ----------------------------------------------------

SERIES = (
    Field(
        "demand",
        "rad",
        is_partial=True,
        dataflash=(
            series("ATT", "DesRoll", "DesPitch", "DesYaw", scale=DEG),
            series("ATT", "DesRoll", "DesPitch", "", scale=DEG),
            series("ATT", "RollIn", "PitchIn", "NavYaw", scale=DEG),
        ),
        ulog=(
            series("vehicle_attitude_setpoint", *axes("q_d", 4), form=angles_of),
            series("vehicle_attitude_setpoint", "roll_body", "pitch_body", "yaw_body"),
        ),
        telemetry=(
            series("ATTITUDE_TARGET", *axes("q", 4), form=target_angles),
            # An autopilot that does not fill the message sends zeros throughout.
            series("NAV_CONTROLLER_OUTPUT", "nav_roll", "nav_pitch", "", scale=DEG, is_filled=True),
        ),
    ),
    Field(
        "demanded_rates",
        "rad/s",
        dataflash=(
            series("RATE", "RDes", "PDes", "YDes", scale=DEG),
            series("RATE", "RllDes", "PitDes", "YawDes", scale=DEG),
        ),
        ulog=(series("vehicle_rates_setpoint", "roll", "pitch", "yaw"),),
        telemetry=(
            series(
                "ATTITUDE_TARGET",
                *(f"body_{axis}_rate" for axis in ("roll", "pitch", "yaw")),
                form=target_rates,
            ),
        ),
    ),
    Field(
        "throttle",
        "share of full",
        dataflash=(
            series("CTUN", "ThO", form=throttle_share),
            series("CTUN", "ThrOut", form=throttle_share),
            series("CTUN", "ThrO", form=throttle_share),
        ),
        ulog=(
            series("vehicle_thrust_setpoint", "xyz[2]", form=magnitude),
            series("actuator_controls_0", "control[3]", form=magnitude),
            series("actuator_motors", "control[0]", form=magnitude),
        ),
        telemetry=(series("VFR_HUD", "throttle", scale=CENTI),),
    ),
    Field(
        "height_m",
        "m",
        dataflash=(
            series("CTUN", "Alt", largest=HIGHEST_M),
            series("INAV", "IAlt", largest=HIGHEST_M),
        ),
        ulog=(series("vehicle_local_position", "z", scale=-1.0),),
        telemetry=(
            series("GLOBAL_POSITION_INT", "relative_alt", scale=MILLI),
            series("VFR_HUD", "alt"),
        ),
    ),
    Field(
        "height_demand_m",
        "m",
        dataflash=(series("CTUN", "DAlt", largest=HIGHEST_M),),
        ulog=(series("vehicle_local_position_setpoint", "z", scale=-1.0),),
    ),
    Field(
        "climb_m_s",
        "m/s",
        dataflash=(
            series("CTUN", "CRt", form=hundredths),
            series("CTUN", "CRate", form=hundredths),
        ),
        ulog=(series("vehicle_local_position", "vz", scale=-1.0),),
        telemetry=(series("VFR_HUD", "climb"),),
    ),
    Field(
        "baro_height_m",
        "m",
        dataflash=(
            series("BARO", "Alt", largest=HIGHEST_M),
            series("CTUN", "BarAlt", largest=HIGHEST_M),
        ),
        ulog=(
            series("vehicle_air_data", "baro_alt_meter"),
            series("sensor_combined", "baro_alt_meter"),
        ),
    ),
    Field(
        "airborne",
        "1 while it is off the ground",
        ulog=(series("vehicle_land_detected", "landed", form=is_not_set),),
        telemetry=(series("EXTENDED_SYS_STATE", "landed_state", form=is_off_ground),),
    ),
    Field(
        "wind_n_m_s",
        "m/s",
        dataflash=tuple(
            series(name, "VWN", "VWE", largest=FASTEST_M_S) for name in ("XKF2", "NKF2", "EKF2")
        ),
        ulog=tuple(
            series(name, "windspeed_north", "windspeed_east", largest=FASTEST_M_S)
            for name in ("wind", "wind_estimate", "estimator_wind")
        ),
        telemetry=(
            series("WIND", "speed", "direction", form=wind_towards),
            series("WIND_COV", "wind_x", "wind_y"),
        ),
    ),
    Field(
        "current_a",
        "A",
        dataflash=(
            series("BAT", "Curr", form=hundredths),
            series("CURR", "Curr", form=hundredths),
        ),
        ulog=(series("battery_status", "current_a", least=0.0),),
        telemetry=(series("SYS_STATUS", "current_battery", scale=CENTI, least=0.0),),
    ),
    Field(
        "board_v",
        "V",
        dataflash=(
            series("POWR", "Vcc", form=board_volts, is_filled=True),
            series("CURR", "Vcc", form=board_volts, is_filled=True),
        ),
        ulog=(series("system_power", "voltage5v_v"),),
        telemetry=(series("POWER_STATUS", "Vcc", scale=MILLI, is_filled=True),),
    ),
    Field(
        "load",
        "share of the autopilot's processor",
        dataflash=(series("PM", "Load", scale=MILLI),),
        ulog=(series("cpuload", "load"),),
        telemetry=(series("SYS_STATUS", "load", scale=MILLI),),
    ),
    Field(
        "airspeed_m_s",
        "m/s",
        dataflash=tuple(series(name, "Airspeed", form=used_airspeed) for name in ("ARSP", "ASP")),
        ulog=tuple(
            series(topic, "true_airspeed_m_s", form=measured_airspeed)
            for topic in ("airspeed_validated", "airspeed")
        ),
    ),
    Field(
        "motor_shares",
        "share of full",
        is_partial=True,
        ulog=(series("actuator_motors", *axes("control", 12)),),
    ),
    Field(
        "motor_widths_us",
        "us",
        is_partial=True,
        # Until 2014: by number of the motor.
        dataflash=(series("MOT", *_numbered("Mot{}", 8), may_lack=True, is_filled=True),),
    ),
    Field(
        "channels_us",
        "us",
        is_partial=True,
        dataflash=(
            series("RCIN", *_numbered("C{}", MAX_OUTPUTS), may_lack=True, is_filled=True),
            series("RCIN", *_numbered("Ch{}", MAX_OUTPUTS), may_lack=True, is_filled=True),
        ),
        ulog=(series("input_rc", *axes("values", MAX_OUTPUTS), may_lack=True, is_filled=True),),
        telemetry=(
            series("RC_CHANNELS", *_numbered("chan{}_raw", MAX_OUTPUTS), is_filled=True),
            series("RC_CHANNELS_RAW", *_numbered("chan{}_raw", 8), is_filled=True),
        ),
    ),
)

# --- any number of each -----------------------------------------------------------------------

UNKNOWN_AXES = column("", "", "")

_CURR = {
    "voltage_v": column("Volt", form=hundredths),
    "current_a": column("Curr", form=hundredths, may_lack=True),
    "remaining": column("RemPct", scale=CENTI, least=0.0, most=1.0, may_lack=True),
}
_VIBE = {"level": column("VibeX", "VibeY", "VibeZ")}
_ESC = {
    "rpm": column("RPM"),
    "current_a": column("Curr", may_lack=True),
    "temperature_degc": column("Temp", may_lack=True),
}
_TELEMETRY_ESC = {
    "rpm": column("rpm[{0}]"),
    "current_a": column("current[{0}]", scale=CENTI),
    "temperature_degc": column("temperature[{0}]"),
}


def _health(kind: str, message: str, healthy: str = "", errors: str = "", **others: Any) -> Source:
    """The row of one kind of sensor: a flag, a count, or both."""
    columns = {"healthy": healthy, "errors": errors}
    return Source(
        message, {name: column(at) for name, at in columns.items() if at}, kind=kind, **others
    )


def _system(kind: str, bit: int, number: int = 0) -> Source:
    """Of SYS_STATUS."""
    healthy = column("onboard_control_sensors_health", form=system_bit(bit))
    return Source("SYS_STATUS", {"healthy": healthy}, kind=kind, first=number)


def _height(kind: str, message: str, height: LogColumn, climb: LogColumn, **others: Any) -> Source:
    return Source(message, {"height_m": height, "climb_m_s": climb}, kind=kind, **others)


NO_CLIMB = column("")

_WARM: Any = {"needs": "temperature_degc"}  # 0 throughout means that it is not measured

RECORDS = (
    Field(
        "batteries",
        "V, A, share",
        record=Battery,
        dataflash=(Source("BAT", _CURR), Source("CURR", _CURR)),
        ulog=(
            Source(
                "battery_status",
                {
                    "voltage_v": column("voltage_v"),
                    "current_a": column("current_a", least=0.0, may_lack=True),
                    "remaining": column("remaining", least=0.0, may_lack=True),
                },
                needs="voltage_v",
            ),
        ),
        telemetry=(
            Source(
                "SYS_STATUS",
                {
                    "voltage_v": column(
                        "voltage_battery", scale=MILLI, least=MILLI, most=MAX_TELEMETRY_V
                    ),
                    "current_a": column("current_battery", scale=CENTI, least=0.0),
                    "remaining": column("battery_remaining", scale=CENTI, least=0.0),
                },
                needs="voltage_v",
            ),
        ),
    ),
    Field(
        "vibrations",
        "m/s^2, samples",
        record=VibrationTrack,
        dataflash=(
            Source("VIBE", {**_VIBE, "clipped": column("Clip")}),
            # Until 2020: of one IMU, with the clip counts of all.
            (
                Source("VIBE", {**_VIBE, "clipped": column("Clip0")}),
                Source("VIBE", {"level": UNKNOWN_AXES, "clipped": column("Clip1")}, first=1),
                Source("VIBE", {"level": UNKNOWN_AXES, "clipped": column("Clip2")}, first=2),
            ),
        ),
        ulog=(
            Source(
                "vehicle_imu_status",
                {
                    "level": column("accel_vibration_metric", form=row),
                    "clipped": column(*axes("accel_clipping"), form=clips),
                },
            ),
        ),
        telemetry=(
            (
                Source(
                    "VIBRATION",
                    {
                        "level": column("vibration_x", "vibration_y", "vibration_z"),
                        "clipped": column("clipping_0"),
                    },
                ),
                Source(
                    "VIBRATION", {"level": UNKNOWN_AXES, "clipped": column("clipping_1")}, first=1
                ),
                Source(
                    "VIBRATION", {"level": UNKNOWN_AXES, "clipped": column("clipping_2")}, first=2
                ),
            ),
        ),
    ),
    Field(
        "temperatures",
        "degC",
        record=TemperatureTrack,
        dataflash=(
            Source("IMU", {"temperature_degc": column("T", largest=HOTTEST_DEGC)}, **_WARM),
            Source("IMU", {"temperature_degc": column("Temp", largest=HOTTEST_DEGC)}, **_WARM),
        ),
        ulog=(
            Source(
                "vehicle_imu_status",
                {"temperature_degc": column("temperature_accel", largest=HOTTEST_DEGC)},
                **_WARM,
            ),
            Source(
                "sensor_accel",
                {"temperature_degc": column("temperature", largest=HOTTEST_DEGC)},
                **_WARM,
            ),
        ),
        telemetry=(
            tuple(
                Source(
                    name,
                    {
                        "temperature_degc": column(
                            "temperature", scale=CENTI, largest=HOTTEST_DEGC, may_lack=True
                        )
                    },
                    first=first,
                    **_WARM,
                )
                for first, name in enumerate(("RAW_IMU", "SCALED_IMU2", "SCALED_IMU3"))
            ),
        ),
    ),
    Field(
        "escs",
        "1/min, A, degC",
        record=Esc,
        # Until 2020 a message for each.
        dataflash=(
            (Source("ESC{1}", _ESC, packed=MAX_OUTPUTS, first=1), Source("ESC", _ESC, first=1)),
        ),
        ulog=(
            Source(
                "esc_status",
                {
                    "rpm": column("esc[{0}].esc_rpm", least=0.0),
                    "current_a": column("esc[{0}].esc_current", least=0.0, may_lack=True),
                    "temperature_degc": column(
                        "esc[{0}].esc_temperature", least=0.0, may_lack=True
                    ),
                },
                packed=MAX_ESCS,
                first=1,
                needs="rpm",
            ),
        ),
        telemetry=(
            tuple(
                Source(
                    f"ESC_TELEMETRY_{n}_TO_{n + 3}", _TELEMETRY_ESC, packed=4, first=n, needs="rpm"
                )
                for n in (1, 5, 9)
            ),
        ),
    ),
    Field(
        "heights",
        "m, m/s",
        record=HeightTrack,
        dataflash=(
            (
                _height("estimator", "CTUN", column("Alt"), column("CRt", form=hundredths)),
                _height("estimator", "INAV", column("IAlt"), NO_CLIMB),
                _height("EKF3", "XKF1", column("PD", scale=-1.0), column("VD", scale=-1.0)),
                _height("EKF2", "NKF1", column("PD", scale=-1.0), column("VD", scale=-1.0)),
                _height("barometer", "BARO", column("Alt"), column("CRt", may_lack=True)),
                _height("barometer", "BAR2", column("Alt"), column("CRt", may_lack=True), first=1),
                _height("barometer", "BAR3", column("Alt"), column("CRt", may_lack=True), first=2),
                _height("rangefinder", "RFND", column("Dist", form=range_in_use), NO_CLIMB),
                _height("rangefinder", "RFND", column("Dist1", form=range_in_use), NO_CLIMB),
                _height(
                    "rangefinder", "RFND", column("Dist2", form=range_in_use), NO_CLIMB, first=1
                ),
            ),
        ),
        ulog=(
            (
                _height(
                    "estimator",
                    "vehicle_local_position",
                    column("z", scale=-1.0),
                    column("vz", scale=-1.0),
                ),
                _height(
                    "EKF2",
                    "estimator_local_position",
                    column("z", scale=-1.0),
                    column("vz", scale=-1.0),
                ),
                _height("barometer", "vehicle_air_data", column("baro_alt_meter"), NO_CLIMB),
                _height("barometer", "sensor_combined", column("baro_alt_meter"), NO_CLIMB),
                _height(
                    "rangefinder",
                    "distance_sensor",
                    column("current_distance", form=range_in_use),
                    NO_CLIMB,
                ),
            ),
        ),
        telemetry=(
            (
                _height(
                    "estimator",
                    "GLOBAL_POSITION_INT",
                    column("relative_alt", scale=MILLI),
                    column("vz", scale=-CENTI),
                ),
                _height(
                    "barometer",
                    "SCALED_PRESSURE",
                    column("press_abs", form=pressure_height),
                    NO_CLIMB,
                ),
                _height(
                    "rangefinder",
                    "DISTANCE_SENSOR",
                    column("current_distance", scale=CENTI, form=range_in_use),
                    NO_CLIMB,
                    needs="height_m",
                ),
            ),
        ),
    ),
    Field(
        "health",
        "1 = healthy; count",
        record=SensorHealth,
        dataflash=(
            (
                _health("gyro", "IMU", "GH", "EG"),
                _health("accelerometer", "IMU", "AH", "EA"),
                _health("gyro", "IMU", "GyHlt", "ErrG"),
                _health("accelerometer", "IMU", "AcHlt", "ErrA"),
                _health("compass", "MAG", "Health"),
                _health("barometer", "BARO", "Health"),
                _health("barometer", "BARO", "H"),
            ),
        ),
        ulog=(
            (
                _health("gyro", "vehicle_imu_status", errors="gyro_error_count"),
                _health("accelerometer", "vehicle_imu_status", errors="accel_error_count"),
                _health("gyro", "sensor_gyro", errors="error_count"),
                _health("accelerometer", "sensor_accel", errors="error_count"),
                _health("compass", "sensor_mag", errors="error_count"),
                _health("barometer", "sensor_baro", errors="error_count"),
                Source(
                    "sensor_combined",
                    {"healthy": column("accelerometer_timestamp_relative", form=is_in_time)},
                    kind="accelerometer",
                ),
                *(
                    Source(
                        "sensors_status_imu",
                        {
                            "healthy": column(f"{name}_healthy[{{0}}]"),
                            "device": column(f"{name}_device_ids[{{0}}]"),
                        },
                        kind=kind,
                        packed=4,
                        needs="device",
                    )
                    for name, kind in (("gyro", "gyro"), ("accel", "accelerometer"))
                ),
            ),
        ),
        telemetry=(
            (
                _system("gyro", mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO),
                _system("gyro", mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO2, 1),
                _system("accelerometer", mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL),
                _system("accelerometer", mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL2, 1),
                _system("compass", mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG),
                _system("compass", mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG2, 1),
                _system("barometer", mavlink.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE),
                _system("GPS", mavlink.MAV_SYS_STATUS_SENSOR_GPS),
            ),
        ),
    ),
    Field(
        "outputs",
        "us",
        record=OutputBank,
        dataflash=tuple(
            Source(
                "RCOU",
                {"values": column(*_numbered(name, MAX_OUTPUTS), may_lack=True)},
                needs="values",
            )
            for name in ("C{}", "Ch{}", "Chan{}")
        ),
        ulog=(Source("actuator_outputs", {"values": column(*axes("output", MAX_OUTPUTS))}),),
        telemetry=(
            Source(
                "SERVO_OUTPUT_RAW",
                {"values": column(*_numbered("servo{}_raw", MAX_OUTPUTS))},
            ),
        ),
    ),
    Field(
        "pilot",
        "share of travel",
        record=Sticks,
        ulog=(
            Source(
                "manual_control_setpoint",
                {
                    "roll": column("roll"),
                    "pitch": column("pitch", scale=-1.0),
                    "yaw": column("yaw"),
                    "throttle": column("throttle", form=from_both_sides),
                },
            ),
            # Until 1.13.
            Source(
                "manual_control_setpoint",
                {
                    "roll": column("y"),
                    "pitch": column("x", scale=-1.0),
                    "yaw": column("r"),
                    "throttle": column("z"),
                },
            ),
        ),
    ),
)

FIELDS = (*SERIES, *RECORDS)
"""All of them."""
