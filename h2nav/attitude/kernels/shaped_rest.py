"""Bias of the default filter from the gyro at rest.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    G_BIAS_LIMIT,
    G_REST_FORCE,
    G_REST_NOISE,
    G_REST_RATE,
    G_T_REST,
    G_T_REST_LP,
    REST,
    REST_FLOOR,
    REST_SIGMAS_2,
    X_BIAS,
    X_D,
    X_FORCE_LP,
    X_P,
    X_RATE_LP,
    X_T_REST,
    X_T_STEADY,
    Z_DT,
    Z_FORCE,
    Z_RATE,
    Z_REST,
)
from h2nav.attitude.kernels.shaped_theta import apply_theta, shrink


def use_rest(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Bias from the low-passed rate while nothing moves; how long nothing has been felt to move.

    Source: docs/filter.md Eq. (20), (31).
    """
    dt = z[Z_DT]
    share = dt / (g[G_T_REST_LP] + dt)
    rate = 0.0
    force = 0.0
    slow = 1.0
    for i in range(3):
        d = z[Z_RATE + i] - x[X_RATE_LP + i]
        rate = rate + d * d
        x[X_RATE_LP + i] = x[X_RATE_LP + i] + share * d
        d = z[Z_FORCE + i] - x[X_FORCE_LP + i]
        force = force + d * d
        x[X_FORCE_LP + i] = x[X_FORCE_LP + i] + share * d
        if math.fabs(x[X_RATE_LP + i]) > g[G_BIAS_LIMIT]:
            slow = 0.0
    still = slow * z[Z_REST]
    if still == 1.0:
        # By the signals alone a slow turn looks like rest: the bias must not jump by it.
        still = 1.0 - moves(x, X_P, 0) - moves(x, X_P + 4, 1) - moves(x, X_P + 7, 2)
    if slow <= 0.0 or rate > g[G_REST_RATE] or force > g[G_REST_FORCE]:
        x[X_T_STEADY] = 0.0
        x[X_T_REST] = 0.0
        return 0
    x[X_T_STEADY] = x[X_T_STEADY] + dt
    if still <= 0.0:
        x[X_T_REST] = 0.0
        return 0
    x[X_T_REST] = x[X_T_REST] + dt
    if x[X_T_REST] < g[G_T_REST]:
        return 0
    noise = g[G_REST_NOISE] / dt
    measure_bias(x, 0, x[X_P], x[X_P + 1], x[X_P + 2], x[X_P + 3], x[X_P] + noise)
    measure_bias(x, 1, x[X_P + 1], x[X_P + 4], x[X_P + 5], x[X_P + 6], x[X_P + 4] + noise)
    measure_bias(x, 2, x[X_P + 2], x[X_P + 5], x[X_P + 7], x[X_P + 8], x[X_P + 7] + noise)
    return REST


def moves(x: list[float], variance: int, axis: int) -> float:
    """1 when the low-passed rate contradicts the bias as far as it is known (x[variance])."""
    d = x[X_RATE_LP + axis] - x[X_BIAS + axis]
    if d * d > REST_SIGMAS_2 * (x[variance] + REST_FLOOR):
        return 1.0
    return 0.0


def measure_bias(
    x: list[float], axis: int, h0: float, h1: float, h2: float, h3: float, variance: float
) -> None:
    """Theta from one axis of the low-passed rate; h is that axis' row of P."""
    scale = 1.0 / variance
    e = scale * (x[X_RATE_LP + axis] - x[X_BIAS + axis])
    x[X_D] = h0 * e
    x[X_D + 1] = h1 * e
    x[X_D + 2] = h2 * e
    x[X_D + 3] = h3 * e
    shrink(x, h0, h1, h2, h3, scale)
    apply_theta(x, 0.0, 0.0)
