"""What only measured velocities teach: bias of the accelerometer, latency of the fixes.

Equations: docs/filter.md.
"""

from ..memory import Gains, Memory
from .theta import shrink


def measure_all(
    s: Memory,
    row: list[float],
    row_accel: list[float],
    row_lag: float,
    innovation: float,
    noise: float,
    learns: float,
) -> None:
    """One scalar measurement of theta, accelerometer bias and latency; adds to the corrections.

    Args:
        s: memory.
        row: how the innovation depends on theta.
        row_accel: how it depends on the bias of the accelerometer.
        row_lag: how it depends on the latency.
        innovation: of the measurement.
        noise: its variance without the errors of all these.
        learns: 1: bias and latency are learnt; 0: they only count as uncertain.

    Source: docs/filter.md Eq. (18), (37) - (39).
    """
    a0 = row[0]
    a1 = row[1]
    a2 = row[2]
    a3 = row[3]
    ax = row_accel[0]
    ay = row_accel[1]
    h0 = s.p_xx * a0 + s.p_xy * a1 + s.p_xz * a2 + s.p_xh * a3
    h1 = s.p_xy * a0 + s.p_yy * a1 + s.p_yz * a2 + s.p_yh * a3
    h2 = s.p_xz * a0 + s.p_yz * a1 + s.p_zz * a2 + s.p_zh * a3
    h3 = s.p_xh * a0 + s.p_yh * a1 + s.p_zh * a2 + s.heading_variance * a3
    h0 = h0 + s.p_accel_x[0] * ax + s.p_accel_y[0] * ay
    h1 = h1 + s.p_accel_x[1] * ax + s.p_accel_y[1] * ay
    h2 = h2 + s.p_accel_x[2] * ax + s.p_accel_y[2] * ay
    h3 = h3 + s.p_accel_x[3] * ax + s.p_accel_y[3] * ay
    hx = s.p_accel[0] * ax + s.p_accel[1] * ay
    hy = s.p_accel[1] * ax + s.p_accel[2] * ay
    hx = hx + s.p_accel_x[0] * a0 + s.p_accel_x[1] * a1 + s.p_accel_x[2] * a2 + s.p_accel_x[3] * a3
    hy = hy + s.p_accel_y[0] * a0 + s.p_accel_y[1] * a1 + s.p_accel_y[2] * a2 + s.p_accel_y[3] * a3
    hl = s.fix_lag_variance * row_lag
    total = a0 * h0 + a1 * h1 + a2 * h2 + a3 * h3 + ax * hx + ay * hy + row_lag * hl + noise
    scale = 1.0 / total
    e = innovation - a0 * s.dtheta[0] - a1 * s.dtheta[1] - a2 * s.dtheta[2] - a3 * s.dtheta[3]
    e = scale * (e - ax * s.daccel[0] - ay * s.daccel[1] - row_lag * s.dfix_lag)
    s.dtheta[0] = s.dtheta[0] + h0 * e
    s.dtheta[1] = s.dtheta[1] + h1 * e
    s.dtheta[2] = s.dtheta[2] + h2 * e
    s.dtheta[3] = s.dtheta[3] + h3 * e
    shrink(s, h0, h1, h2, h3, scale)
    kx = scale * hx
    ky = scale * hy
    s.p_accel_x[0] = s.p_accel_x[0] - kx * h0
    s.p_accel_x[1] = s.p_accel_x[1] - kx * h1
    s.p_accel_x[2] = s.p_accel_x[2] - kx * h2
    s.p_accel_x[3] = s.p_accel_x[3] - kx * h3
    s.p_accel_y[0] = s.p_accel_y[0] - ky * h0
    s.p_accel_y[1] = s.p_accel_y[1] - ky * h1
    s.p_accel_y[2] = s.p_accel_y[2] - ky * h2
    s.p_accel_y[3] = s.p_accel_y[3] - ky * h3
    if learns > 0.0:
        s.daccel[0] = s.daccel[0] + hx * e
        s.daccel[1] = s.daccel[1] + hy * e
        s.p_accel[0] = s.p_accel[0] - kx * hx
        s.p_accel[1] = s.p_accel[1] - kx * hy
        s.p_accel[2] = s.p_accel[2] - ky * hy
        s.dfix_lag = s.dfix_lag + hl * e
        s.fix_lag_variance = s.fix_lag_variance - scale * hl * hl


def use_gains(s: Memory, accel_n: float, accel_e: float, kt: float, kv: float) -> None:
    """The constant gain moves the sensitivities.

    Source: docs/filter.md Eq. (17), (38).
    """
    for i in range(2):
        s.dtilt_accel_n[i] = s.dtilt_accel_n[i] - kt * s.dvelocity_accel_n[i]
        s.dvelocity_accel_n[i] = s.dvelocity_accel_n[i] - kv * s.dvelocity_accel_n[i]
        s.dtilt_accel_e[i] = s.dtilt_accel_e[i] - kt * s.dvelocity_accel_e[i]
        s.dvelocity_accel_e[i] = s.dvelocity_accel_e[i] - kv * s.dvelocity_accel_e[i]
    part = s.dvelocity_lag[0] - accel_n
    s.dtilt_lag[0] = s.dtilt_lag[0] - kt * part
    s.dvelocity_lag[0] = s.dvelocity_lag[0] - kv * part
    part = s.dvelocity_lag[1] - accel_e
    s.dtilt_lag[1] = s.dtilt_lag[1] - kt * part
    s.dvelocity_lag[1] = s.dvelocity_lag[1] - kv * part


def correct_accel(s: Memory, g: Gains) -> None:
    """Moves bias, latency and velocity by their corrections.

    Source: docs/filter.md Eq. (19).
    """
    s.accel_bias[0] = s.accel_bias[0] + s.daccel[0]
    s.accel_bias[1] = s.accel_bias[1] + s.daccel[1]
    lag = s.fix_lag_s + s.dfix_lag
    if lag < 0.0:
        lag = 0.0
    if lag > g.fix_lag_limit:
        lag = g.fix_lag_limit
    s.dfix_lag = lag - s.fix_lag_s
    s.fix_lag_s = lag
    s.velocity_n = (
        s.velocity_n
        + s.dvelocity_accel_n[0] * s.daccel[0]
        + s.dvelocity_accel_n[1] * s.daccel[1]
        + s.dvelocity_lag[0] * s.dfix_lag
    )
    s.velocity_e = (
        s.velocity_e
        + s.dvelocity_accel_e[0] * s.daccel[0]
        + s.dvelocity_accel_e[1] * s.daccel[1]
        + s.dvelocity_lag[1] * s.dfix_lag
    )


def accel_tilt_n(s: Memory) -> float:
    """Tilt north by the corrections of bias and latency, rad."""
    return (
        s.dtilt_accel_n[0] * s.daccel[0]
        + s.dtilt_accel_n[1] * s.daccel[1]
        + s.dtilt_lag[0] * s.dfix_lag
    )


def accel_tilt_e(s: Memory) -> float:
    """The same east."""
    return (
        s.dtilt_accel_e[0] * s.daccel[0]
        + s.dtilt_accel_e[1] * s.daccel[1]
        + s.dtilt_lag[1] * s.dfix_lag
    )
