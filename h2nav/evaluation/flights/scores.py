"""Scores one flight: every estimator over the whole flight and its parts."""

import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from h2nav.errors import BadInput
from h2nav.evaluation.flights.flight import FlightTask, PlayedFlight, flight_of
from h2nav.evaluation.flights.tracks import ErrorTrack, Mask, figures
from h2nav.maths.rows import Array
from h2nav.recordings.trials import RECORDING_SUFFIXES

SETTLED_S = 60.0
SPANS = ("whole", "settled", "airborne")
Document = dict[str, Any]


class FlightScore(NamedTuple):
    """The result of a task."""

    name: str  # of the flight
    document: Document  # its figures; empty when it was left out
    remark: str = ""  # why it was left out


def flight_paths(place: Path) -> list[Path]:
    """The recordings of a folder, or the given one; raises BadInput if there is none."""
    if place.is_file():
        return [place]
    if not place.is_dir():
        raise BadInput(f"{place}: no such file or folder")
    found = (path for path in place.iterdir() if path.suffix in RECORDING_SUFFIXES)
    paths = sorted(path for path in found if path.is_file())
    if not paths:
        raise BadInput(
            f"{place}: no recordings in this folder; expected {', '.join(RECORDING_SUFFIXES)} files"
        )
    return paths


def score_flight(task: FlightTask) -> FlightScore:
    """Plays and scores one flight, in a worker process."""
    try:
        flight = flight_of(task)
    except BadInput as error:
        return FlightScore(task.name, {}, " ".join(error.lines))
    if task.plots is not None:
        from h2nav.evaluation.flights.pictures import draw

        draw(flight, task.plots / f"{task.name}.png")
    return FlightScore(task.name, document(flight))


def document(flight: PlayedFlight) -> Document:
    """The figures of a flight, as JSON."""
    parts: dict[str, Callable[[ErrorTrack], Mask]] = {
        "whole": lambda track: np.ones(len(track.t_s), dtype=bool),
        "settled": lambda track: track.t_s >= SETTLED_S,
        "airborne": lambda track: _inside(track.t_s, flight.airborne or ()),
    }
    spans = {span: _of_all(flight.tracks, mask) for span, mask in parts.items()}
    names = dict.fromkeys(phase.name for phase in flight.phases)
    phases = {
        name: _of_all(
            flight.tracks,
            lambda track, name=name: _inside(  # type: ignore[misc]
                track.t_s, [(p.from_s, p.to_s) for p in flight.phases if p.name == name]
            ),
        )
        for name in names
    }
    return {
        **spans,
        "phases": phases,
        "best": {span: _best(spans[span]) for span in SPANS if spans[span]},
        "states": {
            name: {state: round(lasted_s, 3) for state, lasted_s in run.state_s.items()}
            for name, run in flight.runs.items()
        },
        "notices": {
            name: [
                {
                    "t_s": round((t_us - flight.start_us) * 1e-6, 3),
                    "severity": severity.word,
                    "text": text,
                }
                for t_us, severity, text in run.notices
            ]
            for name, run in flight.runs.items()
        },
        "truth": flight.truth,
        "duration_s": round(flight.duration_s, 3),
        "notes": list(flight.notes),
    }


def _of_all(
    tracks: Mapping[str, ErrorTrack], mask: Callable[[ErrorTrack], Mask]
) -> dict[str, Document]:
    """Estimator -> figures over a part, for those with estimates in it."""
    found = {name: figures(track, mask(track)) for name, track in tracks.items()}
    return {name: values for name, values in found.items() if values is not None}


def _inside(t_s: Array, stretches: Sequence[tuple[float, float]]) -> Mask:
    inside = np.zeros(len(t_s), dtype=bool)
    for from_s, to_s in stretches:
        inside |= (from_s <= t_s) & (t_s < to_s)
    return inside


def _best(span: Mapping[str, Document]) -> str:
    return min(span, key=lambda name: float(span[name]["total"]))


def mean(documents: Sequence[Document]) -> dict[str, dict[str, Document]]:
    """Span -> estimator -> means over the flights that have it, and their number."""
    result: dict[str, dict[str, Document]] = {}
    for span in SPANS:
        names = dict.fromkeys(name for flight in documents for name in flight[span])
        result[span] = {
            name: _mean([f[span][name] for f in documents if name in f[span]]) for name in names
        }
    return result


def _mean(rows: Sequence[Document]) -> Document:
    keys = [key for key in rows[0] if key != "estimates" and not key.startswith("worst_")]
    means: Document = {}
    for key in keys:
        values = [row[key] for row in rows if row.get(key) is not None]
        means[key] = statistics.fmean(values) if values else None
    return {**means, "flights": len(rows)}
