"""The autopilot's estimators and the truth compared with our best attitude."""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.witness import BEYOND, QUALITIES, AttitudeSource
from h2nav.recordings.context import Array, AttitudeTrack
from h2nav.reviews.angles import tilt_and_heading
from h2nav.reviews.flight import Flight
from h2nav.reviews.inertial import Attitudes, best_attitude


class Difference(NamedTuple):
    """Another attitude minus ours."""

    name: str  # of the other attitude
    is_truth: bool  # from a simulator, so that the difference is our error
    t_s: Array  # (N,)
    tilt_rad: Array  # (N,) angle between the verticals; NaN where we have no estimate
    heading_rad: Array  # (N,) the other heading minus ours, -pi to pi
    tilt_limit_rad: Array  # (N,) three deviations of both together; NaN if ours is unknown
    heading_limit_rad: Array  # (N,) the same


def differences(flight: Flight) -> tuple[Difference, ...]:
    """Differences of every estimator of the autopilot, the truth last; none without an estimate."""
    ours = best_attitude(flight)
    if ours is None or len(ours.t_s) < 2:
        return ()
    found = [_against(ours, track, is_truth=False) for track in flight.context.attitudes]
    if flight.context.truth is not None:
        found.append(_against(ours, flight.context.truth, is_truth=True))
    return tuple(found)


def _against(ours: Attitudes, track: AttitudeTrack, *, is_truth: bool) -> Difference:
    tilt, heading = tilt_and_heading(ours.at(track.t_s), track.q_nb)
    healthy = QUALITIES[AttitudeSource.AUTOPILOT]
    own = (0.0, 0.0) if is_truth else (healthy.tilt_rad, healthy.heading_rad)
    limits = [
        BEYOND * np.hypot(ours.near(np.where(np.isinf(sigma), np.nan, sigma), track.t_s), of_other)
        for sigma, of_other in zip((ours.sigma_tilt_rad, ours.sigma_heading_rad), own, strict=True)
    ]
    return Difference(track.name, is_truth, track.t_s, tilt, heading, limits[0], limits[1])
