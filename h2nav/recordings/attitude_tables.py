"""Attitudes of estimators in logs of every format: their column tables, and the tracks they make.

As in `h2nav.recordings.field_tables`: one row for each field and format, today's spelling first.
"""

from typing import Any, NamedTuple

import numpy as np

from h2nav.recordings.board_trim import NO_TRIM, Trim
from h2nav.recordings.columns import Field, RowFinder, Source, axes, column, read
from h2nav.recordings.context import Array, AttitudeTrack
from h2nav.recordings.log_clock import in_order
from h2nav.recordings.log_rows import Rows
from h2nav.recordings.rotations import are_units, normalized, quaternions
from h2nav.recordings.row_tables import Table


class AttitudeColumns(NamedTuple):
    """The attitude of one estimator; NaN where it is none."""

    rows: Rows  # with their times
    number: int  # of its core, from 0
    kind: str  # its name; ``{1}`` is the number of the core from 1; empty = the one flown by
    q_nb: Array  # (N, 4) body to NED
    q_board: Array  # (N, 4) axes of the autopilot's board to NED, if it is that


def of_angles(table: Table, *names: str) -> Array:
    """(N, 4) quaternions of roll, pitch and yaw; NaN where they are not finite."""
    return _of_rad(table.numbers(*names))


def of_degrees(table: Table, *names: str) -> Array:
    """The same of angles in degrees."""
    return _of_rad(np.radians(table.numbers(*names)))


def _of_rad(angles: Array) -> Array:
    angles[~np.isfinite(angles).all(axis=1)] = np.nan
    return quaternions(angles)


def of_unit_length(table: Table, *names: str) -> Array:
    """(N, 4) quaternions; NaN where they are none."""
    q = table.numbers(*names)
    return normalized(np.where(are_units(q)[:, None], q, np.nan))


def _degrees(message: str, kind: str = "", **others: Any) -> Source:
    """Angles of ArduPilot's body."""
    angles = column("Roll", "Pitch", "Yaw", form=of_degrees)
    return Source(message, {"q_nb": angles}, kind=kind, **others)


def _radians(message: str, kind: str) -> Source:
    return Source(message, {"q_nb": column("roll", "pitch", "yaw", form=of_angles)}, kind=kind)


def _quaternion(message: str, kind: str = "") -> Source:
    return Source(message, {"q_nb": column(*axes("q", 4), form=of_unit_length)}, kind=kind)


_OF_BOARD = {"q_board": column("Q1", "Q2", "Q3", "Q4", form=of_unit_length)}


def _cores(letter: str, kind: str) -> tuple[tuple[Source, ...], ...]:
    """Of ArduPilot's EKF; until 2020 a message for each core."""
    quaternion = (f"{letter}KQ", f"{letter}KQ{{1}}")
    angles = ((f"{letter}KF1", 0), (f"{letter}KF6", 1), (f"{letter}KF11", 2))
    return (
        tuple(
            Source(name, _OF_BOARD, kind=kind, packed=packed)
            for name, packed in zip(quaternion, (0, 3), strict=True)
        ),
        tuple(_degrees(name, kind, first=first) for name, first in angles),
    )


ESTIMATORS = (
    Field(
        "flown",
        "quaternion",
        record=AttitudeColumns,
        dataflash=(_degrees("ATT"),),
        ulog=(_quaternion("vehicle_attitude"),),
        telemetry=(_radians("ATTITUDE", "autopilot"),),
    ),
    Field("ekf3", "quaternion", record=AttitudeColumns, dataflash=_cores("X", "EKF3 core {1}")),
    Field(
        "ekf2",
        "quaternion",
        record=AttitudeColumns,
        dataflash=_cores("N", "EKF2 core {1}"),
        ulog=(_quaternion("estimator_attitude", "EKF2 instance {1}"),),
    ),
    Field("ekf1", "quaternion", record=AttitudeColumns, dataflash=(_degrees("EKF1", "EKF1"),)),
    Field(
        "second",
        "quaternion",
        record=AttitudeColumns,
        dataflash=(_degrees("AHR2", "AHRS2"),),
        telemetry=(_radians("AHRS2", "autopilot's second (AHRS2)"),),
    ),
)
TRUTH = (
    Field(
        "truth",
        "quaternion",
        record=AttitudeColumns,
        dataflash=(
            Source("SIM", {"q_nb": _OF_BOARD["q_board"]}, kind="truth"),
            _degrees("SIM", "truth"),
        ),
        ulog=(_quaternion("vehicle_attitude_groundtruth", "truth"),),
        telemetry=(_radians("SIMSTATE", "truth"),),
    ),
)
ATTITUDES = (*ESTIMATORS, *TRUTH)
"""All of them; the first one was used for control."""


def attitudes_of(
    log: RowFinder, flown_by: str = "", trim: Trim = NO_TRIM
) -> tuple[AttitudeTrack, ...]:
    """The attitudes of the autopilot's estimators; the first one was used for control.

    Args:
        flown_by: name of the estimator used for control, where the log does not have it.
        trim: of the autopilot's board.
    """
    found = read(log, ESTIMATORS).values.values()
    return tuple(_track(one, flown_by, trim) for several in found for one in several)


def truth_of(log: RowFinder) -> AttitudeTrack | None:
    """The attitude of a simulator; None elsewhere."""
    found = read(log, TRUTH).values["truth"]
    return _track(found[0], "", NO_TRIM) if found else None


def _track(found: AttitudeColumns, flown_by: str, trim: Trim) -> AttitudeTrack:
    """The attitude at the times of its samples."""
    is_of_board = np.isfinite(found.q_board).any()
    q_nb = found.q_board if is_of_board else found.q_nb
    good = np.isfinite(q_nb[:, 0])
    good[good] = in_order(found.rows.sample_us[good])
    q_nb = trim.attitudes(q_nb[good]) if is_of_board else q_nb[good]
    name = found.kind.format(found.number, found.number + 1) or flown_by
    return AttitudeTrack(name, found.rows.sample_s[good], q_nb)
