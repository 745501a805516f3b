"""The findings that only a whole flight shows, and what they were read from."""

from typing import NamedTuple

import numpy as np

from h2nav.flightlogs.context import GpsTrack, ImuTrack
from h2nav.integrity.findings import Finding
from h2nav.review.compass import look_at_compass
from h2nav.review.ending import look_at_ending
from h2nav.review.estimators import look_at_estimators
from h2nav.review.flight import Flight
from h2nav.review.inertial import Mask, best_attitude
from h2nav.review.receiver import look_at_receiver
from h2nav.review.sensor_bias import look_at_biases
from h2nav.review.spectra import look_at_spectra, look_at_vibration
from h2nav.review.timing import look_at_timing
from h2nav.review.tracks import (
    Bias,
    CompassFit,
    Field,
    Receiver,
    Spectrum,
    Timing,
    Vibration,
)


class Analysis(NamedTuple):
    """What `analyse` returns; the tracks are for pictures.

    Attributes:
        findings: of the whole flight only, in the order of their times. Those of the checks in
            flight stand in `Flight.findings`.
        spectra: gyro and accelerometer of each IMU.
        vibrations: one per IMU.
        fields: one per compass.
        compasses: one per compass that could be compared with the earth's field.
        biases: one per IMU.
        timings: one per IMU.
        receivers: one per receiver.
    """

    findings: tuple[Finding, ...] = ()
    spectra: tuple[Spectrum, ...] = ()
    vibrations: tuple[Vibration, ...] = ()
    fields: tuple[Field, ...] = ()
    compasses: tuple[CompassFit, ...] = ()
    biases: tuple[Bias, ...] = ()
    timings: tuple[Timing, ...] = ()
    receivers: tuple[Receiver, ...] = ()


def analyse(flight: Flight) -> Analysis:
    """Looks at a whole flight."""
    context = flight.context
    armed = context.armed
    best = best_attitude(flight)
    compasses = tuple(_in_order(track) for track in context.imus)
    tracks = tuple(t for t in map(_numbers, compasses) if len(t.t_s) > 1)
    found: list[Finding] = []
    timings, vibrations, fields, fits, receivers = [], [], [], [], []
    for track in tracks:
        timing, own = look_at_timing(track, armed)
        timings.append(timing)
        found += own
        vibration, own = look_at_vibration(track, armed, is_told=_is_told(flight, track))
        vibrations.append(vibration)
        found += own
    spectra, own = look_at_spectra(tracks, context.bursts, armed)
    found += own
    biases, own = look_at_biases(tracks, best, armed, flight.findings)
    found += own
    for track in compasses:
        is_raw = "PX4" in f"{flight.autopilot} {context.firmware}" and "SCALED" in track.source
        field, fit, own = look_at_compass(track, best, flight.earth, context, is_raw=is_raw)
        fields += [] if field is None else [field]
        fits += [] if fit is None else [fit]
        found += own
    first = _soundest(flight, tracks)
    for gps in context.gps:
        receiver, own = look_at_receiver(_fixes(gps), context, first, best)
        receivers.append(receiver)
        found += own
    found += look_at_estimators(context, first, best, flight.findings)
    found += look_at_ending(first, armed) if first is not None else []
    return Analysis(
        tuple(sorted(found, key=lambda finding: finding.from_s)),
        spectra,
        tuple(vibrations),
        tuple(fields),
        tuple(fits),
        biases,
        tuple(timings),
        tuple(receivers),
    )


def _is_told(flight: Flight, track: ImuTrack) -> bool:
    source = f"IMU {track.imu + 1}"
    return any(f.kind == "vibration" and f.source == source for f in flight.findings)


def _soundest(flight: Flight, tracks: tuple[ImuTrack, ...]) -> ImuTrack | None:
    """The IMU that the checks in flight found wrong for the shortest time."""

    def wrong_s(track: ImuTrack) -> float:
        source = f"IMU {track.imu + 1}"
        return sum(f.to_s - f.from_s for f in flight.findings if f.source == source)

    return min(tracks, key=wrong_s, default=None)


def _in_order(track: ImuTrack) -> ImuTrack:
    """Samples whose times increase."""
    return _part(track, np.diff(track.t_s, prepend=-np.inf) >= 0.0)


def _numbers(track: ImuTrack) -> ImuTrack:
    """Samples of a gyro and an accelerometer: all zero is what a compass without an IMU shows."""
    values = np.hstack((track.w_b, track.f_b))
    good = np.isfinite(values.sum(axis=1)) & (np.abs(track.f_b).sum(axis=1) > 0.0)
    return _part(track, good)


def _part(track: ImuTrack, rows: Mask) -> ImuTrack:
    if rows.all():
        return track
    return track._replace(
        t_s=track.t_s[rows],
        stamp_us=track.stamp_us[rows],
        w_b=track.w_b[rows],
        f_b=track.f_b[rows],
        m_b_ut=track.m_b_ut[rows],
    )


def _fixes(gps: GpsTrack) -> GpsTrack:
    """Fixes whose times increase."""
    rows = np.diff(gps.t_s, prepend=-np.inf) > 0.0
    return gps._replace(
        t_s=gps.t_s[rows],
        has_fix=gps.has_fix[rows],
        latitude_deg=gps.latitude_deg[rows],
        longitude_deg=gps.longitude_deg[rows],
        altitude_m=gps.altitude_m[rows],
        v_n=gps.v_n[rows],
        sigma_m_s=gps.sigma_m_s[rows],
        satellites=gps.satellites[rows],
    )
