"""``h2nav odometry calibrate``: wheel parameters from increments or a recording."""

import argparse
import math
import sys
from pathlib import Path
from typing import Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.calibration.odometry import calibration, recordings, tables
from h2nav.calibration.odometry.calibration import WheelCalibration
from h2nav.calibration.odometry.tracks import Drive, Increments, drive
from h2nav.errors import BadInput
from h2nav.maths.least_squares import SOLVERS
from h2nav.motion.settings import OdometrySettings

FED_REMARK = "  # the wheel radius from which the autopilot makes WHEEL_DISTANCE"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the command's arguments."""
    parser.add_argument(
        "data",
        type=Path,
        help="CSV of increments (phi_left_rad,phi_right_rad | phi_1_rad..phi_3_rad | "
        "odo_dx_m,odo_dy_m,odo_dtheta_rad, with dx_m,dy_m,dtheta_rad), CSV of a drive "
        "(time_s,way_left_m,way_right_m | way_1_m..way_3_m, with x_m,y_m,heading_rad), or a tlog "
        "or MCAP with WHEEL_DISTANCE and a pose",
    )
    parser.add_argument(
        "--model", choices=tables.READINGS, help="default: what the data's columns say"
    )
    parser.add_argument("--solver", choices=SOLVERS, default="qr", help="default: qr")
    parser.add_argument(
        "--wheel-angles-deg",
        default="0,120,240",
        metavar="A,B,C",
        help="omni: angles of the wheels, counter-clockwise from ahead (default 0,120,240)",
    )
    parser.add_argument(
        "--autopilot-radius-m",
        type=float,
        default=1.0,
        metavar="R",
        help="wheel radius from which the autopilot makes WHEEL_DISTANCE (ArduPilot: WENC_RADIUS); "
        "default 1: from increments, the daemon must be fed wheel angles; from counters, the "
        "radii are metres rolled per metre reported",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    parser.add_argument("--plots", type=Path, metavar="DIR", help="write pictures into DIR")


def run(args: argparse.Namespace) -> int:
    """Calibrates, and prints the parameters with a configuration block for the daemon."""
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    angles = _angles_rad(args.wheel_angles_deg)
    fed_radius_m = args.autopilot_radius_m
    if not 1e-4 <= fed_radius_m <= 1e3:
        raise BadInput(
            f"--autopilot-radius-m {fed_radius_m}: expected a number from 0.0001 to 1000"
        )
    read = _read(args.data, args.model)
    # Counters in metres are wheel angles times the autopilot's radius; increments are angles.
    data = read if read.track is None else read._replace(readings=read.readings / fed_radius_m)
    if data.model == "diff":
        result = calibration.calibrate_differential(data.readings, data.motion, args.solver)
    elif data.model == "omni":
        result = calibration.calibrate_omni(data.readings, data.motion, angles, args.solver)
    else:
        result = calibration.calibrate_matrix(data.readings, data.motion, args.solver)
    block = calibration.configuration(result, angles, fed_radius_m)
    driven = None
    if data.track is not None and block is not None:
        # Repeats the whole drive with the daemon's odometry and the new section.
        driven = drive(data.track, OdometrySettings(**block))
    if args.json:
        print_json(_document(result, block, driven), indent=1)
    else:
        _print_text(result, data, block, driven)
    if args.plots is not None:
        from h2nav.calibration.odometry import pictures

        for path in pictures.write(args.plots, result, data, angles):
            print(f"wrote {path}", file=sys.stderr)
    return 0


def _read(path: Path, model: str | None) -> Increments:
    if path.suffix.lower() in (".csv", ".txt"):
        return tables.read_increments(path, model)
    if model == "matrix":
        raise BadInput(f"{path}: a recording holds wheel distances; the model matrix needs a CSV")
    return recordings.read_increments(path, model)


def _angles_rad(text: str) -> tuple[float, float, float]:
    try:
        a, b, c = (math.radians(float(part)) for part in text.split(","))
    except ValueError:
        raise BadInput(
            f"--wheel-angles-deg {text}: expected three numbers, such as 0,120,240"
        ) from None
    return (a, b, c)


def _document(
    result: WheelCalibration, block: dict[str, Any] | None, driven: Drive | None
) -> dict[str, Any]:
    rms_m, rms_rad = result.residual_rms
    values = result.values.tolist()
    if result.model == "matrix":
        parameters: dict[str, Any] = {"matrix": [values[0:3], values[3:6], values[6:9]]}
    else:
        parameters = dict(zip(result.names, values, strict=True))
    return {
        **parameters,
        "parameters": list(result.names),
        "covariance": result.covariance.tolist(),
        "rank": result.solution.rank,
        "unknowns": int(result.solution.x.size),
        "condition": result.solution.condition,
        "residual_rms": math.sqrt((2.0 * rms_m**2 + rms_rad**2) / 3.0),
        "residual_rms_m": rms_m,
        "residual_rms_rad": rms_rad,
        "determined": result.determined,
        "notes": list(result.notes),
        "model": result.model,
        "solver": result.solution.solver,
        "reference_read_as": result.reading,
        "increments": len(result.residuals),
        "drive": driven and driven._asdict(),
        "configuration": block,
    }


def _print_text(
    result: WheelCalibration,
    data: Increments,
    block: dict[str, Any] | None,
    driven: Drive | None,
) -> None:
    rms_m, rms_rad = result.residual_rms
    solution = result.solution
    print(f"{result.model} from {data.source}; reference read as {result.reading}")
    for i, (name, value) in enumerate(zip(result.names, result.values.tolist(), strict=True)):
        # Rounding can leave a variance of badly scaled data below 0.
        sigma = math.sqrt(max(result.covariance[i, i], 0.0))
        shown = "not determined" if math.isnan(value) else f"{value:.6g} +- {sigma:.2g}"
        print(f"  {name:16} {shown}")
    print(
        f"  rank {solution.rank} of {solution.x.size}, condition {solution.condition:.3g}, "
        f"solver {solution.solver}, residual rms {rms_m * 1e3:.3g} mm, {rms_rad * 1e3:.3g} mrad"
    )
    for note in result.notes:
        print(f"  note: {note}")
    if driven is not None:
        print(
            f"  driven again: after {driven.length_m:.1f} m the odometry ends "
            f"{driven.end_error_m:.3f} m off, {driven.end_error_sigmas:.2g} sigma of its covariance"
        )
    if block is None:
        print("no configuration block: the data do not determine every parameter")
        return
    print("\nodometry:")
    for key, value in block.items():
        remark = FED_REMARK if key == "autopilot_radius_m" and value == 1.0 else ""
        print(f"  {key}: {value}{remark}")
