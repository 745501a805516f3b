"""A picture per flight of `h2nav evaluate flights --plots`: errors of all estimators over time."""

import re
from pathlib import Path
from typing import Any

import numpy as np

from h2nav.calibration import pictures
from h2nav.evaluation.flights.events import PHASE, Event
from h2nav.evaluation.flights.flight import PlayedFlight
from h2nav.evaluation.flights.tracks import ErrorTrack
from h2nav.maths.attitude_errors import BEYOND
from h2nav.maths.rows import Array

# Errors are shown as the rms over this time: single samples would fill the picture.
BIN_S = 0.5
SMALLEST_DEG = 0.01
COLOURS = {"h2nav": "C0", "h2nav_no_gps": "C2", "ekf": "C1", "ahrs2": "0.55"}
OURS = "h2nav"
# The autopilot's texts at boot would hide the others.
QUIET = ("COUNTS", PHASE, "READY", "TAKEOFF", "AT ")
INFORMATIVE_TEXT = " sev6 "
TEXT = re.compile(r"TEXT \(\d+, \d+\) sev\d ")
LABEL_LETTERS = 44
LABEL_LINES = 6
PHASE_LINES = 3
PHASE_LETTERS_ACROSS = 150.0
LETTERS_ACROSS = 190.0  # of a label, over the width of the picture


def draw(flight: PlayedFlight, path: Path) -> None:
    """Writes the picture of a flight."""
    figure, axes = pictures.pyplot().subplots(
        4,
        1,
        sharex=True,
        figsize=(13, 10),
        layout="constrained",
        gridspec_kw={"height_ratios": (3, 3, 3, 1.5)},
    )
    edges = np.arange(0.0, flight.duration_s + 2.0 * BIN_S, BIN_S)
    for axis, name in zip(axes, ("total", "tilt", "heading"), strict=False):
        for estimator, track in flight.tracks.items():
            values = _binned(track.t_s, getattr(track, name), edges)
            is_ours = estimator == OURS
            axis.plot(
                edges[:-1] + 0.5 * BIN_S,
                np.maximum(values, SMALLEST_DEG),
                label=estimator,
                color=COLOURS[estimator],
                linewidth=1.4 if is_ours else 0.9,
                zorder=3 if is_ours else 2,
            )
        if OURS in flight.tracks:
            _band(axis, flight.tracks[OURS], name, edges)
        axis.set_yscale("log")
        axis.set_ylim(bottom=SMALLEST_DEG)
        axis.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axis.set_ylabel(f"{name} error, deg")
        axis.grid(alpha=0.3)
    _shade(axes, flight)
    _label(axes, flight)
    axes[0].set_xlim(0.0, flight.duration_s)
    handles, labels = axes[1].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels), frameon=False)
    figure.suptitle(f"{flight.name}: rms of every {BIN_S:g} s against {flight.truth}")
    axes[-1].set_xlabel("time since the start of the recording, s")
    figure.align_ylabels()
    pictures.save(figure, path)


def _binned(t_s: Array, values: Array, edges: Array) -> Array:
    """Root mean square in each bin; NaN where there is nothing."""
    is_known = np.isfinite(values)
    counts, _ = np.histogram(t_s[is_known], edges)
    sums, _ = np.histogram(t_s[is_known], edges, weights=values[is_known] ** 2)
    found: Array = np.sqrt(
        np.divide(sums, counts, out=np.full(len(sums), np.nan), where=counts > 0)
    )
    return found


def _band(axis: Any, track: ErrorTrack, name: str, edges: Array) -> None:
    sigma = {"tilt": track.sigma_tilt, "heading": track.sigma_heading}.get(name)
    if sigma is None:
        return
    limit = BEYOND * _binned(track.t_s, sigma, edges)
    axis.fill_between(
        edges[:-1] + 0.5 * BIN_S,
        SMALLEST_DEG,
        np.maximum(limit, SMALLEST_DEG),
        color=COLOURS[OURS],
        alpha=0.13,
        linewidth=0.0,
        label=f"{OURS}, {BEYOND:g} sigma",
        zorder=1,
    )


def _shade(axes: Any, flight: PlayedFlight) -> None:
    """Every second phase in grey, with its name on top."""
    free_s = [0.0] * PHASE_LINES
    for number, phase in enumerate(flight.phases):
        to_s = min(phase.to_s, flight.duration_s)
        if phase.from_s >= flight.duration_s or to_s <= 0.0:
            continue
        if number % 2 == 0:
            for axis in axes[:-1]:
                axis.axvspan(phase.from_s, to_s, color="0.5", alpha=0.1, linewidth=0.0, zorder=0)
        from_s = max(phase.from_s, 0.0)
        line = _free_line(free_s, from_s)
        if line is None:
            continue
        free_s[line] = from_s + len(phase.name) * flight.duration_s / PHASE_LETTERS_ACROSS
        axes[0].annotate(
            phase.name,
            (from_s, 1.0),
            xycoords=axes[0].get_xaxis_transform(),
            xytext=(2, 2 + 11 * line),
            textcoords="offset points",
            fontsize="small",
        )


def _label(axes: Any, flight: PlayedFlight) -> None:
    """Draws events and our notices under the errors, without overlap."""
    shown = [(event, "0.25") for event in flight.events if _is_shown(event)]
    shown += [
        (Event((t_us - flight.start_us) * 1e-6, f"{OURS}: {text}"), COLOURS[OURS])
        for t_us, _, text in flight.runs[OURS].notices
    ]
    strip = axes[-1]
    strip.set_ylim(LABEL_LINES, 0)
    strip.set_yticks([])
    for side in ("left", "right", "top"):
        strip.spines[side].set_visible(False)
    strip.set_ylabel("events")
    free_s = [0.0] * LABEL_LINES  # of each line
    letter_s = flight.duration_s / LETTERS_ACROSS
    for event, colour in sorted(shown, key=lambda pair: pair[0].boot_s):
        for axis in axes[:-1]:
            axis.axvline(event.boot_s, color=colour, linewidth=0.6, alpha=0.35, zorder=0)
        line = _free_line(free_s, event.boot_s)
        if line is None:
            continue
        text = TEXT.sub("", event.text)[:LABEL_LETTERS]
        end_s = event.boot_s + letter_s * (len(text) + 2)
        ends_inside = end_s <= flight.duration_s
        free_s[line] = end_s
        strip.text(
            event.boot_s,
            line + 0.5,
            f"|{text}" if ends_inside else f"{text}|",
            ha="left" if ends_inside else "right",
            va="center",
            fontsize=7,
            color=colour,
        )


def _free_line(free_s: list[float], from_s: float) -> int | None:
    """The first line with room from a time on; None if all are taken."""
    return next((line for line, free in enumerate(free_s) if free <= from_s), None)


def _is_shown(event: Event) -> bool:
    return not event.text.startswith(QUIET) and INFORMATIVE_TEXT not in event.text
