"""Fits a receiver's velocity to the IMU with free heading and tilt.

A filter may lose its heading unnoticed, and its attitude would then blame a sound receiver. Over
some seconds the gyro alone rotates the forces into one frame; the rotation from there to
north-east-down that fits their integral to the measured velocity is found in closed form (Kabsch).
The residual belongs to the receiver: noise, jumps, jamming.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Finding
from h2nav.maths.rows import product
from h2nav.maths.units import DEG, GRAVITY_M_S2
from h2nav.recordings.context import Array, ImuTrack
from h2nav.reviews.inertial import (
    Attitudes,
    Mask,
    conjugate,
    exponential,
    held_s,
    interpolated,
    rotate,
    unit,
)

# Half a window; a shorter one fits anything; in a longer one a gyro's bias turns the frame.
HALF_S = 5.0
MIN_FIT_FIXES, LONGEST_PAUSE_S = 8, 1.5
# Residual of a sound receiver: twice the usual one of the flight, which is no more than this, and a
# tenth of the reported error, which slow samples of a vibrating IMU cause.
TIMES, USUAL_M_S, MIN_RESIDUAL_M_S, SHARE = 2.0, 1.0, 0.3, 0.1
# A receiver led astray also fits, with a tilt that the vehicle does not have. Our tilt is more
# certain than this, except where our heading was unknown: velocities then pull the tilt.
TILT_RAD, OF_HEADING, MAX_HEADING_RAD = 5.0 * DEG, 0.25, 1.0
MAX_WINDOWS = 60


class Moves(NamedTuple):
    """Fixes with a velocity: (N,) times, (N, 3) velocity (0 for unknown down), (3,) known axes."""

    t_s: Array
    v_n: Array
    sigma_m_s: Array
    axes: Mask


class _Lined(NamedTuple):
    """The data of the fit, in a frame carried by the gyro alone."""

    t_s: Array  # (N,) of the fixes, minus their delay
    v_s: Array  # (N, 3) integral of the force
    v_n: Array  # (N, 3) measured velocity minus that of gravity
    up_s: Array  # (N, 3) our vertical
    tilt_rad: Array  # (N,) its possible error


def fits(
    one: Finding, moves: Moves, track: ImuTrack, best: Attitudes, bias_b: Array, lag_s: float
) -> bool:
    """Whether a flagged receiver fits throughout with another heading or a small tilt.

    Args:
        one: the finding that blames it.
        bias_b: of the gyro, as far as known, rad/s.
    """
    lined = _lined(moves, track, best, bias_b, lag_s)
    inside = (lined.t_s >= one.from_s - lag_s) & (lined.t_s <= one.to_s - lag_s)
    usual = _left(lined, _spread(np.ones(len(inside), dtype=bool)))
    flagged = _left(lined, _spread(inside))
    known, all_known = flagged[np.isfinite(flagged)], usual[np.isfinite(usual)]
    if len(known) <= np.count_nonzero(np.isinf(flagged)) or not len(all_known):
        return False
    limit = TIMES * min(float(np.median(all_known)), USUAL_M_S)
    share = SHARE * one.size if one.unit == "m/s" else 0.0
    return bool(known.max() < max(limit, MIN_RESIDUAL_M_S, share))


def _spread(wanted: Mask) -> NDArray[np.intp]:
    """Places of windows, up to a limit."""
    places = np.flatnonzero(wanted)
    if len(places) <= MAX_WINDOWS:
        return places
    return places[np.linspace(0, len(places) - 1, MAX_WINDOWS).astype(np.intp)]


def _lined(moves: Moves, track: ImuTrack, best: Attitudes, bias_b: Array, lag_s: float) -> _Lined:
    q_sb, t_s, v_s, v_n = gained(moves, track, bias_b, lag_s)
    place = np.searchsorted(track.t_s, t_s).clip(max=len(track.t_s) - 1)
    q_ns = product(best.at(track.t_s[place]), conjugate(q_sb[place]))
    up_s = rotate(conjugate(q_ns), np.tile([0.0, 0.0, -1.0], (len(t_s), 1)))
    good = np.isfinite(v_s.sum(axis=1))
    heading = np.minimum(best.near(best.sigma_heading_rad, t_s - HALF_S), MAX_HEADING_RAD)
    tilt = np.maximum(3.0 * best.near(best.sigma_tilt_rad, t_s), OF_HEADING * heading)
    return _Lined(t_s[good], v_s[good], v_n[good], up_s[good], np.maximum(tilt, TILT_RAD)[good])


def gained(
    moves: Moves, track: ImuTrack, bias_b: Array, lag_s: float
) -> tuple[Array, Array, Array, Array]:
    """What the force has gained, and what the receiver measured.

    Args:
        bias_b: of the gyro, as far as known, rad/s.
        lag_s: delay of the receiver.

    Returns:
        (N, 4) attitudes of the samples by the gyro alone, in the frame of the first one; of the M
        moves (M,) their times, (M, 3) the velocity that the force has gained, in that frame, and
        (M, 3) the measured one without gravity's, NED, m/s.
    """
    dt_s = held_s(track.t_s)
    q_sb = carried(track, bias_b, dt_s)
    force = rotate(q_sb, track.f_b)
    force[1:] = 0.5 * (force[1:] + force[:-1])
    t_s = moves.t_s - lag_s
    v_s = interpolated(t_s, track.t_s, np.cumsum(force * dt_s[:, None], axis=0))
    v_n = moves.v_n.copy()
    v_n[:, 2] -= GRAVITY_M_S2 * (t_s - t_s[:1])
    return q_sb, t_s, v_s, v_n


def carried(track: ImuTrack, bias_b: Array, dt_s: Array) -> Array:
    """(N, 4) attitudes by the gyro alone, from the first sample on."""
    q_sb = exponential((track.w_b - bias_b) * dt_s[:, None])
    reach = 1
    while reach < len(q_sb):  # products of two, of four, of eight...
        q_sb[reach:] = product(q_sb[:-reach].copy(), q_sb[reach:])
        reach *= 2
    return unit(q_sb)


def _left(lined: _Lined, places: NDArray[np.intp]) -> Array:
    """(M,) rms residuals of windows after the best rotation; infinite if its tilt is too large."""
    found = np.full(len(places), np.nan)
    for row, place in enumerate(places):
        t_s = lined.t_s[place]
        part = slice(*np.searchsorted(lined.t_s, (t_s - HALF_S, t_s + HALF_S)))
        times = lined.t_s[part]
        if len(times) < MIN_FIT_FIXES or np.diff(times).max() > LONGEST_PAUSE_S:
            continue
        turn, left = fitted(lined.v_s[part], lined.v_n[part])
        found[row] = np.sqrt((left[:, :2] ** 2).sum(axis=1).mean())
        cosine = float(turn[2] @ -lined.up_s[place])
        if np.arccos(np.clip(cosine, -1.0, 1.0)) > lined.tilt_rad[place]:
            found[row] = np.inf
    return found


def fitted(v_s: Array, v_n: Array) -> tuple[Array, Array]:
    """(3, 3) rotation from one frame to the other by which velocities fit, but for a constant.

    Returns:
        The rotation, and (N, 3) what it leaves.
    """
    a, b = v_s - v_s.mean(axis=0), v_n - v_n.mean(axis=0)
    u, _, vt = np.linalg.svd(a.T @ b)
    mirror = np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turn: Array = (u @ mirror @ vt).T
    return turn, b - a @ turn.T
