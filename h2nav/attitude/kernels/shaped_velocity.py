"""Both corrections of the default filter by a velocity, bounded or measured.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_doubt import doubt_tilt, restart_tilt
from h2nav.attitude.kernels.shaped_layout import (
    DENIED_DOUBT,
    FORCE_USED,
    G_CEILING,
    G_CORRELATION,
    G_FIX_CEILING,
    G_FIX_CORRELATION,
    G_FIX_FLOOR,
    G_FIX_GATE,
    G_FIX_INFLATE,
    G_FLOOR,
    G_GRAVITY,
    G_GYRO,
    G_IMPOSSIBLE,
    G_INFLATE,
    G_PERIODS,
    G_SCALE,
    G_SETS,
    G_START,
    G_T_DRIFT,
    G_T_LEVEL,
    MOST_MISSES,
    PERIOD_SIZE,
    PERIODS,
    RESTARTED,
    SET_SIZE,
    SETS,
    STARTED,
    VELOCITY_USED,
    X_C,
    X_D,
    X_DENIED,
    X_DOUBT,
    X_DRIFT,
    X_EASE,
    X_INNOVATION,
    X_KT,
    X_KV,
    X_MISSES,
    X_MOVING,
    X_NV2,
    X_R,
    X_S,
    X_SET,
    X_SHAKING,
    X_T_RUN,
    X_TURNING,
    X_UE,
    X_UN,
    X_VE,
    X_VN,
    Z_DT,
    Z_FIX_C,
    Z_FIX_DT,
    Z_FIX_V,
    Z_FIX_VAR,
    Z_NOSE,
)
from h2nav.attitude.kernels.shaped_theta import apply_theta, measure_theta


def use_bounded_velocity(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Tilt, velocity and bias from the velocity being near zero, or near Z_NOSE along the nose.

    Source: docs/filter.md Eq. (9) - (11), (14).
    """
    dt = z[Z_DT]
    nose = z[Z_NOSE] / g[G_GRAVITY]
    north = nose * x[X_R] - x[X_S]
    east = nose * x[X_R + 3] - x[X_S + 1]
    square = north * north + east * east
    if square > g[G_IMPOSSIBLE]:
        restart_tilt(x, g, nose)
        return RESTARTED
    time = g[G_T_LEVEL]
    if x[X_T_RUN] < time:
        time = x[X_T_RUN]
    share = dt / time
    x[X_MOVING] = x[X_MOVING] + share * (square - x[X_MOVING])
    # An innovation that stays is a wrong bias rather than motion: it must not hide itself.
    slow = dt / (g[G_T_DRIFT] + dt)
    d = north - x[X_DRIFT]
    x[X_DRIFT] = x[X_DRIFT] + slow * d
    square = d * d
    d = east - x[X_DRIFT + 1]
    x[X_DRIFT + 1] = x[X_DRIFT + 1] + slow * d
    x[X_SHAKING] = x[X_SHAKING] + share * (square + d * d - x[X_SHAKING])
    density = g[G_FLOOR] + g[G_CORRELATION] * x[X_SHAKING]
    if density > g[G_CEILING]:
        density = g[G_CEILING]
    noise = g[G_INFLATE] * density
    density = g[G_FLOOR] + g[G_CORRELATION] * x[X_MOVING]
    if density > g[G_CEILING]:
        density = g[G_CEILING]
    x[X_NV2] = density
    number = select_set(x, g, density)
    base = G_SETS + SET_SIZE * number
    x[X_KT] = g[base + 1]
    x[X_KV] = g[base + 2]
    keep = dt
    if dt * x[X_KV] > 0.5:
        keep = 0.5 / x[X_KV]
    noise = x[X_EASE] * noise * (1.0 / dt + x[X_KV])
    correct_velocity(x, north, east, noise, keep * x[X_KT], keep * x[X_KV])
    return FORCE_USED


def use_fix(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Tilt, velocity, bias and heading from a measured velocity.

    Source: docs/filter.md Eq. (15), (16).
    """
    north = z[Z_FIX_V] / g[G_GRAVITY] + x[X_C] - z[Z_FIX_C] - x[X_S]
    east = z[Z_FIX_V + 1] / g[G_GRAVITY] + x[X_C + 1] - z[Z_FIX_C + 1] - x[X_S + 1]
    square = north * north + east * east
    period = z[Z_FIX_DT]
    variance = z[Z_FIX_VAR] / (g[G_GRAVITY] * g[G_GRAVITY])
    if x[X_MISSES] >= MOST_MISSES:
        # Nothing is known of the velocity yet, or the fixes agree in contradicting it.
        for i in range(8):
            x[X_VN + i] = 0.0
        x[X_S] = x[X_S] + north
        x[X_S + 1] = x[X_S + 1] + east
        x[X_MISSES] = 0.0
        if x[X_DOUBT] > DENIED_DOUBT and x[X_EASE] < STARTED:
            x[X_DENIED] = 1.0
        return VELOCITY_USED
    floor = g[G_FIX_FLOOR] / period + variance
    if square > x[X_EASE] * g[G_FIX_GATE] * (floor + x[X_MOVING]):
        x[X_MISSES] = x[X_MISSES] + 1.0
        doubt_tilt(x, math.sqrt(square) / (period * MOST_MISSES))
        return 0
    x[X_MISSES] = 0.0
    time = g[G_T_LEVEL]
    if x[X_T_RUN] < time:
        time = x[X_T_RUN]
    share = 1.0
    if period < time:
        share = period / time
    x[X_MOVING] = x[X_MOVING] + share * (square - x[X_MOVING])
    density = g[G_FIX_FLOOR] + period * variance + g[G_FIX_CORRELATION] * x[X_MOVING]
    if density > g[G_FIX_CEILING]:
        density = g[G_FIX_CEILING]
    x[X_NV2] = density
    number = select_set(x, g, density)
    base = G_PERIODS
    for i in range(PERIODS - 1):
        if period > g[G_PERIODS + PERIOD_SIZE * i]:
            base = G_PERIODS + PERIOD_SIZE * (i + 1)
    x[X_KT] = g[base + 1 + 2 * number]
    x[X_KV] = g[base + 2 + 2 * number]
    noise = x[X_EASE] * g[G_FIX_INFLATE] * density / (period * (1.0 - x[X_KV]))
    correct_velocity(x, north, east, noise, x[X_KT], x[X_KV])
    return FORCE_USED | VELOCITY_USED


def select_set(x: list[float], g: Sequence[float], density: float) -> int:
    """Number of the gain set for the measured levels; sharper sets while the filter starts.

    Source: docs/filter.md Eq. (9), (14).
    """
    wanted = (g[G_GYRO] + g[G_SCALE] * x[X_TURNING]) / density
    ramp = g[G_START] / x[X_T_RUN]
    ramp = ramp * ramp
    ramp = ramp * ramp
    if wanted < ramp:
        wanted = ramp
    number = 0
    for i in range(SETS - 1):
        if wanted > g[G_SETS + SET_SIZE * i]:
            number = i + 1
    x[X_SET] = number
    return number


def correct_velocity(
    x: list[float], north: float, east: float, noise: float, kt: float, kv: float
) -> None:
    """Both stages: the constant gain on tilt and velocity, the covariance on theta.

    Args:
        x: memory.
        north: innovation of the velocity over g.
        east: the same.
        noise: variance of either innovation without the error of theta, s^2.
        kt: tilt per innovation, 1/s.
        kv: velocity per innovation.

    Source: docs/filter.md Eq. (10), (17) - (19), (30).
    """
    for i in range(4):
        x[X_D + i] = 0.0
    measure_theta(x, X_VN, north, noise)
    measure_theta(x, X_VE, east, noise)
    for i in range(4):
        x[X_UN + i] = x[X_UN + i] - kt * x[X_VN + i]
        x[X_VN + i] = x[X_VN + i] - kv * x[X_VN + i]
        x[X_UE + i] = x[X_UE + i] - kt * x[X_VE + i]
        x[X_VE + i] = x[X_VE + i] - kv * x[X_VE + i]
    x[X_S] = x[X_S] + kv * north
    x[X_S + 1] = x[X_S + 1] + kv * east
    apply_theta(x, kt * north, kt * east)
    x[X_DOUBT] = x[X_DOUBT] - 0.5 * kv * x[X_DOUBT]
    x[X_INNOVATION] = kt * east
    x[X_INNOVATION + 1] = -kt * north
