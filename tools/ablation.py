"""What each idea of the default filter is worth: the filter without it, on recorded trials.

    python tools/ablation.py DIR

DIR holds `.npz` trials; files named broad__* and tumvi__* run as handheld, sitl__* as multirotor,
*thor* as fixed wing. Prints the Markdown table of docs/filter.md, degrees.
"""

import statistics
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import NamedTuple

from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.memory import SETS, Gains
from h2nav.evaluation.dataset.filters import Conditions, run_shaped
from h2nav.evaluation.scoring import errors, rms
from h2nav.io import gain_files
from h2nav.io.trials import read_trial

Change = Callable[[Gains], None]
DECLINATION_DEG = 12.69  # of the simulated flights


class DataSet(NamedTuple):
    """Trials that share a class and a figure of merit (0 total, 2 inclination)."""

    title: str
    pattern: str
    conditions: Conditions
    figure: int


DATA_SETS = (
    DataSet("BROAD total", "broad__*.npz", Conditions("handheld"), 0),
    DataSet("BROAD incl.", "broad__*.npz", Conditions("handheld"), 2),
    DataSet("TUM-VI incl.", "tumvi__*.npz", Conditions("handheld"), 2),
    DataSet("flights total", "sitl__*.npz", Conditions("multirotor"), 0),
    DataSet("flights incl.", "sitl__*.npz", Conditions("multirotor"), 2),
    DataSet(
        "flights total, GPS", "sitl__*.npz", Conditions("multirotor", True, DECLINATION_DEG), 0
    ),
    DataSet("Thor incl.", "*thor*.npz", Conditions("fixed-wing"), 2),
)


def put(name: str, value: float) -> Change:
    def change(g: Gains) -> None:
        setattr(g, name, value)

    return change


def one_set(g: Gains) -> None:
    """Always the set in the middle of what is used: omega0 = 0.25 rad/s."""
    middle = 5
    g.k_tilt[:] = [g.k_tilt[middle]] * SETS
    g.k_velocity[:] = [g.k_velocity[middle]] * SETS


ABLATIONS: dict[str, Change | None] = {
    "the filter": None,
    "gain blind to rotation": put("scale_noise", 0.0),
    "gain blind to motion": put("velocity_correlation", 0.0),
    "one gain set": one_set,
    "bias from rest and field alone": put("bias_inflation", 1e12),
    "lasting innovations count as motion": put("innovation_mean_time_s", 1e9),
    "no latency of the field": put("mag_lag_limit", 0.0),
    "field noise blind to disturbance": put("mag_correlation", 0.0),
    "no easing into the start": put("startup_time_s", 0.0),
}


def score(path: Path, conditions: Conditions, name: str) -> tuple[float, float, float]:
    trial = read_trial(path)
    file = f"{conditions.vehicle_class}_{gain_files.shipped_rate(trial.rate_hz)}hz"
    gains = velocity_aided_gains(gain_files.load(file), file)
    change = ABLATIONS[name]
    if change is not None:
        change(gains.kernel)
    track = run_shaped(trial, conditions, gains)
    assert trial.q_es is not None
    return rms(errors(track.q_es, trial.q_es, trial.mask, trial.heading_fixed), trial.mask)


def main(folder: Path) -> None:
    runs = sorted({(d.pattern, d.conditions) for d in DATA_SETS}, key=str)
    with ProcessPoolExecutor() as pool:
        futures = {
            (pattern, conditions, name): [
                pool.submit(score, path, conditions, name) for path in sorted(folder.glob(pattern))
            ]
            for name in ABLATIONS
            for pattern, conditions in runs
        }
        print("| without | " + " | ".join(d.title for d in DATA_SETS) + " |")
        print("|---" * (len(DATA_SETS) + 1) + "|")
        for name in ABLATIONS:
            cells = []
            for d in DATA_SETS:
                scores = [f.result() for f in futures[d.pattern, d.conditions, name]]
                value = statistics.fmean(s[d.figure] for s in scores) if scores else float("nan")
                cells.append(f"{value:.2f}")
            print(f"| {name} | " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main(Path(sys.argv[1]))
