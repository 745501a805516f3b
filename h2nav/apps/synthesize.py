"""`h2nav synthesize`: makes a certified gain file from a sensor or disturbance model."""

import argparse
import math
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput, TaskFailed

if TYPE_CHECKING:
    from h2nav.attitude.gains.envelope import GainFile
    from h2nav.synthesis.model import SensorModel

LMI_SOLVERS = ("CLARABEL", "SCS")
SECONDS_PER_YEAR = 31_556_952.0
UNIX_EPOCH_YEAR = 1970.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument(
        "model",
        type=Path,
        metavar="MODEL.yaml",
        help="sensors and field, or the disturbances of a vehicle class",
    )
    parser.add_argument("--rate", type=float, required=True, metavar="HZ", help="filter rate")
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="GAINS.yaml", help="file to write"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    # cvxpy would continue without a solver, and the gain file would lack the comparison.
    solvers = map(str.lower, LMI_SOLVERS)
    extras.require("synthesis", "synthesize", "scipy.linalg", "cvxpy", *solvers)
    from h2nav.files import gain_files
    from h2nav.synthesis.certificate import CertificateError

    if not 1.0 <= args.rate <= 4000.0:
        raise BadInput(f"--rate {args.rate:g}: expected a rate from 1 to 4000 Hz")
    started = time.perf_counter()
    try:
        file, solver_wall_time_s = _synthesize(args.model, args.rate)
    except CertificateError as error:
        raise TaskFailed(f"{args.model}: no trustworthy gain: {error}") from None
    gain_files.write(args.output, file)
    wall_time_s = time.perf_counter() - started
    # The first loop is the one whose norm is the expected error (rad): see the kinds' `loops`.
    norm = next(iter(file.certificate["loops"].values()))["h2_norm"]  # type: ignore[attr-defined]
    if args.json:
        summary = {
            "ok": True,
            "file": str(args.output),
            "h2_norm": norm,
            "certificate": file.certificate,
            "methods": file.methods,
            "fixed_point": file.fixed_point,
            "wall_time_s": wall_time_s,
            "solver_wall_time_s": solver_wall_time_s,
        }
        print_json(summary)
        return 0
    sys.stdout.write(_report(file.methods, norm))
    if "refused" in file.fixed_point:
        sys.stderr.write(f"{args.output}: for floats only: {file.fixed_point['refused']}\n")
    sys.stderr.write(f"{args.output}: written and certified in {wall_time_s:.1f} s\n")
    return 0


def _synthesize(path: Path, rate_hz: float) -> "tuple[GainFile, dict[str, float]]":
    """Synthesises the gain file of a model of either kind; also returns the solvers' times."""
    from h2nav.attitude.gains.envelope import FORMER_KINDS
    from h2nav.files.plain_yaml import read_mapping
    from h2nav.synthesis import sensors, velocity_aided

    mapping = read_mapping(path)
    kind = str(mapping.get("kind"))
    if FORMER_KINDS.get(kind, kind) == "velocity_aided":
        return velocity_aided.synthesize(mapping, rate_hz, str(path), LMI_SOLVERS)
    model = sensor_model(mapping, str(path))
    return sensors.synthesize(model, rate_hz, str(path), LMI_SOLVERS)


def sensor_model(mapping: dict[str, Any], place: str) -> "SensorModel":
    """The sensor model in a file's contents, its field by value.

    Raises:
        BadInput: one line per error.
    """
    from h2nav.files.earth_field import earth_field_at
    from h2nav.files.strict_yaml import into_record
    from h2nav.synthesis.model import SensorModel, needs_place, with_field

    model = into_record(SensorModel, mapping, place)
    if not needs_place(model, place):
        return model
    at = model.field
    altitude_m = 0.0 if math.isnan(at.altitude_m) else at.altitude_m
    unix_s = (at.year - UNIX_EPOCH_YEAR) * SECONDS_PER_YEAR
    field = earth_field_at(at.latitude_deg, at.longitude_deg, altitude_m, unix_s)
    if field is None:
        raise BadInput(
            f"{place}: field: at {at.latitude_deg:g}, {at.longitude_deg:g} deg the field is nearly "
            "parallel to gravity, so heading cannot be observed; choose another place"
        )
    return with_field(model, field)


def _report(methods: Mapping[str, object], norm: float) -> str:
    """The methods side by side, and the expected accuracy."""
    lines = ["plant              time        method        rms deg     distance"]
    for plant, times in methods.items():
        for when, entries in _items(times):
            for method, entry in _items(entries):
                if not isinstance(entry, dict):
                    continue
                if "refused" in entry:
                    lines.append(f"{plant:18} {when:11} {method:13} refused: {entry['refused']}")
                    continue
                rms = math.degrees(entry["h2_norm"])
                lines.append(
                    f"{plant:18} {when:11} {method:13} {rms:<11.6f} {entry['distance']:.1e}"
                )
    lines.append(f"expected attitude error at rest: {math.degrees(norm):.4f} deg rms (three axes)")
    return "\n".join(lines) + "\n"


def _items(section: object) -> list[tuple[str, object]]:
    return list(section.items()) if isinstance(section, dict) else []
