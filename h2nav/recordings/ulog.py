"""PX4's ULog files as events of the service, and as context for the review.

Topics and fields have changed since 2016: sensor_combined included the magnetometer, receivers were
vehicle_gps_position, and since 1.11 every IMU has its vehicle_imu, which the default set of topics
logs twice a second, so that only sensor_combined is usable then.

Sources: PX4's msg/*.msg, 2016 to 2026.
"""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings import imu_series
from h2nav.recordings import ulog_controls as controls
from h2nav.recordings.attitude_tables import attitudes_of, truth_of
from h2nav.recordings.autopilot_log import (
    MAX_BURSTS,
    AutopilotLog,
    Recorded,
    Setting,
    completed,
    imus_of,
)
from h2nav.recordings.compass_tables import (
    compass_columns,
    compass_tracks,
    fields_of,
    statistics_of,
)
from h2nav.recordings.context import (
    Burst,
    Context,
    Span,
)
from h2nav.recordings.context_fields import table_fields
from h2nav.recordings.imu_series import ImuRows, Samples
from h2nav.recordings.imu_tables import ImuColumns, devices_in_use, imu_columns
from h2nav.recordings.log_rows import MAX_INSTANCES, Rows
from h2nav.recordings.receiver_tables import receivers_of, start_unix_s
from h2nav.recordings.text_tables import said_of
from h2nav.recordings.ulog_rows import ULogRows
from h2nav.recordings.ulog_tables import ULogFile, read_ulog

ARMED = 2
FIFO_VALUES = 32
MODES = {
    0: "MANUAL",
    1: "ALTCTL",
    2: "POSCTL",
    3: "AUTO_MISSION",
    4: "AUTO_LOITER",
    5: "AUTO_RTL",
    6: "POSITION_SLOW",
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
    **{23 + number: f"EXTERNAL{number + 1}" for number in range(8)},
}
# vehicle_status.vehicle_type, if no MAV_TYPE is known.
VEHICLE_TYPES = {
    1: mavlink.MAV_TYPE_QUADROTOR,
    2: mavlink.MAV_TYPE_FIXED_WING,
    3: mavlink.MAV_TYPE_GROUND_ROVER,
    4: mavlink.MAV_TYPE_AIRSHIP,
}
# The estimator selected by SYS_MC_EST_GROUP, while there was a choice.
EKF2_GROUP = 2.0


class ULog(AutopilotLog):
    """A ``.ulg`` file."""

    kind = "ulog"

    def _read(self) -> Recorded:
        return recorded(read_ulog(self.path))


def open_ulog(path: Path) -> ULog:
    """Opens a log of PX4; raises BadInput if it cannot be opened, or is not a ULog."""
    return ULog(path)


def recorded(file: ULogFile) -> Recorded:
    """Reads the contents of a file."""
    log = ULogRows(file)
    settings = _settings(log)
    parameters = {setting.name: setting.value for setting in settings}
    vehicle_type = _vehicle_type(log, parameters)
    compasses = compass_columns(log)
    imus, readings = imus_of(log, _imu_rows(log), fields_of(compasses))
    receivers = receivers_of(log)
    kind = (mavlink.MAV_AUTOPILOT_PX4, vehicle_type)
    attitudes = attitudes_of(log, _flown_by(parameters))
    context = Context(
        firmware=_firmware(log),
        uid=str(log.file.info.get("sys_uuid", "")).lower(),
        board=str(log.file.info.get("ver_hw", "")),
        system_id=int(parameters.get("MAV_SYS_ID", 0.0)),
        start_unix_s=start_unix_s(log),
        imus=imus,
        compasses=tuple(compass_tracks(log, compasses)),
        bursts=_bursts(log),
        attitudes=attitudes,
        truth=truth_of(log),
        gps=receivers.tracks,
        modes=_modes(log),
        primary=_primary(log),
        said=said_of(log),
        vehicle_type=vehicle_type,
        compass_rows=statistics_of(compasses, parameters),
        faults=controls.faults(log),
        silent=log.silences(),
        **table_fields(log, parameters, kind, receivers.tracks),
    )
    hidden = "only one IMU, because the others were logged too seldom"
    return Recorded(
        completed(context, log, settings, _armed(log), {hidden: _hides_imus(log, context)}),
        *kind,
        log.clock.start_us,
        readings,
        receivers.used,
        receivers.fix_us,
        flown=attitudes[0] if attitudes else None,
        airspeed_m_s=context.measured["airspeed_m_s"],
        airspeed_is_true=True,
        settings=settings,
    )


# --- inertial sensors and compasses -----------------------------------------------------------


def _imu_rows(log: ULogRows) -> list[ImuRows]:
    """Means of every IMU over the time before them, from the first topic with a sufficient rate."""
    found = imu_columns(log)
    choices = (
        [one.as_rows(one.device_ids) for one in found if one.message == "vehicle_imu"],
        [one.as_rows(devices_in_use(log)) for one in found if one.message == "sensor_combined"],
        _single_sensors(found),
    )
    fast = [
        [rows for rows in found if rows.samples.rate_hz >= imu_series.MIN_IMU_HZ]
        for found in choices
    ]
    return next((rows for rows in (*fast, *choices) if rows), [])


def _single_sensors(found: list[ImuColumns]) -> list[ImuRows]:
    """sensor_gyro and sensor_accel of the same number, with the newest force at each rate."""
    accels = {one.number: one for one in found if one.message == "sensor_accel"}
    pairs = []
    for gyro in found:
        if gyro.message != "sensor_gyro" or gyro.number not in accels:
            continue
        accel, t_us = accels[gyro.number], gyro.rows.sample_us
        place = np.searchsorted(accel.rows.sample_us, t_us, side="right") - 1
        has_force = place >= 0
        samples = Samples(t_us[has_force], gyro.w_b[has_force], accel.f_b[place[has_force]])
        pairs.append(ImuRows(gyro.number, "sensor_gyro", samples, np.zeros(len(samples.t_us))))
    return pairs


def _hides_imus(log: ULogRows, context: Context) -> bool:
    """Whether there is a second IMU with too few logged samples."""
    others = [rows.number for rows in log.instances("vehicle_imu", "delta_angle_dt")]
    return len(others) > 1 and [track.source for track in context.imus] == ["sensor_combined"]


def _bursts(log: ULogRows) -> tuple[Burst, ...]:
    """Contents of the sensors' own buffers: up to 32 raw values per message, of about 1 ms each."""
    found: list[Burst] = []
    for topic, sensor in (
        ("sensor_gyro_fifo", "gyro"),
        ("sensor_accel_fifo", "accelerometer"),
    ):
        for rows in log.instances(topic, "samples", "dt", "scale", "x[0]", "y[0]", "z[0]"):
            found += _fifo(log, rows, sensor)
    return tuple(found[:MAX_BURSTS])


def _fifo(log: ULogRows, rows: Rows, sensor: str) -> Iterator[Burst]:
    """Messages without a gap between them form one burst."""
    table = rows.table
    size = sum(all(f"{axis}[{n}]" in table for axis in "xyz") for n in range(FIFO_VALUES))
    # (N, size, 3)
    values = np.stack(
        [table.numbers(*(f"{axis}[{number}]" for axis in "xyz")) for number in range(size)], axis=1
    )
    counts = table.integers("samples").clip(0, size)
    dt_us, scale = table.numbers("dt"), table.numbers("scale")
    usual_us = float(np.median(dt_us))
    if not usual_us > 0.0:
        return
    ends = rows.sample_us
    gaps = np.abs(np.diff(ends) - counts[1:] * usual_us) > 0.5 * counts[1:] * usual_us
    edges = [0, *(np.flatnonzero(gaps) + 1).tolist(), len(ends)]
    for first, last in pairwise(edges):
        valid = np.arange(size) < counts[first:last, None]
        part = (values[first:last] * scale[first:last, None, None])[valid]
        if len(part) >= 2 * FIFO_VALUES and np.isfinite(part).all():
            t_s = float(log.since_start(ends[first : first + 1])[0])
            yield Burst(rows.number, sensor, t_s, 1e6 / usual_us, part)


# --- attitudes --------------------------------------------------------------------------------


def _flown_by(parameters: dict[str, float]) -> str:
    """Name of the estimator used for control."""
    chosen = parameters.get("SYS_MC_EST_GROUP", EKF2_GROUP)
    return "EKF2" if chosen == EKF2_GROUP else "attitude_estimator_q"


def _primary(log: ULogRows) -> tuple[Span, ...]:
    """The instance of the estimator in use."""
    rows = log.find("estimator_selector_status", "primary_instance")
    if rows is None:
        return ()
    numbers = rows.table.integers("primary_instance").tolist()
    names = (f"EKF2 instance {n + 1}" if n < MAX_INSTANCES else "" for n in numbers)
    return log.spans(rows, names)


# --- the vehicle ------------------------------------------------------------------------------


def _settings(log: ULogRows) -> tuple[Setting, ...]:
    """Parameters; a change has the time of the surrounding data."""
    stored = log.file.parameters
    times = log.clock.at(np.array([place for place, _, _ in stored], np.int64)).tolist()
    return tuple(
        Setting(t_us, name, value) for t_us, (_, name, value) in zip(times, stored, strict=True)
    )


def _vehicle_type(log: ULogRows, parameters: dict[str, float]) -> int:
    """MAV_TYPE: from the parameter, the status of old logs, or the class of vehicle."""
    for value in (parameters.get("MAV_TYPE"), _usual(log, "system_type")):
        if value in mavlink.enums["MAV_TYPE"] and value:
            return int(value)
    return int(VEHICLE_TYPES.get(_usual(log, "vehicle_type"), mavlink.MAV_TYPE_GENERIC))


def _usual(log: ULogRows, column: str) -> int:
    """The most frequent value in vehicle_status; 0 without any."""
    rows = log.find("vehicle_status", column)
    return (
        0 if rows is None else int(np.bincount(rows.table.integers(column).clip(0, 255)).argmax())
    )


def _firmware(log: ULogRows) -> str:
    """Such as ``PX4 v1.14.3``: four bytes, the last of which marks releases."""
    info = log.file.info
    name, release = info.get("sys_name", ""), info.get("ver_sw_release", 0.0)
    if isinstance(release, float) and release > 0.0:
        number = int(release)
        version = f"v{number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}"
    else:
        version = str(info.get("ver_sw", ""))[:8]
    return f"{name} {version}".strip()


def _modes(log: ULogRows) -> tuple[Span, ...]:
    rows = log.find("vehicle_status", "nav_state")
    if rows is None:
        return ()
    numbers = rows.table.integers("nav_state").tolist()
    names = (MODES.get(number, f"mode {number}") for number in numbers)
    return log.spans(rows, names)


def _armed(log: ULogRows) -> tuple[Span, ...] | None:
    """While it was armed; None if unknown."""
    rows = log.find("vehicle_status", "arming_state")
    if rows is not None:
        armed = rows.table.integers("arming_state") == ARMED
    else:
        rows = log.find("actuator_armed", "armed")
        if rows is None:
            return None
        armed = rows.table.integers("armed") != 0
    names = ("armed" if is_armed else "" for is_armed in armed.tolist())
    return log.spans(rows, names)
