"""Fits errors of an accelerometer and a receiver to changes of the velocity in flight.

In turns an offset rotates with the vehicle and an attitude error does not; load factors show the
scale; turns show the velocity's delay and the antenna's position. All of it is linear. Prior
deviations are those of data sheets and vehicles; unobserved values keep them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.knots import Knots, normal, prior
from h2nav.calibration.motion_rows import MotionRows
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
from h2nav.maths.units import DEG
from h2nav.reviews.inertial import Mask

OFFSET, SCALE, LAG, ARM = slice(0, 3), slice(3, 6), slice(6, 7), slice(7, 10)
COUNT = 10
# MPU-6000: zero-g output 50 to 80 mg, sensitivity 3 %. Receivers differ by 0.1 s, and antennas sit
# within an arm's length.
SIGMAS = np.repeat((0.6, 0.03, 0.1, 0.3), (3, 3, 1, 3))
MIN_SIGMA_RAD = 0.1 * DEG
# The noise of the best receivers between two fixes, and of a vehicle that rests.
MIN_NOISE_M_S, REST_M_S = 0.02, 0.05
# A value must not rest on a single one of so many parts of the flights.
PARTS = 16


class MotionFit(NamedTuple):
    """The result of `fitted`."""

    # (10,) force to add, m/s^2, and as a share of the force; delay of the velocity beyond the
    # assumed one, s; position of the antenna from the IMU, m, body
    values: Array
    covariance: Array  # (10, 10) of these; 0 for those not fitted
    # (10,) the largest deviation without any one part of the windows: large for values
    # observed in a single moment
    lasting: Array
    weight: Array  # (N,) 0 to 1; below a half, a window does not fit
    residual: Array  # (N, 3) of each measured axis, m/s

    @property
    def sigma(self) -> Array:
        """(10,) deviations."""
        found: Array = np.sqrt(np.diag(self.covariance))
        return found


def fitted(rows: MotionRows, free: Mask) -> MotionFit:
    """Fits the values, and the attitude's error over time as nuisance states.

    Args:
        rows: at least one between fixes.
        free: (10,) the values to fit; the others are 0.
    """
    knots = Knots.of(rows.flight, rows.t_s, KNOT_S)
    tilt = wander(knots, rows.sigma_tilt, MIN_SIGMA_RAD)
    heading = wander(knots, rows.sigma_heading, MIN_SIGMA_RAD)
    places = np.flatnonzero(free)
    own, turned = _derivatives(rows, places)
    y = rows.share * rows.apart
    known = prior(SIGMAS[places], (tilt, tilt, heading))
    x: Array = np.zeros(len(places))
    swing: Array = np.zeros((knots.number, 3))
    moves = rows.share[:, 0] > 0.0
    noise = np.full(len(y), REST_M_S)
    for start in (*np.repeat(STARTS, ROUNDS), *[1.0] * LAST_ROUNDS):
        r = _left(y, own @ x, turned, knots.at_rows(swing))
        length = np.linalg.norm(r, axis=1)
        if moves.any():  # not in a part of a flight at rest
            noise[moves] = max(noise_of(length[moves], np.ones(moves.sum())), MIN_NOISE_M_S)
        weight = robust(length, noise, start)
        w = weight / noise**2
        shown = normal(own, turned, knots, w, y)
        before = np.concatenate((x, swing.ravel()))
        x, swing = shown.plus(known).reduced().solved()
        moved = np.abs(np.concatenate((x, swing.ravel())) - before)
        if start == 1.0 and moved.max(initial=0.0) < SETTLED:
            break
    r = _left(y, own @ x, turned, knots.at_rows(swing))
    inflated = longer(rows.flight, rows.t_s, r / noise[:, None], weight, len(places))
    covariance = np.zeros((COUNT, COUNT))
    whole = shown.times(1.0 / inflated).plus(known)
    covariance[np.ix_(places, places)] = np.linalg.inv(whole.reduced().own)
    lasting = np.zeros(COUNT)
    for part in np.array_split(np.arange(len(y)), PARTS) if len(places) else ():
        alone = normal(own[part], turned[part], knots.part(part), w[part], y[part])
        without = np.linalg.inv(whole.plus(alone, -1.0 / inflated).reduced().own)
        lasting[places] = np.fmax(lasting[places], np.sqrt(np.diag(without)))
    values = np.zeros(COUNT)
    values[places] = x
    return MotionFit(values, covariance, lasting, weight, r)


def _left(y: Array, own: Array, turned: Array, angles: Array) -> Array:
    """(N, 3) what neither the (N, 3) effect of the values nor the (N, 3) angles explain."""
    left: Array = y - own - np.einsum("ncm,nm->nc", turned, angles)
    return left


def _derivatives(rows: MotionRows, places: NDArray[np.intp]) -> tuple[Array, Array]:
    """(N, 3, P) of the weighted windows by the values; (N, 3, 3) by the attitude's error."""
    values = (rows.offset, rows.scale, -rows.late[:, :, None], rows.arm)
    own = np.concatenate(values, axis=2)[:, :, places]
    turned = np.stack([np.cross(axis, rows.force) for axis in np.eye(3)], axis=2)
    share = rows.share[:, :, None]
    return share * own, share * turned
