"""`h2nav evaluate flights`: compares the service and the autopilot's estimators with the truth."""

import argparse
import functools
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from h2nav.apps import extras, playback
from h2nav.apps.json_output import print_json
from h2nav.apps.recorded_flights import ESTIMATORS, play
from h2nav.errors import BadInput
from h2nav.evaluation.flights.events import FlightPhase, parse_phase
from h2nav.evaluation.flights.flight import FlightTask
from h2nav.evaluation.flights.scores import (
    SETTLED_S,
    Document,
    flight_paths,
    mean,
    score_flight,
)
from h2nav.evaluation.names import names_of
from h2nav.evaluation.parallel import results

_CLOSING = f"""\
more examples:
  h2nav evaluate flights recordings/ --json > figures.json
  h2nav evaluate flights flight.tlog --phase climb=42-56 --phase cruise=56-200 --plots pictures

truth: SIMSTATE in the recording. Where there is none, a CSV beside it: NAME_truth.csv, or, one per
boot of the autopilot, NAME_truth_0.csv, NAME_truth_1.csv ...; columns t_us (the autopilot's clock),
q_w q_x q_y q_z (body to north-east-down) and, if there is one, ekf2_q_w ... ekf2_q_z (the
autopilot's own estimate, empty while it has none).

estimators: h2nav and h2nav_no_gps are the service of `h2nav run`, with and without the velocity of
the GPS receiver; ekf is ATTITUDE, or the ekf2 columns of the CSV; ahrs2 is AHRS2.

spans: whole begins with an estimator's first estimate, settled {SETTLED_S:.0f} s after the
recording's start; airborne is while the vehicle says that it is armed and not landed.
NAME.tlog.events or NAME.events (lines of the autopilot's time in s and a text) split a flight into
phases: `PHASE word` begins one.

NEES is the mean of (error / predicted deviation) squared: 1 for a consistent prediction, more for
an optimistic one."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _CLOSING
    parser.add_argument(
        "places",
        nargs="+",
        type=Path,
        metavar="DIR",
        help="folders of recordings, or recordings: .tlog, our .mcap, raw .bytes",
    )
    playback.add_arguments(parser)
    parser.add_argument(
        "--phase",
        dest="phases",
        action="append",
        type=_phase,
        metavar="NAME=FROM-TO",
        help="a phase, in s of the autopilot's time, instead of those of the events file; may be "
        "given more than once",
    )
    parser.add_argument(
        "--plots", type=Path, metavar="DIR", help="folder for one figure per flight"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def _phase(text: str) -> FlightPhase:
    try:
        return parse_phase(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    tasks = _tasks(args)
    if args.plots is not None:
        args.plots.mkdir(parents=True, exist_ok=True)
    scores = {score.name: score for score in results(score_flight, _longest_first(tasks))}
    ordered = [scores[task.name] for task in tasks]
    left_out = {score.name: score.remark for score in ordered if not score.document}
    if len(left_out) == len(ordered) == 1:
        raise BadInput(ordered[0].remark)
    for remark in left_out.values():
        print(f"left out: {remark}", file=sys.stderr)
    flights = {score.name: score.document for score in ordered if score.document}
    if not flights:
        raise BadInput(f"{', '.join(map(str, args.places))}: no flight could be scored")
    means = mean(list(flights.values()))
    if args.json:
        print_json({"flights": flights, "mean": means, "left_out": left_out}, indent=1)
    else:
        sys.stdout.write(_table(flights, means))
    return 0


def _tasks(args: argparse.Namespace) -> list[FlightTask]:
    flights = names_of(path for place in args.places for path in flight_paths(place))
    played = functools.partial(play, options=playback.options(args))
    phases = None if args.phases is None else tuple(args.phases)
    return [FlightTask(path, name, played, phases, args.plots) for path, name in flights.items()]


def _longest_first(tasks: Sequence[FlightTask]) -> list[FlightTask]:
    """Sorts long flights first, so that no processor ends up with one while the others idle."""
    return sorted(tasks, key=lambda task: -task.path.stat().st_size)


def _table(flights: dict[str, Document], means: dict[str, dict[str, Document]]) -> str:
    width = max(map(len, [*flights, "mean of flights"]))
    names = f"{'':{width}}  {'':{_NAME_WIDTH}}"
    lines = [
        "RMS errors in deg, total (tilt); * = nearest to the truth",
        "",
        f"{names}  {'whole':^18}  {'settled':^18}  {'NEES':^15}  {'beyond 3 sigma':^16}",
        f"{names}  {'':18}  {'':18}  {'tilt':>6} {'heading':>8}  {'tilt':>7} {'heading':>8}",
    ]
    for name, flight in flights.items():
        lines += _rows(name, flight, flight["best"], width)
        lines += [f"{'':{width}}  {phrase}" for phrase in _remarks(flight)]
    if len(flights) > 1:
        lines += _rows("mean of flights", means, {}, width)
    else:
        (flight,) = flights.values()
        lines += _phase_lines(flight)
    lines += [
        "",
        f"Settled: from {SETTLED_S:.0f} s on. NEES (1 is honest) and the shares of time beyond "
        "3 sigma are",
        "of the settled part, else of the whole.",
    ]
    return "\n".join(lines) + "\n"


_NAME_WIDTH = max(map(len, ESTIMATORS))
_HONESTY_WIDTH = 33


def _rows(name: str, spans: dict[str, Any], best: dict[str, str], width: int) -> list[str]:
    """One line per estimator."""
    lines = []
    whole, settled = spans["whole"], spans["settled"]
    for number, (estimator, figures) in enumerate(whole.items()):
        later = settled.get(estimator)
        cells = [
            _errors(figures, best.get("whole") == estimator),
            _errors(later, best.get("settled") == estimator),
            _honesty(figures if later is None else later),
        ]
        title = "" if number else name
        count = f"  ({figures['flights']} flights)" if "flights" in figures else ""
        line = f"{title:{width}}  {estimator:{_NAME_WIDTH}}  {'  '.join(cells)}{count}"
        lines.append(line.rstrip())
    return lines


def _errors(figures: Document | None, is_best: bool) -> str:
    if figures is None:
        return f"{'-':>7}{'':11}"
    tilt = f"({figures['tilt']:.2f})"
    return f"{figures['total']:7.2f} {tilt:>8}{'*' if is_best else ' '} "


def _honesty(figures: Document) -> str:
    """NEES and shares; empty for an estimator without predictions."""
    if "nees_tilt" not in figures and "nees_heading" not in figures:
        return f"{'':{_HONESTY_WIDTH}}"
    nees = [figures.get(f"nees_{name}") for name in ("tilt", "heading")]
    beyond = [figures.get(f"{name}_beyond_3_sigma") for name in ("tilt", "heading")]
    shown = ["-" if value is None else f"{value:.2f}" for value in nees]
    shares = ["-" if value is None else f"{value:.1%}" for value in beyond]
    return f"{shown[0]:>6} {shown[1]:>8}  {shares[0]:>7} {shares[1]:>8}"


def _remarks(flight: Document) -> list[str]:
    """Remarks on unusual figures of a flight."""
    remarks = [] if flight["truth"] == "SIMSTATE" else [f"truth: {flight['truth']}"]
    return remarks + list(flight["notes"])


def _phase_lines(flight: Document) -> list[str]:
    """The errors of one flight by phase."""
    phases = {"airborne": flight["airborne"], **flight["phases"]}
    names = list(flight["whole"])
    width = max(map(len, phases))
    lines = ["", f"{'':{width}}  " + "  ".join(f"{name:^16}" for name in names)]
    for phase, figures in phases.items():
        cells = [_errors(figures.get(name), False)[:16] for name in names]
        if figures:
            lines.append(f"{phase:{width}}  {'  '.join(cells)}".rstrip())
    return lines
