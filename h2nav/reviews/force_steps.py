"""Steps of an accelerometer's bias in flight, by the velocity of the receiver.

The gyro carries an attitude over some seconds, independent of any filter that uses the
accelerometer. The force's unexplained part of the receiver's acceleration is then the same before
and after a time, unless the bias jumped at that time.
"""

from typing import NamedTuple

import numpy as np

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.recordings.context import Array, ImuTrack, Span
from h2nav.reviews.inertial import (
    LONGEST_STEP_S,
    Attitudes,
    conjugate,
    held_s,
    interpolated,
    noise,
    rotate,
    within,
)
from h2nav.reviews.receiver_fit import Moves, carried
from h2nav.reviews.tracks import Bias

# Length on each side of a jump, and the excluded time around it.
STEP_WINDOW_S, GUARD_S = 4.0, 0.5
REACH_S = STEP_WINDOW_S + GUARD_S
EVERY_S = 0.25
MIN_FIXES = 10
# Afterwards the filter absorbs the jump into its attitude; before it, the bias is steady this long.
WINDOWS_BEFORE = 3
# Zero-g output changes by 0.1 mg/K and less: this much at once is not thermal. A tilt drift of
# 0.5 deg over the window contributes a sixth of it.
STEP_M_S2 = 0.5
GATE = 3.0
# The halves of a window, and the windows of a lasting jump, may differ by this share of it.
STEADY_SHARE = 0.4
# Of the vehicle's own acceleration: a heading error of 15 deg contributes this much, and more where
# our heading may be worse.
MOVED_SHARE = 0.25
# A direction observed less than this share of the best one is ignored: without the velocity down,
# the vertical.
UNSEEN = 0.6
SCALE_SIGMA = 0.01  # of a gyro
# The receiver may miss one fix.
LONGEST_PAUSE_S = 1.5
# When all IMUs jump alike, the receiver is wrong, or the vehicle was struck.
ALIKE_SHARE = 0.5
# Of the jump, by another IMU at the same time, whatever its direction.
TOGETHER_SHARE = 0.5


def detect_force_steps(
    tracks: tuple[ImuTrack, ...],
    biases: tuple[Bias, ...],
    moves: Moves,
    lag_s: float,
    best: Attitudes,
    armed: tuple[Span, ...],
) -> list[Finding]:
    """Finds jumps of one accelerometer that the others do not show.

    Args:
        tracks: IMUs, each with at least two samples.
        lag_s: delay of the receiver; NaN if unknown.
        armed: while the motors could turn; only then there is an acceleration to compare.
    """
    if len(moves.t_s) < MIN_FIXES:
        return []
    moves = moves._replace(t_s=moves.t_s - np.nan_to_num(lag_s))
    at_s = np.arange(moves.t_s[0], moves.t_s[-1], EVERY_S)
    flown = within(at_s - REACH_S, armed) & within(at_s + REACH_S, armed)
    flown &= ~within(at_s, _pauses(moves.t_s))
    looked = [_jumps(track, _known_bias(biases, track.imu), best, moves, at_s) for track in tracks]
    found = []
    for place, (own, least) in enumerate(looked):
        size = np.linalg.norm(own, axis=1)
        size[~(flown & (size > least))] = 0.0
        others = [other for i, (other, _) in enumerate(looked) if i != place]
        for other in others:
            size[np.linalg.norm(own - other, axis=1) < ALIKE_SHARE * size] = 0.0
            # Two that jump at once, however, have been compared with something that jumped.
            size[_around(np.linalg.norm(other, axis=1)) > TOGETHER_SHARE * size] = 0.0
        found += _findings(tracks[place].imu, at_s, own, size, is_alone=not others)
    return found


def _around(size: Array) -> Array:
    """(N,) the largest within the reach of a window."""
    half = round(REACH_S / EVERY_S)
    wide = np.pad(np.nan_to_num(size), half)
    found: Array = np.lib.stride_tricks.sliding_window_view(wide, 2 * half + 1).max(axis=1)
    return found


def _pauses(fixes_s: Array) -> list[Span]:
    """Spans in which a window would include a gap in the fixes."""
    after = np.flatnonzero(np.diff(fixes_s) > LONGEST_PAUSE_S)
    return [Span(fixes_s[i] - REACH_S, fixes_s[i + 1] + REACH_S, "no fix") for i in after]


def _known_bias(biases: tuple[Bias, ...], imu: int) -> Array:
    """(3,) bias of a gyro, rad/s; zero if unknown."""
    for bias in biases:
        if bias.imu == imu and np.isfinite(bias.gyro_b).all(axis=1).any():
            known: Array = np.nanmedian(bias.gyro_b, axis=0)
            return known
    return np.zeros(3)


def _jumps(
    track: ImuTrack, bias_b: Array, best: Attitudes, moves: Moves, at_s: Array
) -> tuple[Array, Array]:
    """(M, 3) jump of the bias at each time, body axes, and (M,) its threshold, m/s^2.

    NaN where it was not steady before, or where the halves of a window show different biases.
    """
    q_s = carried(track, bias_b, held_s(track.t_s))
    sums = track.t_s, _sums(track, q_s)
    edges = at_s + np.array([-1.0, -0.5, 0.0, 0.0, 0.5, 1.0])[:, None] * STEP_WINDOW_S
    edges += np.array([-1.0, -1.0, -1.0, 1.0, 1.0, 1.0])[:, None] * GUARD_S
    start = Attitudes(track.t_s, q_s, *np.zeros((2, len(track.t_s)))).at(edges[0])
    q_ns = product(best.at(edges[0]), conjugate(start))
    halves = [_half(sums, q_ns, moves, edges[i], edges[i + 1]) for i in (0, 1, 3, 4)]
    before, worst_before = _bias(halves[0], halves[1])
    after, worst_after = _bias(halves[2], halves[3])
    jump = after - before
    size = np.linalg.norm(jump, axis=1)
    # Two differences of means, of two fixes each, plus the aliasing of slow samples.
    variance = (2.0 * np.median(moves.sigma_m_s) / STEP_WINDOW_S) ** 2
    variance = variance + 0.25 * np.sum([half.variance for half in halves], axis=0)
    variance += GRAVITY_M_S2**2 * _turn_variance(track, edges[0], edges[-1])
    moved = np.max([np.linalg.norm(half.moved_n, axis=1) for half in halves], axis=0)
    off = np.minimum(GATE * best.near(best.sigma_heading_rad, at_s), np.pi)
    share = np.maximum(MOVED_SHARE, 2.0 * np.sin(0.5 * off))
    least = np.maximum(STEP_M_S2, np.maximum(GATE * np.sqrt(variance), share * moved))
    steady = np.maximum(worst_before, worst_after)
    for earlier in range(1, WINDOWS_BEFORE):
        shift = earlier * round(STEP_WINDOW_S / EVERY_S)
        steady[:shift] = np.inf
        apart = np.linalg.norm(before[shift:] - before[:-shift], axis=1)
        steady[shift:] = np.maximum(steady[shift:], apart)
    # Missing samples in between may hide a turn.
    span = interpolated(edges[-1], *sums) - interpolated(edges[0], *sums)
    is_whole = span[:, 12] < 0.5 * LONGEST_STEP_S
    jump[~(is_whole & (steady < STEADY_SHARE * size))] = np.nan
    return jump, least


class _Half(NamedTuple):
    """Means over half a window."""

    extra_n: Array  # (M, 3) acceleration of the force minus that of the receiver, NED, m/s^2
    axes_n: Array  # (M, 3, 3) the body's axes as columns, NED
    moved_n: Array  # (M, 3) acceleration of the receiver
    variance: Array  # (M,) of the force, from slow samples of a vibration


def _sums(track: ImuTrack, q_s: Array) -> Array:
    """(N, 14) integrals: force and the body's axes, in the first sample's; gaps, s; variance."""
    gap_s = np.diff(track.t_s, prepend=track.t_s[:1])
    dt_s = np.clip(gap_s, 0.0, LONGEST_STEP_S)
    ones = [rotate(q_s, np.tile(axis, (len(q_s), 1))) for axis in np.eye(3)]
    rates = np.hstack([rotate(q_s, track.f_b), *ones])
    rates[1:] = 0.5 * (rates[1:] + rates[:-1])
    gained = np.cumsum(rates * dt_s[:, None], axis=0)
    return np.column_stack((gained, np.cumsum(gap_s - dt_s), noise(track.f_b, dt_s)))


def _turn_variance(track: ImuTrack, from_s: Array, to_s: Array) -> Array:
    """(M,) of the gyro's turn from one time to another, rad^2."""
    dt_s = held_s(track.t_s)
    path = np.cumsum(np.linalg.norm(track.w_b, axis=1) * dt_s)
    sums = np.column_stack((path, noise(track.w_b, dt_s)))
    change = interpolated(to_s, track.t_s, sums) - interpolated(from_s, track.t_s, sums)
    found: Array = (SCALE_SIGMA * change[:, 0]) ** 2 + change[:, 1]
    return found


def _half(
    sums: tuple[Array, Array], q_ns: Array, moves: Moves, from_s: Array, to_s: Array
) -> _Half:
    length_s = (to_s - from_s)[:, None]
    change = (interpolated(to_s, *sums) - interpolated(from_s, *sums)) / length_s
    force_n, *axes = (rotate(q_ns, change[:, i : i + 3]) for i in range(0, 12, 3))
    force_n[:, 2] += GRAVITY_M_S2
    moved_n = (interpolated(to_s, *moves[:2]) - interpolated(from_s, *moves[:2])) / length_s
    known = moves.axes.astype(np.float64)
    axes_n = np.stack(axes, axis=2) * known[:, None]
    return _Half((force_n - moved_n) * known, axes_n, moved_n, change[:, 13] / length_s[:, 0])


def _bias(one: _Half, two: _Half) -> tuple[Array, Array]:
    """(M, 3) bias that explains both halves, and (M,) its residual in either, m/s^2."""
    rows = np.concatenate((one.axes_n, two.axes_n), axis=1)
    extra = np.concatenate((one.extra_n, two.extra_n), axis=1)
    is_known = np.isfinite(rows.sum(axis=(1, 2)) + extra.sum(axis=1))
    bias, left = np.full((len(rows), 3), np.nan), np.full(len(rows), np.nan)
    a, y = rows[is_known], extra[is_known][:, :, None]
    normal = a.transpose(0, 2, 1) @ a
    found = np.linalg.pinv(normal, rcond=UNSEEN, hermitian=True) @ (a.transpose(0, 2, 1) @ y)
    bias[is_known] = found[:, :, 0]
    apart = (y - a @ found)[:, :, 0]
    left[is_known] = np.maximum(
        np.linalg.norm(apart[:, :3], axis=1), np.linalg.norm(apart[:, 3:], axis=1)
    )
    return bias, left


def _findings(imu: int, at_s: Array, jumps: Array, size: Array, *, is_alone: bool) -> list[Finding]:
    """The largest jump: those after it may show how the attitude absorbed it."""
    place = int(np.argmax(size))
    if size[place] == 0.0:
        return []
    x, y, z = jumps[place]
    either = ", unless the receiver's velocity runs away" if is_alone else ""
    return [
        Finding(
            Kind.ACCELEROMETER_BIAS_STEP,
            Sensor(SensorKind.IMU, imu + 1),
            Severity.WARNING,
            float(at_s[place] - GUARD_S),
            float(at_s[place] + GUARD_S),
            float(size[place]),
            "m/s^2",
            f"accelerometer bias jumped by {size[place]:.1f} m/s^2",
            f"({x:+.1f}, {y:+.1f}, {z:+.1f}) m/s^2 in x, y, z, by the receiver's velocity over "
            f"{STEP_WINDOW_S:.0f} s before and after{either}",
        )
    ]
