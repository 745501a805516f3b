"""Fits the drag of a multirotor and the wind to the force across its rotors.

Rotors push along the body's vertical axis alone, so that the force along x and y is drag: of the
body, with the square of the speed through the air, and of the rotors, which turn the air that comes
from the side (momentum drag), in proportion to it:

    f = -(rho/2 k |v| v + M sqrt(rho/rho_0) v) + b + d L,   v = R' (v_n - w_n)

with k = 1/BCOEF of each axis, M, the wind w_n at knots, an offset b of the accelerometer and a lean
d of the IMU against the rotors, whose lift is L. The receiver gives v_n.

Sources: ArduPilot, AP_NavEKF3, FuseDragForces, where |v| is the speed along the axis; PX4, EKF2,
drag_fusion.cpp, where it is the whole speed.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.knots import Knots, normal, prior
from h2nav.calibration.regression import Array, longer, robust
from h2nav.maths.air import SEA_LEVEL_KG_M3
from h2nav.maths.units import DEG

# Values in the order of the fit.
BODY, ROTORS, OFFSET, LEAN = slice(0, 2), slice(2, 3), slice(3, 5), slice(5, 7)
COUNT = 7
# 1/BCOEF in m^2/kg (a vehicle of 1.5 kg with 0.03 m^2: 0.02), M in 1/s (a quadrotor: 0.2), zero-g
# output of a calibrated accelerometer, and how straight an autopilot is mounted.
SIGMAS = np.array((0.3, 0.3, 1.0, 0.2, 0.2, 2.0 * DEG, 2.0 * DEG))
START = np.array((0.02, 0.02, 0.2, 0.0, 0.0, 0.0, 0.0))
# The wind: at knots, as strong as this, and changing by so much from one to the next.
KNOT_S, WIND_M_S, WIND_STEP_M_S = 20.0, 8.0, 1.0
# Windows; the least noise of their forces: that of a vibrating accelerometer.
MIN_NOISE_M_S2 = 0.05
MEDIAN_OF_TWO = 1.1774  # of the length of two unit normals
ROUNDS, SETTLED = 30, 1e-5


class DragRows(NamedTuple):
    """Windows of flight."""

    flight: NDArray[np.int64]  # (N,) number of the flight
    t_s: Array  # (N,) their middles, increasing within each flight
    f_b: Array  # (N, 2) mean specific force along body x and y, m/s^2
    lift: Array  # (N,) along the rotors' axis, m/s^2
    R_bn: Array  # (N, 3, 3) from NED to the body
    v_n: Array  # (N, 3) velocity over ground, m/s
    density: Array  # (N,) of the air, kg/m^3


class DragFit(NamedTuple):
    """The result of `fitted_drag`."""

    values: Array  # (7,) 1/BCOEF of x and y, M, offset, lean
    sigma: Array  # (7,) deviations
    wind_n: Array  # (N, 2) velocity of the air at each window, north and east, m/s
    sigma_wind: Array  # (N,) deviation of either
    v_b: Array  # (N, 2) speed through the air along x and y
    residual: Array  # (N, 2) m/s^2
    weight: Array  # (N,) 0 to 1


def fitted_drag(rows: DragRows, *, is_whole_speed: bool) -> DragFit:
    """Fits drag, wind, offset and lean.

    Args:
        rows: at least some tens.
        is_whole_speed: of PX4: the drag of the body along an axis grows with the whole speed.
    """
    knots = Knots.of(rows.flight, rows.t_s, KNOT_S)
    steady = _steady(knots)
    known = prior(SIGMAS, (steady, steady))
    x, wind_n = START.copy(), np.zeros((knots.number, 2))
    noise = 1.0
    weight: Array = np.ones(len(rows.t_s))
    cost = math.inf
    for _ in range(ROUNDS):
        predicted, own, by_wind, _ = _model(rows, x, knots.at_rows(wind_n), is_whole_speed)
        r = rows.f_b - predicted
        length = np.linalg.norm(r, axis=1)
        noise = max(float(np.median(length)) / MEDIAN_OF_TWO, MIN_NOISE_M_S2)
        weight = robust(length, noise, 1.0)
        shown = normal(own, by_wind, knots, weight / noise**2, r)
        step, turn = shown.plus(known).against(known, x, wind_n).reduced().solved()
        # A wind beyond any leads nowhere.
        reach = min(1.0, 5.0 / max(float(np.abs(turn).max()), 1e-9))
        x = x + step * reach
        wind_n = wind_n + turn * reach
        before, cost = cost, float(max(np.abs(step).max(), np.abs(turn).max()))
        if cost < SETTLED or cost == before:
            break
    at_rows_n = knots.at_rows(wind_n)
    predicted, _, _, v_b = _model(rows, x, at_rows_n, is_whole_speed)
    r = rows.f_b - predicted
    inflated = longer(rows.flight, rows.t_s, r / noise, weight, COUNT + wind_n.size)
    left = shown.times(1.0 / inflated).plus(known)
    return DragFit(
        x,
        np.sqrt(np.diag(np.linalg.inv(left.reduced().own))),
        at_rows_n,
        np.sqrt(0.5 * knots.variance(left.covariance()).sum(axis=1)),
        v_b,
        r,
        weight,
    )


def _model(
    rows: DragRows, x: Array, wind_n: Array, is_whole_speed: bool
) -> tuple[Array, Array, Array, Array]:
    """(N, 2) predicted force; its derivatives, (N, 2, 7) and (N, 2, 2) by the wind; and (N, 2).

    The last one is the speed through the air.
    """
    over_ground = rows.v_n.copy()
    over_ground[:, :2] -= wind_n
    whole_b = np.einsum("nij,nj->ni", rows.R_bn, over_ground)
    v_b = whole_b[:, :2]
    speed = np.linalg.norm(whole_b, axis=1, keepdims=True) if is_whole_speed else np.abs(v_b)
    half = 0.5 * rows.density[:, None]
    thin = np.sqrt(rows.density / SEA_LEVEL_KG_M3)[:, None]
    body, rotors = half * speed * v_b, thin * v_b
    predicted = -x[BODY] * body - x[ROTORS] * rotors + x[OFFSET] + x[LEAN] * rows.lift[:, None]
    J = np.zeros((len(rows.t_s), 2, COUNT))
    for axis in range(2):
        J[:, axis, axis] = -body[:, axis]
        J[:, axis, 2] = -rotors[:, axis]
        J[:, axis, 3 + axis] = 1.0
        J[:, axis, 5 + axis] = rows.lift
    # |v| v changes by 2 |v| along an axis; with the whole speed, by |v| + v v'/|v|.
    along = x[ROTORS] * thin + x[BODY] * half * speed * (1.0 if is_whole_speed else 2.0)
    by_air = -along[:, :, None] * np.eye(2, 3)
    if is_whole_speed:
        turned = v_b[:, :, None] * whole_b[:, None, :] / np.maximum(speed, 1e-6)[:, :, None]
        by_air = by_air - (x[BODY] * half)[:, :, None] * turned
    by_wind = -np.einsum("nij,njk->nik", by_air, rows.R_bn[:, :, :2])
    return predicted, J, by_wind, v_b


def _steady(knots: Knots) -> tuple[Array, Array]:
    """Information on one component of the wind: (K,) of each knot, and with the next one."""
    begins = knots.begins
    ends = np.roll(begins, -1)
    step = WIND_STEP_M_S**-2
    return step * (2.0 - begins - ends) + begins * WIND_M_S**-2, np.where(ends, 0.0, -step)


def excited(fit: DragFit) -> tuple[float, float]:
    """Range of the speed through the air along x and y, m/s, in which 9 of 10 windows lie."""
    low, high = np.percentile(fit.v_b, (5.0, 95.0), axis=0)
    return float(high[0] - low[0]), float(high[1] - low[1])
