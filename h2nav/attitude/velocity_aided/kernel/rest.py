"""Bias of the velocity-aided filter from the gyro at rest.

Equations: docs/filter.md.
"""

import math

from ..memory import REST, Gains, Memory, Sample
from .theta import apply_theta, shrink

SIGMAS_2 = 9.0  # a rate that is this far from the known bias is no bias
FLOOR = 3.0e-6  # (0.1 deg/s)^2


def use_rest(s: Memory, g: Gains, sample: Sample) -> int:
    """Bias from the low-passed rate while nothing moves; how long nothing has been felt to move.

    Source: docs/filter.md Eq. (20), (31).
    """
    dt = sample.dt_s
    share = dt / (g.rest_lowpass_s + dt)
    rate = 0.0
    force = 0.0
    slow = 1.0
    for i in range(3):
        d = sample.gyro[i] - s.gyro_lp[i]
        rate = rate + d * d
        s.gyro_lp[i] = s.gyro_lp[i] + share * d
        d = sample.accel[i] - s.accel_lp[i]
        force = force + d * d
        s.accel_lp[i] = s.accel_lp[i] + share * d
        if math.fabs(s.gyro_lp[i]) > g.bias_limit:
            slow = 0.0
    still = slow * sample.rest_prior
    if still == 1.0:
        # By the signals alone a slow turn looks like rest: the bias must not jump by it.
        still = 1.0 - moves(s, 0, s.p_xx) - moves(s, 1, s.p_yy) - moves(s, 2, s.p_zz)
    if slow <= 0.0 or rate > g.rest_gyro or force > g.rest_accel:
        s.steady_s = 0.0
        s.rest_s = 0.0
        return 0
    s.steady_s = s.steady_s + dt
    if still <= 0.0:
        s.rest_s = 0.0
        return 0
    s.rest_s = s.rest_s + dt
    if s.rest_s < g.rest_time_s:
        return 0
    noise = g.rest_noise / dt
    measure_bias(s, 0, s.p_xx, s.p_xy, s.p_xz, s.p_xh, s.p_xx + noise)
    measure_bias(s, 1, s.p_xy, s.p_yy, s.p_yz, s.p_yh, s.p_yy + noise)
    measure_bias(s, 2, s.p_xz, s.p_yz, s.p_zz, s.p_zh, s.p_zz + noise)
    return REST


def moves(s: Memory, axis: int, variance: float) -> float:
    """1 when the low-passed rate contradicts the bias as far as it is known."""
    d = s.gyro_lp[axis] - s.gyro_bias[axis]
    if d * d > SIGMAS_2 * (variance + FLOOR):
        return 1.0
    return 0.0


def measure_bias(
    s: Memory, axis: int, h0: float, h1: float, h2: float, h3: float, variance: float
) -> None:
    """Theta from one axis of the low-passed rate; h is that axis' row of P."""
    scale = 1.0 / variance
    e = scale * (s.gyro_lp[axis] - s.gyro_bias[axis])
    s.dtheta[0] = h0 * e
    s.dtheta[1] = h1 * e
    s.dtheta[2] = h2 * e
    s.dtheta[3] = h3 * e
    shrink(s, h0, h1, h2, h3, scale)
    apply_theta(s, 0.0, 0.0)
