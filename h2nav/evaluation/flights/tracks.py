"""Errors of one estimator over a flight, and their figures over a part."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.evaluation.flights.heard import FromAutopilot, HeardEstimates
from h2nav.evaluation.flights.truth import EPOCH_US, Truth, pairs
from h2nav.maths.attitude_errors import errors, honesty, root_mean_square
from h2nav.maths.rows import Array, from_euler
from h2nav.recordings.reference import TimedAttitudes

Mask = NDArray[np.bool_]


class ErrorTrack(NamedTuple):
    """Errors of one estimator, all of the same length and in the order of time."""

    t_s: Array  # since the recording's start
    total: Array  # angle of the whole error rotation, deg
    heading: Array  # with sign, deg
    tilt: Array  # of the vertical, deg; `inclination` elsewhere
    sigma_tilt: Array | None = None  # predicted deviation, deg; None without
    sigma_heading: Array | None = None  # the same for the heading


def track_of(truth: Truth, heard: FromAutopilot, estimates: HeardEstimates) -> ErrorTrack:
    """The errors of an estimator against the truth."""
    rows, q_true = pairs(truth, heard, estimates)
    track = _track(estimates.q_nb[rows], q_true, _since_start_s(heard, estimates.arrived_us[rows]))
    deviations = (estimates.sigma_tilt_deg[rows], estimates.sigma_heading_deg[rows])
    known = [sigma if np.isfinite(sigma).any() else None for sigma in deviations]
    return track._replace(sigma_tilt=known[0], sigma_heading=known[1])


def tracks_of_autopilot(truth: Truth, heard: FromAutopilot) -> dict[str, ErrorTrack]:
    """Errors of the estimators on board, by name, as far as recorded."""
    tracks = {}
    if truth.ekf_nb is not None:
        tracks["ekf"] = _recorded_beside(truth, truth.ekf_nb, heard)
    elif heard.ekf.t_us:
        tracks["ekf"] = track_of(truth, heard, _estimates(heard.ekf, np.array(heard.ekf_boot_us)))
    if heard.ahrs2.t_us and truth.is_by_arrival:  # AHRS2 has no other time
        tracks["ahrs2"] = track_of(truth, heard, _estimates(heard.ahrs2, None))
    return {name: track for name, track in tracks.items() if len(track.t_s)}


def _estimates(attitudes: TimedAttitudes, boot_us: NDArray[np.int64] | None) -> HeardEstimates:
    arrived_us, angles = attitudes.arrays()
    unknown = np.full(len(arrived_us), np.nan)
    boot_us = np.zeros_like(arrived_us) if boot_us is None else boot_us
    return HeardEstimates(arrived_us, boot_us, from_euler(angles), unknown, unknown)


def _recorded_beside(truth: Truth, ekf_nb: Array, heard: FromAutopilot) -> ErrorTrack:
    """The autopilot's estimates in the rows of the truth, while the recording ran."""
    arrived_us, _ = heard.ekf.arrays()
    boot_us = np.array(heard.ekf_boot_us) + EPOCH_US * heard.epochs(arrived_us)
    if not len(boot_us):
        return _track(ekf_nb[:0], truth.q_nb[:0], np.empty(0))
    order = np.argsort(boot_us, kind="stable")
    offset_us = np.interp(truth.t_us, boot_us[order], (arrived_us - boot_us)[order])
    t_us = truth.t_us + offset_us.astype(np.int64)
    is_heard = (heard.start_us <= t_us) & (t_us <= heard.end_us)
    used = is_heard & np.isfinite(ekf_nb).all(axis=1)
    return _track(ekf_nb[used], truth.q_nb[used], _since_start_s(heard, t_us[used]))


def _track(q_est: Array, q_true: Array, t_s: Array) -> ErrorTrack:
    total, heading, tilt = errors(q_est, q_true, np.ones(len(t_s), dtype=bool), True)
    return ErrorTrack(t_s, total, heading, tilt)


def _since_start_s(heard: FromAutopilot, t_us: NDArray[np.int64]) -> Array:
    return (t_us - heard.start_us).astype(np.float64) * 1e-6


def figures(track: ErrorTrack, mask: Mask) -> dict[str, Any] | None:
    """RMS and worst errors, deg, over a part, and the consistency of the predicted deviations.

    Returns:
        None for an empty part. ``nees_*`` is the mean of (error / predicted deviation) squared: 1
        for a consistent prediction, more for an optimistic one; ``*_beyond_3_sigma`` is a share of
        the time.
    """
    if not mask.any():
        return None
    found: dict[str, Any] = {}
    columns = {"tilt": track.tilt[mask], "heading": track.heading[mask], "total": track.total[mask]}
    for name, column in columns.items():
        found[name] = root_mean_square(column)
    for name, column in columns.items():
        found[f"worst_{name}"] = float(np.abs(column).max())
    for name, sigma in (("tilt", track.sigma_tilt), ("heading", track.sigma_heading)):
        if sigma is not None:
            found |= honesty(name, columns[name], sigma[mask])
    found["estimates"] = int(mask.sum())
    return found
