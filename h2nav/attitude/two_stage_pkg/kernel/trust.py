"""What the two-stage filter believes: levels, gates, contradictions.

Arrays as in `two_stage_layout`; equations: docs/derivation.md section 3.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.two_stage_layout import (
    G_BIAS_DOUBT,
    G_DIP_SHARE,
    G_FIELD_CUT,
    G_FIELD_D,
    G_FIELD_GATE,
    G_FIELD_INFO,
    G_FIELD_N,
    G_FORCE_GATE,
    G_FORCE_INFO,
    G_GRAVITY,
    G_LAST_POWER,
    G_LEVEL_CAP,
    G_LEVELS,
    G_NORM_SHARE,
    G_T_LEVEL,
    G_T_MEAN,
    G_T_RESIDUAL,
    G_T_TURNED,
    G_T_WRONG,
    LEVEL_SIZE,
    LEVELS,
    WRONG,
    X_AGE,
    X_BLIND,
    X_CONVERGED,
    X_F,
    X_HEADING,
    X_JITTER,
    X_LEVEL,
    X_M,
    X_MEAN,
    X_OFF,
    X_P,
    X_POWER,
    X_RES,
    X_SHARE,
    X_SUM_FIELD,
    X_SUM_FORCE,
    X_T_DOUBT,
    X_T_FIELD_AGE,
    X_T_MOVING,
    X_T_NO_FIELD,
    X_T_TURNED,
    X_T_WRONG,
    X_U,
    X_VAR,
    Z_DT,
    Z_HAS_FIELD,
)
from h2nav.attitude.kernels.two_stage_motion import (
    turn_world,
)


def track_force(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Learns how much the vehicle accelerates and vibrates; returns the gain level.

    Source: docs/derivation.md Eq. (3.14).
    """
    dt = z[Z_DT]
    c = dt / (g[G_T_RESIDUAL] + dt)
    fast_n = x[X_F] - x[X_RES]
    fast_e = x[X_F + 1] - x[X_RES + 1]
    x[X_RES] += c * fast_n
    x[X_RES + 1] += c * fast_e
    c = dt / (g[G_T_LEVEL] + dt)
    # Jerks that fill less than half of the time must not open the gate for themselves.
    most = 2.0 * x[X_JITTER] + 2.0 / g[G_FORCE_INFO]
    power = fast_n * fast_n + fast_e * fast_e
    if power > most:
        power = most
    x[X_JITTER] += c * (power - x[X_JITTER])
    slow_n = x[X_RES]
    slow_e = x[X_RES + 1]
    if slow_n * slow_n + slow_e * slow_e < g[G_FORCE_GATE] * g[G_FORCE_GATE]:
        # What stays in NED is the tilt's own error: it must not lower the weight that cures it.
        slow_n -= x[X_MEAN]
        slow_e -= x[X_MEAN + 1]
        mean = dt / (g[G_T_MEAN] + dt)
        x[X_MEAN] += mean * slow_n
        x[X_MEAN + 1] += mean * slow_e
    power = slow_n * slow_n + slow_e * slow_e
    x[X_AGE] += dt
    if x[X_AGE] > g[G_T_LEVEL]:
        x[X_AGE] = g[G_T_LEVEL]
    c = dt / (x[X_AGE] + dt)
    if x[X_CONVERGED] < 1.0 or x[X_BLIND] > 0.0:
        x[X_POWER] += c * (power - x[X_POWER])
    if power > g[G_LEVEL_CAP]:
        power = g[G_LEVEL_CAP]
    x[X_LEVEL] += c * (power - x[X_LEVEL])
    level = 0
    for i in range(LEVELS):
        if x[X_LEVEL] > g[G_LEVELS + LEVEL_SIZE * i]:
            level = i
    x[X_SHARE] = 1.0
    if level > 0:
        if x[X_BLIND] > 0.0 and x[X_POWER] > g[G_LAST_POWER]:
            x[X_SHARE] = g[G_LAST_POWER] / x[X_POWER]
        x[X_T_MOVING] += dt
    else:
        x[X_T_MOVING] = 0.0
        x[X_BLIND] = 0.0
    return level


def force_sane(x: list[float], g: Sequence[float]) -> int:
    """1 when the force has the size of gravity."""
    force_2 = x[X_F] * x[X_F] + x[X_F + 1] * x[X_F + 1] + x[X_F + 2] * x[X_F + 2]
    if math.fabs(force_2 / (g[G_GRAVITY] * g[G_GRAVITY]) - 1.0) < 2.0 * g[G_NORM_SHARE]:
        return 1
    return 0


def force_near(x: list[float], g: Sequence[float]) -> int:
    """1 when the force points down, within the gate and 3.4 times its own jitter."""
    width = g[G_FORCE_GATE] + 3.4 * math.sqrt(x[X_JITTER])
    if x[X_F + 2] > 0.0 and x[X_F] * x[X_F] + x[X_F + 1] * x[X_F + 1] < width * width:
        return 1
    return 0


def field_sane(x: list[float], g: Sequence[float]) -> int:
    """1 when the field has the size of the reference."""
    field_2 = x[X_M] * x[X_M] + x[X_M + 1] * x[X_M + 1] + x[X_M + 2] * x[X_M + 2]
    h_2 = g[G_FIELD_N] * g[G_FIELD_N] + g[G_FIELD_D] * g[G_FIELD_D]
    if math.fabs(field_2 / h_2 - 1.0) < 2.0 * g[G_NORM_SHARE]:
        return 1
    return 0


def track_contradiction(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """WRONG when both sensors have long agreed with each other but not with the attitude.

    The error is constant in NED while nothing corrects it, so the sums of both vectors over that
    time give the new alignment.

    Source: docs/derivation.md Eq. (3.16).
    """
    if z[Z_HAS_FIELD] <= 0.0:
        return 0
    against = 0
    near = force_near(x, g)
    if x[X_OFF] < g[G_FIELD_GATE]:
        near += 1
    if near > 0 and x[X_T_DOUBT] > 0.0 and (near < 2 or x[X_OFF] > g[G_FIELD_CUT]):
        near = 0
    if near == 0 and force_sane(x, g) + field_sane(x, g) == 2:
        dot = x[X_F] * x[X_M] + x[X_F + 1] * x[X_M + 1] + x[X_F + 2] * x[X_M + 2]
        h = math.sqrt(g[G_FIELD_N] * g[G_FIELD_N] + g[G_FIELD_D] * g[G_FIELD_D])
        if math.fabs(dot / (g[G_GRAVITY] * h) - g[G_FIELD_D] / h) < g[G_DIP_SHARE]:
            against = 1
    if against == 1:
        x[X_T_WRONG] += x[X_T_FIELD_AGE]
        for i in range(3):
            x[X_SUM_FORCE + i] += x[X_F + i]
            x[X_SUM_FIELD + i] += x[X_M + i]
    elif x[X_T_WRONG] > 0.0:
        x[X_T_WRONG] = 0.0
        for i in range(3):
            x[X_SUM_FORCE + i] = 0.0
            x[X_SUM_FIELD + i] = 0.0
    if x[X_T_WRONG] > g[G_T_WRONG]:
        return WRONG
    return 0


def track_turned(x: list[float], g: Sequence[float]) -> int:
    """1 when a field of the right size and slope has long pointed to another north.

    Source: docs/derivation.md Eq. (3.18).
    """
    if x[X_OFF] < g[G_FIELD_GATE] or math.fabs(x[X_M + 2] - g[G_FIELD_D]) > g[G_FIELD_GATE]:
        x[X_T_TURNED] = 0.0
        return 0
    x[X_T_TURNED] += x[X_T_FIELD_AGE]
    if x[X_T_TURNED] > g[G_T_TURNED]:
        return 1
    return 0


def take_heading(x: list[float], g: Sequence[float]) -> None:
    """Turns a heading that was tied to nothing to where the field shows north.

    Source: docs/derivation.md Eq. (3.17).
    """
    turn_world(x, 0.0, 0.0, -math.atan2(x[X_M + 1], x[X_M]))
    for i in range(9):
        x[X_U + i] = 0.0
    x[X_RES] = 0.0
    x[X_RES + 1] = 0.0
    x[X_VAR + 2] = 1.0 / (g[G_FIELD_N] * g[G_FIELD_N] * g[G_FIELD_INFO])
    x[X_VAR + 3] = 0.0
    x[X_HEADING] = 1.0
    x[X_T_NO_FIELD] = 0.0
    x[X_T_FIELD_AGE] = 0.0


def doubt_bias(x: list[float], g: Sequence[float]) -> None:
    """What led the attitude astray may have led the bias astray, beyond its covariance."""
    x[X_P] += g[G_BIAS_DOUBT]
    x[X_P + 3] += g[G_BIAS_DOUBT]
    x[X_P + 5] += g[G_BIAS_DOUBT]
