"""Second stage of the velocity-aided filter: theta = (bias error 3, heading error).

Equations: docs/filter.md.
"""

import math

from ..memory import SATURATED, Gains, State, Workspace
from .prediction import turn

SETTLED = 30.0  # s: ten times the start-up time, and six of the slowest mean of the innovation
MOVING_TIME = 20.0  # s: the corrections of a bias that moves add up over this time
# Fastest warm-up of a MEMS gyro, 0.5 deg/s per minute, over that time: (rad/s^2)^2 s.
MAX_WALK = (0.5 / 60.0 * (math.pi / 180.0)) * (0.5 / 60.0 * (math.pi / 180.0)) * MOVING_TIME


def predict_theta(s: State, w: Workspace, g: Gains, dt: float) -> None:
    """Propagates the covariance of theta and the sensitivities over one step.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    dx = dt * w.r_nb[6]
    dy = dt * w.r_nb[7]
    dz = dt * w.r_nb[8]
    p00 = s.p_xx
    p01 = s.p_xy
    p02 = s.p_xz
    p03 = s.p_xh
    p11 = s.p_yy
    p12 = s.p_yz
    p13 = s.p_yh
    p22 = s.p_zz
    p23 = s.p_zh
    c0 = p00 * dx + p01 * dy + p02 * dz
    c1 = p01 * dx + p11 * dy + p12 * dz
    c2 = p02 * dx + p12 * dy + p22 * dz
    turn_noise = dt * (
        g.gyro_noise + g.jitter_share * s.gyro_jitter + g.heading_scale_noise * s.turning
    )
    both = (c0 - 2.0 * p03) * dx + (c1 - 2.0 * p13) * dy + (c2 - 2.0 * p23) * dz
    s.p_xh = p03 - c0
    s.p_yh = p13 - c1
    s.p_zh = p23 - c2
    s.heading_variance = s.heading_variance + both + turn_noise
    walk = g.bias_walk * dt
    if p00 < g.bias_variance:
        s.p_xx = p00 + walk + s.bias_walk[0] * dt
    if p11 < g.bias_variance:
        s.p_yy = p11 + walk + s.bias_walk[1] * dt
    if p22 < g.bias_variance:
        s.p_zz = p22 + walk + s.bias_walk[2] * dt
    # The heading error grows with the bias error; the sensitivities refer to its present value.
    v = s.dvelocity_n[3]
    s.dvelocity_n[0] = s.dvelocity_n[0] + dt * s.dtilt_n[0] + dx * v
    s.dvelocity_n[1] = s.dvelocity_n[1] + dt * s.dtilt_n[1] + dy * v
    s.dvelocity_n[2] = s.dvelocity_n[2] + dt * s.dtilt_n[2] + dz * v
    s.dvelocity_n[3] = v + dt * s.dtilt_n[3]
    v = s.dvelocity_e[3]
    s.dvelocity_e[0] = s.dvelocity_e[0] + dt * s.dtilt_e[0] + dx * v
    s.dvelocity_e[1] = s.dvelocity_e[1] + dt * s.dtilt_e[1] + dy * v
    s.dvelocity_e[2] = s.dvelocity_e[2] + dt * s.dtilt_e[2] + dz * v
    s.dvelocity_e[3] = v + dt * s.dtilt_e[3]
    u = s.dtilt_n[3]
    s.dtilt_n[0] = s.dtilt_n[0] + dt * w.r_nb[3] + dx * u
    s.dtilt_n[1] = s.dtilt_n[1] + dt * w.r_nb[4] + dy * u
    s.dtilt_n[2] = s.dtilt_n[2] + dt * w.r_nb[5] + dz * u
    u = s.dtilt_e[3]
    s.dtilt_e[0] = s.dtilt_e[0] - dt * w.r_nb[0] + dx * u
    s.dtilt_e[1] = s.dtilt_e[1] - dt * w.r_nb[1] + dy * u
    s.dtilt_e[2] = s.dtilt_e[2] - dt * w.r_nb[2] + dz * u


def times_covariance(s: State, row: list[float], product: list[float]) -> None:
    """Writes row . P, where P is the covariance of theta."""
    a0 = row[0]
    a1 = row[1]
    a2 = row[2]
    a3 = row[3]
    product[0] = s.p_xx * a0 + s.p_xy * a1 + s.p_xz * a2 + s.p_xh * a3
    product[1] = s.p_xy * a0 + s.p_yy * a1 + s.p_yz * a2 + s.p_yh * a3
    product[2] = s.p_xz * a0 + s.p_yz * a1 + s.p_zz * a2 + s.p_zh * a3
    product[3] = s.p_xh * a0 + s.p_yh * a1 + s.p_zh * a2 + s.heading_variance * a3


def measure_theta(
    s: State, w: Workspace, row: list[float], innovation: float, noise: float
) -> None:
    """Takes one scalar measurement row . theta; adds to the correction in dtheta.

    Source: docs/filter.md Eq. (18).
    """
    h = [0.0, 0.0, 0.0, 0.0]
    times_covariance(s, row, h)
    variance = 0.0
    left = innovation
    for i in range(4):
        variance = variance + row[i] * h[i]
        left = left - row[i] * w.dtheta[i]
    scale = 1.0 / (variance + noise)
    e = scale * left
    for i in range(4):
        w.dtheta[i] = w.dtheta[i] + h[i] * e
    shrink(s, h[0], h[1], h[2], h[3], scale)


def measure_level(
    s: State, w: Workspace, row: list[float], innovation: float, noise: float
) -> None:
    """The same without a heading reference: vertical bias and heading only add uncertainty.

    Source: docs/filter.md Eq. (39), (58).
    """
    h = [0.0, 0.0, 0.0, 0.0]
    times_covariance(s, row, h)
    variance = 0.0
    for i in range(4):
        variance = variance + row[i] * h[i]
    scale = 1.0 / (variance + noise)
    left = innovation
    for i in range(3):
        left = left - row[i] * w.dtheta[i]
    e = scale * left
    vertical = w.r_nb[6] * h[0] + w.r_nb[7] * h[1] + w.r_nb[8] * h[2]
    v = [vertical * w.r_nb[6], vertical * w.r_nb[7], vertical * w.r_nb[8], h[3]]
    for i in range(3):
        w.dtheta[i] = w.dtheta[i] + (h[i] - v[i]) * e
    shrink(s, h[0], h[1], h[2], h[3], scale)
    shrink(s, v[0], v[1], v[2], v[3], -scale)


def shrink(s: State, h0: float, h1: float, h2: float, h3: float, scale: float) -> None:
    """P -= scale h h^T."""
    k = scale * h0
    s.p_xx = s.p_xx - k * h0
    s.p_xy = s.p_xy - k * h1
    s.p_xz = s.p_xz - k * h2
    s.p_xh = s.p_xh - k * h3
    k = scale * h1
    s.p_yy = s.p_yy - k * h1
    s.p_yz = s.p_yz - k * h2
    s.p_yh = s.p_yh - k * h3
    k = scale * h2
    s.p_zz = s.p_zz - k * h2
    s.p_zh = s.p_zh - k * h3
    s.heading_variance = s.heading_variance - scale * h3 * h3


def follow_bias(s: State, w: Workspace, before_x: float, before_y: float, before_z: float) -> None:
    """Notes a correction of the bias, and how large it was expected to be.

    Args:
        s: state.
        w: workspace.
        before_x: variance of the bias x before the measurement.
        before_y: the same of y.
        before_z: the same of z.

    Source: docs/filter.md Eq. (74).
    """
    for i in range(3):
        s.bias_moved[i] = s.bias_moved[i] + w.dtheta[i]
    s.bias_expected[0] = s.bias_expected[0] + before_x - s.p_xx
    s.bias_expected[1] = s.bias_expected[1] + before_y - s.p_yy
    s.bias_expected[2] = s.bias_expected[2] + before_z - s.p_zz


def adapt_walk(s: State, period: float) -> None:
    """Raises the walk of a bias whose corrections of late add up to more than expected.

    Source: docs/filter.md Eq. (74).
    """
    keep = MOVING_TIME / (MOVING_TIME + period)
    if s.age_s < SETTLED:
        # What the start had wrong is corrected first.
        keep = 0.0
    for i in range(3):
        moved = keep * s.bias_moved[i]
        # What the raised walk has let in is no part of the usual.
        expected = keep * keep * (s.bias_expected[i] - s.bias_walk[i] * period)
        if expected < 0.0:
            expected = 0.0
        # A receiver's velocity that swings moves the bias to and fro, a warm-up one way.
        trend = keep * s.bias_trend[i] + (1.0 - keep) * moved
        usual = keep * s.bias_usual[i] + (1.0 - keep) * expected
        walk = 2.0 * (trend * trend - 0.5 * usual) / MOVING_TIME
        if walk < 0.0:
            walk = 0.0
        if walk > MAX_WALK:
            walk = MAX_WALK
        s.bias_moved[i] = moved
        s.bias_trend[i] = trend
        s.bias_expected[i] = expected
        s.bias_usual[i] = usual
        s.bias_walk[i] = walk


def apply_theta(s: State, w: Workspace, north: float, east: float) -> None:
    """Corrects bias, velocity and attitude by dtheta, and the attitude by a further tilt.

    Source: docs/filter.md Eq. (19).
    """
    d0 = w.dtheta[0]
    d1 = w.dtheta[1]
    d2 = w.dtheta[2]
    d3 = w.dtheta[3]
    s.gyro_bias[0] = s.gyro_bias[0] + d0
    s.gyro_bias[1] = s.gyro_bias[1] + d1
    s.gyro_bias[2] = s.gyro_bias[2] + d2
    s.velocity_n = (
        s.velocity_n
        + s.dvelocity_n[0] * d0
        + s.dvelocity_n[1] * d1
        + s.dvelocity_n[2] * d2
        + s.dvelocity_n[3] * d3
    )
    s.velocity_e = (
        s.velocity_e
        + s.dvelocity_e[0] * d0
        + s.dvelocity_e[1] * d1
        + s.dvelocity_e[2] * d2
        + s.dvelocity_e[3] * d3
    )
    north = north + s.dtilt_n[0] * d0 + s.dtilt_n[1] * d1 + s.dtilt_n[2] * d2 + s.dtilt_n[3] * d3
    east = east + s.dtilt_e[0] * d0 + s.dtilt_e[1] * d1 + s.dtilt_e[2] * d2 + s.dtilt_e[3] * d3
    turn(s, 0.5 * east, -0.5 * north, 0.5 * d3)


def limit(s: State, g: Gains) -> int:
    """Keeps the bias inside its limit and the heading variance where theta is linear."""
    bits = 0
    for i in range(3):
        if s.gyro_bias[i] > g.bias_limit:
            s.gyro_bias[i] = g.bias_limit
            bits = SATURATED
        if s.gyro_bias[i] < -g.bias_limit:
            s.gyro_bias[i] = -g.bias_limit
            bits = SATURATED
    if s.heading_variance > g.heading_variance:
        c = math.sqrt(g.heading_variance / s.heading_variance)
        s.p_xh = c * s.p_xh
        s.p_yh = c * s.p_yh
        s.p_zh = c * s.p_zh
        s.p_accel_x[3] = c * s.p_accel_x[3]
        s.p_accel_y[3] = c * s.p_accel_y[3]
        s.p_offset_x[3] = c * s.p_offset_x[3]
        s.p_offset_y[3] = c * s.p_offset_y[3]
        s.p_offset_z[3] = c * s.p_offset_z[3]
        s.heading_variance = g.heading_variance
    return bits
