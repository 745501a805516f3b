"""Scale error of a gyro, from the magnetic field alone: the earth's field does not turn.

Over some seconds the gyro carries the measured field along. A difference to the field measured then
has one of three causes: a bias, a scale error, or a magnet of the vehicle. They differ in how they
depend on the turns, and one fit separates them without an attitude: a filter led astray by a wrong
gyro has no part in it.
"""

import numpy as np
from numpy.typing import NDArray

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.maths.rows import product
from h2nav.recordings.context import Array, ImuTrack, Span
from h2nav.reviews.inertial import (
    STEADY_HZ,
    Mask,
    conjugate,
    logarithm,
    means,
    rotate,
    turns,
    within,
)

SCALE_WINDOW_S, PARTS = 4.0, 20
# The field is averaged around each time; at 10 Hz, over two or three values of a compass.
FIELD_WITHIN_S = 0.15
MIN_WINDOWS = 15
# Sensitivity: MPU-6000 and MPU-9250 3 %, BMI088 and ICM-20602 1 %.
SCALE_LIMIT = 0.03
SURE = 5.0
ROUNDS = 5
STEPS, LARGEST_STEP = 3, 0.2
# Allowed residual of the field for a credible compass (integrity.field_windows).
FIELD_SHARE = 0.07
AXES = "xyz"


def detect_gyro_scale(track: ImuTrack, armed: tuple[Span, ...]) -> list[Finding]:
    """Compares one gyro with the compass of the same number.

    Args:
        track: samples, in order, all finite.
        armed: while the motors could turn; objects around a vehicle on the ground distort the
            field.
    """
    fitted = None if _is_seldom(track) else _fitted(track, armed)
    if fitted is None:
        return []
    scale, sigma = fitted
    sure = np.abs(scale) > np.maximum(SCALE_LIMIT, SURE * sigma)
    if not sure.any():
        return []
    axis = int(np.argmax(np.where(sure, np.abs(scale), 0.0)))
    size = float(100.0 * scale[axis])
    shown = ", ".join(
        f"{name} {100.0 * value:+.1f} ± {100.0 * own:.1f} %"
        for name, value, own in zip(AXES, scale, sigma, strict=True)
    )
    return [
        Finding(
            Kind.GYRO_SCALE,
            Sensor(SensorKind.IMU, track.imu + 1),
            Severity.WARNING,
            armed[0].from_s,
            armed[-1].to_s,
            abs(size),
            "%",
            f"gyro turns {abs(size):.0f} % too {'much' if size > 0.0 else 'little'} about "
            f"{AXES[axis]}",
            f"by the field that it carries along over {SCALE_WINDOW_S:.0f} s: {shown}; data sheets "
            f"admit {100.0 * SCALE_LIMIT:.0f} %",
        )
    ]


def _is_seldom(track: ImuTrack) -> bool:
    """Whether the turns between two samples are unknown."""
    return len(track.t_s) < 2 or float(np.median(np.diff(track.t_s))) * STEADY_HZ > 1.0


def _fitted(track: ImuTrack, armed: tuple[Span, ...]) -> tuple[Array, Array] | None:
    """(3,) excess of the gyro about each axis, as a share, and its deviation."""
    factor, nearer = np.ones(3), None
    # A large scale error turns further than one linear step can fit.
    for _ in range(STEPS):
        nearer = _nearer(track._replace(w_b=track.w_b / factor), armed)
        if nearer is None:
            return None
        factor *= 1.0 + nearer[0].clip(-LARGEST_STEP, LARGEST_STEP)
    return None if nearer is None else (factor - 1.0, nearer[1])


def _nearer(track: ImuTrack, armed: tuple[Span, ...]) -> tuple[Array, Array] | None:
    """One linear step of the fit."""
    has_field = np.isfinite(track.m_b_ut).all(axis=1)
    if not has_field.any() or not armed:
        return None
    edges = np.arange(track.t_s[0] + SCALE_WINDOW_S, track.t_s[-1] - SCALE_WINDOW_S, SCALE_WINDOW_S)
    if len(edges) <= MIN_WINDOWS:
        return None
    around = (edges[:, None] + FIELD_WITHIN_S * np.array([-1.0, 1.0])).ravel()
    field = means(track.t_s[has_field], track.m_b_ut[has_field], around)[::2]
    turn, by_bias, by_scale = _turned(track, edges)
    carried = rotate(conjugate(turn), field[:-1])
    norm = np.linalg.norm(field[1:], axis=1)
    cross = _crosses(carried)
    own = _rotations(conjugate(turn)) - np.eye(3)
    rows = np.concatenate((cross @ by_bias, cross @ by_scale, own), axis=2) / norm[:, None, None]
    apart = (carried - field[1:]) / norm[:, None]
    good = np.isfinite(rows.sum(axis=(1, 2)) + apart.sum(axis=1))
    good &= within(edges[:-1], armed) & within(edges[1:], armed)
    if np.count_nonzero(good) < MIN_WINDOWS:
        return None
    found = [
        fit for part in _parts(good) if (fit := _least_squares(rows[part], apart[part])) is not None
    ]
    if len(found) < len(_parts(good)):
        return None
    scales, sigmas = np.array(found).transpose(1, 0, 2)
    # An effect in one part of the flight only is not a scale error.
    return scales[0], np.maximum(sigmas[0], np.ptp(scales, axis=0) / 2.0)


def _parts(good: Mask) -> tuple[NDArray[np.intp], ...]:
    """Windows of the whole flight, its first half, and its second half."""
    places = np.flatnonzero(good)
    half = len(places) // 2
    return places, places[:half], places[half:]


def _least_squares(rows: Array, apart: Array) -> tuple[Array, Array] | None:
    """Scale and its deviation from (N, 3, 9) rows of bias, scale and iron, and (N, 3) residuals."""
    weight = np.ones(len(rows))
    for _ in range(ROUNDS):
        a = (rows * weight[:, None, None]).reshape(-1, 9)
        normal = a.T @ a
        if np.linalg.matrix_rank(normal, rtol=1e-9, hermitian=True) < len(normal):
            return None
        inverse = np.linalg.inv(normal)
        x = inverse @ (a.T @ (apart * weight[:, None]).ravel())
        left = np.linalg.norm(apart - rows @ x, axis=1)
        usual = max(float(np.median(left)), 1e-3)
        weight = np.minimum(1.0, 2.0 * usual / np.maximum(left, 1e-9))
    if usual > FIELD_SHARE:
        return None
    # One in three components of a residual has this size.
    sigma = usual * np.sqrt(np.diag(inverse))
    return x[3:6], sigma[3:6]


def _turned(track: ImuTrack, edges: Array) -> tuple[Array, Array, Array]:
    """(M, 4) turn of each window, (M, 3, 3) derivative by bias and scale, at its end."""
    count = len(edges) - 1
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(PARTS) / PARTS
    q = turns(track.t_s, track.w_b, np.append(inner.ravel(), edges[-1])).reshape(count, PARTS, 4)
    rest = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1))
    by_bias, by_scale = np.zeros((2, count, 3, 3))
    for part in reversed(range(PARTS)):
        back = _rotations(conjugate(rest))
        by_bias += back * SCALE_WINDOW_S / PARTS
        by_scale += back * logarithm(q[:, part])[:, None, :]
        rest = product(q[:, part], rest)
    return rest, by_bias, by_scale


def _rotations(q: Array) -> Array:
    """(N, 3, 3) matrices of (N, 4) rotations."""
    columns = [rotate(q, np.tile(axis, (len(q), 1))) for axis in np.eye(3)]
    return np.stack(columns, axis=2)


def _crosses(v: Array) -> Array:
    """(N, 3, 3) matrices of the cross products with (N, 3) vectors."""
    found = np.zeros((len(v), 3, 3))
    for row, column, axis, sign in ((0, 1, 2, -1), (0, 2, 1, 1), (1, 2, 0, -1)):
        found[:, row, column] = sign * v[:, axis]
        found[:, column, row] = -sign * v[:, axis]
    return found
