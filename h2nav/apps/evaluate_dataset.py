"""`h2nav evaluate dataset`: compares filters on recorded trials with truth."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.apps.recorded_trials import read
from h2nav.attitude.gains.envelope import VEHICLE_CLASSES
from h2nav.errors import BadInput, TaskFailed
from h2nav.evaluation.dataset.filters import Conditions
from h2nav.evaluation.dataset.peers import NEEDS, RECOMMENDED, SMOOTHED, installed
from h2nav.evaluation.dataset.scores import TrialScore, TrialTask, score_task, summary
from h2nav.evaluation.names import names_of
from h2nav.evaluation.parallel import results
from h2nav.recordings.trials import trial_paths

MAX_SPEED_M_S = 300.0
_EXAMPLES = """\
more examples:
  h2nav evaluate dataset trials/ --filter all
  h2nav evaluate dataset flight.tlog --class multirotor --gps --filter default --filter vqf --json
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _EXAMPLES
    parser.add_argument(
        "places",
        nargs="+",
        type=Path,
        metavar="DIR",
        help="folders of trials, or trials: .npz, or recordings of an autopilot (.tlog, our "
        ".mcap, raw .bytes), whose truth is SIMSTATE, else ATTITUDE",
    )
    parser.add_argument(
        "--class",
        dest="vehicle_class",
        choices=VEHICLE_CLASSES,
        default="handheld",
        help="vehicle class of the velocity-aided filter (default: handheld)",
    )
    parser.add_argument(
        "--filter",
        dest="filters",
        action="append",
        metavar="F",
        help="filter to run, or 'all'; may be given more than once (default: default). Known: "
        "default = velocity_aided, default_fixed = velocity_aided_integer (the same in 32-bit "
        "integers); where installed paper, vqf, imufusion, ahrs.madgwick, ahrs.ekf",
    )
    parser.add_argument(
        "--smooth",
        action="store_true",
        help="also run each of our filters backward and add the smoothed estimate: NAME_smoothed; "
        "vqf_offline beside vqf",
    )
    parser.add_argument("--gps", action="store_true", help="use the trials' GPS velocities")
    parser.add_argument(
        "--declination-deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="declination of the truth's north, for --gps on .npz trials whose north is magnetic; "
        "recordings have their own",
    )
    parser.add_argument(
        "--cruise-speed-m-s",
        type=float,
        metavar="V",
        help="speed along the nose of a fixed wing without airspeed; 0 = unknown "
        "(default: the class's)",
    )
    parser.add_argument("--plots", type=Path, metavar="DIR", help="folder for one figure per run")
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    _check(args)
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    tasks = _tasks(args)
    if args.plots is not None:
        args.plots.mkdir(parents=True, exist_ok=True)
    scores = list(results(score_task, tasks))
    remarks = {score.remark for score in scores if score.rms_deg is None}
    if all(score.rms_deg is None for score in scores):
        error = BadInput if all(score.is_bad_input for score in scores) else TaskFailed
        if len(remarks) == 1:
            raise error(remarks.pop())
        _say_left_out(scores)
        raise error(f"{', '.join(map(str, args.places))}: no trial could be scored")
    _say_left_out(scores)
    names = list(dict.fromkeys(task.filter_name for task in tasks))
    summaries = {name: summary(scores, name) for name in names}
    notes = {score.trial: score.notes for score in scores if score.notes}
    if args.json:
        first = summaries[names[0]]
        document = dict(first) if len(names) == 1 else {**first, "filters": summaries}
        print_json({"class": args.vehicle_class, **document, "notes": notes})
    else:
        sys.stdout.write("".join(_table(name, summaries[name]) for name in names))
        for trial, lines in notes.items():
            sys.stdout.write("".join(f"{trial}: {line}\n" for line in lines))
    return 0


def _say_left_out(scores: Sequence[TrialScore]) -> None:
    for score in scores:
        if score.rms_deg is None:
            sys.stderr.write(f"{score.trial}: {score.filter_name}: left out: {score.remark}\n")


def _check(args: argparse.Namespace) -> None:
    if not abs(args.declination_deg) <= 180.0:
        raise BadInput("--declination-deg: expected a number within +-180")
    if args.cruise_speed_m_s is not None and not 0.0 <= args.cruise_speed_m_s <= MAX_SPEED_M_S:
        raise BadInput(f"--cruise-speed-m-s: expected a number from 0 to {MAX_SPEED_M_S:g}")


def _tasks(args: argparse.Namespace) -> list[TrialTask]:
    known = installed()
    names: Sequence[str] = args.filters or ["default"]
    if "all" in names:
        others = {*RECOMMENDED.values(), *SMOOTHED.values()}
        names = [name for name in known if name not in others]
    if args.smooth:
        names = [each for name in names for each in (name, SMOOTHED.get(name)) if each is not None]
    for name in names:
        if name in NEEDS:
            extra, module = NEEDS[name]
            extras.require(extra, f"--filter {name}", module)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(
            *(f"--filter {name}: not known; have {', '.join(known)}, all" for name in unknown)
        )
    conditions = Conditions(
        args.vehicle_class,
        args.gps,
        args.declination_deg,
        args.cruise_speed_m_s,
        shows_insides=args.plots is not None,
    )
    trials = names_of(path for place in args.places for path in trial_paths(place))
    return [
        TrialTask(path, read, trial, name, conditions, args.plots)
        for name in dict.fromkeys(names)
        for path, trial in trials.items()
    ]


def _table(name: str, result: dict[str, Any]) -> str:
    trials, mean = result["trials"], result["mean"]
    if not trials:
        return f"{name}: no trial could be scored\n\n"
    width = max(map(len, [*trials, name]))
    lines = [f"{name:{width}}    total  heading  inclination   (rms, deg)"]
    for trial, row in [*trials.items(), ("mean", mean)]:
        total, heading, inclination = row.values()
        lines.append(f"{trial:{width}} {total:8.3f} {heading:8.3f} {inclination:12.3f}")
    lines.append(f"{result['us_per_sample']:.2f} us per sample ({result['backend']})")
    return "\n".join(lines) + "\n\n"
