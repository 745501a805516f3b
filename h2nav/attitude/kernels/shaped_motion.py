"""Prediction of the default filter's attitude and velocity, and turns of the attitude.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    G_GRAVITY,
    G_T_EASE,
    G_T_LEVEL,
    MOST_MISSES,
    X_AIDED,
    X_BIAS,
    X_C,
    X_DENIED,
    X_EASE,
    X_MISSES,
    X_Q,
    X_R,
    X_S,
    X_T_RUN,
    X_TURNING,
    X_UE,
    X_UN,
    X_VE,
    X_VN,
    Z_AIDED,
    Z_DT,
    Z_FORCE,
    Z_NOSE,
    Z_RATE,
)


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
