"""States that only measured velocities observe: accelerometer bias, latency of the fixes.

Equations: docs/filter.md.
"""

from ..memory import Gains, State, Workspace
from .field_offset import shrink_offset, times_offset
from .theta import shrink, times_covariance

MAX_ACCEL_BIAS = 0.06  # g: the limit of data sheets
MATCHING_S = 30.0  # mean over so many independent values of the low-passed innovation: six


def measure_all(
    s: State,
    w: Workspace,
    row: list[float],
    row_accel: list[float],
    row_lag: float,
    innovation: float,
    noise: float,
    learns: float,
) -> None:
    """Takes a scalar measurement of theta, accelerometer bias and latency; adds to the corrections.

    Args:
        s: state.
        w: workspace.
        row: how the innovation depends on theta.
        row_accel: how it depends on the bias of the accelerometer.
        row_lag: how it depends on the latency.
        innovation: of the measurement.
        noise: its variance without the errors of these states.
        learns: share of the gain applied to bias and latency; 0: they only add uncertainty.

    Source: docs/filter.md Eq. (18), (37) - (39).
    """
    ax = row_accel[0]
    ay = row_accel[1]
    h = [0.0, 0.0, 0.0, 0.0]
    times_covariance(s, row, h)
    hx = s.p_accel[0] * ax + s.p_accel[1] * ay
    hy = s.p_accel[1] * ax + s.p_accel[2] * ay
    hl = s.fix_lag_variance * row_lag
    times_offset(s, w)
    variance = 0.0
    left = innovation
    for i in range(3):
        left = left - w.row_offset[i] * w.doffset[i]
        hx = hx + s.p_accel_offset[i] * w.row_offset[i]
        hy = hy + s.p_accel_offset[3 + i] * w.row_offset[i]
        shared = s.p_accel_offset[i] * ax + s.p_accel_offset[3 + i] * ay
        w.offset_gain[i] = w.offset_gain[i] + shared
    for i in range(4):
        h[i] = (
            h[i]
            + s.p_accel_x[i] * ax
            + s.p_accel_y[i] * ay
            + w.row_offset[0] * s.p_offset_x[i]
            + w.row_offset[1] * s.p_offset_y[i]
            + w.row_offset[2] * s.p_offset_z[i]
        )
        w.offset_gain[0] = w.offset_gain[0] + s.p_offset_x[i] * row[i]
        w.offset_gain[1] = w.offset_gain[1] + s.p_offset_y[i] * row[i]
        w.offset_gain[2] = w.offset_gain[2] + s.p_offset_z[i] * row[i]
        hx = hx + s.p_accel_x[i] * row[i]
        hy = hy + s.p_accel_y[i] * row[i]
        variance = variance + row[i] * h[i]
        left = left - row[i] * w.dtheta[i]
    for i in range(3):
        variance = variance + w.row_offset[i] * w.offset_gain[i]
    w.predicted = variance + ax * hx + ay * hy + row_lag * hl
    scale = 1.0 / (w.predicted + noise)
    e = scale * (left - ax * w.daccel[0] - ay * w.daccel[1] - row_lag * w.dfix_lag)
    shrink(s, h[0], h[1], h[2], h[3], scale)
    shrink_offset(s, w, h, scale)
    for i in range(3):
        w.doffset[i] = w.doffset[i] + w.offset_gain[i] * e
    kx = scale * hx
    ky = scale * hy
    for i in range(3):
        s.p_accel_offset[i] = s.p_accel_offset[i] - kx * w.offset_gain[i]
        s.p_accel_offset[3 + i] = s.p_accel_offset[3 + i] - ky * w.offset_gain[i]
    for i in range(4):
        w.dtheta[i] = w.dtheta[i] + h[i] * e
        s.p_accel_x[i] = s.p_accel_x[i] - kx * h[i]
        s.p_accel_y[i] = s.p_accel_y[i] - ky * h[i]
    e = learns * e
    w.daccel[0] = w.daccel[0] + hx * e
    w.daccel[1] = w.daccel[1] + hy * e
    w.dfix_lag = w.dfix_lag + hl * e
    falls = learns * (2.0 - learns)
    s.p_accel[0] = s.p_accel[0] - falls * kx * hx
    s.p_accel[1] = s.p_accel[1] - falls * kx * hy
    s.p_accel[2] = s.p_accel[2] - falls * ky * hy
    s.fix_lag_variance = s.fix_lag_variance - falls * scale * hl * hl


def match_variance(
    s: State, g: Gains, north: float, east: float, predicted: float, period: float
) -> None:
    """Estimates the excess of the predicted variance over that of the low-passed innovations.

    An error of tilt or bias moves the velocity for as long as the loop takes to correct it; the
    noise of the fixes is shorter.

    Args:
        s: state.
        g: gains.
        north: innovation, s.
        east: the same.
        predicted: variance of both together without the noise of the fixes, s^2.
        period: time since the fix before, s.

    Source: docs/filter.md Eq. (63).
    """
    slow = period / (g.innovation_mean_time_s + period)
    s.fix_mean_n = s.fix_mean_n + slow * (north - s.fix_mean_n)
    s.fix_mean_e = s.fix_mean_e + slow * (east - s.fix_mean_e)
    unused = 0.0
    square = s.fix_mean_n * s.fix_mean_n + s.fix_mean_e * s.fix_mean_e
    if square < predicted:
        unused = 1.0 - square / predicted
    s.unused_variance = s.unused_variance + period / (MATCHING_S + period) * (
        unused - s.unused_variance
    )


def use_gains(s: State, accel_n: float, accel_e: float, kt: float, kv: float) -> None:
    """Applies the constant gain to the sensitivities.

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


def bound_bias(s: State, w: Workspace, g: Gains, axis: int, with_theta: list[float]) -> None:
    """Keeps an axis of the bias that the corrections lead to within data sheets.

    What is beyond is no bias of an accelerometer: all estimates become those of a bias at the
    limit, and the bias is known no better than beforehand.

    Args:
        s: state.
        w: workspace, whose corrections change.
        g: gains.
        axis: of the bias, 0 or 1.
        with_theta: its covariance with theta.

    Source: docs/filter.md Eq. (78).
    """
    bias = s.accel_bias[axis] + w.daccel[axis]
    excess = bias - within_limit(bias)
    variance = s.p_accel[2 * axis]
    if excess == 0.0 or variance <= 0.0:
        return
    e = excess / variance
    for i in range(4):
        w.dtheta[i] = w.dtheta[i] - with_theta[i] * e
    for i in range(3):
        w.doffset[i] = w.doffset[i] - s.p_accel_offset[3 * axis + i] * e
    w.daccel[axis] = w.daccel[axis] - excess
    w.daccel[1 - axis] = w.daccel[1 - axis] - s.p_accel[1] * e
    if variance < g.accel_variance:
        s.p_accel[2 * axis] = g.accel_variance


def within_limit(bias: float) -> float:
    """The nearest bias of the accelerometer within data sheets, g."""
    if bias > MAX_ACCEL_BIAS:
        return MAX_ACCEL_BIAS
    if bias < -MAX_ACCEL_BIAS:
        return -MAX_ACCEL_BIAS
    return bias


def correct_accel(s: State, w: Workspace, g: Gains) -> None:
    """Applies the corrections of bias, latency and velocity.

    Source: docs/filter.md Eq. (19), (78).
    """
    bound_bias(s, w, g, 0, s.p_accel_x)
    bound_bias(s, w, g, 1, s.p_accel_y)
    for i in range(2):
        # One axis at its limit may have moved the other a little beyond its own.
        s.accel_bias[i] = within_limit(s.accel_bias[i] + w.daccel[i])
    lag = s.fix_lag_s + w.dfix_lag
    if lag < -s.fix_removed_s:
        # A fix is late, not early; too much may have been removed from its time.
        lag = -s.fix_removed_s
    if lag > g.fix_lag_limit:
        lag = g.fix_lag_limit
    w.dfix_lag = lag - s.fix_lag_s
    s.fix_lag_s = lag
    s.velocity_n = (
        s.velocity_n
        + s.dvelocity_accel_n[0] * w.daccel[0]
        + s.dvelocity_accel_n[1] * w.daccel[1]
        + s.dvelocity_lag[0] * w.dfix_lag
    )
    s.velocity_e = (
        s.velocity_e
        + s.dvelocity_accel_e[0] * w.daccel[0]
        + s.dvelocity_accel_e[1] * w.daccel[1]
        + s.dvelocity_lag[1] * w.dfix_lag
    )


def accel_tilt_n(s: State, w: Workspace) -> float:
    """Tilt north due to the corrections of bias and latency, rad."""
    return (
        s.dtilt_accel_n[0] * w.daccel[0]
        + s.dtilt_accel_n[1] * w.daccel[1]
        + s.dtilt_lag[0] * w.dfix_lag
    )


def accel_tilt_e(s: State, w: Workspace) -> float:
    """The same east."""
    return (
        s.dtilt_accel_e[0] * w.daccel[0]
        + s.dtilt_accel_e[1] * w.daccel[1]
        + s.dtilt_lag[1] * w.dfix_lag
    )
