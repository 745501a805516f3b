"""Both corrections of the two-stage filter: weighing, attitude, bias.

Equations: docs/derivation.md section 3.
"""

import math

from ..memory import FIELD_USED, FORCE_USED, SATURATED, Gains, Sample, State
from .motion import turn_world
from .trust import field_sane, force_near, force_sane

# The constant gains serve once no variance is above its fixed point by more than this.
STEADY = 1.02


def weigh(s: State, g: Gains, sample: Sample, level: int) -> int:
    """Weighted innovation zeta and its information from what is accepted. Returns bits.

    Source: docs/derivation.md Eq. (3.2), (3.3), (3.15).
    """
    for i in range(3):
        s.zeta[i] = 0.0
    s.info_n = 0.0
    s.info_e = 0.0
    s.info_d = 0.0
    s.info_nd = 0.0
    s.heading_share = 1.0
    s.mag_cut = 0.0
    s.bias_frozen = 0.0
    near = force_near(s, g)
    if near == 1 and level == 0 and s.converged > 0.0:
        freeze(s, g, sample.dt_s)
    s.is_split = 0.0
    if s.started_moving > 0.0 or s.age_s < g.align_s:
        s.is_split = 1.0
    bits = 0
    if s.contradicted_s <= 0.0:
        if near == 1 or s.moving_s > g.hold_s or (s.converged < 1.0 and force_sane(s, g) == 1):
            bits = FORCE_USED
            weight = g.level_weight[level] * g.accel_info * g.gravity
            weight *= s.accel_share
            s.zeta[0] = weight * s.gravity_ned[1]
            s.zeta[1] = -weight * s.gravity_ned[0]
            s.info_n = weight * g.gravity
            s.info_e = weight * g.gravity
        if (
            sample.has_mag > 0.0
            and field_sane(s, g) == 1
            and (s.mag_error < g.mag_gate or s.converged < 1.0)
        ):
            bits = bits + FIELD_USED
            weigh_field(s, g, g.level_weight[level])
    if sample.has_mag > 0.0:
        s.mag_age_s = 0.0
    return bits


def freeze(s: State, g: Gains, dt: float) -> None:
    """Sets bias_frozen while the force stands off its place by more than the bias explains.

    Source: docs/derivation.md Eq. (3.19).
    """
    still_2 = g.steady_accel + 8.0 * s.accel_jitter * dt / g.lowpass_s
    off_2 = s.gravity_lp_n * s.gravity_lp_n + s.gravity_lp_e * s.gravity_lp_e
    if off_2 < still_2:
        return
    spread = s.p_xx + s.p_yy + s.p_zz
    reach = (
        s.regressor[0] * s.regressor[0]
        + s.regressor[1] * s.regressor[1]
        + s.regressor[2] * s.regressor[2]
    )
    if off_2 > still_2 + 9.0 * g.gravity * g.gravity * reach * spread:
        s.bias_frozen = 1.0
        s.p_xx += g.frozen_walk * dt
        s.p_yy += g.frozen_walk * dt
        s.p_zz += g.frozen_walk * dt


def weigh_field(s: State, g: Gains, force_weight: float) -> None:
    """Adds the field; a sample that stands for several steps carries their information.

    Source: docs/derivation.md Eq. (3.2), (3.19), (3.20).
    """
    s.mag_accepted_age_s = 0.0
    steps = s.mag_age_s / g.dt_s
    if steps > 20.0:
        steps = 20.0
    off_n = s.mag_ned[0] - g.mag_n
    off_e = s.mag_ned[1]
    off_d = s.mag_ned[2] - g.mag_d
    size = s.mag_error
    if s.converged > 0.0 and size > g.mag_cut:
        s.is_split = 1.0
        s.mag_cut = 1.0
        off_e *= g.mag_cut / size
    weight = steps * g.mag_info
    if s.is_split > 0.0:
        # The heading is seen from the tilt that the force gives, as good or bad as that is.
        blur = g.mag_info * g.mag_d * g.mag_d
        blur /= g.accel_info * g.gravity * g.gravity * force_weight
        s.heading_share = (1.0 + blur) / (1.0 + blur / s.accel_share)
        hn = weight * g.mag_n / (1.0 + blur / s.accel_share)
        s.zeta[2] -= hn * off_e
        s.info_d += hn * g.mag_n
    else:
        hn = weight * g.mag_n
        hd = weight * g.mag_d
        s.zeta[0] += hd * off_e
        s.zeta[1] += hn * off_d - hd * off_n
        s.zeta[2] -= hn * off_e
        s.info_n += hd * g.mag_d
        s.info_e += hn * g.mag_n + hd * g.mag_d
        s.info_d += hn * g.mag_n
        s.info_nd = -hd * g.mag_n


def correct(s: State, g: Gains, level: int) -> int:
    """Both stages: attitude by K_b, bias by its own small covariance. Returns bits.

    Source: docs/derivation.md Eq. (3.4), (3.10) - (3.13).
    """
    k_nn = g.k_n[level]
    k_ee = g.k_e[level]
    k_dd = g.k_d[level]
    k_nd = g.k_nd[level]
    m_nn = s.info_n
    m_ee = s.info_e
    m_dd = s.info_d
    m_nd = s.info_nd
    # The Riccati recursion whose fixed point the constant gain is. At the start and after a gap
    # the attitude is worse than at the fixed point, and the recursion's own gain is taken.
    p_nn = s.variance_n
    p_dd = s.variance_d
    p_nd = s.covariance_nd
    b_nn = 1.0 + m_nn * p_nn + m_nd * p_nd
    b_nd = m_nn * p_nd + m_nd * p_dd
    b_dn = m_nd * p_nn + m_dd * p_nd
    b_dd = 1.0 + m_nd * p_nd + m_dd * p_dd
    scale = 1.0 / (b_nn * b_dd - b_nd * b_dn)
    s.variance_n = scale * (p_nn * b_dd - p_nd * b_dn)
    s.variance_e = s.variance_e / (1.0 + s.variance_e * m_ee)
    s.variance_d = scale * (p_dd * b_nn - p_nd * b_nd)
    s.covariance_nd = scale * (p_nd * b_nn - p_nn * b_nd)
    if s.is_split > 0.0:
        # The level's time constant with the honest weight, unless the attitude is worse.
        k_nd = 0.0
        k_nn = max_of(k_nn / s.accel_share, s.variance_n)
        k_ee = max_of(g.k_n[level] / s.accel_share, s.variance_e)
        k_dd = max_of(k_dd / s.heading_share, s.variance_d)
    elif (
        s.variance_n > STEADY * k_nn or s.variance_e > STEADY * k_ee or s.variance_d > STEADY * k_dd
    ):
        k_nn = s.variance_n
        k_ee = s.variance_e
        k_dd = s.variance_d
        k_nd = s.covariance_nd
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
    if w_nn > 0.0 and s.bias_frozen < 1.0:
        ratio = w_nd / w_nn
        learn(
            s,
            w_nn,
            s.regressor[0] + ratio * s.regressor[6],
            s.regressor[1] + ratio * s.regressor[7],
            s.regressor[2] + ratio * s.regressor[8],
        )
    if m_ee > 0.0 and s.bias_frozen < 1.0:
        learn(s, m_ee * a_ee, s.regressor[3], s.regressor[4], s.regressor[5])
    if s.mag_cut + s.bias_frozen < 1.0 and w_dd - ratio * w_nd > 0.0:
        learn(s, w_dd - ratio * w_nd, s.regressor[6], s.regressor[7], s.regressor[8])
    zeta_n = s.zeta[0]
    zeta_e = s.zeta[1]
    zeta_d = s.zeta[2]
    for i in range(3):
        u_n = s.regressor[i]
        u_d = s.regressor[6 + i]
        s.regressor[i] = a_nn * u_n + a_nd * u_d
        s.regressor[3 + i] = a_ee * s.regressor[3 + i]
        s.regressor[6 + i] = a_dn * u_n + a_dd * u_d
    return move(
        s,
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


def learn(s: State, weight: float, u_0: float, u_1: float, u_2: float) -> None:
    """One scalar update of the bias covariance: P^-1 <- P^-1 + weight u u^T.

    Source: docs/derivation.md Eq. (3.10).
    """
    h_0 = s.p_xx * u_0 + s.p_xy * u_1 + s.p_xz * u_2
    h_1 = s.p_xy * u_0 + s.p_yy * u_1 + s.p_yz * u_2
    h_2 = s.p_xz * u_0 + s.p_yz * u_1 + s.p_zz * u_2
    c = weight / (1.0 + weight * (u_0 * h_0 + u_1 * h_1 + u_2 * h_2))
    s.p_xx -= c * h_0 * h_0
    s.p_xy -= c * h_0 * h_1
    s.p_xz -= c * h_0 * h_2
    s.p_yy -= c * h_1 * h_1
    s.p_yz -= c * h_1 * h_2
    s.p_zz -= c * h_2 * h_2


def move(s: State, g: Gains, eps_n: float, eps_e: float, eps_d: float) -> int:
    """Applies the bias step of the second stage and the turn of both stages. Returns bits.

    `eps` is the turn that the first stage asks for, NED.

    Source: docs/derivation.md Eq. (3.11) - (3.13).
    """
    bits = 0
    s_0 = 0.0
    s_1 = 0.0
    s_2 = 0.0
    if s.mag_cut > 0.0:
        s.zeta[2] = 0.0
    if s.bias_frozen > 0.0:
        s.zeta[0] = 0.0
        s.zeta[1] = 0.0
        s.zeta[2] = 0.0
    for i in range(3):
        s_0 -= s.regressor[3 * i] * s.zeta[i]
        s_1 -= s.regressor[3 * i + 1] * s.zeta[i]
        s_2 -= s.regressor[3 * i + 2] * s.zeta[i]
    d_0 = s.p_xx * s_0 + s.p_xy * s_1 + s.p_xz * s_2
    d_1 = s.p_xy * s_0 + s.p_yy * s_1 + s.p_yz * s_2
    d_2 = s.p_xz * s_0 + s.p_yz * s_1 + s.p_zz * s_2
    size = math.sqrt(d_0 * d_0 + d_1 * d_1 + d_2 * d_2)
    if size > g.bias_step_limit:
        d_0 *= g.bias_step_limit / size
        d_1 *= g.bias_step_limit / size
        d_2 *= g.bias_step_limit / size
        bits = SATURATED
    s.gyro_bias[0] += d_0
    s.gyro_bias[1] += d_1
    s.gyro_bias[2] += d_2
    for i in range(3):
        if s.gyro_bias[i] > g.bias_limit:
            s.gyro_bias[i] = g.bias_limit
            bits = SATURATED
        elif s.gyro_bias[i] < -g.bias_limit:
            s.gyro_bias[i] = -g.bias_limit
            bits = SATURATED
    eps_n -= s.regressor[0] * d_0 + s.regressor[1] * d_1 + s.regressor[2] * d_2
    eps_e -= s.regressor[3] * d_0 + s.regressor[4] * d_1 + s.regressor[5] * d_2
    eps_d -= s.regressor[6] * d_0 + s.regressor[7] * d_1 + s.regressor[8] * d_2
    turn_world(s, eps_n, eps_e, eps_d)
    return bits
