"""What each idea of the default filter is worth: the filter without it, on recorded trials.

    python tools/ablation.py DIR...

The folders hold `.npz` trials and telemetry logs of flights with SIMSTATE: files named broad__* and
tumvi__* run as handheld, sitl__* as multirotor, *thor* as fixed wing, and *.tlog as what flew, with
and without the velocities of the GPS receiver. Prints the Markdown table of docs/filter.md: degrees
rms, means over the trials. Logs count from 60 s on, when the declination is known; one whose name
begins with imu_ is left out, because a sensor that fails is no measure of an idea.
"""

import contextlib
import statistics
import sys
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple
from unittest import mock

import numpy as np

from h2nav.apps import recorded_trials
from h2nav.attitude.samples import SensorDelays
from h2nav.attitude.velocity_aided.air_alignment import AirAlignment
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.heading_witness import HeadingWitness
from h2nav.attitude.velocity_aided.memory import SETS, Gains
from h2nav.evaluation.dataset.filters import Conditions, run_with_gains
from h2nav.evaluation.flights.scores import SETTLED_S
from h2nav.files import gain_files
from h2nav.maths.attitude_errors import Rms, errors, rms
from h2nav.recordings.trials import FilterInput, Trial

Change = Callable[[Gains], None]
PROCESSES = 2


class Idea(NamedTuple):
    """How the filter is run without an idea.

    Attributes:
        change: of the gains.
        told: of the filter's other inputs.
        silent: class and method that then finds nothing.
    """

    change: Change | None = None
    told: Callable[[FilterInput], FilterInput] | None = None
    silent: tuple[type, str] | None = None


class Run(NamedTuple):
    """The conditions of a trial that matter here."""

    vehicle_class: str
    use_gps: bool = False


class Column(NamedTuple):
    """Trials that share their conditions, and the figures that are shown of them."""

    title: str
    kind: str
    run: Run
    figures: tuple[str, ...]


COLUMNS = (
    Column("BROAD", "broad", Run("handheld"), ("total", "inclination")),
    Column("TUM-VI", "tumvi", Run("handheld"), ("inclination",)),
    Column("Thor", "thor", Run("fixed-wing"), ("inclination",)),
    Column("copters, field learnt", "sitl", Run("multirotor"), ("total", "inclination")),
    Column("copters, GPS", "tlog", Run("multirotor", True), ("total", "inclination")),
    Column("copters", "tlog", Run("multirotor"), ("total", "inclination")),
    Column("wing, GPS", "tlog", Run("fixed-wing", True), ("total", "inclination")),
    Column("wing", "tlog", Run("fixed-wing"), ("total", "inclination")),
)


def put(name: str, value: float) -> Idea:
    def change(g: Gains) -> None:
        setattr(g, name, value)

    return Idea(change)


def one_set(g: Gains) -> None:
    """Always uses the middle gain set: omega0 = 0.25 rad/s."""
    middle = 5
    g.k_tilt[:] = [g.k_tilt[middle]] * SETS
    g.k_velocity[:] = [g.k_velocity[middle]] * SETS


def no_prior(told: FilterInput) -> FilterInput:
    """Expects the field to have the delay of the rate."""
    if isinstance(told.what, SensorDelays):
        return told._replace(what=told.what._replace(field_s=told.what.gyro_s))
    return told


ABLATIONS: dict[str, Idea] = {
    "the filter": Idea(),
    "gain blind to rotation": put("scale_noise", 0.0),
    "gain blind to motion": put("velocity_correlation", 0.0),
    "one gain set": Idea(one_set),
    "bias from rest and field alone": put("bias_inflation", 1e12),
    "lasting innovations count as motion": put("innovation_mean_time_s", 1e9),
    "no latency of the field": put("mag_lag_limit", 0.0),
    "no latency prior": Idea(told=no_prior),
    "field noise blind to disturbance": put("mag_correlation", 0.0),
    "no easing into the start": put("startup_time_s", 0.0),
    "no jitter": put("jitter_share", 0.0),
    "no accelerometer bias": put("accel_variance", 0.0),
    "no latency of fixes": put("fix_lag_variance", 0.0),
    "no heading gate": put("mag_heading_gate", 0.0),
    "heading drift learnt without field": put("field_silence_s", 1e9),
    "no window in the air": Idea(silent=(AirAlignment, "solve")),
    "no heading from velocities": Idea(silent=(HeadingWitness, "take")),
}


class Known(NamedTuple):
    """A trial, and the conditions that it is run under."""

    trial: Trial
    kind: str
    runs: Sequence[Run]


def read(path: Path) -> Known | None:
    """The trial of a file; None for one that is none of the table's."""
    kind = "tlog" if path.suffix == ".tlog" else path.name.partition("__")[0]
    kind = "thor" if "thor" in path.name else kind
    if kind not in {column.kind for column in COLUMNS} or path.name.startswith("imu_"):
        return None
    trial, vehicle_class = recorded_trials.read_with_class(path)
    if kind == "tlog":
        trial = trial._replace(mask=trial.mask & (trial.t_us > SETTLED_S * 1e6))
        if not trial.mask.any() or not any("SIMSTATE" in note for note in trial.notes):
            return None
    runs = {c.run for c in COLUMNS if c.kind == kind and vehicle_class in ("", c.run.vehicle_class)}
    return Known(trial, kind, sorted(runs))


def score(trial: Trial, run: Run, idea: Idea) -> Rms:
    """The errors of a trial without an idea."""
    file = f"{run.vehicle_class}_{gain_files.shipped_rate(trial.rate_hz)}hz"
    gains = velocity_aided_gains(gain_files.load(file), file)
    if idea.change is not None:
        idea.change(gains.kernel)
    if idea.told is not None:
        trial = trial._replace(inputs=tuple(map(idea.told, trial.inputs)))
    with contextlib.ExitStack() as stack:
        if idea.silent is not None:
            stack.enter_context(mock.patch.object(*idea.silent, return_value=None))
        track = run_with_gains(trial, Conditions(*run), gains)
    assert trial.q_es is not None
    return rms(errors(track.q_es, trial.q_es, trial.mask, trial.heading_fixed), trial.mask)


Scores = dict[tuple[str, Run, str], Rms]


def score_all(path: Path) -> Scores:
    """The errors of a file without each idea, by kind, conditions and idea."""
    known = read(path)
    if known is None:
        return {}
    # An idea may end in an attitude that is no number.
    with np.errstate(invalid="ignore"):
        return {
            (known.kind, run, name): score(known.trial, run, idea)
            for run in known.runs
            for name, idea in ABLATIONS.items()
        }


def cell(found: Iterable[Rms], figures: Sequence[str]) -> str:
    rows = list(found)
    if not rows:
        return ""
    means = (statistics.fmean(getattr(row, figure) for row in rows) for figure in figures)
    return " / ".join(f"{mean:.2f}" for mean in means)


def main(folders: Sequence[Path]) -> None:
    paths = [path for folder in folders for path in folder.iterdir()]
    paths = [path for path in paths if path.suffix in (".npz", ".tlog")]
    paths.sort(key=lambda path: (path.suffix, path.stat().st_size), reverse=True)
    with ProcessPoolExecutor(PROCESSES) as pool:
        scores = list(pool.map(score_all, paths))
    names = {"total": "total", "inclination": "incl."}
    titles = [f"{c.title}: {' / '.join(names[f] for f in c.figures)}" for c in COLUMNS]
    print("| without | " + " | ".join(titles) + " |")
    print("|---" * (len(COLUMNS) + 1) + "|")
    for name in ABLATIONS:
        wanted = [(column, (column.kind, column.run, name)) for column in COLUMNS]
        cells = [cell((s[key] for s in scores if key in s), c.figures) for c, key in wanted]
        print(f"| {name} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main([Path(name) for name in sys.argv[1:]])
