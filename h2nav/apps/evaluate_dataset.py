"""`h2nav evaluate dataset`: filters side by side on recorded trials with truth."""

import argparse
import math
import os
import statistics
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from h2nav.apps import extras
from h2nav.apps.json_output import print_json
from h2nav.errors import BadInput, TaskFailed

if TYPE_CHECKING:
    from h2nav.apps.dataset_filters import Conditions
    from h2nav.io.trials import Trial

CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")
_KEYS = ("total", "heading", "inclination")
_TRUTH = "key q of an .npz, or SIMSTATE or ATTITUDE in a recording"
_EXAMPLES = """\
more examples:
  h2nav evaluate dataset trials/ --filter all
  h2nav evaluate dataset flight.tlog --class multirotor --gps --filter default --filter vqf --json
"""


class Task(NamedTuple):
    """One filter on one trial; complete, so that another process can do it."""

    path: Path
    trial: str
    filter_name: str
    conditions: "Conditions"
    plots: Path | None


class Score(NamedTuple):
    """What came of a task.

    Attributes:
        trial: name of the trial.
        filter_name: name of the filter.
        rms_deg: total, heading, inclination. None when the task was not possible.
        us_per_sample: processor time of the filter's calls alone.
        backend: what they ran on.
        remark: why there is no result.
        notes: of the trial.
    """

    trial: str
    filter_name: str
    rms_deg: tuple[float, float, float] | None
    us_per_sample: float
    backend: str
    remark: str
    notes: tuple[str, ...]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = _EXAMPLES
    parser.add_argument(
        "place",
        type=Path,
        metavar="DIR",
        help="folder of trials, or one: .npz, or recordings of an autopilot (.tlog, our .mcap, raw "
        ".bytes), whose truth is SIMSTATE, else ATTITUDE",
    )
    parser.add_argument(
        "--class",
        dest="vehicle_class",
        choices=CLASSES,
        default="handheld",
        help="vehicle class of the default filter (default: handheld)",
    )
    parser.add_argument(
        "--filter",
        dest="filters",
        action="append",
        metavar="F",
        help="filter to run, or 'all'; may be given more than once (default: default). Known: "
        "default, default_fixed (the same in 32-bit integers), two_stage; where installed paper, "
        "vqf, imufusion, ahrs.madgwick, ahrs.ekf",
    )
    parser.add_argument("--gps", action="store_true", help="use the trials' GPS velocities")
    parser.add_argument(
        "--declination-deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="true course of the truth's north, for --gps on .npz trials whose north is magnetic; "
        "recordings bring their own",
    )
    parser.add_argument(
        "--cruise-speed-m-s",
        type=float,
        metavar="V",
        help="speed along the nose of a fixed wing without airspeed; 0 = unknown "
        "(default: the class's)",
    )
    parser.add_argument("--plots", type=Path, metavar="DIR", help="folder for one figure a run")
    parser.add_argument("--json", action="store_true", help="machine-readable result")


def run(args: argparse.Namespace) -> int:
    """See `h2nav.cli.COMMANDS`."""
    if args.plots is not None:
        extras.require("plots", "--plots", "matplotlib.pyplot")
    tasks = _tasks(args)
    if args.plots is not None:
        args.plots.mkdir(parents=True, exist_ok=True)
    order = {(task.trial, task.filter_name): place for place, task in enumerate(tasks)}
    scores = sorted(_run_all(tasks), key=lambda score: order[score.trial, score.filter_name])
    remarks = {score.remark for score in scores if score.rms_deg is None}
    if all(score.rms_deg is None for score in scores):
        if len(remarks) == 1:
            raise TaskFailed(remarks.pop())
        _say_left_out(scores)
        raise TaskFailed(f"{args.place}: no trial could be scored")
    _say_left_out(scores)
    names = list(dict.fromkeys(task.filter_name for task in tasks))
    results = {name: _summary(scores, name) for name in names}
    notes = {score.trial: score.notes for score in scores if score.notes}
    if args.json:
        first = results[names[0]]
        document = dict(first) if len(names) == 1 else {**first, "filters": results}
        print_json({"class": args.vehicle_class, **document, "notes": notes})
    else:
        sys.stdout.write("".join(_table(name, results[name]) for name in names))
        for trial, lines in notes.items():
            sys.stdout.write("".join(f"{trial}: {line}\n" for line in lines))
    return 0


def score_task(task: Task) -> Score:
    """Runs and scores one task; what a worker process does."""
    from h2nav.apps.dataset_peers import installed
    from h2nav.attitude.scoring import errors, rms

    nothing = Score(task.trial, task.filter_name, None, 0.0, "", "", ())
    try:
        trial = _read(task.path)
        if trial.q_es is None or not trial.mask.any():
            return nothing._replace(remark=f"{task.path}: no truth: {_TRUTH}")
        track = installed()[task.filter_name](trial, task.conditions)
    except (BadInput, TaskFailed) as error:
        return nothing._replace(remark=str(error))
    found = errors(track.q_es, trial.q_es, trial.mask, trial.heading_fixed)
    if task.plots is not None:
        from h2nav.apps.dataset_plots import draw

        draw(trial, track, found, task.plots / f"{task.trial}.{task.filter_name}.png")
    rms_deg = rms(found, trial.mask)
    if not all(map(math.isfinite, rms_deg)):
        return nothing._replace(remark="it gave attitudes that are not finite")
    return nothing._replace(
        rms_deg=rms_deg,
        us_per_sample=track.us_per_sample,
        backend=track.backend,
        notes=trial.notes,
    )


def _read(path: Path) -> "Trial":
    from h2nav.io.trials import SUFFIX, read_trial

    if path.suffix == SUFFIX:
        return read_trial(path)
    from h2nav.apps.recorded_trials import read_recorded_trial

    return read_recorded_trial(path)


def _say_left_out(scores: Sequence[Score]) -> None:
    for score in scores:
        if score.rms_deg is None:
            sys.stderr.write(f"{score.trial}: {score.filter_name}: left out: {score.remark}\n")


def _tasks(args: argparse.Namespace) -> list[Task]:
    from h2nav.apps.dataset_filters import Conditions
    from h2nav.apps.dataset_peers import NEEDS, installed
    from h2nav.io.trials import trial_paths

    known = installed()
    names: Sequence[str] = args.filters or ["default"]
    if "all" in names:
        names = list(known)
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
    paths = trial_paths(args.place)
    stems = Counter(path.stem for path in paths)
    trials = {path: path.stem if stems[path.stem] == 1 else path.name for path in paths}
    return [
        Task(path, trial, name, conditions, args.plots)
        for name in dict.fromkeys(names)
        for path, trial in trials.items()
    ]


def _run_all(tasks: Sequence[Task]) -> Iterator[Score]:
    """The scores of all tasks, on all cores, as they come."""
    from tqdm import tqdm

    workers = min(len(tasks), os.cpu_count() or 1)
    with tqdm(total=len(tasks), unit="run", disable=not sys.stderr.isatty()) as bar:
        if workers == 1:
            for task in tasks:
                yield score_task(task)
                bar.update()
            return
        with ProcessPoolExecutor(workers) as pool:
            for future in as_completed([pool.submit(score_task, task) for task in tasks]):
                yield future.result()
                bar.update()


def _summary(scores: Sequence[Score], name: str) -> dict[str, Any]:
    """One filter's results: per trial, their mean, the time per sample and what it ran on."""
    done = [s for s in scores if s.filter_name == name and s.rms_deg is not None]
    trials = {s.trial: dict(zip(_KEYS, s.rms_deg or (), strict=True)) for s in done}
    if not done:
        return {"trials": {}, "mean": {}, "us_per_sample": 0.0, "backend": ""}
    return {
        "trials": trials,
        "mean": {key: statistics.fmean(row[key] for row in trials.values()) for key in _KEYS},
        "us_per_sample": statistics.fmean(s.us_per_sample for s in done),
        "backend": ", ".join(sorted({s.backend for s in done})),
    }


def _table(name: str, result: dict[str, Any]) -> str:
    trials, mean = result["trials"], result["mean"]
    if not trials:
        return f"{name}: no trial could be scored\n\n"
    width = max(map(len, [*trials, name]))
    lines = [f"{name:{width}}    total  heading  inclination   (rms, deg)"]
    for trial, row in [*trials.items(), ("mean", mean)]:
        total, heading, inclination = (row[key] for key in _KEYS)
        lines.append(f"{trial:{width}} {total:8.3f} {heading:8.3f} {inclination:12.3f}")
    lines.append(f"{result['us_per_sample']:.2f} us per sample ({result['backend']})")
    return "\n".join(lines) + "\n\n"
