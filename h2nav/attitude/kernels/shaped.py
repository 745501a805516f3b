"""One step of the disturbance-shaped filter, in the translatable subset.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    AIR_COSINE,
    ALL_LOST,
    DENIED_DOUBT,
    FIELD_USED,
    FORCE_USED,
    G_BIAS_LIMIT,
    G_BIAS_VAR,
    G_BIAS_WALK,
    G_CEILING,
    G_CORRELATION,
    G_DIP_GATE,
    G_FIELD,
    G_FIELD_CORRELATION,
    G_FIX_CEILING,
    G_FIX_CORRELATION,
    G_FIX_FLOOR,
    G_FIX_GATE,
    G_FIX_INFLATE,
    G_FLOOR,
    G_GRAVITY,
    G_GYRO,
    G_HEADING_VAR,
    G_IMPOSSIBLE,
    G_INFLATE,
    G_LAG_MOST,
    G_LAG_PRIOR,
    G_NEW_TURN,
    G_NORM_GATE,
    G_PERIODS,
    G_REST_FORCE,
    G_REST_NOISE,
    G_REST_RATE,
    G_SCALE,
    G_SCALE_HEADING,
    G_SETS,
    G_START,
    G_T_DRIFT,
    G_T_EASE,
    G_T_LEVEL,
    G_T_NEW,
    G_T_REFERENCE,
    G_T_REST,
    G_T_REST_LP,
    GROUND_COSINE,
    HEADING_LOST,
    LEVEL_DOUBT,
    LEVEL_SIZE,
    MOST_DOUBT,
    MOST_LOST,
    MOST_MISSES,
    OLDEST_FIELD,
    PERIOD_SIZE,
    PERIODS,
    REST,
    REST_FLOOR,
    REST_SIGMAS_2,
    RESTARTED,
    SATURATED,
    SET_SIZE,
    SETS,
    STARTED,
    VELOCITY_USED,
    X_AIDED,
    X_BIAS,
    X_C,
    X_D,
    X_DECLINATION,
    X_DENIED,
    X_DOUBT,
    X_DRIFT,
    X_EASE,
    X_FIELD,
    X_FIELD_AGE,
    X_FORCE_LP,
    X_INNOVATION,
    X_KT,
    X_KV,
    X_LAG_DEN,
    X_LAG_NUM,
    X_LOST,
    X_M,
    X_MAGNETIC,
    X_MISSES,
    X_MOVING,
    X_NEW_DIP,
    X_NEW_NORM,
    X_NEW_T,
    X_NEW_TURN,
    X_NV2,
    X_P,
    X_Q,
    X_R,
    X_RATE_LP,
    X_REF_DIP,
    X_REF_GIVEN,
    X_REF_NORM,
    X_ROW,
    X_S,
    X_SET,
    X_SHAKING,
    X_T_NO_FIELD,
    X_T_REST,
    X_T_RUN,
    X_T_STEADY,
    X_TURNING,
    X_UE,
    X_UN,
    X_VE,
    X_VN,
    Z_AIDED,
    Z_CLIPPED,
    Z_DT,
    Z_FIELD,
    Z_FIX,
    Z_FIX_C,
    Z_FIX_DT,
    Z_FIX_V,
    Z_FIX_VAR,
    Z_FORCE,
    Z_HAS_FIELD,
    Z_NOSE,
    Z_RATE,
    Z_REST,
)


def step(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes one sample; returns bits.

    Source: docs/filter.md Eq. (4) - (26), (30) - (32).
    """
    bits = 0
    dt = z[Z_DT]
    predict_attitude(x, z)
    predict_theta(x, g, dt)
    x[X_FIELD_AGE] = x[X_FIELD_AGE] + dt
    if x[X_T_NO_FIELD] >= 0.0:
        x[X_T_NO_FIELD] = x[X_T_NO_FIELD] + dt
    if z[Z_CLIPPED] > 0.0:
        doubt_rate(x, z)
        bits = SATURATED
    else:
        if x[X_LOST] > MOST_LOST:
            bits = begin_anew(x, g, z)
        x[X_LOST] = 0.0
        predict_velocity(x, g, z)
        if z[Z_AIDED] > 0.0:
            if z[Z_FIX] > 0.0:
                bits = bits | use_fix(x, g, z)
        else:
            bits = bits | use_bounded_velocity(x, g, z)
        if z[Z_HAS_FIELD] > 0.0:
            bits = bits | use_field(x, g, z)
        bits = bits | use_rest(x, g, z) | check_level(x, g, z)
    return bits | limit(x, g)


def predict_attitude(x: list[float], z: Sequence[float]) -> None:
    """Attitude over one step, and its matrix.

    Source: docs/filter.md Eq. (4).
    """
    dt = z[Z_DT]
    px = dt * (z[Z_RATE] - x[X_BIAS])
    py = dt * (z[Z_RATE + 1] - x[X_BIAS + 1])
    pz = dt * (z[Z_RATE + 2] - x[X_BIAS + 2])
    half = 0.5 * math.sqrt(px * px + py * py + pz * pz)
    c = math.cos(half)
    s = 0.5
    if half > 1e-9:
        s = 0.5 * math.sin(half) / half
    px = s * px
    py = s * py
    pz = s * pz
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    nw = c * qw - px * qx - py * qy - pz * qz
    nx = c * qx + px * qw + pz * qy - py * qz
    ny = c * qy + py * qw + px * qz - pz * qx
    nz = c * qz + pz * qw + py * qx - px * qy
    # One Newton step towards unit length: the length is never far from 1.
    s = 1.5 - 0.5 * (nw * nw + nx * nx + ny * ny + nz * nz)
    nw = s * nw
    nx = s * nx
    ny = s * ny
    nz = s * nz
    x[X_Q] = nw
    x[X_Q + 1] = nx
    x[X_Q + 2] = ny
    x[X_Q + 3] = nz
    set_matrix(x, nw, nx, ny, nz)


def set_matrix(x: list[float], nw: float, nx: float, ny: float, nz: float) -> None:
    """The matrix of an attitude, row by row, into X_R."""
    x[X_R] = 1.0 - 2.0 * (ny * ny + nz * nz)
    x[X_R + 1] = 2.0 * (nx * ny - nw * nz)
    x[X_R + 2] = 2.0 * (nx * nz + nw * ny)
    x[X_R + 3] = 2.0 * (nx * ny + nw * nz)
    x[X_R + 4] = 1.0 - 2.0 * (nx * nx + nz * nz)
    x[X_R + 5] = 2.0 * (ny * nz - nw * nx)
    x[X_R + 6] = 2.0 * (nx * nz - nw * ny)
    x[X_R + 7] = 2.0 * (ny * nz + nw * nx)
    x[X_R + 8] = 1.0 - 2.0 * (nx * nx + ny * ny)


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


def predict_velocity(x: list[float], g: Sequence[float], z: Sequence[float]) -> None:
    """Velocity over one step, levels, start-up, and the switch between kinds of velocity.

    Source: docs/filter.md Eq. (5), (8), (13).
    """
    dt = z[Z_DT]
    fx = z[Z_FORCE] / g[G_GRAVITY]
    fy = z[Z_FORCE + 1] / g[G_GRAVITY]
    fz = z[Z_FORCE + 2] / g[G_GRAVITY]
    north = dt * (x[X_R] * fx + x[X_R + 1] * fy + x[X_R + 2] * fz)
    east = dt * (x[X_R + 3] * fx + x[X_R + 4] * fy + x[X_R + 5] * fz)
    if z[Z_AIDED] != x[X_AIDED]:
        # The velocity before and the one after have nothing to do with each other.
        for i in range(8):
            x[X_VN + i] = 0.0
        x[X_UN + 3] = 0.0
        x[X_UE + 3] = 0.0
        x[X_S] = z[Z_NOSE] * x[X_R] / g[G_GRAVITY]
        x[X_S + 1] = z[Z_NOSE] * x[X_R + 3] / g[G_GRAVITY]
        x[X_C] = 0.0
        x[X_C + 1] = 0.0
        x[X_MISSES] = MOST_MISSES
        x[X_DENIED] = 0.0
        x[X_AIDED] = z[Z_AIDED]
    if z[Z_AIDED] > 0.0:
        # Only a measured velocity tells the heading: a bounded one is bounded in any direction.
        x[X_VN + 3] = x[X_VN + 3] - east
        x[X_VE + 3] = x[X_VE + 3] + north
        x[X_C] = x[X_C] + north
        x[X_C + 1] = x[X_C + 1] + east
    x[X_S] = x[X_S] + north
    x[X_S + 1] = x[X_S + 1] + east
    wx = z[Z_RATE] - x[X_BIAS]
    wy = z[Z_RATE + 1] - x[X_BIAS + 1]
    wz = z[Z_RATE + 2] - x[X_BIAS + 2]
    x[X_T_RUN] = x[X_T_RUN] + dt
    # The first tilt error is none of the bias: the second stage listens once it has passed.
    ease = g[G_T_EASE] / x[X_T_RUN]
    ease = ease * ease
    x[X_EASE] = 1.0 + ease * ease
    time = g[G_T_LEVEL]
    if x[X_T_RUN] < time:
        time = x[X_T_RUN]
    share = dt / time
    x[X_TURNING] = x[X_TURNING] + share * (wx * wx + wy * wy + wz * wz - x[X_TURNING])


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


def turn(x: list[float], a: float, b: float, c: float) -> None:
    """Turns the attitude in NED by the vector whose half is given: q <- Exp(2 (a, b, c)) q.

    Exact for every angle but for the length of q, which is made 1 again: large turns shrink, and
    pi becomes a limit instead of a wrap. Source: docs/filter.md Eq. (19).
    """
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    s = 1.0 / math.sqrt(1.0 + a * a + b * b + c * c)
    x[X_Q] = s * (qw - a * qx - b * qy - c * qz)
    x[X_Q + 1] = s * (qx + a * qw + b * qz - c * qy)
    x[X_Q + 2] = s * (qy + b * qw + c * qx - a * qz)
    x[X_Q + 3] = s * (qz + c * qw + a * qy - b * qx)


def restart_tilt(x: list[float], g: Sequence[float], nose: float) -> None:
    """The velocity is impossible, so the tilt was wrong: find it anew, keep bias and heading.

    Source: docs/filter.md Eq. (14).
    """
    for i in range(16):
        x[X_UN + i] = 0.0
    x[X_S] = nose * x[X_R]
    x[X_S + 1] = nose * x[X_R + 3]
    for i in range(5):
        x[X_TURNING + i] = 0.0
    x[X_T_RUN] = 0.0
    x[X_MISSES] = MOST_MISSES
    x[X_DENIED] = 0.0
    x[X_T_STEADY] = 0.0


def doubt_rate(x: list[float], z: Sequence[float]) -> None:
    """A clipped rate is doubted by as much as it differs from the rates before it.

    Source: docs/filter.md Eq. (30).
    """
    square = 0.0
    for i in range(3):
        d = z[Z_RATE + i] - x[X_RATE_LP + i]
        square = square + d * d
    lost = z[Z_DT] * math.sqrt(square)
    x[X_LOST] = x[X_LOST] + lost
    doubt_tilt(x, x[X_DOUBT] + lost)
    # The heading has been turned as well as the tilt; `limit` keeps it where theta is linear.
    x[X_P + 9] = x[X_P + 9] + lost * (2.0 * x[X_LOST] - lost)


def doubt_tilt(x: list[float], angle: float) -> None:
    """The tilt is known no better than this, rad."""
    if angle > MOST_DOUBT:
        angle = MOST_DOUBT
    if angle > x[X_DOUBT]:
        x[X_DOUBT] = angle


def check_level(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes the tilt from a force of size g that contradicts it, once something else does too.

    Source: docs/filter.md Eq. (31), (32).
    """
    cosine = AIR_COSINE
    if x[X_DENIED] > 0.0:
        x[X_DENIED] = 0.0
    elif x[X_T_STEADY] < g[G_T_REST]:
        return 0
    elif z[Z_REST] == 2.0:
        cosine = GROUND_COSINE
    fx = x[X_FORCE_LP]
    fy = x[X_FORCE_LP + 1]
    fz = x[X_FORCE_LP + 2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    ratio = norm / g[G_GRAVITY]
    down = x[X_R + 6] * fx + x[X_R + 7] * fy + x[X_R + 8] * fz
    if math.fabs(ratio * ratio - 1.0) > LEVEL_SIZE or -down > cosine * norm:
        return 0
    level(x, fx, fy, fz, norm)
    restart_tilt(x, g, z[Z_NOSE] / g[G_GRAVITY])
    x[X_DOUBT] = LEVEL_DOUBT
    return RESTARTED


def begin_anew(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Starts the tilt again after clipped samples that may have hidden a turn.

    Source: docs/filter.md Eq. (30).
    """
    fx = z[Z_FORCE]
    fy = z[Z_FORCE + 1]
    fz = z[Z_FORCE + 2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if x[X_LOST] > ALL_LOST and norm > 0.0:
        level(x, fx, fy, fz, norm)
    restart_tilt(x, g, z[Z_NOSE] / g[G_GRAVITY])
    return RESTARTED


def level(x: list[float], fx: float, fy: float, fz: float, norm: float) -> None:
    """Turns the attitude so that a force, of size norm, points up; the heading is asked anew.

    Source: docs/filter.md Eq. (32).
    """
    # The smallest turn that does it: half its tangent along its axis.
    scale = norm - (x[X_R + 6] * fx + x[X_R + 7] * fy + x[X_R + 8] * fz)
    north = x[X_R] * fx + x[X_R + 1] * fy + x[X_R + 2] * fz
    east = x[X_R + 3] * fx + x[X_R + 4] * fy + x[X_R + 5] * fz
    if scale < 0.001 * norm:
        # Upside down: about any horizontal axis.
        scale = 0.001 * norm
        north = norm
    turn(x, -east / scale, north / scale, 0.0)
    set_matrix(x, x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3])
    # The field was seen through the wrong tilt: the next gives the heading, as at the start.
    x[X_T_NO_FIELD] = HEADING_LOST


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


def use_field(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Heading, and theta through it, from a new field.

    Source: docs/filter.md Eq. (21) - (26).
    """
    new = 0.0
    for i in range(3):
        if z[Z_FIELD + i] != x[X_FIELD + i]:
            new = 1.0
        x[X_FIELD + i] = z[Z_FIELD + i]
    if new == 0.0:
        # Held by the sensor's driver: it was used when it was new.
        return 0
    age = x[X_FIELD_AGE]
    x[X_FIELD_AGE] = 0.0
    if age > OLDEST_FIELD:
        age = OLDEST_FIELD
    lag = rotate_field(x, g, z)
    north = x[X_M]
    east = x[X_M + 1]
    down = x[X_M + 2]
    flat = math.sqrt(north * north + east * east)
    norm = math.sqrt(flat * flat + down * down)
    if norm == 0.0:
        return 0
    dip = math.atan2(down, flat)
    if x[X_REF_NORM] == 0.0:
        x[X_REF_NORM] = norm
        x[X_REF_DIP] = dip
    lost = x[X_T_NO_FIELD]
    if lost > HEADING_LOST:
        if not_believed(x, g, norm, dip, age) > 0.0:
            return 0
        learn_field(x, g, norm, dip, flat, age, lag)
    innovation = x[X_DECLINATION] - math.atan2(east, north)
    if innovation > math.pi:
        innovation = innovation - 2.0 * math.pi
    if innovation < -math.pi:
        innovation = innovation + 2.0 * math.pi
    x[X_INNOVATION + 2] = innovation
    x[X_T_NO_FIELD] = 0.0
    if lost < 0.0:
        turn_heading(x, g, innovation)
        return FIELD_USED
    # Only the disturbance in the heading counts; norm and dip show the other two components.
    noise = g[G_FIELD] + g[G_FIELD_CORRELATION] * x[X_MAGNETIC]
    measure_heading(x, g, innovation, noise, age)
    return FIELD_USED


def rotate_field(x: list[float], g: Sequence[float], z: Sequence[float]) -> float:
    """The field in NED, its latency undone, into X_M; its change per second of latency into X_D.

    Returns the latency, s. Source: docs/filter.md Eq. (21).
    """
    wx = z[Z_RATE] - x[X_BIAS]
    wy = z[Z_RATE + 1] - x[X_BIAS + 1]
    wz = z[Z_RATE + 2] - x[X_BIAS + 2]
    mx = z[Z_FIELD]
    my = z[Z_FIELD + 1]
    mz = z[Z_FIELD + 2]
    # What the rotation since the sample was taken has done to it.
    lx = wy * mz - wz * my
    ly = wz * mx - wx * mz
    lz = wx * my - wy * mx
    lag = x[X_LAG_NUM] / (x[X_LAG_DEN] + g[G_LAG_PRIOR])
    if lag < 0.0:
        lag = 0.0
    if lag > g[G_LAG_MOST]:
        lag = g[G_LAG_MOST]
    for i in range(3):
        a = x[X_R + 3 * i]
        b = x[X_R + 3 * i + 1]
        c = x[X_R + 3 * i + 2]
        x[X_D + i] = a * lx + b * ly + c * lz
        x[X_M + i] = a * mx + b * my + c * mz - lag * x[X_D + i]
    return lag


def not_believed(x: list[float], g: Sequence[float], norm: float, dip: float, age: float) -> float:
    """1 while the field contradicts its reference; a steady new field becomes the reference.

    Source: docs/filter.md Eq. (22), (26).
    """
    if (
        math.fabs(norm - x[X_REF_NORM]) < g[G_NORM_GATE] * x[X_REF_NORM]
        and math.fabs(dip - x[X_REF_DIP]) < g[G_DIP_GATE]
    ):
        x[X_NEW_T] = 0.0
        return 0.0
    if (
        x[X_NEW_T] > 0.0
        and math.fabs(norm - x[X_NEW_NORM]) < 0.5 * g[G_NORM_GATE] * x[X_NEW_NORM]
        and math.fabs(dip - x[X_NEW_DIP]) < 0.5 * g[G_DIP_GATE]
    ):
        share = age / (x[X_NEW_T] + age)
        x[X_NEW_T] = x[X_NEW_T] + age
        x[X_NEW_TURN] = x[X_NEW_TURN] + age * math.sqrt(x[X_TURNING])
        x[X_NEW_NORM] = x[X_NEW_NORM] + share * (norm - x[X_NEW_NORM])
        x[X_NEW_DIP] = x[X_NEW_DIP] + share * (dip - x[X_NEW_DIP])
    else:
        x[X_NEW_T] = age
        x[X_NEW_TURN] = 0.0
        x[X_NEW_NORM] = norm
        x[X_NEW_DIP] = dip
    if x[X_NEW_T] < g[G_T_NEW] or x[X_NEW_TURN] < g[G_NEW_TURN]:
        return 1.0
    x[X_REF_NORM] = x[X_NEW_NORM]
    x[X_REF_DIP] = x[X_NEW_DIP]
    x[X_REF_GIVEN] = 0.0
    x[X_NEW_T] = 0.0
    x[X_LAG_NUM] = 0.0
    x[X_LAG_DEN] = 0.0
    x[X_P + 3] = 0.0
    x[X_P + 6] = 0.0
    x[X_P + 8] = 0.0
    x[X_P + 9] = g[G_HEADING_VAR]
    return 0.0


def learn_field(
    x: list[float],
    g: Sequence[float],
    norm: float,
    dip: float,
    flat: float,
    age: float,
    lag: float,
) -> None:
    """Latency, level of disturbance and reference from a field that is believed.

    Source: docs/filter.md Eq. (21), (23), (24).
    """
    reference = x[X_REF_NORM]
    more_norm = (norm - reference) / reference
    more_dip = dip - x[X_REF_DIP]
    # Vertical and horizontal size do not depend on the heading; flat > 0 inside the dip gate.
    down_rate = x[X_D + 2]
    flat_rate = (x[X_M] * x[X_D] + x[X_M + 1] * x[X_D + 1]) / (flat + 0.001 * norm)
    down = x[X_M + 2] + lag * down_rate - reference * math.sin(x[X_REF_DIP])
    level = flat + lag * flat_rate - reference * math.cos(x[X_REF_DIP])
    weight = age / (reference * reference)
    x[X_LAG_NUM] = x[X_LAG_NUM] + weight * (down * down_rate + level * flat_rate)
    x[X_LAG_DEN] = x[X_LAG_DEN] + weight * (down_rate * down_rate + flat_rate * flat_rate)
    cosine = flat / norm
    shown = 0.5 * (more_norm * more_norm + more_dip * more_dip) / (cosine * cosine + 0.01)
    share = age / (g[G_T_LEVEL] + age)
    x[X_MAGNETIC] = x[X_MAGNETIC] + share * (shown - x[X_MAGNETIC])
    if x[X_REF_GIVEN] == 0.0:
        share = age / (g[G_T_REFERENCE] + age)
        x[X_REF_NORM] = reference + share * (norm - reference)
        x[X_REF_DIP] = x[X_REF_DIP] + share * more_dip


def measure_heading(
    x: list[float], g: Sequence[float], innovation: float, density: float, age: float
) -> None:
    """Theta from a heading that is seen through the tilt error.

    Source: docs/filter.md Eq. (25).
    """
    # A tilt about magnetic north turns the dipping field sideways; theta's part of it is known.
    slope = math.tan(x[X_REF_DIP])
    north = slope * math.sin(x[X_DECLINATION])
    east = -slope * math.cos(x[X_DECLINATION])
    for i in range(4):
        x[X_ROW + i] = north * x[X_UN + i] + east * x[X_UE + i]
        x[X_D + i] = 0.0
    x[X_ROW + 3] = x[X_ROW + 3] + 1.0
    tilt = math.sqrt((g[G_GYRO] + g[G_SCALE] * x[X_TURNING]) * x[X_NV2])
    noise = x[X_EASE] * (density + 2.0 * slope * slope * tilt) / age
    measure_theta(x, X_ROW, innovation, noise)
    apply_theta(x, 0.0, 0.0)


def turn_heading(x: list[float], g: Sequence[float], angle: float) -> None:
    """Takes a heading that nothing was known of from the field alone."""
    c = math.cos(0.5 * angle)
    s = math.sin(0.5 * angle)
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    x[X_Q] = c * qw - s * qz
    x[X_Q + 1] = c * qx - s * qy
    x[X_Q + 2] = c * qy + s * qx
    x[X_Q + 3] = c * qz + s * qw
    # Velocity and sensitivities were in the frame that has turned.
    for i in range(16):
        x[X_UN + i] = 0.0
    x[X_S] = 0.0
    x[X_S + 1] = 0.0
    x[X_MISSES] = MOST_MISSES
    x[X_P + 3] = 0.0
    x[X_P + 6] = 0.0
    x[X_P + 8] = 0.0
    x[X_P + 9] = g[G_HEADING_VAR]


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
