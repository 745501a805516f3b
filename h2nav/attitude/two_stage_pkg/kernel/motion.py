"""Propagation of the two-stage filter, and the measured vectors in its frame.

Arrays as in `two_stage_layout`; equations: docs/derivation.md section 3.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.two_stage_layout import (
    G_BIAS_WALK,
    G_DT,
    G_FIELD_D,
    G_FIELD_N,
    G_GYRO_WALK,
    G_MEAN_RATE,
    G_T_HEADING_LOST,
    OPEN_VARIANCE,
    X_BIAS,
    X_CONVERGED,
    X_F,
    X_HEADING,
    X_M,
    X_OFF,
    X_P,
    X_Q,
    X_R,
    X_RATE,
    X_T_CLIPPED,
    X_T_DOUBT,
    X_T_FIELD_AGE,
    X_T_NO_FIELD,
    X_T_RUN,
    X_U,
    X_VAR,
    Z_DT,
    Z_FIELD,
    Z_FORCE,
    Z_HAS_FIELD,
    Z_RATE,
)


def propagate(x: list[float], g: Sequence[float], z: Sequence[float]) -> None:
    """Attitude, regressor and bias covariance over one step; the attitude matrix into X_R.

    Source: docs/derivation.md Eq. (3.8), (3.9).
    """
    dt = z[Z_DT]
    # The part of the step that the new sample does not cover is bridged by the average of both.
    share = 0.5
    if g[G_MEAN_RATE] > 0.0:
        share = 0.0
        if dt > 1.5 * g[G_DT]:
            share = 0.5 * (1.0 - g[G_DT] / dt)
    phi_x = dt * (z[Z_RATE] + share * (x[X_RATE] - z[Z_RATE]) - x[X_BIAS])
    phi_y = dt * (z[Z_RATE + 1] + share * (x[X_RATE + 1] - z[Z_RATE + 1]) - x[X_BIAS + 1])
    phi_z = dt * (z[Z_RATE + 2] + share * (x[X_RATE + 2] - z[Z_RATE + 2]) - x[X_BIAS + 2])
    for i in range(3):
        x[X_RATE + i] = z[Z_RATE + i]
    turn_body(x, phi_x, phi_y, phi_z)
    for i in range(9):
        x[X_U + i] += dt * x[X_R + i]
    if x[X_T_NO_FIELD] > g[G_T_HEADING_LOST]:
        x[X_HEADING] = 0.0
    if x[X_HEADING] < 1.0:
        # Nothing will ever compare this heading with another: its sensitivity has no use.
        for i in range(3):
            x[X_U + 6 + i] = 0.0
    x[X_P] += g[G_BIAS_WALK] * dt
    x[X_P + 3] += g[G_BIAS_WALK] * dt
    x[X_P + 5] += g[G_BIAS_WALK] * dt
    for i in range(3):
        x[X_VAR + i] += g[G_GYRO_WALK] * dt
    x[X_T_RUN] += dt
    x[X_T_NO_FIELD] += dt
    x[X_T_FIELD_AGE] += dt
    x[X_T_DOUBT] -= dt


def pass_clipped(x: list[float], z: Sequence[float]) -> None:
    """A sample whose true rate is unknown: nothing is learnt, and the attitude gets uncertain.

    A rate that is wrong by its own size for T leaves an error of rate T.

    Source: docs/derivation.md Eq. (3.21).
    """
    for i in range(9):
        # What the rate does to the attitude must not be booked as bias.
        x[X_U + i] = 0.0
    rate_2 = z[Z_RATE] * z[Z_RATE] + z[Z_RATE + 1] * z[Z_RATE + 1] + z[Z_RATE + 2] * z[Z_RATE + 2]
    growth = rate_2 * z[Z_DT] * (2.0 * x[X_T_CLIPPED] + z[Z_DT])
    x[X_T_CLIPPED] += z[Z_DT]
    for i in range(3):
        x[X_VAR + i] += growth
    if x[X_VAR] > OPEN_VARIANCE:
        x[X_CONVERGED] = 0.0
        x[X_T_RUN] = 0.0


def turn_body(x: list[float], phi_x: float, phi_y: float, phi_z: float) -> None:
    """Turns the attitude about body axes: q <- q Exp(phi); its matrix into X_R.

    Source: docs/derivation.md Eq. (1.3), (1.4).
    """
    half = 0.5 * math.sqrt(phi_x * phi_x + phi_y * phi_y + phi_z * phi_z)
    c = math.cos(half)
    s = 0.5
    if half > 1e-8:
        s = 0.5 * math.sin(half) / half
    px = s * phi_x
    py = s * phi_y
    pz = s * phi_z
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + pz * qy - py * qz
    uy = c * qy + py * qw + px * qz - pz * qx
    uz = c * qz + pz * qw + py * qx - px * qy
    x[X_Q] = w
    x[X_Q + 1] = ux
    x[X_Q + 2] = uy
    x[X_Q + 3] = uz
    x[X_R] = 1.0 - 2.0 * (uy * uy + uz * uz)
    x[X_R + 1] = 2.0 * (ux * uy - w * uz)
    x[X_R + 2] = 2.0 * (ux * uz + w * uy)
    x[X_R + 3] = 2.0 * (ux * uy + w * uz)
    x[X_R + 4] = 1.0 - 2.0 * (ux * ux + uz * uz)
    x[X_R + 5] = 2.0 * (uy * uz - w * ux)
    x[X_R + 6] = 2.0 * (ux * uz - w * uy)
    x[X_R + 7] = 2.0 * (uy * uz + w * ux)
    x[X_R + 8] = 1.0 - 2.0 * (ux * ux + uy * uy)


def turn_world(x: list[float], eps_n: float, eps_e: float, eps_d: float) -> None:
    """Turns the attitude about NED axes, q <- Exp(eps) q, and restores its length.

    Source: docs/derivation.md Eq. (1.4), (3.13).
    """
    half = 0.5 * math.sqrt(eps_n * eps_n + eps_e * eps_e + eps_d * eps_d)
    c = math.cos(half)
    s = 0.5
    if half > 1e-8:
        s = 0.5 * math.sin(half) / half
    px = s * eps_n
    py = s * eps_e
    pz = s * eps_d
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + py * qz - pz * qy
    uy = c * qy + py * qw + pz * qx - px * qz
    uz = c * qz + pz * qw + px * qy - py * qx
    # One Newton step for 1 / sqrt: the length never strays further than rounding.
    scale = 1.5 - 0.5 * (w * w + ux * ux + uy * uy + uz * uz)
    x[X_Q] = scale * w
    x[X_Q + 1] = scale * ux
    x[X_Q + 2] = scale * uy
    x[X_Q + 3] = scale * uz


def measure(x: list[float], g: Sequence[float], z: Sequence[float]) -> None:
    """The measured vectors in NED: X_F = R y_a with y_a = -f_b, X_M = R y_m; X_OFF of X_M."""
    ax = -z[Z_FORCE]
    ay = -z[Z_FORCE + 1]
    az = -z[Z_FORCE + 2]
    x[X_F] = x[X_R] * ax + x[X_R + 1] * ay + x[X_R + 2] * az
    x[X_F + 1] = x[X_R + 3] * ax + x[X_R + 4] * ay + x[X_R + 5] * az
    x[X_F + 2] = x[X_R + 6] * ax + x[X_R + 7] * ay + x[X_R + 8] * az
    if z[Z_HAS_FIELD] > 0.0:
        mx = z[Z_FIELD]
        my = z[Z_FIELD + 1]
        mz = z[Z_FIELD + 2]
        x[X_M] = x[X_R] * mx + x[X_R + 1] * my + x[X_R + 2] * mz
        x[X_M + 1] = x[X_R + 3] * mx + x[X_R + 4] * my + x[X_R + 5] * mz
        x[X_M + 2] = x[X_R + 6] * mx + x[X_R + 7] * my + x[X_R + 8] * mz
        off_n = x[X_M] - g[G_FIELD_N]
        off_d = x[X_M + 2] - g[G_FIELD_D]
        x[X_OFF] = math.sqrt(off_n * off_n + x[X_M + 1] * x[X_M + 1] + off_d * off_d)
