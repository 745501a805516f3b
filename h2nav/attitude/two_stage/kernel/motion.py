"""Propagation of the two-stage filter, and the measured vectors in its frame.

Equations: docs/derivation.md section 3.
"""

import math

from ..memory import Gains, Sample, State

# Variances of the tilt, rad^2: (1.2 deg)^2 opens the gates again.
OPEN_VARIANCE = 4e-4


def propagate(s: State, g: Gains, sample: Sample) -> None:
    """Attitude, regressor and bias covariance over one step; the matrix of the attitude too.

    Source: docs/derivation.md Eq. (3.8), (3.9).
    """
    dt = sample.dt_s
    # The part of the step that the new sample does not cover is bridged by the average of both.
    share = 0.5
    if g.gyro_is_mean > 0.0:
        share = 0.0
        if dt > 1.5 * g.dt_s:
            share = 0.5 * (1.0 - g.dt_s / dt)
    phi_x = dt * (sample.gyro[0] + share * (s.gyro_last[0] - sample.gyro[0]) - s.gyro_bias[0])
    phi_y = dt * (sample.gyro[1] + share * (s.gyro_last[1] - sample.gyro[1]) - s.gyro_bias[1])
    phi_z = dt * (sample.gyro[2] + share * (s.gyro_last[2] - sample.gyro[2]) - s.gyro_bias[2])
    for i in range(3):
        s.gyro_last[i] = sample.gyro[i]
    turn_body(s, phi_x, phi_y, phi_z)
    for i in range(9):
        s.regressor[i] += dt * s.r_nb[i]
    if s.mag_accepted_age_s > g.heading_lost_s:
        s.heading_referenced = 0.0
    if s.heading_referenced < 1.0:
        # Nothing will ever compare this heading with another: its sensitivity has no use.
        for i in range(3):
            s.regressor[6 + i] = 0.0
    s.p_xx += g.bias_walk * dt
    s.p_yy += g.bias_walk * dt
    s.p_zz += g.bias_walk * dt
    s.variance_n += g.gyro_noise * dt
    s.variance_e += g.gyro_noise * dt
    s.variance_d += g.gyro_noise * dt
    s.age_s += dt
    s.mag_accepted_age_s += dt
    s.mag_age_s += dt
    s.doubt_s -= dt


def pass_clipped(s: State, sample: Sample) -> None:
    """A sample whose true rate is unknown: nothing is learnt, and the attitude gets uncertain.

    A rate that is wrong by its own size for T leaves an error of rate T.

    Source: docs/derivation.md Eq. (3.21).
    """
    for i in range(9):
        # What the rate does to the attitude must not be booked as bias.
        s.regressor[i] = 0.0
    rate_2 = (
        sample.gyro[0] * sample.gyro[0]
        + sample.gyro[1] * sample.gyro[1]
        + sample.gyro[2] * sample.gyro[2]
    )
    growth = rate_2 * sample.dt_s * (2.0 * s.clipped_s + sample.dt_s)
    s.clipped_s += sample.dt_s
    s.variance_n += growth
    s.variance_e += growth
    s.variance_d += growth
    if s.variance_n > OPEN_VARIANCE:
        s.converged = 0.0
        s.age_s = 0.0


def turn_body(s: State, phi_x: float, phi_y: float, phi_z: float) -> None:
    """Turns the attitude about body axes: q <- q Exp(phi); its matrix too.

    Source: docs/derivation.md Eq. (1.3), (1.4).
    """
    half = 0.5 * math.sqrt(phi_x * phi_x + phi_y * phi_y + phi_z * phi_z)
    c = math.cos(half)
    k = 0.5
    if half > 1e-8:
        k = 0.5 * math.sin(half) / half
    px = k * phi_x
    py = k * phi_y
    pz = k * phi_z
    qw = s.q_nb[0]
    qx = s.q_nb[1]
    qy = s.q_nb[2]
    qz = s.q_nb[3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + pz * qy - py * qz
    uy = c * qy + py * qw + px * qz - pz * qx
    uz = c * qz + pz * qw + py * qx - px * qy
    s.q_nb[0] = w
    s.q_nb[1] = ux
    s.q_nb[2] = uy
    s.q_nb[3] = uz
    s.r_nb[0] = 1.0 - 2.0 * (uy * uy + uz * uz)
    s.r_nb[1] = 2.0 * (ux * uy - w * uz)
    s.r_nb[2] = 2.0 * (ux * uz + w * uy)
    s.r_nb[3] = 2.0 * (ux * uy + w * uz)
    s.r_nb[4] = 1.0 - 2.0 * (ux * ux + uz * uz)
    s.r_nb[5] = 2.0 * (uy * uz - w * ux)
    s.r_nb[6] = 2.0 * (ux * uz - w * uy)
    s.r_nb[7] = 2.0 * (uy * uz + w * ux)
    s.r_nb[8] = 1.0 - 2.0 * (ux * ux + uy * uy)


def turn_world(s: State, eps_n: float, eps_e: float, eps_d: float) -> None:
    """Turns the attitude about NED axes, q <- Exp(eps) q, and restores its length.

    Source: docs/derivation.md Eq. (1.4), (3.13).
    """
    half = 0.5 * math.sqrt(eps_n * eps_n + eps_e * eps_e + eps_d * eps_d)
    c = math.cos(half)
    k = 0.5
    if half > 1e-8:
        k = 0.5 * math.sin(half) / half
    px = k * eps_n
    py = k * eps_e
    pz = k * eps_d
    qw = s.q_nb[0]
    qx = s.q_nb[1]
    qy = s.q_nb[2]
    qz = s.q_nb[3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + py * qz - pz * qy
    uy = c * qy + py * qw + pz * qx - px * qz
    uz = c * qz + pz * qw + px * qy - py * qx
    # One Newton step for 1 / sqrt: the length never strays further than rounding.
    scale = 1.5 - 0.5 * (w * w + ux * ux + uy * uy + uz * uz)
    s.q_nb[0] = scale * w
    s.q_nb[1] = scale * ux
    s.q_nb[2] = scale * uy
    s.q_nb[3] = scale * uz


def measure(s: State, g: Gains, sample: Sample) -> None:
    """The measured vectors in NED: gravity = R y_a with y_a = -f_b, field = R y_m."""
    ax = -sample.accel[0]
    ay = -sample.accel[1]
    az = -sample.accel[2]
    s.gravity_ned[0] = s.r_nb[0] * ax + s.r_nb[1] * ay + s.r_nb[2] * az
    s.gravity_ned[1] = s.r_nb[3] * ax + s.r_nb[4] * ay + s.r_nb[5] * az
    s.gravity_ned[2] = s.r_nb[6] * ax + s.r_nb[7] * ay + s.r_nb[8] * az
    if sample.has_mag > 0.0:
        mx = sample.mag[0]
        my = sample.mag[1]
        mz = sample.mag[2]
        s.mag_ned[0] = s.r_nb[0] * mx + s.r_nb[1] * my + s.r_nb[2] * mz
        s.mag_ned[1] = s.r_nb[3] * mx + s.r_nb[4] * my + s.r_nb[5] * mz
        s.mag_ned[2] = s.r_nb[6] * mx + s.r_nb[7] * my + s.r_nb[8] * mz
        off_n = s.mag_ned[0] - g.mag_n
        off_d = s.mag_ned[2] - g.mag_d
        s.mag_error = math.sqrt(off_n * off_n + s.mag_ned[1] * s.mag_ned[1] + off_d * off_d)
