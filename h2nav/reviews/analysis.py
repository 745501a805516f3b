"""Findings that only a whole flight shows, with the data they were derived from."""

import math
from typing import NamedTuple

import numpy as np

from h2nav.airframes.features import FlightRow
from h2nav.airframes.trend import Departure
from h2nav.integrity.findings import Finding, Kind, Severity
from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, ImuTrack
from h2nav.reviews import evidence as parts
from h2nav.reviews.declared import FlightEvidence
from h2nav.reviews.flight import Flight
from h2nav.reviews.impacts import Impact
from h2nav.reviews.inertial import STEADY_HZ, means
from h2nav.reviews.receiver import delay_of
from h2nav.reviews.receiver_fit import fits
from h2nav.reviews.standstill import Rest, bias_at_rest
from h2nav.reviews.subjects import SUBJECTS, compass, past, receiver, timing, vibration
from h2nav.reviews.subjects.features import flight_row
from h2nav.reviews.tracks import (
    Bias,
    CompassFit,
    FieldTrack,
    Receiver,
    Spectrum,
    TimingTrack,
    Vibrations,
)

# Jumps of a sensor that the checks in flight decide by the attitude.
STEPS = (Kind.GYRO_BIAS_STEP, Kind.ACCELEROMETER_BIAS_STEP)
# Two sensors of a kind are compared over this time before a step and after it.
BESIDE_S, BESIDE_GAP_S, BESIDE_SHARE = 4.0, 0.5, 0.5
# A step is so many times the usual change of their difference.
BESIDE_USUAL = 4.0


class Analysis(NamedTuple):
    """The result of `analyse`; the tracks are for pictures."""

    # of the whole flight, in the order of their times; those of the checks in flight are in
    # `Flight.findings`
    findings: tuple[Finding, ...] = ()
    spectra: tuple[Spectrum, ...] = ()  # gyro and accelerometer of each IMU
    vibrations: tuple[Vibrations, ...] = ()  # one per IMU
    fields: tuple[FieldTrack, ...] = ()  # one per compass
    # one per compass that could be compared with the earth's field
    compasses: tuple[CompassFit, ...] = ()
    biases: tuple[Bias, ...] = ()  # one per IMU
    timings: tuple[TimingTrack, ...] = ()  # one per IMU
    receivers: tuple[Receiver, ...] = ()  # one per receiver
    impacts: tuple[Impact, ...] = ()  # crashes and hard landings, in order
    # windows at rest, by the number of the IMU, from 0
    rests: dict[int, Rest] = {}  # noqa: RUF012 - never changed
    # ids of findings in flight that blame autopilot, receiver or sensor where h2nav's own
    # attitude is wrong
    cleared: frozenset[str] = frozenset()
    # id of a finding in flight -> as the whole flight shows it
    judged: dict[str, Finding] = {}  # noqa: RUF012 - never changed
    # what is remembered of the flight, and what in it left the airframe's own past
    row: FlightRow = FlightRow("", "", math.nan, {})
    trends: tuple[Departure, ...] = ()
    ending: parts.Ending = parts.Ending(is_aloft=False, is_moving=False)  # as far as an IMU tells
    looked_at: tuple[str, ...] = ()  # subjects that had what they need
    # the others: name and reason
    blind: tuple[tuple[str, str], ...] = ()


def analyse(flight: Flight) -> Analysis:
    """Analyses a whole flight: each subject that has what it needs."""
    evidence = FlightEvidence(flight)
    lacks = {subject: subject.lacks(evidence) for subject in SUBJECTS}
    found = [one for subject in SUBJECTS if not lacks[subject] for one in subject.look(evidence)]
    told = [subject for subject in SUBJECTS if subject.is_told]
    analysis = Analysis(
        findings=tuple(sorted(found, key=lambda one: one.from_s)),
        spectra=evidence.of(vibration.spectra)[0],
        vibrations=evidence.of(vibration.levels)[0],
        timings=tuple(timing_ for timing_, _ in evidence.of(timing.timings)),
        row=evidence.of(flight_row),
        trends=evidence.of(past.trends),
        ending=evidence.of(parts.ending),
        looked_at=tuple(subject.name for subject in told if not lacks[subject]),
        blind=tuple((subject.name, lacks[subject]) for subject in told if lacks[subject]),
    )
    return _with_tracks(analysis, evidence) if evidence.of(parts.has_times) else analysis


def _with_tracks(analysis: Analysis, evidence: FlightEvidence) -> Analysis:
    """The analysis with what needs times of arrival."""
    looked = evidence.of(compass.compasses)
    shown = evidence.of(parts.attitudes_judged)
    return analysis._replace(
        fields=tuple(field for field, _, _ in looked if field is not None),
        compasses=tuple(fit for _, fit, _ in looked if fit is not None),
        biases=evidence.of(parts.biases)[0],
        receivers=tuple(shown for shown, _ in evidence.of(receiver.receivers)),
        impacts=evidence.of(parts.blows),
        rests=evidence.of(parts.rests),
        cleared=frozenset(
            (
                *(one.id for one in _cleared(evidence)),
                *(one.id for one in _of_our_own_error(evidence, shown)),
                *(one.id for one in _of_slow_samples(evidence)),
                *(one.id for one in shown if not one.backs_us),
            )
        ),
        judged={one.id: one for one in (*shown, *evidence.of(compass.judged))},
    )


def _of_our_own_error(evidence: FlightEvidence, shown: tuple[Finding, ...]) -> list[Finding]:
    """Velocities flagged in flight while velocity and the autopilot agreed against our attitude."""
    right = {one.id for one in shown if one.backs_us}
    flagged = evidence.flight.findings
    ours = [one for one in flagged if one.backs_us is False and one.id not in right]
    return [
        one
        for one in flagged
        if one.kind is Kind.GPS_VELOCITY or _is_guess(one)
        if any(one.from_s <= own.to_s and own.from_s <= one.to_s for own in ours)
    ]


def _of_slow_samples(evidence: FlightEvidence) -> list[Finding]:
    """Steps of a sensor, shown by an attitude that samples this seldom lead astray.

    Not those that another sensor of the kind shows, which needs no attitude.
    """
    if evidence.of(parts.rate_hz) >= STEADY_HZ:
        return []
    steps = (one for one in evidence.flight.findings if one.kind in STEPS)
    return [one for one in steps if not _is_beside(evidence, one)]


def _is_beside(evidence: FlightEvidence, one: Finding) -> bool:
    """Whether its mean left that of another IMU by most of what is said, in its first seconds."""
    tracks = {track.imu + 1: track for track in evidence.of(parts.sampled)}
    own = tracks.get(one.sensor.number or 0)
    if own is None or len(tracks) < 2:
        return False
    column, unit = ("w_b", DEG) if one.kind is Kind.GYRO_BIAS_STEP else ("f_b", 1.0)
    edges = one.from_s + np.array([-BESIDE_S, -BESIDE_GAP_S, BESIDE_GAP_S, BESIDE_S])
    whole = np.arange(own.t_s[0], own.t_s[-1], BESIDE_S - BESIDE_GAP_S)
    for other in (track for track in tracks.values() if track is not own):
        before, _, after = _apart(own, other, column, edges) / unit
        # Seldom samples of what shakes differ by more than sensors do.
        changes = np.linalg.norm(np.diff(_apart(own, other, column, whole) / unit, axis=0), axis=1)
        usual = float(np.nanmedian(changes)) if np.isfinite(changes).any() else np.inf
        if np.linalg.norm(after - before) > max(BESIDE_SHARE * one.size, BESIDE_USUAL * usual):
            return True
    return False


def _apart(own: ImuTrack, other: ImuTrack, column: str, edges_s: Array) -> Array:
    """(len(edges) - 1, 3) by how much the means of two IMUs differ."""
    first, second = (
        means(track.t_s, getattr(track, column).astype(float), edges_s) for track in (own, other)
    )
    return first - second


def _is_guess(one: Finding) -> bool:
    """Whether a spoofed receiver is ours to suspect, and not its own word."""
    return one.kind is Kind.GNSS_SPOOFED and one.severity > Severity.WARNING


def _cleared(evidence: FlightEvidence) -> list[Finding]:
    """Velocities flagged in flight that fit with another heading of ours."""
    track = evidence.of(parts.witness) or evidence.of(parts.soundest)
    best, moves = evidence.of(parts.best), evidence.of(parts.moves)
    if track is None or best is None or moves is None or len(moves.t_s) < 2:
        return []
    flagged = [one for one in evidence.flight.findings if one.kind is Kind.GPS_VELOCITY]
    bias = bias_at_rest(parts.at_rest(evidence, track))
    lag_s = np.nan_to_num(delay_of(moves, track, best)) if flagged else 0.0
    return [one for one in flagged if fits(one, moves, track, best, bias, float(lag_s))]
