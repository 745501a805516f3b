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

from h2nav.calibration.knots import Bordered, Knots, normal, prior
from h2nav.calibration.regression import (
    KNOT_S,
    LAST_ROUNDS,
    ROUNDS,
    SETTLED,
    STARTS,
    Array,
    longer,
    noise_of,
    robust,
    wander,
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
    rows: FieldRows, centre: FieldCorrection, free: Mask, lever: Array, *, strays: bool = True
) -> FieldFit:
    """Fits the free ones of offset, matrix and motors; the others stay as they are.

    Args:
        rows: at least one.
        centre: initial values, and what is expected of them.
        free: (12,) which of its values are fitted.
        lever: (N,) of the motors; 0 without.
        strays: whether earth's field and lean are fitted, too.
    """
    knots = Knots.of(rows.flight, rows.t_s, KNOT_S)
    heading = wander(knots, rows.sigma_rad, MIN_SIGMA_RAD)
    scale = max(float(np.abs(lever).max(initial=0.0)), 1e-9)
    sigma = np.repeat((OFFSET_UT, SCALE, SOFT, MOTOR_UT / scale), 3)
    places = np.flatnonzero(free)
    known = prior(np.concatenate((sigma[places], STRAY_SIGMAS)), [heading])
    # Values and strays, and the heading error at its knots.
    x, strayed, swing = (
        centre.values.copy(),
        np.zeros(len(STRAY_SIGMAS)),
        np.zeros((knots.number, 1)),
    )
    active = np.ones(len(known.own), dtype=bool)
    # A matrix and an earth's field that shrink together would reduce any noise.
    active[EARTH] = not free[MATRIX].any()
    if not strays:
        active[ALL_BUT_DELAY] = False
    balance = _balanced(rows.earth_ut)
    noise_ut = math.inf
    for start in (*np.repeat(STARTS, ROUNDS), *[1.0] * LAST_ROUNDS):
        r, own, turned = _linear(rows, x, knots.at_rows(swing)[:, 0], strayed, lever, places)
        length = np.linalg.norm(r, axis=1)
        noise_ut = max(noise_of(length, balance), MIN_NOISE_UT)
        fits = robust(length, noise_ut, start)
        shown = normal(own, turned[:, :, None], knots, balance * fits / noise_ut**2, -r)
        apart = np.concatenate((x[places] - centre.values[places], strayed))
        step, turn = shown.plus(known).against(known, apart, swing).reduced().solved(active)
        x[places] += step[: len(places)]
        strayed += step[len(places) :]
        swing += turn
        moved = max(np.abs(step).max(initial=0.0), np.abs(turn).max(initial=0.0))
        if start == 1.0 and moved < SETTLED:
            break
    angle = knots.at_rows(swing)[:, 0]
    r, _, _ = _linear(rows, x, angle, strayed, lever, places)
    inflated = longer(rows.flight, rows.t_s, r, balance * fits, len(places))
    covariance = np.zeros((COUNT, COUNT))
    own = _covariance(shown, known, active, inflated)
    covariance[np.ix_(places, places)] = own[: len(places), : len(places)]
    apart = np.concatenate((x[places] - centre.values[places], strayed))
    pulled, swung = known.product(apart, swing)
    cost = float((balance * fits) @ (r**2).sum(axis=1)) / noise_ut**2
    cost += float(apart @ pulled + (swing * swung).sum())
    return FieldFit(correction(x), covariance, angle, fits, r, cost)


def _covariance(shown: Bordered, known: Bordered, active: Mask, inflated: float) -> Array:
    """Of the active values; what is not active was held and is as uncertain as its prior.

    Args:
        shown: by the rows.
        known: before.
        inflated: factor on the variance of the rows.
    """
    both, held = np.ix_(active, active), np.ix_(active, ~active)
    own = np.linalg.inv(shown.times(1.0 / inflated).plus(known).reduced().own[both])
    full = shown.plus(known).reduced().own
    slope = np.linalg.solve(full[both], full[held])
    own += slope / np.diag(known.own)[~active] @ slope.T
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
    angle_rad: Array,
    strayed: Array,
    lever: Array,
    places: NDArray[np.intp],
) -> tuple[Array, Array, Array]:
    """(N, 3) residuals; their derivatives, (N, 3, P + 5) and (N, 3) by the heading error."""
    now = correction(x)
    model = headed(rows, angle_rad)
    strays = _strays(rows, model)
    v = rows.raw_ut + now.offset_ut
    r = now.corrected(rows.raw_ut, lever) - model + strays @ strayed
    turned = cross(rows.down, model)
    if not len(places):
        return r, strays, turned
    J = np.zeros((len(v), 3, COUNT))
    J[:, :, OFFSET] = now.matrix
    for place, (i, j) in enumerate(zip(_ROW, _COLUMN, strict=True), start=MATRIX.start):
        J[:, i, place] += v[:, j]
        if i != j:
            J[:, j, place] += v[:, i]
    J[:, :, MOTOR] = lever[:, None, None] * np.eye(3)
    return r, np.concatenate((J[:, :, places], strays), axis=2), turned


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
