"""Vehicle and control in PX4's logs: demands, outputs, height, supply, faults.

Sources: PX4's msg/*.msg, 2016 to 2026.
"""

from collections.abc import Mapping

import numpy as np

from h2nav.recordings.compass_rows import compass_rows
from h2nav.recordings.context import (
    Array,
    Battery,
    CompassRows,
    Esc,
    Motors,
    ReportedFault,
    Series,
    VibrationTrack,
)
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.motor_outputs import MULTIROTORS, motors_of, px4_channels
from h2nav.recordings.rotations import are_units, roll_pitch_heading
from h2nav.recordings.ulog_rows import ULogRows

MOST_OUTPUTS, MOST_ESCS = 16, 8
LEAST_US, MOST_US = 1000.0, 2000.0
# battery_status.warning, from low on.
BATTERY_WARNINGS = {
    1: "battery low",
    2: "battery critically low",
    3: "battery empty",
    4: "battery failed",
}
# failure_detector_status, and since 2021 the bits of vehicle_status.failure_detector_status.
FAILURES = {
    "fd_roll": ("failsafe", "roll beyond its limit"),
    "fd_pitch": ("failsafe", "pitch beyond its limit"),
    "fd_alt": ("failsafe", "height beyond its limit"),
    "fd_ext": ("failsafe", "failure reported from outside"),
    "fd_arm_escs": ("motor", "motor controllers did not arm"),
    "fd_battery": ("battery", "battery failure"),
    "fd_imbalanced_prop": ("motor", "propeller out of balance"),
    "fd_motor": ("motor", "motor failure"),
}


def demand(log: ULogRows) -> Series | None:
    """Demanded roll, pitch and heading."""
    columns = tuple(f"q_d[{i}]" for i in range(4))
    rows = log.find("vehicle_attitude_setpoint", *columns)
    if rows is not None:
        q = rows.table.numbers(*columns)
        good = are_units(q)
        if good.any():
            return Series(rows.t_s[good], roll_pitch_heading(q[good]))
    angles = ("roll_body", "pitch_body", "yaw_body")
    rows = log.find("vehicle_attitude_setpoint", *angles)
    return None if rows is None else Series(rows.t_s, rows.table.numbers(*angles))


def demanded_rates(log: ULogRows) -> Series | None:
    """Demanded body rates."""
    axes = ("roll", "pitch", "yaw")
    rows = log.find("vehicle_rates_setpoint", *axes)
    return None if rows is None else Series(rows.t_s, rows.table.numbers(*axes))


def motors(log: ULogRows, parameters: Mapping[str, float], vehicle_type: int) -> Motors | None:
    """Outputs to the motors of a multirotor, since 1.13 as shares."""
    if vehicle_type not in MULTIROTORS:
        return None
    names = [f"control[{i}]" for i in range(12)]
    rows = log.find("actuator_motors", *names)
    if rows is not None:
        shares = rows.table.numbers(*names)
        used = np.flatnonzero(np.isfinite(shares).any(axis=0))
        channels = {int(i): int(i) + 1 for i in used}
        pwm_us = LEAST_US + (MOST_US - LEAST_US) * shares
        return motors_of(channels, rows.t_s, pwm_us, (LEAST_US, MOST_US))
    names = [f"output[{i}]" for i in range(MOST_OUTPUTS)]
    found = list(log.instances("actuator_outputs", *names))
    if not found:
        return None
    rows = max(found, key=lambda one: len(one.t_s))
    channels = px4_channels(parameters, vehicle_type)
    least = parameters.get("PWM_MAIN_MIN") or parameters.get("PWM_MIN") or LEAST_US
    most = parameters.get("PWM_MAIN_MAX") or parameters.get("PWM_MAX") or MOST_US
    return motors_of(channels, rows.t_s, rows.table.numbers(*names), (least, most))


def local_position(log: ULogRows, column: str, sign: float) -> Series | None:
    """A column of the estimated position and velocity, NED."""
    rows = log.find("vehicle_local_position", column)
    return None if rows is None else Series.finite(rows.t_s, sign * rows.table.numbers(column))


def height_demand(log: ULogRows) -> Series | None:
    """Above the origin of the estimator; NaN where only a velocity is demanded."""
    rows = log.find("vehicle_local_position_setpoint", "z")
    return None if rows is None else Series.finite(rows.t_s, -rows.table.numbers("z"))


def baro_height(log: ULogRows) -> Series | None:
    """Above mean sea level in the standard atmosphere."""
    for topic, column in (
        ("vehicle_air_data", "baro_alt_meter"),
        ("sensor_combined", "baro_alt_meter"),
    ):
        rows = log.find(topic, column)
        if rows is not None:
            return rows.series(column)
    return None


def batteries(log: ULogRows) -> tuple[Battery, ...]:
    """The connected batteries."""
    return tuple(
        Battery(
            rows.number,
            rows.t_s,
            rows.table.numbers("voltage_v"),
            _column(rows, "current_a"),
            _column(rows, "remaining"),
        )
        for rows in log.instances("battery_status", "voltage_v")
        if (rows.table.numbers("voltage_v") > 0.0).any()
    )


def board(log: ULogRows) -> Series | None:
    """Supply of the autopilot."""
    rows = log.find("system_power", "voltage5v_v")
    return None if rows is None else rows.series("voltage5v_v")


def vibrations(log: ULogRows) -> tuple[VibrationTrack, ...]:
    """vehicle_imu_status since 1.12."""
    clips = tuple(f"accel_clipping[{axis}]" for axis in range(3))
    return tuple(
        VibrationTrack(
            rows.number,
            rows.t_s,
            rows.table.numbers("accel_vibration_metric")[:, None],
            rows.table.numbers(*clips).sum(axis=1),
        )
        for rows in log.instances("vehicle_imu_status", "accel_vibration_metric", *clips)
    )


def escs(log: ULogRows) -> tuple[Esc, ...]:
    """Telemetry of the motors' controllers."""
    found = []
    for number in range(MOST_ESCS):
        prefix = f"esc[{number}].esc_"
        rows = log.find("esc_status", f"{prefix}rpm")
        if rows is not None and rows.table.numbers(f"{prefix}rpm").any():
            columns = (_column(rows, f"{prefix}{n}") for n in ("rpm", "current", "temperature"))
            found.append(Esc(number + 1, rows.t_s, *columns))
    return tuple(found)


def compasses(log: ULogRows, parameters: Mapping[str, float]) -> tuple[CompassRows, ...]:
    """vehicle_magnetometer of each instance."""
    axes = tuple(f"magnetometer_ga[{axis}]" for axis in range(3))
    return tuple(
        compass_rows(rows.number, rows.t_s, rows.table.numbers(*axes), parameters)
        for rows in log.instances("vehicle_magnetometer", *axes)
    )


def faults(log: ULogRows) -> tuple[ReportedFault, ...]:
    """Failsafes, detected failures, and the battery's warnings, as they begin and end."""
    found = []
    rows = log.find("vehicle_status", "failsafe")
    if rows is not None:
        found += _flags(rows, "failsafe", "failsafe", "failsafe")
    status = log.find("failure_detector_status")
    for column, (subsystem, text) in FAILURES.items():
        if status is not None and column in status.table:
            found += _flags(status, column, subsystem, text)
    for rows in log.instances("battery_status", "warning"):
        levels = rows.table.integers("warning")
        for place in _changes(levels):
            level = int(levels[place])
            text = BATTERY_WARNINGS.get(level, "battery: over" if level == 0 else "")
            if text:
                found.append(ReportedFault(float(rows.t_s[place]), "battery", level, text))
    return tuple(sorted(found, key=lambda fault: fault.t_s))


def _flags(rows: Rows, column: str, subsystem: str, text: str) -> list[ReportedFault]:
    is_so = (rows.table.integers(column) != 0).astype(np.int64)
    return [
        ReportedFault(
            float(rows.t_s[place]),
            subsystem,
            int(is_so[place]),
            text if is_so[place] else f"{text}: over",
        )
        for place in _changes(is_so)
    ]


def _changes(values: np.ndarray) -> list[int]:
    """Places where a number differs from the previous one, which is 0 at first."""
    return [int(place) for place in np.flatnonzero(np.diff(values, prepend=0))]


def _column(rows: Rows, name: str) -> Array:
    """A column; NaN if it is absent, and where it is negative, which means unknown."""
    values = rows.table.numbers_or_nan(name)
    return np.where(values < 0.0, np.nan, values)
