"""The autopilot's estimators, and a truth, against our best attitude over the flight."""

from typing import NamedTuple

import numpy as np

from h2nav.flightlogs.context import Array, AttitudeTrack
from h2nav.integrity.witness import BEYOND, QUALITIES, Source
from h2nav.review.angles import at_times, tilt_and_heading
from h2nav.review.flight import Estimates, Flight

# Ours are not interpolated over longer gaps.
LONGEST_GAP_S = 0.2


class Difference(NamedTuple):
    """One attitude less ours.

    Attributes:
        name: whose it is.
        is_truth: a simulator's, so that what differs is our error.
        t_s: (N,).
        tilt_rad: (N,) angle between the verticals; NaN where we have no estimate.
        heading_rad: (N,) the other heading less ours, -pi to pi.
        tilt_limit_rad: (N,) three deviations of both together; NaN where ours has none.
        heading_limit_rad: (N,) the same.
    """

    name: str
    is_truth: bool
    t_s: Array
    tilt_rad: Array
    heading_rad: Array
    tilt_limit_rad: Array
    heading_limit_rad: Array


def reference(flight: Flight) -> Estimates | None:
    """What others are compared with: the smoothed attitude where there is one; it knows more."""
    return flight.estimates if flight.smoothed is None else flight.smoothed


def differences(flight: Flight) -> tuple[Difference, ...]:
    """Of every estimator of the autopilot, and of the truth last; none without an estimate."""
    ours = reference(flight)
    if ours is None or len(ours.t_s) < 2:
        return ()
    tracks = list(flight.context.attitudes)
    found = [_against(ours, track, is_truth=False) for track in tracks]
    if flight.context.truth is not None:
        found.append(_against(ours, flight.context.truth, is_truth=True))
    return tuple(found)


def _against(ours: Estimates, track: AttitudeTrack, *, is_truth: bool) -> Difference:
    q_nb = at_times(ours.t_s, ours.q_nb, track.t_s, LONGEST_GAP_S)
    tilt, heading = tilt_and_heading(q_nb, track.q_nb)
    healthy = QUALITIES[Source.AUTOPILOT]
    own = (0.0, 0.0) if is_truth else (healthy.tilt_rad, healthy.heading_rad)
    limits = [
        BEYOND * np.hypot(np.interp(track.t_s, ours.t_s, sigma), of_other)
        for sigma, of_other in zip((ours.sigma_tilt_rad, ours.sigma_heading_rad), own, strict=True)
    ]
    return Difference(track.name, is_truth, track.t_s, tilt, heading, limits[0], limits[1])
