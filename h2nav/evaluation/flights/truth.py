"""The true attitude of a flight: SIMSTATE in the recording, or CSV files beside it.

A CSV file covers one boot of the autopilot and has the columns `t_us` (the autopilot's clock),
`q_w` ... `q_z` (true attitude, body to north-east-down) and, if recorded, the autopilot's own
estimate, `ekf2_q_w` ... `ekf2_q_z` (empty while it has none). Other columns are ignored.
"""

import csv
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput
from h2nav.evaluation.flights.heard import FromAutopilot, HeardEstimates
from h2nav.maths.rows import Array, from_euler
from h2nav.recordings.reference import FARTHEST_US

TIME = "t_us"
ATTITUDE = ("q_w", "q_x", "q_y", "q_z")
ESTIMATE = tuple(f"ekf2_{name}" for name in ATTITUDE)
# Offset between boots of the autopilot on the time line of the truth.
EPOCH_US = 10**14
MAX_OFF_LENGTH = 0.01  # of a quaternion in a file


class Truth(NamedTuple):
    """The true attitude over time."""

    name: str  # its source
    t_us: NDArray[np.int64]  # (M,) arrival, or the autopilot's time, see `is_by_arrival`
    q_nb: Array  # (M, 4) body to NED
    # meaning of `t_us`; the autopilot's time has `EPOCH_US` added for each boot
    is_by_arrival: bool
    # (M, 4) the autopilot's own estimate, NaN where it has none; None without any
    ekf_nb: Array | None = None


class TruthFile(NamedTuple):
    """A CSV file of one boot."""

    t_us: NDArray[np.int64]  # (M,) the autopilot's time, increasing
    q_nb: Array  # (M, 4) true attitude
    ekf_nb: Array  # (M, 4) the autopilot's estimate, NaN where it has none


def truth_paths(recording: Path) -> list[Path]:
    """The CSV files beside a recording, one per boot of the autopilot."""
    only = recording.with_name(f"{recording.stem}_truth.csv")
    if only.exists():
        return [only]
    paths: list[Path] = []
    while True:
        path = recording.with_name(f"{recording.stem}_truth_{len(paths)}.csv")
        if not path.exists():
            return paths
        paths.append(path)


def truth_of(recording: Path, heard: FromAutopilot) -> tuple[Truth, list[str]]:
    """The truth of a flight, and remarks.

    Raises:
        BadInput: there is none, or a file is not usable.
    """
    paths = truth_paths(recording)
    if heard.truth.t_us:
        arrived_us, angles = heard.truth.arrays()
        notes = [f"{path.name}: not used, the recording has SIMSTATE" for path in paths]
        return Truth("SIMSTATE", arrived_us, from_euler(angles), True), notes
    if not paths:
        raise BadInput(
            f"{recording}: no truth; expected SIMSTATE in the recording, or beside it "
            f"{recording.stem}_truth.csv or, one per boot, {recording.stem}_truth_0.csv ..."
        )
    files = [read_truth(path) for path in paths]
    t_us = np.concatenate([file.t_us + epoch * EPOCH_US for epoch, file in enumerate(files)])
    ekf_nb = np.concatenate([file.ekf_nb for file in files])
    has_ekf = bool(np.isfinite(ekf_nb).any())
    q_nb = np.concatenate([file.q_nb for file in files])
    name = ", ".join(path.name for path in paths)
    truth = Truth(name, t_us, q_nb, False, ekf_nb if has_ekf else None)
    return truth, _notes_on_boots(heard, files)


def _notes_on_boots(heard: FromAutopilot, files: list[TruthFile]) -> list[str]:
    boots = int(heard.epochs(np.array([heard.end_us]))[0]) + 1
    if boots == len(files):
        return []
    return [f"the autopilot booted {boots} times, the truth is of {len(files)} of them"]


def read_truth(path: Path) -> TruthFile:
    """Reads a CSV file of truth.

    Raises:
        BadInput: it has other columns, or a row is not usable.
    """
    with path.open(encoding="utf-8", errors="replace", newline="") as stream:
        reader = csv.reader(stream)
        header = next(reader, [])
        missing = [name for name in (TIME, *ATTITUDE) if name not in header]
        if missing:
            raise BadInput(
                f"{path}: no column {', '.join(missing)}; expected {TIME}, {', '.join(ATTITUDE)}, "
                f"and perhaps {', '.join(ESTIMATE)}"
            )
        has_estimate = set(ESTIMATE) <= set(header)
        wanted = (TIME, *ATTITUDE, *(ESTIMATE if has_estimate else ()))
        places = [header.index(name) for name in wanted]
        try:
            rows = [[float(row[place] or "nan") for place in places] for row in reader if row]
        except (ValueError, IndexError, csv.Error):
            raise BadInput(
                f"{path}:{reader.line_num}: expected numbers in {', '.join(wanted)}"
            ) from None
    table = np.array(rows, dtype=np.float64).reshape(-1, len(places))
    if not len(table) or not np.isfinite(table[:, :5]).all():
        raise BadInput(f"{path}: expected rows with a number in {TIME} and {', '.join(ATTITUDE)}")
    if not _are_attitudes(table[:, 1:5]).all():
        raise BadInput(f"{path}: {', '.join(ATTITUDE)}: expected quaternions of length 1")
    if not ((table[:, 0] >= 0.0) & (table[:, 0] < EPOCH_US)).all():
        raise BadInput(f"{path}: {TIME}: expected microseconds since the autopilot's boot")
    if not (np.diff(table[:, 0]) > 0.0).all():
        raise BadInput(f"{path}: {TIME}: expected times that rise; one file is of one boot")
    ekf_nb = table[:, 5:] if has_estimate else np.full((len(table), 4), np.nan)
    # A row of zeros is no estimate, and would have no error.
    ekf_nb[~_are_attitudes(ekf_nb)] = np.nan
    return TruthFile(table[:, 0].astype(np.int64), table[:, 1:5], ekf_nb)


def _are_attitudes(q: Array) -> NDArray[np.bool_]:
    """(N,) whether (N, 4) quaternions have the length 1, as far as digits of a file go."""
    with np.errstate(over="ignore"):
        near: NDArray[np.bool_] = np.abs(np.linalg.norm(q, axis=1) - 1.0) < MAX_OFF_LENGTH
    return near


class TruthPairs(NamedTuple):
    """Estimates with the true attitude at their times."""

    rows: NDArray[np.int64]  # (K,) numbers of the estimates
    q_nb: Array  # (K, 4) the truth


def pairs(truth: Truth, heard: FromAutopilot, estimates: HeardEstimates) -> TruthPairs:
    """Pairs each estimate with the truth at its time, where one is near."""
    t_us = estimates.arrived_us
    if not truth.is_by_arrival:
        t_us = estimates.boot_us + EPOCH_US * heard.epochs(estimates.arrived_us)
    after = np.minimum(np.searchsorted(truth.t_us, t_us), len(truth.t_us) - 1)
    before = np.maximum(after - 1, 0)
    since_us, until_us = t_us - truth.t_us[before], truth.t_us[after] - t_us
    is_near = np.minimum(np.abs(since_us), np.abs(until_us)) <= FARTHEST_US
    gap_us = since_us + until_us
    share = np.clip(since_us / np.maximum(gap_us, 1), 0.0, 1.0)
    # The middle of a gap is unknown.
    share = np.where(gap_us > 2 * FARTHEST_US, np.round(share), share)
    q_nb = _between(truth.q_nb[before], truth.q_nb[after], share)
    return TruthPairs(np.flatnonzero(is_near), q_nb[is_near])


def _between(q_0: Array, q_1: Array, share: Array) -> Array:
    """(N, 4) attitudes between two that differ little."""
    same_sign = np.where(np.sum(q_0 * q_1, axis=1) < 0.0, -1.0, 1.0)
    q = q_0 * (1.0 - share)[:, None] + q_1 * (same_sign * share)[:, None]
    between: Array = q / np.linalg.norm(q, axis=1)[:, None]
    return between
