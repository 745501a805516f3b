"""Fits a compass's errors to the earth's field, as seen by an independent attitude.

The corrected field S (r + o) + k L of a raw field r must be the earth's in the axes of the board:
an offset o, a symmetric matrix S (scale and soft iron), and a field k of the motors by a lever L
(throttle or current). The attitude comes from gyro, gravity and the receiver's velocity alone; its
heading may have a slowly changing error, which is fitted as well: an Ornstein-Uhlenbeck process as
wide as the attitude's own deviation, no faster than a gyro drifts. The field may be delayed, and so
may its messages; the earth's field may differ from its model, and the attitude may lean in the
axes of the board, as an accelerometer's offset makes it. These are fitted within their deviations,
so that the deviation of an offset contains them.

Least squares with prior deviations that are those of sensors and vehicles. Everything is in
microtesla.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.regression import (
    LAST_ROUNDS,
    ROUNDS,
    SETTLED,
    STARTS,
    Array,
    Wander,
    block_diagonal,
    longer,
    noise_of,
    normal,
    robust,
)
from h2nav.maths.rows import cross

Mask = NDArray[np.bool_]

OFFSET, MATRIX, MOTOR = slice(0, 3), slice(3, 9), slice(9, 12)
COUNT = 12
# Rows and columns of the six of a symmetric matrix: diagonal, then xy, xz, yz.
_ROW, _COLUMN = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)
# Prior deviations: a vehicle's parts and a magnet in them, sensitivity of compasses (AK09916 and
# IST8310 5 %), soft iron, motors at full throttle (30 % of the earth's field is usual, 60 % too
# much).
OFFSET_UT, SCALE, SOFT, MOTOR_UT = 100.0, 0.05, 0.03, 20.0
# Delay of a field, for compasses read 10 to 100 times a second and smoothed.
LATE_S = 0.03
MIN_SIGMA_RAD = math.radians(0.3)
# Of the World Magnetic Model 2025, level and down: the model, the crust, the ionosphere.
EARTH_UT = 0.15
# An accelerometer's offset of 5 mg.
LEAN_RAD = math.radians(0.3)
# What strays beside a wandering heading: delay, lean about the board's x and y, earth's field.
STRAY_SIGMAS = np.array((LATE_S, LEAN_RAD, LEAN_RAD, EARTH_UT, EARTH_UT))
EARTH, ALL_BUT_DELAY = slice(-2, None), slice(-4, None)
# The noise of the best compass, and of the vertical: 0.1 uT; 0.2 deg of 45 uT.
MIN_NOISE_UT = 0.2
# One direction of the field in the body counts at most for this long.
FULL_ROWS, DIRECTIONS = 50, 4.0


class FieldRows(NamedTuple):
    """Means of the raw field over short times, with the expected field."""

    flight: NDArray[np.int64]  # (N,) number of the flight
    t_s: Array  # (N,) increasing within each
    raw_ut: Array  # (N, 3) as the sensor measured it, in the axes of the board
    earth_ut: Array  # (N, 3) of the model by the attitude, in the same axes
    slope_ut: Array  # (N, 3) its rate of change, microtesla per second
    down: Array  # (N, 3) direction of gravity, in the same axes
    heading_rad: Array  # (N,) of the vehicle
    sigma_rad: Array  # (N,) deviation of the attitude's heading
    throttle: Array  # (N,) 0 to 1; NaN if unknown
    current_a: Array  # (N,) NaN if unknown


class FieldCorrection(NamedTuple):
    """The correction from a raw field to the earth's."""

    offset_ut: Array  # (3,) o
    matrix: Array  # (3, 3) S, symmetric
    motor_ut: Array  # (3,) k, by lever

    def corrected(self, raw_ut: Array, lever: Array) -> Array:
        """(N, 3) of (N, 3) raw fields and an (N,) lever."""
        field: Array = (raw_ut + self.offset_ut) @ self.matrix + lever[:, None] * self.motor_ut
        return field

    def undone(self, field_ut: Array, lever: Array) -> Array:
        """(N, 3) raw fields of corrected ones."""
        plain = field_ut - lever[:, None] * self.motor_ut
        raw: Array = np.linalg.solve(self.matrix, plain.T).T - self.offset_ut
        return raw

    @property
    def values(self) -> Array:
        """(12,) offset, matrix (xx, yy, zz, xy, xz, yz), motor."""
        return np.concatenate((self.offset_ut, self.matrix[_ROW, _COLUMN], self.motor_ut))


def correction(values: Array) -> FieldCorrection:
    """The inverse of `FieldCorrection.values`."""
    S = np.empty((3, 3))
    S[_ROW, _COLUMN] = S[_COLUMN, _ROW] = values[MATRIX]
    return FieldCorrection(values[OFFSET], S, values[MOTOR])


NONE = FieldCorrection(np.zeros(3), np.eye(3), np.zeros(3))


class FieldFit(NamedTuple):
    """The result of `fitted`."""

    correction: FieldCorrection  # of the raw field
    covariance: Array  # (12, 12) of its values; 0 for those not fitted
    heading_error_rad: Array  # (N,) of the attitude, positive clockwise
    weight: Array  # (N,) 0 to 1; below a half, a row does not fit
    residual_ut: Array  # (N, 3) corrected minus expected
    cost: float  # of all residuals and priors

    def rms_ut(self) -> float:
        """RMS of the fitting residuals, with equal weight per direction."""
        return weighted_rms(self.residual_ut, self.weight)


def weighted_rms(residual_ut: Array, weight: Array) -> float:
    """Root of the mean square length."""
    return math.sqrt(float(weight @ (residual_ut**2).sum(axis=1)) / max(float(weight.sum()), 1e-9))


def fitted(
    rows: FieldRows, prior: FieldCorrection, free: Mask, lever: Array, *, strays: bool = True
) -> FieldFit:
    """Fits the free ones of offset, matrix and motors; the others stay as in the prior.

    Args:
        rows: at least one.
        prior: initial values and centre of the prior.
        free: (12,) which of its values are fitted.
        lever: (N,) of the motors; 0 without.
        strays: whether earth's field and lean are fitted, too.
    """
    heading = Wander.of(rows.flight, rows.t_s, rows.sigma_rad, MIN_SIGMA_RAD)
    scale = max(float(np.abs(lever).max(initial=0.0)), 1e-9)
    sigma = np.concatenate(
        (np.full(3, OFFSET_UT), np.full(3, SCALE), np.full(3, SOFT), np.full(3, MOTOR_UT / scale))
    )
    places = np.flatnonzero(free)
    information = block_diagonal(
        [np.diag(sigma[places] ** -2), heading.information, np.diag(STRAY_SIGMAS**-2)]
    )
    # The heading error at its knots, and the strays.
    x, knots = prior.values.copy(), np.zeros(heading.knots + len(STRAY_SIGMAS))
    active = np.ones(len(information), dtype=bool)
    # A matrix and an earth's field that shrink together would reduce any noise.
    active[EARTH] = not free[MATRIX].any()
    if not strays:
        active[ALL_BUT_DELAY] = False
    balance = _balanced(rows.earth_ut)
    noise_ut = math.inf
    for start in (*np.repeat(STARTS, ROUNDS), *[1.0] * LAST_ROUNDS):
        r, J = _linear(rows, x, heading, knots, lever, places)
        length = np.linalg.norm(r, axis=1)
        noise_ut = max(noise_of(length, balance), MIN_NOISE_UT)
        fits = robust(length, noise_ut, start)
        A, g = normal(J, (balance * fits / noise_ut**2)[:, None, None], r)
        A += information
        before = np.concatenate((x[places] - prior.values[places], knots))
        step = np.zeros(len(A))
        step[active] = -np.linalg.solve(
            A[np.ix_(active, active)], (g + information @ before)[active]
        )
        x[places] += step[: len(places)]
        knots += step[len(places) :]
        if start == 1.0 and np.abs(step).max(initial=0.0) < SETTLED:
            break
    r, _ = _linear(rows, x, heading, knots, lever, places)
    inflated = longer(rows.flight, rows.t_s, r, balance * fits, len(places))
    covariance = np.zeros((COUNT, COUNT))
    own = _covariance(A, information, active, inflated)
    covariance[np.ix_(places, places)] = own[: len(places), : len(places)]
    before = np.concatenate((x[places] - prior.values[places], knots))
    cost = float((balance * fits) @ (r**2).sum(axis=1)) / noise_ut**2
    cost += float(before @ information @ before)
    angle = heading.hats @ knots[: heading.knots]
    return FieldFit(correction(x), covariance, angle, fits, r, cost)


def _covariance(A: Array, information: Array, active: Mask, inflated: float) -> Array:
    """Of the active values; what is not active was held and is as uncertain as its prior.

    Args:
        A: information of rows and prior.
        inflated: factor on the variance of the rows.
    """
    both, held = np.ix_(active, active), np.ix_(active, ~active)
    own = np.linalg.inv(((A - information) / inflated + information)[both])
    slope = np.linalg.solve(A[both], A[held])
    own += slope / np.diag(information)[~active] @ slope.T
    return own


def headed(rows: FieldRows, angle_rad: Array) -> Array:
    """(N, 3) the earth's field with these heading errors of the attitude."""
    e, d = rows.earth_ut, rows.down
    along = (e * d).sum(axis=1)[:, None] * d
    sine, cosine = np.sin(angle_rad)[:, None], np.cos(angle_rad)[:, None]
    turned: Array = along + (e - along) * cosine - cross(d, e) * sine
    return turned


def _linear(
    rows: FieldRows,
    x: Array,
    heading: Wander,
    knots: Array,
    lever: Array,
    places: NDArray[np.intp],
) -> tuple[Array, Array]:
    """(N, 3) residuals and their (N, 3, P + K + 5) derivatives."""
    now = correction(x)
    model = headed(rows, heading.hats @ knots[: heading.knots])
    strays = _strays(rows, model)
    v = rows.raw_ut + now.offset_ut
    r = now.corrected(rows.raw_ut, lever) - model + strays @ knots[heading.knots :]
    across = cross(rows.down, model)
    turned = across[:, :, None] * heading.hats[:, None, :]
    if not len(places):
        return r, np.concatenate((turned, strays), axis=2)
    J = np.zeros((len(v), 3, COUNT))
    J[:, :, OFFSET] = now.matrix
    for place, (i, j) in enumerate(zip(_ROW, _COLUMN, strict=True), start=MATRIX.start):
        J[:, i, place] += v[:, j]
        if i != j:
            J[:, j, place] += v[:, i]
    J[:, :, MOTOR] = lever[:, None, None] * np.eye(3)
    return r, np.concatenate((J[:, :, places], turned, strays), axis=2)


def _strays(rows: FieldRows, model: Array) -> Array:
    """(N, 3, 5) residual by delay, by the lean, and by the earth's field level and down."""
    level = model - (model * rows.down).sum(axis=1)[:, None] * rows.down
    level /= np.maximum(np.linalg.norm(level, axis=1, keepdims=True), 1e-9)
    leans = (cross(axis, model) for axis in np.eye(3)[:2])
    return np.stack((rows.slope_ut, *leans, -level, -rows.down), axis=2)


def _balanced(earth_ut: Array) -> Array:
    """(N,) weights: a direction held for long counts no more than one held for a while."""
    unit = earth_ut / np.maximum(np.linalg.norm(earth_ut, axis=1, keepdims=True), 1e-9)
    _, place, counts = np.unique(
        np.floor(DIRECTIONS * unit), axis=0, return_inverse=True, return_counts=True
    )
    weight: Array = np.minimum(1.0, FULL_ROWS / counts)[place.ravel()]
    return weight
