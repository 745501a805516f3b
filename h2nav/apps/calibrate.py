"""`h2nav calibrate`: parameters from flights, as a file to load; sends nothing to a vehicle."""

import argparse
from pathlib import Path
from typing import Any

from h2nav.apps import playback
from h2nav.apps.json_output import print_json
from h2nav.apps.log_progress import byte_bar
from h2nav.apps.parameter_files import read_parameters
from h2nav.errors import TaskFailed

_FORMATS = ("ardupilot", "qgroundcontrol", "px4")
_CLOSING = """\
The sensors are compared with an attitude that uses no compass but past and future samples.
FILE.param is ArduPilot's NAME,VALUE, FILE.params QGroundControl's five columns, any other of PX4
`param set` lines. The file holds significant improvements; the others are listed with a reason.
Where the recording holds no parameters, name a file saved by a ground station (--parameters).
Nothing is ever sent to a vehicle: check the values, load them, and fly carefully afterwards."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument(
        "flights", type=Path, nargs="+", metavar="FLIGHT", help="recordings of one vehicle"
    )
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help="parameter file to write")
    parser.add_argument(
        "--format", choices=_FORMATS, help="of the file (default: by its ending and the autopilot)"
    )
    parser.add_argument(
        "--parameters",
        type=Path,
        metavar="FILE",
        help="parameters of the vehicle in that flight, as saved by a ground station",
    )
    playback.add_arguments(parser)
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    from h2nav.apps.reviewing import evidence_of
    from h2nav.calibration.files import ParameterFormat, format_of, written
    from h2nav.calibration.vehicle import calibrate, document_of
    from h2nav.recordings.opening import open_flight

    parameters = {} if args.parameters is None else read_parameters(args.parameters)
    evidence = []
    for path in args.flights:
        with byte_bar(path.name) as progress:
            source = open_flight(path)
            evidence.append(
                evidence_of(source, playback.options(args), parameters, progress=progress)
            )
    calibration = calibrate(evidence)
    if args.output is not None and calibration.changes:
        chosen = args.format or format_of(args.output.name, calibration.autopilot)
        try:
            args.output.write_text(written(calibration, ParameterFormat(chosen)), encoding="utf-8")
        except OSError as error:
            raise TaskFailed(f"{args.output}: {error.strerror}") from error
    found = document_of(calibration)
    if args.json:
        print_json(found)
    else:
        _show(found, args.output)
    return 0


def _show(found: dict[str, Any], output: Path | None) -> None:
    names = set()  # several sensors may share one parameter
    for sensor in found["sensors"]:
        device = f" (device {sensor['device']})" if sensor["device"] else ""
        print(f"{sensor['sensor']}{device}")
        for change in sensor["changes"]:
            sigma = "" if change["sigma"] is None else f" ± {change['sigma']:.4g}"
            old = "" if change["old"] is None else f"{change['old']:.5g}"
            print(f"  {change['name']:18} {old:>10} -> {change['new']:.5g}{sigma}")
            names.add(change["name"])
        for note in sensor["notes"]:
            print(f"  {note}")
        for reason in sensor["not_from_these_flights"]:
            print(f"  nothing to set: {reason}")
        if sensor["shown_by"]:
            print(f"  {sensor['shown_by']}")
    if output is not None:
        said = f"{output}: {len(names)} parameters"
        print(said if names else f"{output} not written: no parameter")
