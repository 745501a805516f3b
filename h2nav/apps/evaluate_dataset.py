"""`h2nav evaluate dataset`: filters side by side on recorded trials with truth."""

import argparse
import json
import os
import statistics
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from h2nav.errors import BadInput, TaskFailed

if TYPE_CHECKING:
    from h2nav.apps.dataset_filters import Conditions

CLASSES = ("handheld", "multirotor", "fixed-wing", "rover")
_KEYS = ("total", "heading", "inclination")


class Task(NamedTuple):
    """One filter on one trial; complete, so that another process can do it."""

    path: Path
    filter_name: str
    conditions: "Conditions"
    plots: Path | None


class Score(NamedTuple):
    """What came of a task.

    Attributes:
        trial: name of the trial.
        filter_name: name of the filter.
        rms_deg: total, heading, inclination; heading and total are NaN where the trial has no
            field to tell the heading by. None when the task was not possible.
        us_per_sample: processor time.
        remark: why there is no result.
    """

    trial: str
    filter_name: str
    rms_deg: tuple[float, float, float] | None
    us_per_sample: float
    remark: str


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """See `h2nav.cli.COMMANDS`."""
    parser.add_argument("place", type=Path, metavar="DIR", help="folder of .npz trials, or one")
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
        "default, two_stage, paper; where installed vqf, imufusion, ahrs.madgwick, ahrs.ekf",
    )
    parser.add_argument("--gps", action="store_true", help="use the trials' GPS velocities")
    parser.add_argument(
        "--declination-deg",
        type=float,
        default=0.0,
        metavar="DEG",
        help="true course of the truth's north (for --gps where the truth's north is magnetic)",
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
    tasks = _tasks(args)
    if args.plots is not None:
        args.plots.mkdir(parents=True, exist_ok=True)
    scores = sorted(_run_all(tasks), key=lambda score: tasks.index(_task_of(score, tasks)))
    for score in scores:
        if score.rms_deg is None:
            sys.stderr.write(f"{score.trial}: {score.filter_name}: left out: {score.remark}\n")
    names = list(dict.fromkeys(task.filter_name for task in tasks))
    results = {name: _summary(scores, name) for name in names}
    if not any(result["trials"] for result in results.values()):
        raise TaskFailed(f"{args.place}: no trial could be scored")
    if args.json:
        first = next(iter(results.values()))
        document = dict(first) if len(names) == 1 else {**first, "filters": results}
        json.dump({"class": args.vehicle_class, **document}, sys.stdout)
        sys.stdout.write("\n")
    else:
        sys.stdout.write("".join(_table(name, results[name]) for name in names))
    return 0


def score_task(task: Task) -> Score:
    """Runs and scores one task; what a worker process does."""
    from h2nav.apps.dataset_peers import installed
    from h2nav.attitude.scoring import errors, rms
    from h2nav.io.trials import read_trial

    nothing = Score(task.path.stem, task.filter_name, None, 0.0, "")
    try:
        trial = read_trial(task.path)
        if trial.q_es is None or not trial.mask.any():
            return nothing._replace(remark="it has no truth (key q)")
        track = installed()[task.filter_name](trial, task.conditions)
    except (BadInput, TaskFailed) as error:
        return nothing._replace(remark=str(error))
    found = errors(track.q_es, trial.q_es, trial.mask, trial.heading_fixed)
    if task.plots is not None:
        from h2nav.apps.dataset_plots import draw

        draw(trial, track, found, task.plots / f"{trial.name}.{task.filter_name}.png")
    return nothing._replace(rms_deg=rms(found, trial.mask), us_per_sample=track.us_per_sample)


def _tasks(args: argparse.Namespace) -> list[Task]:
    from h2nav.apps.dataset_filters import Conditions
    from h2nav.apps.dataset_peers import installed
    from h2nav.io.trials import trial_paths

    known = installed()
    names: Sequence[str] = args.filters or ["default"]
    if "all" in names:
        names = list(known)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise BadInput(
            *(
                f"--filter {name}: not known or not installed; have {', '.join(known)}, all"
                for name in unknown
            )
        )
    conditions = Conditions(
        args.vehicle_class, args.gps, args.declination_deg, args.cruise_speed_m_s
    )
    return [
        Task(path, name, conditions, args.plots)
        for name in dict.fromkeys(names)
        for path in trial_paths(args.place)
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


def _task_of(score: Score, tasks: Sequence[Task]) -> Task:
    return next(
        task
        for task in tasks
        if (task.path.stem, task.filter_name) == (score.trial, score.filter_name)
    )


def _summary(scores: Sequence[Score], name: str) -> dict[str, dict[str, object] | float]:
    """One filter's results: per trial, their mean, and the time per sample."""
    done = [s for s in scores if s.filter_name == name and s.rms_deg is not None]
    trials = {s.trial: dict(zip(_KEYS, s.rms_deg or (), strict=True)) for s in done}
    if not done:
        return {"trials": {}, "mean": {}, "us_per_sample": 0.0}
    mean = {key: statistics.fmean(row[key] for row in trials.values()) for key in _KEYS}
    time = statistics.fmean(s.us_per_sample for s in done)
    return {"trials": dict(trials), "mean": dict(mean), "us_per_sample": time}


def _table(name: str, result: dict[str, dict[str, object] | float]) -> str:
    trials, mean = result["trials"], result["mean"]
    assert isinstance(trials, dict)
    assert isinstance(mean, dict)
    if not trials:
        return f"{name}: no trial could be scored\n\n"
    width = max(map(len, [*trials, name]))
    lines = [f"{name:{width}}    total  heading  inclination   (rms, deg)"]
    for trial, row in [*trials.items(), ("mean", mean)]:
        assert isinstance(row, dict)
        numbers = (row[key] for key in _KEYS)
        total, heading, inclination = numbers
        lines.append(f"{trial:{width}} {total:8.3f} {heading:8.3f} {inclination:12.3f}")
    lines.append(f"{result['us_per_sample']:.2f} us per sample")
    return "\n".join(lines) + "\n\n"
