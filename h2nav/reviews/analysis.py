"""Findings that only a whole flight shows, with the data they were derived from."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind
from h2nav.maths.rows import select_rows
from h2nav.recordings.context import Context, GpsTrack, ImuTrack, Span
from h2nav.recordings.spans import without
from h2nav.reviews.compass import look_at_compass
from h2nav.reviews.control import look_at_control
from h2nav.reviews.dead_compass import dead_compasses, look_at_dead
from h2nav.reviews.estimators import look_at_estimators, look_at_texts, misjudged
from h2nav.reviews.flight import Flight
from h2nav.reviews.force_steps import REACH_S, look_at_force_steps
from h2nav.reviews.gyro_scale import look_at_gyro_scale
from h2nav.reviews.impacts import Impact, binned, impacts, look_at_crash_checks, look_at_impacts
from h2nav.reviews.inertial import Attitudes, Mask, best_attitude, slowed
from h2nav.reviews.motors import look_at_motors
from h2nav.reviews.receiver import look_at_receiver, moves_of
from h2nav.reviews.receiver_fit import fits
from h2nav.reviews.sensor_bias import look_at_biases, measuring
from h2nav.reviews.shaking import look_at_shaking
from h2nav.reviews.spectra import look_at_spectra, look_at_vibration
from h2nav.reviews.standstill import NEVER, Rest, bias_at_rest, look_at_rest, rest_of
from h2nav.reviews.supply import look_at_supply
from h2nav.reviews.timing import look_at_pauses, look_at_slow_log, look_at_timing, pauses
from h2nav.reviews.tracks import (
    Bias,
    CompassFit,
    FieldTrack,
    Receiver,
    Spectrum,
    TimingTrack,
    Vibrations,
)

# Recordings of streams, whose messages arrive at rhythms of their own.
TELEMETRY = ("tlog", "mcap")
# Raw bytes have no recorded times of arrival; only the stamps inside them are real.
WITHOUT_TIMES = "bytes"
# Attitudes are not judged while the vehicle turns over on its way to the ground.
BEFORE_IMPACT_S = 2.0
AT_REST = {
    Kind.GYRO_BIAS: (Kind.GYRO_BIAS, Kind.GYRO_BIAS_STEP),
    Kind.ACCELEROMETER_SCALE: (Kind.ACCELEROMETER_BIAS,),
    Kind.ACCELEROMETER_BIAS: (Kind.ACCELEROMETER_BIAS,),
}


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
    # ids of findings in flight that blame autopilot or receiver where h2nav's own attitude is
    # wrong
    misjudged: frozenset[str] = frozenset()


def analyse(flight: Flight) -> Analysis:
    """Analyses a whole flight."""
    # A gap in a ground station's recording is a link problem.
    is_own_log = flight.kind not in (*TELEMETRY, WITHOUT_TIMES)
    paused = pauses(flight.context) if is_own_log else ()
    context = flight.context._replace(armed=without(flight.context.armed, paused))
    compasses = tuple(_in_order(track) for track in context.imus)
    tracks = tuple(t for t in map(_numbers, compasses) if len(t.t_s) > 1)
    if flight.kind == WITHOUT_TIMES:
        return _of_samples(flight, tuple(_stamped(track) for track in tracks), (), ())
    dead = dead_compasses(context)
    numbers = {one.compass for one in dead}
    compasses = tuple(_without_field(t) if t.imu in numbers else t for t in compasses)
    analysis = _of_samples(flight, tracks, context.armed, paused)
    seldom = [one for t in tracks for one in look_at_slow_log(t, context) if is_own_log]
    slow_ones = {one.sensor for one in seldom}
    other = [
        one
        for one in analysis.findings
        if one.kind is not Kind.IMU_SLOW or one.sensor not in slow_ones
    ]
    analysis = analysis._replace(findings=(*other, *seldom))
    best = best_attitude(flight)
    slow = tuple(slowed(_without_field(t) if t.imu in numbers else t) for t in tracks)
    first = _soundest(flight, slow)
    rests = {track.imu: rest_of(track, context) for track in slow}
    blows, found = _of_vehicle(context, tracks, first)
    found += look_at_dead(dead)
    # After a crash, sensors and attitudes do not represent a flight.
    crashed = [Span(b.t_s - BEFORE_IMPACT_S, b.to_s, "crashed") for b in blows if b.is_crash]
    context = context._replace(armed=without(context.armed, crashed))
    biases, own = look_at_biases(slow, best, context.armed, flight.findings)
    at_rest = [one for track in slow for one in look_at_rest(rests[track.imu], track.imu)]
    # Evidence at rest needs no attitude, and is more reliable.
    known = {(kind, one.sensor) for one in at_rest for kind in AT_REST.get(one.kind, ())}
    found += [*at_rest, *(one for one in own if (one.kind, one.sensor) not in known)]
    fields, fits = [], []
    receivers: list[Receiver] = []
    for track in compasses:
        is_raw = "PX4" in f"{flight.autopilot} {context.firmware}" and "SCALED" in track.source
        field, fit, own = look_at_compass(track, best, flight.earth, context, is_raw=is_raw)
        fields += [] if field is None else [field]
        fits += [] if fit is None else [fit]
        found += own
    alive = tuple(t for t in (measuring(t, flight.findings) for t in slow) if len(t.t_s) > 1)
    for track in alive:
        found += look_at_gyro_scale(track, context.armed)
    is_polled = flight.kind in TELEMETRY
    rest = NEVER if first is None else rests[first.imu]
    for fixes in map(_fixes, context.gps):
        receiver, own = look_at_receiver(
            fixes, context, first, best, is_polled=is_polled, rest=rest
        )
        if best is not None and not receivers:
            moves = moves_of(fixes)
            steps = look_at_force_steps(alive, biases, moves, receiver.lag_s, best, context.armed)
            if len(alive) == 1:
                own, steps = _undecided(own, steps), []
            elif first is not None and any(first.imu + 1 in s.sensor.numbers for s in steps):
                # A wrong accelerometer must not judge a receiver.
                first = next(t for t in alive if t.imu != first.imu)
                receiver, own = look_at_receiver(fixes, context, first, best, is_polled=is_polled)
            found += steps
        receivers.append(receiver)
        found += own
    found += look_at_estimators(context, first, best, flight.findings, rest)
    wrong = [
        *misjudged(context, first, best, rest, flight.findings),
        *_acquitted(flight, context, first, best, rest),
    ]
    return analysis._replace(
        findings=tuple(sorted([*analysis.findings, *found], key=lambda f: f.from_s)),
        fields=tuple(fields),
        compasses=tuple(fits),
        biases=biases,
        receivers=tuple(receivers),
        impacts=tuple(blows),
        rests=rests,
        misjudged=frozenset(one.id for one in wrong),
    )


def _acquitted(
    flight: Flight,
    context: Context,
    track: ImuTrack | None,
    best: Attitudes | None,
    rest: Rest,
) -> list[Finding]:
    """Velocities flagged in flight that fit with another heading of ours."""
    flagged = [one for one in flight.findings if one.kind is Kind.GPS_VELOCITY]
    moves = [moves_of(_fixes(gps)) for gps in context.gps[:1]]
    if not flagged or track is None or best is None or not moves or len(moves[0].t_s) < 2:
        return []
    bias = bias_at_rest(rest)
    return [one for one in flagged if fits(one, moves[0], track, best, bias, 0.0)]


def _of_vehicle(
    context: Context, tracks: tuple[ImuTrack, ...], first: ImuTrack | None
) -> tuple[list[Impact], list[Finding]]:
    """Findings on the vehicle: by force and rate of the soundest IMU, outputs and demands."""
    found = [*look_at_supply(context), *look_at_texts(context)]
    track = next((one for one in tracks if first is not None and one.imu == first.imu), None)
    if track is None:
        return [], found
    blows = impacts(track, context)
    crashes = [blow for blow in blows if blow.is_crash]
    bins = binned(track, context)
    found += look_at_impacts(blows)
    found += look_at_crash_checks(bins, context, blows)
    found += look_at_motors(bins, context, crashes)
    found += look_at_control(bins, context, crashes)
    for one in tracks:
        found += look_at_shaking(one, bins, context, blows)
    return blows, found


def _without_field(track: ImuTrack) -> ImuTrack:
    return track._replace(m_b_ut=np.full_like(track.m_b_ut, np.nan))


def _undecided(found: list[Finding], steps: list[Finding]) -> list[Finding]:
    """The receiver's findings, with single accelerometer jumps as an alternative explanation.

    Such a jump is not reported by itself: without another IMU, it has too many other explanations.
    """
    explained = []
    for one in found:
        near = [
            f"; or the {step.text} {step.evidence}"
            for step in steps
            if one.from_s - REACH_S < step.to_s and step.from_s < one.to_s + REACH_S
        ]
        is_shown = one.kind is Kind.GPS_VELOCITY
        explained.append(one._replace(evidence=one.evidence + "".join(near)) if is_shown else one)
    return explained


def _of_samples(
    flight: Flight,
    tracks: tuple[ImuTrack, ...],
    armed: tuple[Span, ...],
    paused: tuple[Span, ...],
) -> Analysis:
    """Findings from the samples alone."""
    found: list[Finding] = []
    timings, vibrations = [], []
    found += look_at_pauses(paused)
    for track in tracks:
        timing, own = look_at_timing(track, armed, paused)
        timings.append(timing)
        found += own
        vibration, own = look_at_vibration(track, armed, is_reported=_is_reported(flight, track))
        vibrations.append(vibration)
        found += own
    spectra, own = look_at_spectra(tracks, flight.context.bursts, armed)
    return Analysis(
        (*found, *own),
        spectra=spectra,
        vibrations=tuple(vibrations),
        timings=tuple(timings),
    )


def _is_reported(flight: Flight, track: ImuTrack) -> bool:
    imu = Sensor(SensorKind.IMU, track.imu + 1)
    return any(f.kind is Kind.VIBRATION and f.sensor == imu for f in flight.findings)


def _soundest(flight: Flight, tracks: tuple[ImuTrack, ...]) -> ImuTrack | None:
    """The IMU with the shortest time of faults in flight."""

    def wrong_s(track: ImuTrack) -> float:
        imu = Sensor(SensorKind.IMU, track.imu + 1)
        return sum(f.to_s - f.from_s for f in flight.findings if f.sensor == imu)

    return min(tracks, key=wrong_s, default=None)


def _stamped(track: ImuTrack) -> ImuTrack:
    """Samples with their own stamps as times."""
    return _in_order(track._replace(t_s=(track.stamp_us - track.stamp_us[0]) * 1e-6))


def _in_order(track: ImuTrack) -> ImuTrack:
    """Samples with increasing times."""
    return _part(track, np.diff(track.t_s, prepend=-np.inf) >= 0.0)


def _numbers(track: ImuTrack) -> ImuTrack:
    """Samples of gyro and accelerometer: zeros throughout come from a compass without an IMU."""
    ones = np.ones(3)
    good = np.isfinite(track.w_b @ ones + track.f_b @ ones) & (np.abs(track.f_b) @ ones > 0.0)
    return _part(track, good)


def _part(track: ImuTrack, rows: Mask) -> ImuTrack:
    return track if rows.all() else select_rows(track, rows)


def _fixes(gps: GpsTrack) -> GpsTrack:
    """Fixes with increasing times."""
    return select_rows(gps, np.diff(gps.t_s, prepend=-np.inf) > 0.0)
