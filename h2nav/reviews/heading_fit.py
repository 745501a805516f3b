"""The heading by which an autopilot flies, against that of its motion, without an attitude.

Over some seconds the gyro alone rotates the forces into one frame. The rotation from there to
north-east-down that fits their integral to the receiver's velocity (`receiver_fit`) has a heading;
gravity gives it its tilt. Samples that are too seldom for an attitude of a whole flight carry the
frame over these seconds.
"""

from typing import NamedTuple

import numpy as np

from h2nav.maths.units import DEG
from h2nav.recordings.context import Array, ImuTrack
from h2nav.reviews.inertial import Attitudes, Mask, rotate, unbroken
from h2nav.reviews.receiver_fit import (
    HALF_S,
    LONGEST_PAUSE_S,
    MIN_FIT_FIXES,
    Moves,
    fitted,
    gained,
)

EVERY_S = 2.0
# The motion of a window has to show a heading: this much change of velocity (rms), of which the fit
# leaves a part. That part is an angle; a window of 10 s holds four manoeuvres that are independent.
MOVED_M_S, LEFT_SHARE, MANOEUVRES = 1.0, 0.3, 4
# Receivers are late by up to this much; in a turn of 60 deg/s a tenth of a second is 6 deg.
LAGS_S = (0.0, 0.1, 0.2, 0.3, 0.4)
# Beyond declination, compass calibration and delay, and beyond four deviations; in three windows
# in a row, which is 14 s of motion.
OFF_RAD, OFF_SIGMAS, MIN_WINDOWS_OFF = 30.0 * DEG, 4.0, 3


class Headings(NamedTuple):
    """How far the autopilot's heading is from that of the motion, by windows that show it."""

    t_s: Array  # (N,) their middles
    off_rad: Array  # (N,) -pi to pi
    sigma_rad: Array  # (N,)


class Off(NamedTuple):
    """A heading that stays off."""

    from_s: float
    to_s: float
    size_rad: float  # median
    windows: int


def headings(moves: Moves, track: ImuTrack, own: Attitudes, bias_b: Array, flies: Mask) -> Headings:
    """The autopilot's heading against the receiver's velocities.

    Args:
        track: samples of an IMU.
        own: attitudes of the autopilot.
        bias_b: of the gyro, as far as known, rad/s.
        flies: (N,) moves that count.
    """
    each = [_headings(moves, track, own, bias_b, flies, lag_s) for lag_s in LAGS_S]
    # The delay with which most is explained.
    return max(each, key=lambda one: one[1])[0]


def _headings(
    moves: Moves, track: ImuTrack, own: Attitudes, bias_b: Array, flies: Mask, lag_s: float
) -> tuple[Headings, float]:
    """With one delay of the receiver, and minus the median of what the fits leave, m/s."""
    q_sb, t_s, v_s, v_n = gained(moves, track, bias_b, lag_s)
    good = np.isfinite(v_s.sum(axis=1)) & flies
    t_s, v_s, v_n = t_s[good], v_s[good], v_n[good]
    found, left_m_s = [], []
    nose = np.array([[1.0, 0.0, 0.0]])
    for middle in np.arange(t_s[0] + HALF_S, t_s[-1] - HALF_S, EVERY_S) if len(t_s) else ():
        part = slice(*np.searchsorted(t_s, (middle - HALF_S, middle + HALF_S)))
        if part.stop - part.start < MIN_FIT_FIXES or np.diff(t_s[part]).max() > LONGEST_PAUSE_S:
            continue
        turn, left = fitted(v_s[part], v_n[part])
        moved = _but_for_a_tilt(t_s[part], v_n[part, :2])
        rest, whole = (float(np.sqrt((one**2).sum(axis=1).mean())) for one in (left, moved))
        left_m_s.append(rest)
        place = min(int(np.searchsorted(track.t_s, middle)), len(track.t_s) - 1)
        theirs = rotate(own.at(track.t_s[place : place + 1]), nose)[0]
        ours = turn @ rotate(q_sb[place : place + 1], nose)[0]
        if whole > MOVED_M_S and rest < LEFT_SHARE * whole and np.isfinite(theirs).all():
            off = np.angle(complex(*theirs[:2]) * complex(*ours[:2]).conjugate())
            found.append((middle, float(off), rest / whole / np.sqrt(MANOEUVRES)))
    rows = np.array(found).reshape(-1, 3)
    worst = float(np.median(left_m_s)) if left_m_s else np.inf
    return Headings(*rows.T), -worst


def _but_for_a_tilt(t_s: Array, v_n: Array) -> Array:
    """(N, 2) changes of velocity beyond a constant acceleration, which the fit takes for a tilt."""
    line = np.stack((np.ones_like(t_s), t_s - t_s.mean()), axis=1)
    rest: Array = v_n - line @ np.linalg.lstsq(line, v_n, rcond=None)[0]
    return rest


def longest_off(known: Headings) -> Off | None:
    """The longest time for which the heading was off; None if it never was for long."""
    most = np.maximum(OFF_RAD, OFF_SIGMAS * known.sigma_rad)
    best: Off | None = None
    for sign in (1.0, -1.0):
        # A heading that is off by half a turn has either sign.
        is_off = (np.abs(known.off_rad) > most) & (
            (sign * known.off_rad > 0.0) | (np.abs(known.off_rad) > np.pi - OFF_RAD)
        )
        for first, last in unbroken(is_off, known.t_s, HALF_S):
            off = Off(
                float(known.t_s[first]) - HALF_S,
                float(known.t_s[last]) + HALF_S,
                float(np.median(np.abs(known.off_rad[first : last + 1]))),
                last + 1 - first,
            )
            if off.windows >= MIN_WINDOWS_OFF and (best is None or off.windows > best.windows):
                best = off
    return best
