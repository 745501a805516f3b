"""One flight scored: every estimator over the whole of it and over its parts."""

import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from h2nav.errors import BadInput
from h2nav.evaluation.flights.events import (
    Event,
    Phase,
    events_path,
    phases_of,
    read_events,
)
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardFlight
from h2nav.evaluation.flights.tracks import Mask, Track, figures, track_of, tracks_of_autopilot
from h2nav.evaluation.flights.truth import truth_of
from h2nav.evaluation.rows import Array
from h2nav.recordings.trials import RECORDING_SUFFIXES

SETTLED_S = 60.0
MOST = 0.98  # of the estimates; where fewer have a truth, that is told
SPANS = ("whole", "settled", "airborne")
Document = dict[str, Any]


class Task(NamedTuple):
    """One flight; complete, so that another process can do it.

    Attributes:
        path: the recording.
        name: of the flight.
        play: plays the recording through the service.
        phases: the autopilot's time, instead of those in the file of events; None = those.
        plots: folder for a picture; None = no picture.
    """

    path: Path
    name: str
    play: Callable[[Path], HeardFlight]
    phases: tuple[Phase, ...] | None = None
    plots: Path | None = None


class Score(NamedTuple):
    """What came of a task.

    Attributes:
        name: of the flight.
        document: its figures; empty when it was left out.
        remark: why it was left out.
    """

    name: str
    document: Document
    remark: str = ""


class Flight(NamedTuple):
    """A flight with everything that its figures and its picture are made from.

    Attributes:
        name: of the flight.
        truth: where the truth comes from.
        duration_s: of the recording.
        tracks: estimator -> errors, ours first.
        airborne: stretches of time in the air, s since the recording's start; None = unknown.
        phases: s since the recording's start.
        events: s since the recording's start.
        runs: our estimators -> what the service said.
        start_us: of the recording, on the clock of the runs.
        notes: what a reader of the figures has to know.
    """

    name: str
    truth: str
    duration_s: float
    tracks: dict[str, Track]
    airborne: tuple[tuple[float, float], ...] | None
    phases: tuple[Phase, ...]
    events: tuple[Event, ...]
    runs: dict[str, FromService]
    start_us: int
    notes: tuple[str, ...]


def flight_paths(place: Path) -> list[Path]:
    """The recordings of a folder, or the one that is given.

    Raises:
        BadInput: there is none.
    """
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


def score_flight(task: Task) -> Score:
    """Plays and scores one flight; what a worker process does."""
    try:
        flight = flight_of(task)
    except BadInput as error:
        return Score(task.name, {}, " ".join(error.lines))
    if task.plots is not None:
        from h2nav.evaluation.flights.pictures import draw

        draw(flight, task.plots / f"{task.name}.png")
    return Score(task.name, document(flight))


def flight_of(task: Task) -> Flight:
    """Plays one flight.

    Raises:
        BadInput: it cannot be played, or has no truth, or our service made no estimates of it.
    """
    heard = task.play(task.path)
    autopilot = heard.autopilot
    truth, notes = truth_of(task.path, autopilot)
    estimates = {name: run.estimates() for name, run in heard.runs.items()}
    ours = {name: track_of(truth, autopilot, said) for name, said in estimates.items()}
    tracks = {name: track for name, track in ours.items() if len(track.t_s)}
    if not tracks:
        raise BadInput(
            f"{task.path}: no estimate of ours at a time of the truth; expected IMU samples of an "
            f"autopilot that sends heartbeats, and {truth.name} on the same clock"
        )
    for name, track in tracks.items():
        share = len(track.t_s) / len(estimates[name].q_nb)
        if share < MOST:
            notes.append(f"{name}: {1.0 - share:.0%} of the estimates have no truth near them")
    tracks |= tracks_of_autopilot(truth, autopilot)
    events, phases, more = _told_beside(task, autopilot)
    return Flight(
        name=task.name,
        truth=truth.name,
        duration_s=(autopilot.end_us - autopilot.start_us) * 1e-6,
        tracks=tracks,
        airborne=_airborne(autopilot),
        phases=phases,
        events=events,
        runs=heard.runs,
        start_us=autopilot.start_us,
        notes=(*notes, *more),
    )


def _airborne(heard: FromAutopilot) -> tuple[tuple[float, float], ...] | None:
    """Stretches of time; None where the vehicle does not say."""
    if not heard.airborne:
        return None
    times_us = [t_us for t_us, _ in heard.airborne] + [heard.end_us]
    return tuple(
        ((t_us - heard.start_us) * 1e-6, (until_us - heard.start_us) * 1e-6)
        for (t_us, is_airborne), until_us in zip(heard.airborne, times_us[1:], strict=True)
        if is_airborne
    )


def _told_beside(
    task: Task, heard: FromAutopilot
) -> tuple[tuple[Event, ...], tuple[Phase, ...], list[str]]:
    """Events and phases on the recording's clock, and what there is to say of them."""
    path = events_path(task.path)
    try:
        events = read_events(path) if path is not None else []
    except BadInput as error:
        return (), (), [f"{line}; the events are left out" for line in error.lines]
    phases = phases_of(events) if task.phases is None else list(task.phases)
    offset_us = heard.boot_offset_us()
    if offset_us is None:
        told = bool(events or phases)
        notes = ["no ATTITUDE relates the events' clock to the recording's"] if told else []
        return (), (), notes
    shift_s = (offset_us - heard.start_us) * 1e-6
    return (
        tuple(Event(event.boot_s + shift_s, event.text) for event in events),
        tuple(Phase(p.name, p.from_s + shift_s, p.to_s + shift_s) for p in phases),
        [],
    )


def document(flight: Flight) -> Document:
    """The figures of a flight, as they are printed as JSON."""
    parts: dict[str, Callable[[Track], Mask]] = {
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


def _of_all(tracks: Mapping[str, Track], mask: Callable[[Track], Mask]) -> dict[str, Document]:
    """Estimator -> figures over a part, for those that said something in it."""
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
    """Span -> estimator -> means over the flights that have it, and how many those are."""
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
