"""Both corrections of the two-stage filter: weighing, attitude, bias.

Arrays as in `two_stage_layout`; equations: docs/derivation.md section 3.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.two_stage_layout import (
    FIELD_USED,
    FORCE_USED,
    G_BIAS_LIMIT,
    G_BIAS_STEP,
    G_DT,
    G_FIELD_CUT,
    G_FIELD_D,
    G_FIELD_GATE,
    G_FIELD_INFO,
    G_FIELD_N,
    G_FORCE_INFO,
    G_FROZEN_WALK,
    G_GRAVITY,
    G_LEVELS,
    G_STILL_2,
    G_T_ALIGN,
    G_T_HOLD,
    G_T_RESIDUAL,
    LEVEL_SIZE,
    SATURATED,
    STEADY,
    X_APART,
    X_BIAS,
    X_BLIND,
    X_CONVERGED,
    X_F,
    X_FROZEN,
    X_HELD,
    X_INFO,
    X_JITTER,
    X_M,
    X_OFF,
    X_P,
    X_RES,
    X_SHARE,
    X_SHARE_D,
    X_T_FIELD_AGE,
    X_T_MOVING,
    X_T_NO_FIELD,
    X_T_RUN,
    X_T_WRONG,
    X_U,
    X_VAR,
    X_ZETA,
    Z_DT,
    Z_HAS_FIELD,
)
from h2nav.attitude.kernels.two_stage_motion import (
    turn_world,
)
from h2nav.attitude.kernels.two_stage_trust import (
    field_sane,
    force_near,
    force_sane,
)


def weigh(x: list[float], g: Sequence[float], z: Sequence[float], level: int) -> int:
    """Weighted innovation X_ZETA and its information X_INFO from what is believed. Returns bits.

    Source: docs/derivation.md Eq. (3.2), (3.3), (3.15).
    """
    for i in range(3):
        x[X_ZETA + i] = 0.0
    for i in range(4):
        x[X_INFO + i] = 0.0
    x[X_SHARE_D] = 1.0
    x[X_HELD] = 0.0
    x[X_FROZEN] = 0.0
    near = force_near(x, g)
    if near == 1 and level == 0 and x[X_CONVERGED] > 0.0:
        freeze(x, g, z[Z_DT])
    x[X_APART] = 0.0
    if x[X_BLIND] > 0.0 or x[X_T_RUN] < g[G_T_ALIGN]:
        x[X_APART] = 1.0
    bits = 0
    if x[X_T_WRONG] <= 0.0:
        if (
            near == 1
            or x[X_T_MOVING] > g[G_T_HOLD]
            or (x[X_CONVERGED] < 1.0 and force_sane(x, g) == 1)
        ):
            bits = FORCE_USED
            weight = g[G_LEVELS + LEVEL_SIZE * level + 1] * g[G_FORCE_INFO] * g[G_GRAVITY]
            weight *= x[X_SHARE]
            x[X_ZETA] = weight * x[X_F + 1]
            x[X_ZETA + 1] = -weight * x[X_F]
            x[X_INFO] = weight * g[G_GRAVITY]
            x[X_INFO + 1] = weight * g[G_GRAVITY]
        if (
            z[Z_HAS_FIELD] > 0.0
            and field_sane(x, g) == 1
            and (x[X_OFF] < g[G_FIELD_GATE] or x[X_CONVERGED] < 1.0)
        ):
            bits = bits + FIELD_USED
            weigh_field(x, g, g[G_LEVELS + LEVEL_SIZE * level + 1])
    if z[Z_HAS_FIELD] > 0.0:
        x[X_T_FIELD_AGE] = 0.0
    return bits


def freeze(x: list[float], g: Sequence[float], dt: float) -> None:
    """Sets X_FROZEN while the force stands off its place by more than the bias explains.

    Source: docs/derivation.md Eq. (3.19).
    """
    still_2 = g[G_STILL_2] + 8.0 * x[X_JITTER] * dt / g[G_T_RESIDUAL]
    off_2 = x[X_RES] * x[X_RES] + x[X_RES + 1] * x[X_RES + 1]
    if off_2 < still_2:
        return
    spread = x[X_P] + x[X_P + 3] + x[X_P + 5]
    reach = x[X_U] * x[X_U] + x[X_U + 1] * x[X_U + 1] + x[X_U + 2] * x[X_U + 2]
    if off_2 > still_2 + 9.0 * g[G_GRAVITY] * g[G_GRAVITY] * reach * spread:
        x[X_FROZEN] = 1.0
        x[X_P] += g[G_FROZEN_WALK] * dt
        x[X_P + 3] += g[G_FROZEN_WALK] * dt
        x[X_P + 5] += g[G_FROZEN_WALK] * dt


def weigh_field(x: list[float], g: Sequence[float], force_weight: float) -> None:
    """Adds the field; a sample that stands for several steps carries their information.

    Source: docs/derivation.md Eq. (3.2), (3.19), (3.20).
    """
    x[X_T_NO_FIELD] = 0.0
    steps = x[X_T_FIELD_AGE] / g[G_DT]
    if steps > 20.0:
        steps = 20.0
    off_n = x[X_M] - g[G_FIELD_N]
    off_e = x[X_M + 1]
    off_d = x[X_M + 2] - g[G_FIELD_D]
    size = x[X_OFF]
    if x[X_CONVERGED] > 0.0 and size > g[G_FIELD_CUT]:
        x[X_APART] = 1.0
        x[X_HELD] = 1.0
        off_e *= g[G_FIELD_CUT] / size
    weight = steps * g[G_FIELD_INFO]
    if x[X_APART] > 0.0:
        # The heading is seen from the tilt that the force gives, as good or bad as that is.
        blur = g[G_FIELD_INFO] * g[G_FIELD_D] * g[G_FIELD_D]
        blur /= g[G_FORCE_INFO] * g[G_GRAVITY] * g[G_GRAVITY] * force_weight
        x[X_SHARE_D] = (1.0 + blur) / (1.0 + blur / x[X_SHARE])
        hn = weight * g[G_FIELD_N] / (1.0 + blur / x[X_SHARE])
        x[X_ZETA + 2] -= hn * off_e
        x[X_INFO + 2] += hn * g[G_FIELD_N]
    else:
        hn = weight * g[G_FIELD_N]
        hd = weight * g[G_FIELD_D]
        x[X_ZETA] += hd * off_e
        x[X_ZETA + 1] += hn * off_d - hd * off_n
        x[X_ZETA + 2] -= hn * off_e
        x[X_INFO] += hd * g[G_FIELD_D]
        x[X_INFO + 1] += hn * g[G_FIELD_N] + hd * g[G_FIELD_D]
        x[X_INFO + 2] += hn * g[G_FIELD_N]
        x[X_INFO + 3] = -hd * g[G_FIELD_N]


def correct(x: list[float], g: Sequence[float], level: int) -> int:
    """Both stages: attitude by K_b, bias by its own small covariance. Returns bits.

    Source: docs/derivation.md Eq. (3.4), (3.10) - (3.13).
    """
    base = G_LEVELS + LEVEL_SIZE * level
    k_nn = g[base + 2]
    k_ee = g[base + 3]
    k_dd = g[base + 4]
    k_nd = g[base + 5]
    m_nn = x[X_INFO]
    m_ee = x[X_INFO + 1]
    m_dd = x[X_INFO + 2]
    m_nd = x[X_INFO + 3]
    # The Riccati recursion whose fixed point the constant gain is. At the start and after a gap
    # the attitude is worse than at the fixed point, and the recursion's own gain is taken.
    p_nn = x[X_VAR]
    p_dd = x[X_VAR + 2]
    p_nd = x[X_VAR + 3]
    b_nn = 1.0 + m_nn * p_nn + m_nd * p_nd
    b_nd = m_nn * p_nd + m_nd * p_dd
    b_dn = m_nd * p_nn + m_dd * p_nd
    b_dd = 1.0 + m_nd * p_nd + m_dd * p_dd
    scale = 1.0 / (b_nn * b_dd - b_nd * b_dn)
    x[X_VAR] = scale * (p_nn * b_dd - p_nd * b_dn)
    x[X_VAR + 1] = x[X_VAR + 1] / (1.0 + x[X_VAR + 1] * m_ee)
    x[X_VAR + 2] = scale * (p_dd * b_nn - p_nd * b_nd)
    x[X_VAR + 3] = scale * (p_nd * b_nn - p_nn * b_nd)
    if x[X_APART] > 0.0:
        # The level's time constant with the honest weight, unless the attitude is worse.
        k_nd = 0.0
        k_nn = max_of(k_nn / x[X_SHARE], x[X_VAR])
        k_ee = max_of(g[base + 2] / x[X_SHARE], x[X_VAR + 1])
        k_dd = max_of(k_dd / x[X_SHARE_D], x[X_VAR + 2])
    elif x[X_VAR] > STEADY * k_nn or x[X_VAR + 1] > STEADY * k_ee or x[X_VAR + 2] > STEADY * k_dd:
        k_nn = x[X_VAR]
        k_ee = x[X_VAR + 1]
        k_dd = x[X_VAR + 2]
        k_nd = x[X_VAR + 3]
    a_nn = 1.0 - k_nn * m_nn - k_nd * m_nd
    a_nd = -k_nn * m_nd - k_nd * m_dd
    a_ee = 1.0 - k_ee * m_ee
    a_dn = -k_nd * m_nn - k_dd * m_nd
    a_dd = 1.0 - k_nd * m_nd - k_dd * m_dd
    # W = M (I - K_b M), taken apart as l (1, 0, r)(1, 0, r)^T + ... for three scalar updates.
    w_nn = m_nn * a_nn + m_nd * a_dn
    w_nd = m_nn * a_nd + m_nd * a_dd
    w_dd = m_nd * a_nd + m_dd * a_dd
    ratio = 0.0
    if w_nn > 0.0 and x[X_FROZEN] < 1.0:
        ratio = w_nd / w_nn
        learn(
            x,
            w_nn,
            x[X_U] + ratio * x[X_U + 6],
            x[X_U + 1] + ratio * x[X_U + 7],
            x[X_U + 2] + ratio * x[X_U + 8],
        )
    if m_ee > 0.0 and x[X_FROZEN] < 1.0:
        learn(x, m_ee * a_ee, x[X_U + 3], x[X_U + 4], x[X_U + 5])
    if x[X_HELD] + x[X_FROZEN] < 1.0 and w_dd - ratio * w_nd > 0.0:
        learn(x, w_dd - ratio * w_nd, x[X_U + 6], x[X_U + 7], x[X_U + 8])
    zeta_n = x[X_ZETA]
    zeta_e = x[X_ZETA + 1]
    zeta_d = x[X_ZETA + 2]
    for i in range(3):
        u_n = x[X_U + i]
        u_d = x[X_U + 6 + i]
        x[X_U + i] = a_nn * u_n + a_nd * u_d
        x[X_U + 3 + i] = a_ee * x[X_U + 3 + i]
        x[X_U + 6 + i] = a_dn * u_n + a_dd * u_d
    return move(
        x,
        g,
        k_nn * zeta_n + k_nd * zeta_d,
        k_ee * zeta_e,
        k_nd * zeta_n + k_dd * zeta_d,
    )


def max_of(a: float, b: float) -> float:
    """The larger of two numbers; the subset has no max."""
    if a > b:
        return a
    return b


def learn(x: list[float], weight: float, u_0: float, u_1: float, u_2: float) -> None:
    """One scalar update of the bias covariance: P^-1 <- P^-1 + weight u u^T.

    Source: docs/derivation.md Eq. (3.10).
    """
    h_0 = x[X_P] * u_0 + x[X_P + 1] * u_1 + x[X_P + 2] * u_2
    h_1 = x[X_P + 1] * u_0 + x[X_P + 3] * u_1 + x[X_P + 4] * u_2
    h_2 = x[X_P + 2] * u_0 + x[X_P + 4] * u_1 + x[X_P + 5] * u_2
    c = weight / (1.0 + weight * (u_0 * h_0 + u_1 * h_1 + u_2 * h_2))
    x[X_P] -= c * h_0 * h_0
    x[X_P + 1] -= c * h_0 * h_1
    x[X_P + 2] -= c * h_0 * h_2
    x[X_P + 3] -= c * h_1 * h_1
    x[X_P + 4] -= c * h_1 * h_2
    x[X_P + 5] -= c * h_2 * h_2


def move(x: list[float], g: Sequence[float], eps_n: float, eps_e: float, eps_d: float) -> int:
    """Applies the bias step of the second stage and the turn of both stages. Returns bits.

    `eps` is the turn that the first stage asks for, NED.

    Source: docs/derivation.md Eq. (3.11) - (3.13).
    """
    bits = 0
    s_0 = 0.0
    s_1 = 0.0
    s_2 = 0.0
    if x[X_HELD] > 0.0:
        x[X_ZETA + 2] = 0.0
    if x[X_FROZEN] > 0.0:
        x[X_ZETA] = 0.0
        x[X_ZETA + 1] = 0.0
        x[X_ZETA + 2] = 0.0
    for i in range(3):
        s_0 -= x[X_U + 3 * i] * x[X_ZETA + i]
        s_1 -= x[X_U + 3 * i + 1] * x[X_ZETA + i]
        s_2 -= x[X_U + 3 * i + 2] * x[X_ZETA + i]
    d_0 = x[X_P] * s_0 + x[X_P + 1] * s_1 + x[X_P + 2] * s_2
    d_1 = x[X_P + 1] * s_0 + x[X_P + 3] * s_1 + x[X_P + 4] * s_2
    d_2 = x[X_P + 2] * s_0 + x[X_P + 4] * s_1 + x[X_P + 5] * s_2
    size = math.sqrt(d_0 * d_0 + d_1 * d_1 + d_2 * d_2)
    if size > g[G_BIAS_STEP]:
        d_0 *= g[G_BIAS_STEP] / size
        d_1 *= g[G_BIAS_STEP] / size
        d_2 *= g[G_BIAS_STEP] / size
        bits = SATURATED
    x[X_BIAS] += d_0
    x[X_BIAS + 1] += d_1
    x[X_BIAS + 2] += d_2
    for i in range(3):
        if x[X_BIAS + i] > g[G_BIAS_LIMIT]:
            x[X_BIAS + i] = g[G_BIAS_LIMIT]
            bits = SATURATED
        elif x[X_BIAS + i] < -g[G_BIAS_LIMIT]:
            x[X_BIAS + i] = -g[G_BIAS_LIMIT]
            bits = SATURATED
    eps_n -= x[X_U] * d_0 + x[X_U + 1] * d_1 + x[X_U + 2] * d_2
    eps_e -= x[X_U + 3] * d_0 + x[X_U + 4] * d_1 + x[X_U + 5] * d_2
    eps_d -= x[X_U + 6] * d_0 + x[X_U + 7] * d_1 + x[X_U + 8] * d_2
    turn_world(x, eps_n, eps_e, eps_d)
    return bits
