"""Second stage of the default filter: theta = (bias error 3, heading error).

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    G_BIAS_LIMIT,
    G_BIAS_VAR,
    G_BIAS_WALK,
    G_GYRO,
    G_HEADING_VAR,
    G_SCALE_HEADING,
    SATURATED,
    X_BIAS,
    X_D,
    X_P,
    X_R,
    X_S,
    X_TURNING,
    X_UE,
    X_UN,
    X_VE,
    X_VN,
)
from h2nav.attitude.kernels.shaped_motion import turn


def predict_theta(x: list[float], g: Sequence[float], dt: float) -> None:
    """Covariance of theta and the sensitivities over one step.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    dx = dt * x[X_R + 6]
    dy = dt * x[X_R + 7]
    dz = dt * x[X_R + 8]
    p00 = x[X_P]
    p01 = x[X_P + 1]
    p02 = x[X_P + 2]
    p03 = x[X_P + 3]
    p11 = x[X_P + 4]
    p12 = x[X_P + 5]
    p13 = x[X_P + 6]
    p22 = x[X_P + 7]
    p23 = x[X_P + 8]
    c0 = p00 * dx + p01 * dy + p02 * dz
    c1 = p01 * dx + p11 * dy + p12 * dz
    c2 = p02 * dx + p12 * dy + p22 * dz
    turn_noise = dt * (g[G_GYRO] + g[G_SCALE_HEADING] * x[X_TURNING])
    both = (c0 - 2.0 * p03) * dx + (c1 - 2.0 * p13) * dy + (c2 - 2.0 * p23) * dz
    x[X_P + 3] = p03 - c0
    x[X_P + 6] = p13 - c1
    x[X_P + 8] = p23 - c2
    x[X_P + 9] = x[X_P + 9] + both + turn_noise
    walk = g[G_BIAS_WALK] * dt
    if p00 < g[G_BIAS_VAR]:
        x[X_P] = p00 + walk
    if p11 < g[G_BIAS_VAR]:
        x[X_P + 4] = p11 + walk
    if p22 < g[G_BIAS_VAR]:
        x[X_P + 7] = p22 + walk
    # The heading error moves with the bias error, and the sensitivities refer to where it is now.
    v = x[X_VN + 3]
    x[X_VN] = x[X_VN] + dt * x[X_UN] + dx * v
    x[X_VN + 1] = x[X_VN + 1] + dt * x[X_UN + 1] + dy * v
    x[X_VN + 2] = x[X_VN + 2] + dt * x[X_UN + 2] + dz * v
    x[X_VN + 3] = v + dt * x[X_UN + 3]
    v = x[X_VE + 3]
    x[X_VE] = x[X_VE] + dt * x[X_UE] + dx * v
    x[X_VE + 1] = x[X_VE + 1] + dt * x[X_UE + 1] + dy * v
    x[X_VE + 2] = x[X_VE + 2] + dt * x[X_UE + 2] + dz * v
    x[X_VE + 3] = v + dt * x[X_UE + 3]
    u = x[X_UN + 3]
    x[X_UN] = x[X_UN] + dt * x[X_R + 3] + dx * u
    x[X_UN + 1] = x[X_UN + 1] + dt * x[X_R + 4] + dy * u
    x[X_UN + 2] = x[X_UN + 2] + dt * x[X_R + 5] + dz * u
    u = x[X_UE + 3]
    x[X_UE] = x[X_UE] - dt * x[X_R] + dx * u
    x[X_UE + 1] = x[X_UE + 1] - dt * x[X_R + 1] + dy * u
    x[X_UE + 2] = x[X_UE + 2] - dt * x[X_R + 2] + dz * u


def measure_theta(x: list[float], row: int, innovation: float, noise: float) -> None:
    """One scalar measurement x[row..row+3] . theta; adds to the correction in X_D.

    Source: docs/filter.md Eq. (18).
    """
    a0 = x[row]
    a1 = x[row + 1]
    a2 = x[row + 2]
    a3 = x[row + 3]
    h0 = x[X_P] * a0 + x[X_P + 1] * a1 + x[X_P + 2] * a2 + x[X_P + 3] * a3
    h1 = x[X_P + 1] * a0 + x[X_P + 4] * a1 + x[X_P + 5] * a2 + x[X_P + 6] * a3
    h2 = x[X_P + 2] * a0 + x[X_P + 5] * a1 + x[X_P + 7] * a2 + x[X_P + 8] * a3
    h3 = x[X_P + 3] * a0 + x[X_P + 6] * a1 + x[X_P + 8] * a2 + x[X_P + 9] * a3
    scale = 1.0 / (a0 * h0 + a1 * h1 + a2 * h2 + a3 * h3 + noise)
    d0 = x[X_D]
    d1 = x[X_D + 1]
    d2 = x[X_D + 2]
    d3 = x[X_D + 3]
    e = scale * (innovation - a0 * d0 - a1 * d1 - a2 * d2 - a3 * d3)
    x[X_D] = d0 + h0 * e
    x[X_D + 1] = d1 + h1 * e
    x[X_D + 2] = d2 + h2 * e
    x[X_D + 3] = d3 + h3 * e
    shrink(x, h0, h1, h2, h3, scale)


def shrink(x: list[float], h0: float, h1: float, h2: float, h3: float, scale: float) -> None:
    """P -= scale h h^T."""
    k = scale * h0
    x[X_P] = x[X_P] - k * h0
    x[X_P + 1] = x[X_P + 1] - k * h1
    x[X_P + 2] = x[X_P + 2] - k * h2
    x[X_P + 3] = x[X_P + 3] - k * h3
    k = scale * h1
    x[X_P + 4] = x[X_P + 4] - k * h1
    x[X_P + 5] = x[X_P + 5] - k * h2
    x[X_P + 6] = x[X_P + 6] - k * h3
    k = scale * h2
    x[X_P + 7] = x[X_P + 7] - k * h2
    x[X_P + 8] = x[X_P + 8] - k * h3
    x[X_P + 9] = x[X_P + 9] - scale * h3 * h3


def apply_theta(x: list[float], north: float, east: float) -> None:
    """Moves bias, velocity and attitude by the correction in X_D and by a tilt besides.

    Source: docs/filter.md Eq. (19).
    """
    d0 = x[X_D]
    d1 = x[X_D + 1]
    d2 = x[X_D + 2]
    d3 = x[X_D + 3]
    x[X_BIAS] = x[X_BIAS] + d0
    x[X_BIAS + 1] = x[X_BIAS + 1] + d1
    x[X_BIAS + 2] = x[X_BIAS + 2] + d2
    x[X_S] = x[X_S] + x[X_VN] * d0 + x[X_VN + 1] * d1 + x[X_VN + 2] * d2 + x[X_VN + 3] * d3
    x[X_S + 1] = x[X_S + 1] + x[X_VE] * d0 + x[X_VE + 1] * d1 + x[X_VE + 2] * d2 + x[X_VE + 3] * d3
    north = north + x[X_UN] * d0 + x[X_UN + 1] * d1 + x[X_UN + 2] * d2 + x[X_UN + 3] * d3
    east = east + x[X_UE] * d0 + x[X_UE + 1] * d1 + x[X_UE + 2] * d2 + x[X_UE + 3] * d3
    turn(x, 0.5 * east, -0.5 * north, 0.5 * d3)


def limit(x: list[float], g: Sequence[float]) -> int:
    """Keeps the bias inside its limit and the heading variance where theta is linear."""
    bits = 0
    for i in range(3):
        if x[X_BIAS + i] > g[G_BIAS_LIMIT]:
            x[X_BIAS + i] = g[G_BIAS_LIMIT]
            bits = SATURATED
        if x[X_BIAS + i] < -g[G_BIAS_LIMIT]:
            x[X_BIAS + i] = -g[G_BIAS_LIMIT]
            bits = SATURATED
    if x[X_P + 9] > g[G_HEADING_VAR]:
        c = math.sqrt(g[G_HEADING_VAR] / x[X_P + 9])
        x[X_P + 3] = c * x[X_P + 3]
        x[X_P + 6] = c * x[X_P + 6]
        x[X_P + 8] = c * x[X_P + 8]
        x[X_P + 9] = g[G_HEADING_VAR]
    return bits
