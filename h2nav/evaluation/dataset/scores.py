"""Scores one filter on one trial, and summarises a filter over all trials."""

import math
import statistics
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from h2nav.errors import BadInput, TaskFailed
from h2nav.evaluation.dataset.filters import Conditions
from h2nav.evaluation.dataset.peers import installed
from h2nav.maths.attitude_errors import Rms, errors, rms
from h2nav.recordings.trials import Trial

_TRUTH = "key q of an .npz, or SIMSTATE or ATTITUDE in a recording"


class TrialTask(NamedTuple):
    """One filter on one trial; self-contained, for another process."""

    path: Path  # the trial's file
    read: Callable[[Path], Trial]  # reads it
    trial: str  # name of the trial
    filter_name: str  # one of `peers.installed`
    conditions: Conditions  # inputs of the filter
    plots: Path | None = None  # folder for a picture of the run; None = no picture


class TrialScore(NamedTuple):
    """The result of a task."""

    trial: str  # name of the trial
    filter_name: str  # name of the filter
    rms_deg: Rms | None = None  # total, heading, inclination. None when the task was not possible.
    us_per_sample: float = 0.0  # processor time of the filter's calls
    backend: str = ""  # see `Track`
    remark: str = ""  # why there is no result
    is_bad_input: bool = False  # the file is the reason
    notes: tuple[str, ...] = ()  # of the trial


def score_task(task: TrialTask) -> TrialScore:
    """Runs and scores one task, in a worker process."""
    nothing = TrialScore(task.trial, task.filter_name)
    try:
        trial = task.read(task.path)
        if trial.q_es is None or not trial.mask.any():
            return nothing._replace(remark=f"{task.path}: no truth: {_TRUTH}", is_bad_input=True)
        track = installed()[task.filter_name](trial, task.conditions)
    except (BadInput, TaskFailed) as error:
        is_bad_input = isinstance(error, BadInput)
        return nothing._replace(remark=str(error), is_bad_input=is_bad_input)
    found = errors(track.q_es, trial.q_es, trial.mask, trial.heading_fixed)
    if task.plots is not None:
        from h2nav.evaluation.dataset.pictures import draw

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


def summary(scores: Sequence[TrialScore], name: str) -> dict[str, Any]:
    """One filter's results: per trial, their mean, the time per sample and the backend."""
    done = [s for s in scores if s.filter_name == name and s.rms_deg is not None]
    trials = {s.trial: s.rms_deg._asdict() for s in done if s.rms_deg is not None}
    if not done:
        return {"trials": {}, "mean": {}, "us_per_sample": 0.0, "backend": ""}
    return {
        "trials": trials,
        "mean": {key: statistics.fmean(row[key] for row in trials.values()) for key in Rms._fields},
        "us_per_sample": statistics.fmean(s.us_per_sample for s in done),
        "backend": ", ".join(sorted({s.backend for s in done})),
    }
