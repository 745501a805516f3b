"""Changes of the receiver's velocity against those integrated from an IMU and the attitude.

The differences are linear in the errors: offset and scale of the accelerometer, attitude, delay of
the velocity, and position of the antenna.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.evidence import Evidence
from h2nav.calibration.regression import Array, part_of, together
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import GpsTrack, ImuTrack
from h2nav.reviews.inertial import (
    LONGEST_STEP_S,
    Attitudes,
    inertial_velocity,
    interpolated,
    rotate,
    slowed,
    thinned,
)
from h2nav.reviews.receiver import lag_of, moves_of
from h2nav.reviews.receiver_fit import Moves
from h2nav.reviews.sensor_bias import measuring
from h2nav.reviews.standstill import REST_WINDOW_S, rest_of

MOTION_WINDOW_S = 1.0
LONGEST = 3.0
MAX_ROWS = 1500
MIN_FIXES = 20
# The delay that autopilots assume, for a receiver whose delay no turn shows.
USUAL_LAG_S = 0.15
# In a fast turn an attitude delayed by 10 ms is wrong by 1 deg.
FASTEST_RAD_S = 120.0 * DEG
SURE_TILT_RAD = 4.0 * DEG
# Accelerations and rates at a fix are means around it.
AROUND_S = 0.1
# A vertical velocity is twice as noisy as a level one.
DOWN_SHARE = 0.5
# A fix is logged on arrival, within a loop of a busy autopilot; in telemetry it may be older by
# half of its period. The effect on the velocity is added to the noise of the receiver.
LOGGED_WITHIN_S, NOISE_M_S = 0.02, 0.1


class MotionRows(NamedTuple):
    """Windows between fixes, NED and m/s; the sensor's axes are those of its calibration."""

    flight: NDArray[np.int64]  # (N,) number of the flight
    t_s: Array  # (N,) increasing within each
    length_s: Array  # (N,) of the windows
    apart: Array  # (N, 3) measured change of velocity minus that of the IMU
    share: Array  # (N, 3) weight of each axis; 0 if not measured
    offset: Array  # (N, 3, 3) derivative by the offset; the sensor's axis is the last
    scale: Array  # (N, 3, 3) derivative by the scale, likewise
    force: Array  # (N, 3) change of velocity by the forces alone
    late: Array  # (N, 3) derivative by the delay: change of the acceleration, m/s^2
    arm: Array  # (N, 3, 3) derivative by the antenna's position along each axis of the body
    sigma_tilt: Array  # (N,) deviation of the attitude, rad
    sigma_heading: Array  # (N,)


class Motion(NamedTuple):
    """An IMU in a flight."""

    rows: MotionRows  # windows between fixes
    lag_s: float  # assumed delay of the velocities
    is_lag_shown: bool  # the flight shows it; otherwise it is the usual delay


def motion_of(
    evidence: Evidence, track: ImuTrack, gps: GpsTrack, axes: Array, flight: int
) -> Motion | None:
    """The windows of a flight with a known attitude and no fast turn.

    Args:
        axes: (3, 3) from the axes of its calibration to those of the track.
        flight: its number, for the rows.
    """
    track = measuring(track, evidence.flight.findings)
    moves = moves_of(gps)
    if len(track.t_s) < MIN_FIXES or len(moves.t_s) < MIN_FIXES:
        return None
    track = slowed(track)
    attitude = evidence.attitude_of_tracks()
    q = attitude.at(track.t_s)
    found_s = lag_of(moves, inertial_velocity(track, q))
    lag_s = USUAL_LAG_S if math.isnan(found_s) else found_s
    windows = _windows(evidence, track, moves, lag_s)
    if not len(windows.first_s):
        return None
    rows = _rows(_Sums.of(track, q, axes), attitude, windows)
    good = (rows.length_s < LONGEST * MOTION_WINDOW_S) & (rows.sigma_tilt < SURE_TILT_RAD)
    for column in rows[3:]:
        good &= np.isfinite(column.reshape(len(good), -1).sum(axis=1))
    order = np.flatnonzero(good)
    order = order[np.argsort(rows.t_s[order], kind="stable")]
    order = order[thinned(len(order), MAX_ROWS)]
    kept = part_of(rows, order)
    return Motion(kept._replace(flight=np.full(len(order), flight)), lag_s, not math.isnan(found_s))


def combined(motions: Sequence[Motion]) -> Motion:
    """Joins several flights, with one assumed delay of the velocities."""
    shown = [one.lag_s for one in motions if one.is_lag_shown]
    lag_s = float(np.median(shown)) if shown else USUAL_LAG_S
    rows = [
        one.rows._replace(apart=one.rows.apart + (lag_s - one.lag_s) * one.rows.late)
        for one in motions
    ]
    return Motion(together(rows), lag_s, bool(shown))


class _Windows(NamedTuple):
    """Windows with a measured change of velocity."""

    first_s: Array  # (M,) beginnings
    last_s: Array  # (M,) ends
    measured: Array  # (M, 3) the change, NED, m/s
    share: Array  # (M, 3) weights of the axes
    jitter_s: Array  # (M,) uncertainty of the times


def _windows(evidence: Evidence, track: ImuTrack, moves: Moves, lag_s: float) -> _Windows:
    """Windows between fixes in flight; at rest the vertical only: the tilt is of the force."""
    flies = evidence.flying(moves.t_s)
    t_s, v_n = moves.t_s[flies], moves.v_n[flies]
    place = _spaced(t_s)
    edges = t_s[place] - lag_s
    rest_s = rest_of(track, evidence.context).t_s
    counts = max(len(edges) - 1, 0), len(rest_s)
    jitter_s = LOGGED_WITHIN_S if evidence.is_log else 0.5 * float(np.median(np.diff(moves.t_s)))
    level = np.where(moves.axes, (1.0, 1.0, DOWN_SHARE), 0.0)
    return _Windows(
        np.concatenate((edges[:-1], rest_s)),
        np.concatenate((edges[1:], rest_s + REST_WINDOW_S)),
        np.vstack((np.diff(v_n[place], axis=0), np.zeros((len(rest_s), 3)))),
        np.repeat(np.array((level, (0.0, 0.0, 1.0))), counts, axis=0),
        np.repeat((jitter_s, 0.0), counts),
    )


def _spaced(t_s: Array) -> NDArray[np.intp]:
    """Indices of times at least a window apart."""
    found: list[int] = []
    place = 0
    while place < len(t_s):
        found.append(place)
        place = max(place + 1, int(np.searchsorted(t_s, t_s[place] + MOTION_WINDOW_S - 1e-3)))
    return np.array(found, dtype=np.intp)


class _Sums(NamedTuple):
    """Integrals over the windows, and values at their ends."""

    t_s: Array  # (N,) of the samples
    # (N, 22) of the force, of the sensor's axes, of its forces along them, NED; and the
    # unknown time, s
    integrals: Array
    # (N, 13) acceleration, velocities of the points 1 m along the body's axes, NED, and the
    # angular rate
    moving: Array

    @classmethod
    def of(cls, track: ImuTrack, q_nb: Array, axes: Array) -> "_Sums":
        """Integrates samples with their attitudes."""
        count = len(track.t_s)
        is_known = ~np.isnan(q_nb.sum(axis=1))
        q = np.where(is_known[:, None], q_nb, 0.0)
        turned = [rotate(q, np.tile(axis, (count, 1))) for axis in axes.T]
        along = track.f_b @ axes
        force = rotate(q, track.f_b)
        gap = np.diff(track.t_s, prepend=track.t_s[:1])
        dt = np.clip(gap, 0.0, LONGEST_STEP_S)
        forces = [axis * own[:, None] for axis, own in zip(turned, along.T, strict=True)]
        values = np.hstack((force, *turned, *forces))
        values[1:] = 0.5 * (values[1:] + values[:-1])
        unknown_s = np.cumsum(np.where(is_known, gap - dt, gap))
        arms = [rotate(q, np.cross(track.w_b, axis)) for axis in np.eye(3)]
        rate = np.linalg.norm(track.w_b, axis=1, keepdims=True)
        moving = np.hstack((force, *arms, rate))
        moving[~is_known] = np.nan
        return cls(
            track.t_s, np.column_stack((np.cumsum(values * dt[:, None], axis=0), unknown_s)), moving
        )

    def around(self, t_s: Array) -> Array:
        """(M, 13) means around times."""
        found = np.full((len(t_s), self.moving.shape[1]), np.nan)
        firsts = np.searchsorted(self.t_s, t_s - AROUND_S)
        afters = np.searchsorted(self.t_s, t_s + AROUND_S)
        for place, (first, after) in enumerate(zip(firsts, afters, strict=True)):
            if after > first:
                found[place] = self.moving[first:after].mean(axis=0)
        return found


def _rows(sums: _Sums, attitude: Attitudes, windows: _Windows) -> MotionRows:
    """Rows of any windows; NaN if unknown."""
    first_s, last_s, measured, share, jitter_s = windows
    change = interpolated(last_s, sums.t_s, sums.integrals)
    change -= interpolated(first_s, sums.t_s, sums.integrals)
    change[~(change[:, -1] < 0.5 * LONGEST_STEP_S)] = np.nan
    ends = np.stack((sums.around(first_s), sums.around(last_s)))
    moved = ends[1] - ends[0]
    moved[ends[:, :, 12].max(axis=0) > FASTEST_RAD_S] = np.nan
    gravity = np.array((0.0, 0.0, GRAVITY_M_S2))
    pulled = ((ends[:, :, :3] + gravity) ** 2).sum(axis=(0, 2))
    length_s, middle_s = last_s - first_s, 0.5 * (first_s + last_s)
    force = change[:, :3]
    columns = (change[:, 3:12], change[:, 12:21], moved[:, 3:12])
    offset, scale, arm = (each.reshape(-1, 3, 3).transpose(0, 2, 1) for each in columns)
    return MotionRows(
        np.zeros(len(first_s), dtype=np.int64),
        middle_s,
        length_s,
        measured - force - length_s[:, None] * gravity,
        share / np.sqrt(1.0 + pulled * (jitter_s / NOISE_M_S) ** 2)[:, None],
        offset,
        scale,
        force,
        moved[:, :3],
        arm,
        attitude.near(attitude.sigma_tilt_rad, middle_s),
        attitude.near(attitude.sigma_heading_rad, middle_s),
    )
