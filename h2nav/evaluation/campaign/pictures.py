"""Pictures of a campaign: how many flights are better than what, and what became of the faults."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from h2nav.calibration import pictures
from h2nav.evaluation.campaign.summary import HONEST, LONG_S, OUTCOMES, Row, summary

COLOURS = {"right": "C2", "late": "C8", "undecided": "0.7", "wrong": "C3", "missed": "C1"}


def draw_pictures(rows: Sequence[Row], folder: Path) -> None:
    """Writes survival.png and faults.png."""
    folder.mkdir(parents=True, exist_ok=True)
    scored = [row for row in rows if "heading_deg" in row]
    _survival(scored, folder / "survival.png")
    _faults(summary(rows)["by_fault"], folder / "faults.png")


def _survival(rows: Sequence[Row], path: Path) -> None:
    """Shares of flights beyond each error, each time of a wrong attitude, and each NEES."""
    figure, axes = pictures.pyplot().subplots(1, 3, figsize=(13, 4.2), layout="constrained")
    for name, colour in (("heading", "C0"), ("tilt", "C1")):
        for p, style in (("p50", ":"), ("p95", "-"), ("p100", "--")):
            label = f"{name}, {p}" if p != "p100" else f"{name}, worst"
            _curve(axes[0], [row[f"{name}_deg"][p] for row in rows], label, colour, style)
        _curve(axes[1], [row[f"{name}_wrong_s"] for row in rows], name, colour, "-")
        _curve(axes[2], [row[f"nees_{name}"] for row in rows], name, colour, "-")
    axes[1].axvline(LONG_S, color="0.5", linewidth=0.8)
    axes[2].axvspan(*HONEST, color="0.9")
    titles = ("error, deg", "wrong while a sensor shows better, s", "NEES after two minutes")
    for axis, title in zip(axes, titles, strict=True):
        axis.set(xlabel=title, ylabel="share of flights beyond", yscale="log", xscale="log")
        axis.grid(alpha=0.3)
        axis.legend(frameon=False, fontsize="small")
    figure.suptitle(f"{len(rows)} flights")
    pictures.save(figure, path)


def _curve(axis: Any, values: Sequence[float | None], label: str, colour: str, style: str) -> None:
    known = np.sort([max(value, 1e-3) for value in values if value is not None])
    beyond = 1.0 - np.arange(len(known)) / max(len(known), 1)
    axis.step(known, beyond, where="pre", label=label, color=colour, linestyle=style)


def _faults(by_fault: dict[str, Row], path: Path) -> None:
    """One bar per fault: how often it was named, and what else became of it."""
    names = list(by_fault)
    size = (9, 1.2 + 0.32 * max(len(names), 1))
    figure, axis = pictures.pyplot().subplots(figsize=size, layout="constrained")
    left = np.zeros(len(names))
    for outcome in OUTCOMES:
        width = np.array([by_fault[name][outcome] for name in names], dtype=float)
        axis.barh(names, width, left=left, label=outcome, color=COLOURS[outcome])
        left += width
    axis.invert_yaxis()
    axis.set_xlabel("faults")
    axis.legend(frameon=False, ncols=len(OUTCOMES), loc="lower center", bbox_to_anchor=(0.5, 1.0))
    pictures.save(figure, path)
