"""Vehicle and control in ArduPilot's logs: demands, outputs, height, supply, faults.

Sources: ArduPilot's LogStructure.h and Log.cpp of its libraries and vehicles, 2014 to 2026;
`LogEvent` of AP_Logger.h.
"""

from collections.abc import Mapping

import numpy as np

from h2nav.maths.units import DEG
from h2nav.recordings.compass_rows import compass_rows
from h2nav.recordings.context import (
    Array,
    Battery,
    CompassRows,
    Esc,
    Motors,
    Occurrence,
    ReportedFault,
    Series,
    VibrationTrack,
)
from h2nav.recordings.dataflash_errors import said_of_error, subsystem_of
from h2nav.recordings.dataflash_rows import DataflashRows
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.motor_outputs import ardupilot_channels, ardupilot_range, motors_of
from h2nav.wire.imu import MOST_IMUS

MOST_OUTPUTS = 16
HIGHEST_M = 50_000.0
# Widths of the ranges in which old logs stored volts without a unit.
MOST_BOARD_VOLTS = 10.0
OCCURRENCES = {
    10: "armed",
    11: "disarmed",
    15: "auto armed",
    17: "maybe landed",
    18: "landed",
    19: "GPS lost",
    21: "flip began",
    22: "flip ended",
    25: "home set",
    28: "took off",
    30: "autotune began",
    33: "autotune succeeded",
    34: "autotune failed",
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
}


def demand(log: DataflashRows) -> Series | None:
    """Demanded roll, pitch and heading."""
    rows = log.find("ATT", "DesRoll", "DesPitch")
    if rows is None:
        return None
    columns = [rows.table.numbers_or_nan(name) for name in ("DesRoll", "DesPitch", "DesYaw")]
    return Series(rows.t_s, np.stack(columns, axis=1) * DEG)


def demanded_rates(log: DataflashRows) -> Series | None:
    """Demanded body rates."""
    for columns in (("RDes", "PDes", "YDes"), ("RllDes", "PitDes", "YawDes")):
        rows = log.find("RATE", *columns)
        if rows is not None:
            return Series(rows.t_s, rows.table.numbers(*columns) * DEG)
    return None


def motors(log: DataflashRows, parameters: Mapping[str, float], vehicle_type: int) -> Motors | None:
    """Outputs to the motors of a multirotor.

    Args:
        parameters: at the beginning: a change in flight renames no motor.
        vehicle_type: MAV_TYPE.
    """
    for prefix in ("C", "Ch", "Chan"):
        rows = log.find("RCOU", f"{prefix}1")
        if rows is None:
            continue
        names = [f"{prefix}{i + 1}" for i in range(MOST_OUTPUTS)]
        outputs = np.stack([rows.table.numbers(n) for n in names if n in rows.table], axis=1)
        channels = ardupilot_channels(parameters, vehicle_type, outputs)
        return motors_of(channels, rows.t_s, outputs, ardupilot_range(parameters))
    return None


def height(log: DataflashRows, column: str) -> Series | None:
    """Of CTUN: ``Alt`` is the estimate, ``DAlt`` the demand; m."""
    rows = log.find("CTUN", column)
    return None if rows is None else rows.series(column, largest=HIGHEST_M)


def climb(log: DataflashRows) -> Series | None:
    """Positive up; until 2017 centimetres a second."""
    rows = log.find("CTUN", "CRt")
    if rows is None:
        return None
    return Series(rows.t_s, hundredths(rows, "CRt"))


def baro_height(log: DataflashRows) -> Series | None:
    """Height of the first barometer."""
    for rows in log.instances("BARO", "Alt"):
        return rows.series("Alt", largest=HIGHEST_M)
    return None


def batteries(log: DataflashRows) -> tuple[Battery, ...]:
    """BAT, and CURR until 2018."""
    for name in ("BAT", "CURR"):
        found = [_battery(rows) for rows in log.instances(name, "Volt")]
        if found:
            return tuple(found)
    return ()


def _battery(rows: Rows) -> Battery:
    remaining = 0.01 * rows.table.numbers_or_nan("RemPct")
    remaining[(remaining < 0.0) | (remaining > 1.0)] = np.nan
    volts, amperes = hundredths(rows, "Volt"), hundredths(rows, "Curr")
    return Battery(rows.number, rows.t_s, volts, amperes, remaining)


def current(log: DataflashRows) -> Series | None:
    """Current of the first battery."""
    for name in ("BAT", "CURR"):
        for rows in log.instances(name, "Curr"):
            return Series.finite(rows.t_s, hundredths(rows, "Curr"))
    return None


def hundredths(rows: Rows, column: str) -> Array:
    """A column whose whole numbers are hundredths in old logs, which state no unit."""
    table, values = rows.table, rows.table.numbers_or_nan(column)
    is_plain = column not in table or table.kind(column) == "f" or table.is_scaled(column)
    return values if is_plain else values * 0.01


def board(log: DataflashRows) -> Series | None:
    """Supply of the autopilot; stored as volts or as millivolts over the years."""
    for name in ("POWR", "CURR"):
        rows = log.find(name, "Vcc")
        if rows is None:
            continue
        values = rows.table.numbers("Vcc")
        if not len(values) or float(np.nanmax(values)) <= 0.0:
            continue
        unit = 1e-3 if float(np.nanmedian(values)) > MOST_BOARD_VOLTS else 1.0
        return Series(rows.t_s, values * unit)
    return None


def vibrations(log: DataflashRows) -> tuple[VibrationTrack, ...]:
    """VIBE: of each IMU; until 2020 of one, with the clip counts of all."""
    axes = ("VibeX", "VibeY", "VibeZ")
    found = [
        VibrationTrack(rows.number, rows.t_s, rows.table.numbers(*axes), rows.table.numbers("Clip"))
        for rows in log.instances("VIBE", *axes, "Clip")
    ]
    if found:
        return tuple(found)
    rows = log.find("VIBE", *axes, "Clip0")
    if rows is None:
        return ()
    level, table = rows.table.numbers(*axes), rows.table
    clips = [(i, f"Clip{i}") for i in range(MOST_IMUS) if f"Clip{i}" in table]
    unknown = np.full_like(level, np.nan)
    return tuple(
        VibrationTrack(i, rows.t_s, unknown if i else level, table.numbers(name))
        for i, name in clips
    )


def escs(log: DataflashRows) -> tuple[Esc, ...]:
    """Telemetry of the motors' controllers; until 2020 a message for each."""
    numbered = ((i, log.find(f"ESC{i}", "RPM")) for i in range(1, MOST_OUTPUTS + 1))
    found = [(i, rows) for i, rows in numbered if rows is not None]
    found += [(rows.number + 1, rows) for rows in log.instances("ESC", "RPM")]
    names = ("RPM", "Curr", "Temp")
    return tuple(
        Esc(number, rows.t_s, *map(rows.table.numbers_or_nan, names)) for number, rows in found
    )


def compasses(log: DataflashRows, parameters: Mapping[str, float]) -> tuple[CompassRows, ...]:
    """MAG of each compass."""
    axes = ("MagX", "MagY", "MagZ")
    return tuple(
        compass_rows(rows.number, rows.t_s, rows.table.numbers(*axes), parameters)
        for rows in log.instances("MAG", *axes)
    )


def faults(log: DataflashRows) -> tuple[ReportedFault, ...]:
    """ERR, all subsystems."""
    rows = log.occasional("ERR", "Subsys", "ECode")
    if rows is None:
        return ()
    subsystems = rows.table.integers("Subsys").tolist()
    codes = rows.table.integers("ECode").tolist()
    return tuple(
        ReportedFault(t_s, subsystem_of(subsystem), code, said_of_error(subsystem, code))
        for t_s, subsystem, code in zip(rows.t_s.tolist(), subsystems, codes, strict=True)
        if said_of_error(subsystem, code)
    )


def occurrences(log: DataflashRows) -> tuple[Occurrence, ...]:
    """EV, without unnamed events."""
    rows = log.occasional("EV", "Id")
    if rows is None:
        return ()
    pairs = zip(rows.t_s.tolist(), rows.table.integers("Id").tolist(), strict=True)
    return tuple(Occurrence(t_s, n, OCCURRENCES[n]) for t_s, n in pairs if n in OCCURRENCES)
