"""The slides' figures drawn from our runs, and the stable region of the paper's constant gain."""

from pathlib import Path
from typing import Any

import numpy as np

from h2nav.calibration import pictures
from h2nav.errors import BadInput
from h2nav.evaluation.paper.filter import paper_gain, spectral_abscissa
from h2nav.evaluation.paper.trials import (
    CASES,
    Assumptions,
    Case,
    Trials,
    errors_deg,
    make_trials,
    runners,
)
from h2nav.maths.units import DEG

ANGLES = ("roll", "pitch", "yaw")
AXES = ("x", "y", "z")
# Filters whose errors are drawn: as in the slides, and ours.
SHOWN = (
    ("ekf_unit", "EKF, unit weights"),
    ("eh2_paper", "extended H2"),
)
# The stable region is drawn over (across, up) with the third angle 0.
SECTIONS = (
    ("heading", "roll", "pitch"),
    ("heading", "pitch", "roll"),
    ("roll", "pitch", "heading"),
)
DPI = 75


def draw_cases(assumptions: Assumptions, folder: Path) -> None:
    """Writes true angles, sensor data, errors per case, and the stable region, as PNG.

    Raises:
        BadInput: the folder cannot be written.
    """
    plt = pictures.pyplot()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for case in CASES[:2]:
            trials = make_trials(case, assumptions, range(1))
            _draw_motion(plt, case, trials, folder / f"{case.key}_motion.png")
            _draw_errors(plt, case, trials, folder / f"{case.key}_errors.png")
        _draw_stable_region(plt, assumptions, folder / "stable_region.png")
    except OSError as error:
        raise BadInput(f"--plots {folder}: cannot be written: {error}") from None


def _draw_motion(plt: Any, case: Case, trials: Trials, path: Path) -> None:
    t_s = (trials.t_us[trials.scored :] - trials.t_us[trials.scored]) * 1e-6
    figure, rows = plt.subplots(4, 1, figsize=(8, 9), sharex=True, layout="constrained")
    series = (
        ("true angle (deg)", trials.truth / DEG, ANGLES),
        ("gyro (deg/s)", trials.rate[0] / DEG, AXES),
        ("force (m/s²)", trials.force[0], AXES),
        ("field (µT)", trials.field[0], AXES),
    )
    for axes, (label, values, names) in zip(rows, series, strict=True):
        for number, name in enumerate(names):
            axes.plot(t_s, values[trials.scored :, number], linewidth=0.8, label=name)
        axes.set_ylabel(label)
        axes.grid(alpha=0.3)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
    rows[-1].set_xlabel("time (s)")
    figure.suptitle(f"{_title(case)}: truth and sensor data")
    pictures.save(figure, path, DPI)


def _draw_errors(plt: Any, case: Case, trials: Trials, path: Path) -> None:
    t_s = (trials.t_us[trials.scored :] - trials.t_us[trials.scored]) * 1e-6
    figure, rows = plt.subplots(3, 1, figsize=(8, 7), sharex=True, layout="constrained")
    all_runners = runners(case)
    for name, label in SHOWN:
        errors = errors_deg(trials, all_runners[name](trials)[name])[0]
        for number, axes in enumerate(rows):
            axes.plot(t_s, errors[:, number], linewidth=0.9, label=label)
    for axes, angle in zip(rows, ANGLES, strict=True):
        axes.set_ylabel(f"{angle} error (deg)")
        axes.grid(alpha=0.3)
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    rows[-1].set_xlabel("time (s)")
    figure.suptitle(f"{_title(case)}: estimation error")
    pictures.save(figure, path, DPI)


def _draw_stable_region(plt: Any, assumptions: Assumptions, path: Path) -> None:
    """Three sections through (roll, pitch, heading); red where the error grows."""
    order = {"roll": 0, "pitch": 1, "heading": 2}
    vectors = assumptions.vectors
    L = paper_gain(vectors)
    figure, columns = plt.subplots(1, 3, figsize=(12, 4.4), layout="constrained")
    for axes, (across, up, fixed) in zip(columns, SECTIONS, strict=True):
        x = np.linspace(*_range(across), 121)
        y = np.linspace(*_range(up), 121)
        angles = np.zeros((x.size * y.size, 3))
        angles[:, order[across]] = np.tile(x, y.size) * DEG
        angles[:, order[up]] = np.repeat(y, x.size) * DEG
        growth = spectral_abscissa(L, vectors, angles).reshape(y.size, x.size)
        shown = axes.pcolormesh(
            x, y, np.clip(growth, -0.6, 0.6), cmap="RdYlGn_r", vmin=-0.6, vmax=0.6, rasterized=True
        )
        axes.contour(x, y, growth, levels=[0.0], colors="black", linewidths=1.5)
        axes.set(xlabel=f"{across} (deg)", ylabel=f"{up} (deg)", title=f"{fixed} 0")
    figure.colorbar(shown, ax=list(columns), label="growth of the error (1/s)")
    figure.suptitle("The paper's constant gain: the error decays only where it is green")
    pictures.save(figure, path, DPI)


def _range(angle: str) -> tuple[float, float]:
    return (-89.0, 89.0) if angle == "pitch" else (-180.0, 180.0)


def _title(case: Case) -> str:
    return {"case_1": "Case I", "case_2": "Case II"}[case.key]
