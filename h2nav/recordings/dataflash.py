"""ArduPilot's dataflash logs as events of the service, and as context for the review.

Messages and columns have changed since 2014: a second IMU was IMU2, now it is IMU with a number;
times were in milliseconds, angles in hundredths of degrees. The reader returns physical values, and
this module looks for every spelling.

Sources: ArduPilot's LogStructure.h and Log.cpp of its libraries and vehicles, 2014 to 2026.
"""

import math
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Severity
from h2nav.recordings import dataflash_controls as controls
from h2nav.recordings import flight_modes
from h2nav.recordings.airframe_identity import ardupilot_board
from h2nav.recordings.attitude_tables import attitudes_of, truth_of
from h2nav.recordings.autopilot_log import (
    MAX_BURSTS,
    AutopilotLog,
    Recorded,
    Setting,
    completed,
    imus_of,
)
from h2nav.recordings.board_trim import Trim
from h2nav.recordings.compass_tables import (
    compass_columns,
    compass_tracks,
    fields_of,
    statistics_of,
)
from h2nav.recordings.context import (
    Array,
    Burst,
    Context,
    Said,
    Series,
    Span,
)
from h2nav.recordings.context_fields import table_fields
from h2nav.recordings.dataflash_errors import said_of_error
from h2nav.recordings.dataflash_rows import DataflashRows
from h2nav.recordings.dataflash_tables import read_dataflash
from h2nav.recordings.imu_series import ImuRows
from h2nav.recordings.imu_tables import imu_columns
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.receiver_tables import is_on_earth, receivers_of, start_unix_s
from h2nav.recordings.row_tables import LogTables
from h2nav.recordings.spans import spans
from h2nav.recordings.text_tables import said_of
from h2nav.wire.imu import MAX_IMUS
from h2nav.wire.position import Place

ARMED, DISARMED, LAND_COMPLETE, NOT_LANDED = 10, 11, 18, 28
# Raw values come in blocks; a gap of more periods begins another.
BURST_PAUSE = 5.0
MIN_BURST = 64
BATCH_ROW = (32,)
BURST_KINDS = {0: "accelerometer", 1: "gyro"}
# Largest interval between an error and its text.
IN_WORDS_S = 0.5
# FRAME_CLASS of a copter -> MAV_TYPE; 0 and 1 are quadrotors.
COPTERS = {
    2: mavlink.MAV_TYPE_HEXAROTOR,
    3: mavlink.MAV_TYPE_OCTOROTOR,
    4: mavlink.MAV_TYPE_OCTOROTOR,
    5: mavlink.MAV_TYPE_HEXAROTOR,
    6: mavlink.MAV_TYPE_HELICOPTER,
    7: mavlink.MAV_TYPE_TRICOPTER,
    8: mavlink.MAV_TYPE_COAXIAL,
    9: mavlink.MAV_TYPE_COAXIAL,
    10: mavlink.MAV_TYPE_COAXIAL,
    11: mavlink.MAV_TYPE_HELICOPTER,
    12: mavlink.MAV_TYPE_DODECAROTOR,
    13: mavlink.MAV_TYPE_HELICOPTER,
    14: mavlink.MAV_TYPE_DECAROTOR,
}
# Until 2017 only the firmware knew; these parameters no other copter has.
OF_HELICOPTERS = ("H_COL_MAX", "H_COL_MID", "H_RSC_MODE")


SECOND = "AHRS2"
# AHRS_EKF_TYPE and ATT.AEKF.
ESTIMATORS = {0: "DCM", 1: "EKF1", 2: "EKF2", 3: "EKF3"}


class VehicleKind(NamedTuple):
    """A vehicle's firmware and how to recognise it by texts and parameters."""

    names: tuple[str, ...]  # beginnings of its version
    parameters: tuple[str, ...]  # that it alone has, in some year
    vehicle_type: int  # MAV_TYPE
    modes: dict[int, str]  # number -> name


COPTER = VehicleKind(
    ("ArduCopter", "APM:Copter", "Copter"),
    ("MOT_SPIN_ARM", "MOT_SPIN_ARMED", "MOT_THST_HOVER", "THR_MID", "WPNAV_SPEED", "WPNAV_RADIUS"),
    mavlink.MAV_TYPE_QUADROTOR,
    flight_modes.COPTER,
)
KINDS = (
    VehicleKind(
        ("ArduSub",),
        ("JS_GAIN_DEFAULT", "SURFACE_DEPTH"),
        mavlink.MAV_TYPE_SUBMARINE,
        flight_modes.SUB,
    ),
    VehicleKind(
        ("ArduRover", "APMrover2", "APM:Rover", "Rover"),
        ("CRUISE_SPEED", "STEER2SRV_P"),
        mavlink.MAV_TYPE_GROUND_ROVER,
        flight_modes.ROVER,
    ),
    VehicleKind(
        ("ArduPlane", "APM:Plane", "Plane"),
        ("TECS_CLMB_MAX", "RLL2SRV_P", "RLL2SRV_TCONST", "TRIM_ARSPD_CM", "AIRSPEED_CRUISE"),
        mavlink.MAV_TYPE_FIXED_WING,
        flight_modes.PLANE,
    ),
    VehicleKind(
        ("AntennaTracker", "ArduTracker"),
        ("PITCH_SRV_RATE",),
        mavlink.MAV_TYPE_ANTENNA_TRACKER,
        flight_modes.TRACKER,
    ),
    COPTER,
)
UNKNOWN = VehicleKind((), (), mavlink.MAV_TYPE_GENERIC, {})


class DataflashLog(AutopilotLog):
    """A ``.bin`` file, or its text form ``.log``."""

    kind = "dataflash"

    def _read(self) -> Recorded:
        return recorded(read_dataflash(self.path))


def open_dataflash(path: Path) -> DataflashLog:
    """Opens a log of ArduPilot; raises BadInput if it cannot be opened."""
    return DataflashLog(path)


def recorded(tables: LogTables) -> Recorded:
    """Reads the tables of a log."""
    log = DataflashRows(tables)
    settings = _settings(log)
    parameters = {setting.name: setting.value for setting in settings}
    said = _said(log)
    firmware = _firmware(log, said)
    kind = _kind_of(firmware, parameters)
    vehicle_type = _vehicle_type(kind, parameters)
    trim = Trim(parameters)
    compasses = compass_columns(log)
    fields = fields_of(compasses, trim.vectors)
    imus, readings = imus_of(log, _imu_rows(log), fields, trim.vectors)
    receivers = receivers_of(log)
    attitudes = attitudes_of(log, _flown_by(parameters), trim)
    autopilot = (mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, vehicle_type)
    table = table_fields(log, _first_values(settings), autopilot, receivers.tracks)
    table["airborne"] = _airborne(log)
    board, uid = ardupilot_board(one.text for one in said)
    context = Context(
        firmware=firmware,
        uid=uid,
        board=board,
        system_id=int(parameters.get("MAV_SYSID", parameters.get("SYSID_THISMAV", 0.0))),
        start_unix_s=start_unix_s(log),
        imus=imus,
        compasses=tuple(compass_tracks(log, compasses)),
        bursts=_bursts(log),
        attitudes=attitudes,
        truth=truth_of(log),
        gps=receivers.tracks,
        modes=_modes(log, kind),
        primary=_primary(log),
        flown_by=_in_use(log),
        said=said,
        vehicle_type=vehicle_type,
        compass_rows=statistics_of(compasses, parameters),
        faults=controls.faults(log),
        occurrences=controls.occurrences(log),
        silent=log.silences(),
        **table,
    )
    lacks = {
        "no version of the firmware": not firmware,
        "most rows have no time: theirs follows from their place in the file": not log.is_timed,
    }
    return Recorded(
        completed(context, log, settings, _armed(log), lacks),
        *autopilot,
        log.clock.start_us,
        readings,
        receivers.used,
        receivers.fix_us,
        next((track for track in attitudes if not track.name.startswith(SECOND)), None),
        next((track for track in attitudes if track.name == SECOND), None),
        context.measured["airspeed_m_s"],
        settings,
        _origin(log),
    )


# --- inertial sensors and compasses -----------------------------------------------------------


def _imu_rows(log: DataflashRows) -> Iterator[ImuRows]:
    """Samples that the autopilot itself does not call unhealthy."""
    for imu in imu_columns(log):
        good = imu.is_healthy != 0.0
        reason = f"samples of IMU {imu.number + 1} that the autopilot calls unhealthy"
        log.note(reason, int((~good).sum()))
        rows = imu.as_rows(is_timed=log.times_of(imu.rows.table) is not None)
        yield rows._replace(samples=rows.samples.only(good))


def _bursts(log: DataflashRows) -> tuple[Burst, ...]:
    """Values at the sensor's own rate: batches, and raw rows."""
    found = [*_batches(log)]
    for name, sensor, columns in (
        ("GYR", "gyro", ("GyrX", "GyrY", "GyrZ")),
        ("ACC", "accelerometer", ("AccX", "AccY", "AccZ")),
    ):
        instances = list(log.instances(name, *columns))
        # Before 4.1: GYR1 to GYR3.
        numbered = (log.find(f"{name}{i + 1}", *columns) for i in range(MAX_IMUS))
        instances += [
            rows._replace(number=i) for i, rows in enumerate(numbered) if rows is not None
        ]
        for rows in instances:
            found += _raw(log, rows, sensor, rows.table.numbers(*columns))
    return tuple(found[:MAX_BURSTS])


def _raw(log: DataflashRows, rows: Rows, sensor: str, values: Array) -> Iterator[Burst]:
    """Bursts of rows without gaps."""
    stamps = rows.table.integers("SampleUS") if "SampleUS" in rows.table else rows.t_us
    steps = np.diff(stamps)
    if len(steps) < MIN_BURST or (usual := float(np.median(steps))) <= 0.0:
        return
    ends = np.flatnonzero((steps <= 0) | (steps > BURST_PAUSE * usual)) + 1
    edges = [0, *ends.tolist(), len(stamps)]
    for first, last in pairwise(edges):
        part = values[first:last]
        if last - first >= MIN_BURST and np.isfinite(part).all():
            rate_hz = (last - first - 1) * 1e6 / float(stamps[last - 1] - stamps[first])
            yield Burst(rows.number, sensor, float(rows.t_s[first]), rate_hz, part)


def _batches(log: DataflashRows) -> Iterator[Burst]:
    """ISBH announces a batch, and the rows of ISBD with its number hold 32 values each."""
    heads = log.find("ISBH", "N", "type", "instance", "mul", "smp_cnt", "smp_rate")
    data = log.find("ISBD", "N", "seqno")
    if heads is None or data is None:
        return
    rows = data.table.stored_rows()
    if [rows.dtype[axis].shape for axis in data.table.columns if axis in "xyz"] != 3 * [BATCH_ROW]:
        return
    numbers = data.table.integers("N")
    # One that is damaged, or a count that began again, would lead a search to others' rows.
    order = np.argsort(numbers, kind="stable")
    numbers = numbers[order]
    values = np.stack([rows[axis] for axis in "xyz"], axis=2).astype(np.float64)[order]
    whole = (heads.table.integers(name) for name in ("N", "type", "instance", "smp_cnt"))
    columns = (*whole, heads.table.numbers("mul"), heads.table.numbers("smp_rate"), heads.t_s)
    for row in zip(*(each.tolist() for each in columns), strict=True):
        number, kind, imu, count, factor, rate_hz, t_s = row
        first, last = np.searchsorted(numbers, (number, number + 1))
        part = values[first:last].reshape(-1, 3)[:count]
        is_known = kind in BURST_KINDS and abs(factor) > 0.0 and 0.0 < rate_hz < math.inf
        if is_known and len(part) >= MIN_BURST:
            yield Burst(imu, BURST_KINDS[kind], t_s, rate_hz, part / factor)


# --- where it started ------------------------------------------------------------------------


def _origin(log: DataflashRows) -> Place | None:
    rows = log.find("ORGN", "Lat", "Lng", "Alt")
    if rows is None:
        return None
    first = rows.table.numbers("Lat", "Lng", "Alt")[:1]
    return Place(*first[0].tolist()) if is_on_earth(first[:, 0], first[:, 1]).all() else None


# --- which estimator flew ----------------------------------------------------------------------


def _flown_by(parameters: dict[str, float]) -> str:
    """Name of the estimator behind ATT, as far as the parameters show."""
    chosen = parameters.get("AHRS_EKF_TYPE")
    if chosen is not None:
        return ESTIMATORS.get(int(chosen), "autopilot")
    uses = parameters.get("AHRS_EKF_USE")
    return "autopilot" if uses is None else ("EKF1" if uses else "DCM")


def _primary(log: DataflashRows) -> tuple[Span, ...]:
    """The core in use, from the first core that reports it."""
    for message, name in (("XKF4", "EKF3"), ("NKF4", "EKF2")):
        for rows in log.instances(message, "PI"):
            numbers = rows.table.integers("PI").tolist()
            names = (f"{name} core {number + 1}" if number >= 0 else "" for number in numbers)
            return log.spans(rows, names)
    return ()


def _in_use(log: DataflashRows) -> tuple[Span, ...]:
    """The estimator behind each row of ATT: its AEKF, where 0 is the DCM."""
    rows = log.find("ATT", "AEKF")
    if rows is None:
        return ()
    numbers = rows.table.integers("AEKF").tolist()
    return log.spans(rows, (ESTIMATORS.get(number, "") for number in numbers))


# --- the vehicle --------------------------------------------------------------------------------


def _settings(log: DataflashRows) -> tuple[Setting, ...]:
    rows = log.find("PARM", "Name", "Value")
    if rows is None:
        return ()
    values = rows.table.numbers("Value")
    triples = zip(rows.t_us.tolist(), rows.table.texts("Name"), values.tolist(), strict=True)
    return tuple(Setting(*triple) for triple in triples if math.isfinite(triple[2]))


def _first_values(settings: tuple[Setting, ...]) -> dict[str, float]:
    """The values at the beginning."""
    return {setting.name: setting.value for setting in reversed(settings)}


def _said(log: DataflashRows) -> tuple[Said, ...]:
    """Texts and errors; the log has no severities."""
    said = said_of(log)
    return tuple(sorted((*said, *_errors(log, said)), key=lambda one: one.t_s))


def _errors(log: DataflashRows, said: tuple[Said, ...]) -> list[Said]:
    """Errors reported by ERR as numbers, unless the autopilot also reported them in words."""
    rows = log.find("ERR", "Subsys", "ECode")
    if rows is None:
        return []
    table = rows.table
    pairs = zip(table.integers("Subsys").tolist(), table.integers("ECode").tolist(), strict=True)
    in_words = np.array([one.t_s for one in said if one.t_s > 0.0])
    return [
        Said(t_s, Severity.INFO, f"error: {text}", is_made=True)
        for t_s, text in zip(
            rows.t_s.tolist(), (said_of_error(*pair) for pair in pairs), strict=True
        )
        if text and not (np.abs(in_words - t_s) < IN_WORDS_S).any()
    ]


def _firmware(log: DataflashRows, said: tuple[Said, ...]) -> str:
    """Such as ``ArduCopter V4.0.4 (93ffdf4b)``."""
    rows = log.find("VER", "FWS")
    if rows is not None:
        return rows.table.texts("FWS")[0]
    names = tuple(name for kind in KINDS for name in kind.names)
    texts = (*(text.text for text in said), *log.preamble)
    return next((text for text in texts if text.startswith(names)), "")


def _kind_of(firmware: str, parameters: dict[str, float]) -> VehicleKind:
    for kind in KINDS:
        if firmware.startswith(kind.names):
            return kind
    for kind in KINDS:
        if any(name in parameters for name in kind.parameters):
            return kind
    return UNKNOWN


def _vehicle_type(kind: VehicleKind, parameters: dict[str, float]) -> int:
    """MAV_TYPE as in its heartbeat."""
    if kind is not COPTER:
        return kind.vehicle_type
    if "FRAME_CLASS" not in parameters and any(name in parameters for name in OF_HELICOPTERS):
        return int(mavlink.MAV_TYPE_HELICOPTER)
    return int(COPTERS.get(int(parameters.get("FRAME_CLASS", 0.0)), kind.vehicle_type))


def _modes(log: DataflashRows, kind: VehicleKind) -> tuple[Span, ...]:
    rows = log.find("MODE", "Mode")
    if rows is None:
        return ()
    if rows.table.kind("Mode") == "S":
        # In a text: names, or numbers.
        words = rows.table.texts("Mode")
    else:
        words = [str(number) for number in rows.table.integers("Mode").tolist()]
    names = [
        kind.modes.get(int(word), f"mode {word}") if word.isdecimal() else word for word in words
    ]
    return log.spans(rows, names)


def _armed(log: DataflashRows) -> tuple[Span, ...] | None:
    """While it was armed; None if unknown."""
    changes: list[tuple[float, bool]] = []
    rows = log.find("ARM", "ArmState")
    if rows is not None:
        states = rows.table.integers("ArmState") != 0
        changes = list(zip(rows.t_s.tolist(), states.tolist(), strict=True))
    if not changes:
        changes = _changes(log, ARMED, DISARMED)
    if not changes:
        return None
    # Before the first change it was in the other state.
    changes.insert(0, (0.0, not changes[0][1]))
    names = ("armed" if is_armed else "" for _, is_armed in changes)
    return spans([t_s for t_s, _ in changes], names, log.duration_s)


def _airborne(log: DataflashRows) -> Series | None:
    """1 while a copter is off the ground."""
    changes = _changes(log, NOT_LANDED, LAND_COMPLETE)
    if not changes:
        return None
    changes.insert(0, (0.0, not changes[0][1]))
    t_s, flies = zip(*changes, strict=True)
    return Series(np.array(t_s), np.array(flies, np.float64))


def _changes(log: DataflashRows, begins: int, ends: int) -> list[tuple[float, bool]]:
    """When something began (True) and ended (False), by the log's events."""
    found = []
    for number, is_begin in ((begins, True), (ends, False)):
        rows = (log.beginnings if is_begin else log.find)("EV", "Id")
        if rows is not None:
            are_so = rows.table.integers("Id") == number
            found += [(t_s, is_begin) for t_s in rows.t_s[are_so].tolist()]
    return sorted(found)
