"""One recorded flight: played through the service, with its truth and other estimates."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from h2nav.errors import BadInput
from h2nav.evaluation.flights.events import (
    Event,
    FlightPhase,
    events_path,
    phases_of,
    read_events,
)
from h2nav.evaluation.flights.heard import FromAutopilot, FromService, HeardFlight
from h2nav.evaluation.flights.tracks import ErrorTrack, track_of, tracks_of_autopilot
from h2nav.evaluation.flights.truth import truth_of

MIN_SHARE_WITH_TRUTH = 0.98  # of the estimates; where fewer have a truth, that is noted


class FlightTask(NamedTuple):
    """One flight; self-contained, for another process."""

    path: Path  # the recording
    name: str  # of the flight
    play: Callable[[Path], HeardFlight]  # plays the recording through the service
    # in the autopilot's time, instead of those in the file of events; None = those
    phases: tuple[FlightPhase, ...] | None = None
    plots: Path | None = None  # folder for a picture; None = no picture


class PlayedFlight(NamedTuple):
    """A flight with everything for its figures and its picture."""

    name: str  # of the flight
    truth: str  # its source
    duration_s: float  # of the recording
    tracks: dict[str, ErrorTrack]  # estimator -> errors, ours first
    # stretches of time in the air, s since the recording's start; None = unknown
    airborne: tuple[tuple[float, float], ...] | None
    phases: tuple[FlightPhase, ...]  # s since the recording's start
    events: tuple[Event, ...]  # s since the recording's start
    runs: dict[str, FromService]  # our estimators -> output of the service
    start_us: int  # of the recording, on the clock of the runs
    notes: tuple[str, ...]  # remarks for readers of the figures


def flight_of(task: FlightTask) -> PlayedFlight:
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
        if share < MIN_SHARE_WITH_TRUTH:
            notes.append(f"{name}: {1.0 - share:.0%} of the estimates have no truth near them")
    tracks |= tracks_of_autopilot(truth, autopilot)
    events, phases, more = _events_beside(task, autopilot)
    return PlayedFlight(
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
    """Periods in the air; None if the vehicle does not report them."""
    if not heard.airborne:
        return None
    times_us = [t_us for t_us, _ in heard.airborne] + [heard.end_us]
    return tuple(
        ((t_us - heard.start_us) * 1e-6, (until_us - heard.start_us) * 1e-6)
        for (t_us, is_airborne), until_us in zip(heard.airborne, times_us[1:], strict=True)
        if is_airborne
    )


def _events_beside(
    task: FlightTask, heard: FromAutopilot
) -> tuple[tuple[Event, ...], tuple[FlightPhase, ...], list[str]]:
    """Events and phases on the recording's clock, and remarks."""
    path = events_path(task.path)
    try:
        events = read_events(path) if path is not None else []
    except BadInput as error:
        return (), (), [f"{line}; the events are left out" for line in error.lines]
    phases = phases_of(events) if task.phases is None else list(task.phases)
    offset_us = heard.boot_offset_us()
    if offset_us is None:
        has_events = bool(events or phases)
        notes = ["no ATTITUDE relates the events' clock to the recording's"] if has_events else []
        return (), (), notes
    shift_s = (offset_us - heard.start_us) * 1e-6
    return (
        tuple(Event(event.boot_s + shift_s, event.text) for event in events),
        tuple(FlightPhase(p.name, p.from_s + shift_s, p.to_s + shift_s) for p in phases),
        [],
    )
