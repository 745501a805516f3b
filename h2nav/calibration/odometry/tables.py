"""CSV tables of wheel odometry, read strictly: every bad row is reported, nothing is guessed."""

import csv
import math
from pathlib import Path

import numpy as np

from h2nav.calibration.odometry.tracks import Array, Increments, PoseTrack, TimedPose, of_track
from h2nav.errors import BadInput
from h2nav.motion.samples import WheelSample
from h2nav.validation import shown

REFERENCE = ("dx_m", "dy_m", "dtheta_rad")
READINGS = {
    "diff": ("phi_left_rad", "phi_right_rad"),
    "omni": ("phi_1_rad", "phi_2_rad", "phi_3_rad"),
    "matrix": ("odo_dx_m", "odo_dy_m", "odo_dtheta_rad"),
}
COUNTERS = {
    "diff": ("way_left_m", "way_right_m"),
    "omni": ("way_1_m", "way_2_m", "way_3_m"),
}
POSE = ("x_m", "y_m", "heading_rad")
MAX_ERRORS = 20
LARGEST = 1e12  # of any column: 30,000 years in s, the orbit of Jupiter in m


Rows = list[tuple[int, list[str]]]  # line number and cells


def read_increments(path: Path, model: str | None) -> Increments:
    """Increments from a CSV file with a header: of increments, or of a drive with counters.

    A drive has ``time_s``, cumulative counters ``way_left_m,way_right_m`` (or ``way_1_m`` to
    ``way_3_m``) and the reference ``x_m,y_m,heading_rad`` (y left, counter-clockwise).

    Args:
        model: which columns to take; None = the model whose columns the header has.

    Raises:
        BadInput: no such columns, or rows that are not complete finite numbers, each named.
    """
    header, rows = _cells(path)
    if "time_s" in header:
        return _read_track(path, model, header, rows)
    if model is None:
        model = _model_of(path, header)
    values = _columns(path, model, READINGS[model] + REFERENCE, header, rows)
    split = len(READINGS[model])
    return Increments(model, values[:, :split], values[:, split:], f"{len(values)} rows of {path}")


def _read_track(path: Path, model: str | None, header: list[str], rows: Rows) -> Increments:
    if model is None:
        model = "omni" if COUNTERS["omni"][0] in header else "diff"
    if model not in COUNTERS:
        raise BadInput(f"{path}:1: the model {model} needs increments, not counters over time_s")
    values = _columns(path, model, ("time_s", *COUNTERS[model], *POSE), header, rows)
    falls = np.flatnonzero(np.diff(values[:, 0]) <= 0.0)
    if falls.size:
        line = rows[int(falls[0]) + 1][0]
        raise BadInput(f"{path}:{line}: time_s does not rise; expected rows in the order of time")
    readings, poses = [], []
    for time_s, *rest in values.tolist():
        x, y, heading = rest[-3:]
        readings.append(WheelSample(round(time_s * 1e6), tuple(rest[:-3])))
        poses.append(TimedPose(round(time_s * 1e6), (x, y, heading)))
    return of_track(PoseTrack(readings, poses), model, str(path))


def _model_of(path: Path, header: list[str]) -> str:
    for model, names in READINGS.items():
        if all(name in header for name in names):
            return model
    forms = "; ".join(f"{model}: {','.join(names)}" for model, names in READINGS.items())
    raise BadInput(
        f"{path}:1: the header has no known columns; expected {','.join(REFERENCE)} with one of "
        f"({forms})"
    )


def _cells(path: Path) -> tuple[list[str], Rows]:
    """The header and the rows that are not empty, with their line numbers."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True)
            lines = [(reader.line_num, row) for row in reader if any(cell.strip() for cell in row)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadInput(f"{path}: cannot be read as CSV: {error}") from None
    if not lines:
        raise BadInput(f"{path}: empty; expected a header line and rows of numbers")
    header = [name.strip() for name in lines[0][1]]
    double = sorted({name for name in header if header.count(name) > 1})
    if double:
        raise BadInput(f"{path}:1: column(s) {', '.join(double)} stand twice")
    return header, lines[1:]


def _columns(
    path: Path, model: str, wanted: tuple[str, ...], header: list[str], rows: Rows
) -> Array:
    missing = [name for name in wanted if name not in header]
    if missing:
        raise BadInput(
            f"{path}:1: column(s) {', '.join(missing)} missing for the model {model}; expected "
            f"the header {','.join(wanted)}"
        )
    columns = [header.index(name) for name in wanted]
    values: list[list[float]] = []
    errors: list[str] = []
    for line, row in rows:
        if len(row) != len(header):
            errors.append(f"{path}:{line}: {len(row)} cells, expected {len(header)} as the header")
            continue
        numbers = [_number(row[column]) for column in columns]
        bad = [header[c] for c, n in zip(columns, numbers, strict=True) if not abs(n) <= LARGEST]
        if bad:
            cells = ", ".join(f"{name} = {shown(repr(row[header.index(name)]))}" for name in bad)
            errors.append(
                f"{path}:{line}: {cells}: expected a finite number up to {LARGEST:g}; "
                "correct or remove the row"
            )
        values.append(numbers)
    if errors:
        more = len(errors) - MAX_ERRORS
        rest = [f"{path}: and {more} more bad rows"] if more > 0 else []
        raise BadInput(*errors[:MAX_ERRORS], *rest)
    if not values:
        raise BadInput(f"{path}: a header without rows; expected at least one increment")
    return np.array(values)


def _number(cell: str) -> float:
    """The cell's number; NaN for anything else."""
    try:
        return float(cell)
    except ValueError:
        return math.nan
