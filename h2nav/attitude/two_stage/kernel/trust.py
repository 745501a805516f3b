"""What the two-stage filter accepts: levels, gates, contradictions.

Equations: docs/derivation.md section 3.
"""

import math

from ..memory import LEVELS, WRONG, Gains, Sample, State
from .motion import turn_world


def track_force(s: State, g: Gains, sample: Sample) -> int:
    """Learns how much the vehicle accelerates and vibrates; returns the gain level.

    Source: docs/derivation.md Eq. (3.14).
    """
    dt = sample.dt_s
    c = dt / (g.lowpass_s + dt)
    fast_n = s.gravity_ned[0] - s.gravity_lp_n
    fast_e = s.gravity_ned[1] - s.gravity_lp_e
    s.gravity_lp_n += c * fast_n
    s.gravity_lp_e += c * fast_e
    c = dt / (g.level_time_s + dt)
    # Jerks that fill less than half of the time must not open the gate for themselves.
    most = 2.0 * s.accel_jitter + 2.0 / g.accel_info
    power = fast_n * fast_n + fast_e * fast_e
    if power > most:
        power = most
    s.accel_jitter += c * (power - s.accel_jitter)
    slow_n = s.gravity_lp_n
    slow_e = s.gravity_lp_e
    if slow_n * slow_n + slow_e * slow_e < g.accel_gate * g.accel_gate:
        # What stays in NED is the tilt's own error: it must not lower the weight that cures it.
        slow_n -= s.gravity_mean_n
        slow_e -= s.gravity_mean_e
        mean = dt / (g.mean_time_s + dt)
        s.gravity_mean_n += mean * slow_n
        s.gravity_mean_e += mean * slow_e
    power = slow_n * slow_n + slow_e * slow_e
    s.power_age_s += dt
    if s.power_age_s > g.level_time_s:
        s.power_age_s = g.level_time_s
    c = dt / (s.power_age_s + dt)
    if s.converged < 1.0 or s.started_moving > 0.0:
        s.accel_power_uncapped += c * (power - s.accel_power_uncapped)
    if power > g.accel_power_cap:
        power = g.accel_power_cap
    s.accel_power += c * (power - s.accel_power)
    level = 0
    for i in range(LEVELS):
        if s.accel_power > g.level_power[i]:
            level = i
    s.accel_share = 1.0
    if level > 0:
        if s.started_moving > 0.0 and s.accel_power_uncapped > g.last_power:
            s.accel_share = g.last_power / s.accel_power_uncapped
        s.moving_s += dt
    else:
        s.moving_s = 0.0
        s.started_moving = 0.0
    return level


def force_sane(s: State, g: Gains) -> int:
    """1 when the force has the size of gravity."""
    force_2 = (
        s.gravity_ned[0] * s.gravity_ned[0]
        + s.gravity_ned[1] * s.gravity_ned[1]
        + s.gravity_ned[2] * s.gravity_ned[2]
    )
    if math.fabs(force_2 / (g.gravity * g.gravity) - 1.0) < 2.0 * g.norm_gate:
        return 1
    return 0


def force_near(s: State, g: Gains) -> int:
    """1 when the force points down, within the gate and 3.4 times its own jitter."""
    width = g.accel_gate + 3.4 * math.sqrt(s.accel_jitter)
    if (
        s.gravity_ned[2] > 0.0
        and s.gravity_ned[0] * s.gravity_ned[0] + s.gravity_ned[1] * s.gravity_ned[1]
        < width * width
    ):
        return 1
    return 0


def field_sane(s: State, g: Gains) -> int:
    """1 when the field has the size of the reference."""
    field_2 = (
        s.mag_ned[0] * s.mag_ned[0] + s.mag_ned[1] * s.mag_ned[1] + s.mag_ned[2] * s.mag_ned[2]
    )
    h_2 = g.mag_n * g.mag_n + g.mag_d * g.mag_d
    if math.fabs(field_2 / h_2 - 1.0) < 2.0 * g.norm_gate:
        return 1
    return 0


def track_contradiction(s: State, g: Gains, sample: Sample) -> int:
    """WRONG when both sensors have long agreed with each other but not with the attitude.

    The error is constant in NED while nothing corrects it, so the sums of both vectors over that
    time give the new alignment.

    Source: docs/derivation.md Eq. (3.16).
    """
    if sample.has_mag <= 0.0:
        return 0
    against = 0
    near = force_near(s, g)
    if s.mag_error < g.mag_gate:
        near += 1
    if near > 0 and s.doubt_s > 0.0 and (near < 2 or s.mag_error > g.mag_cut):
        near = 0
    if near == 0 and force_sane(s, g) + field_sane(s, g) == 2:
        dot = (
            s.gravity_ned[0] * s.mag_ned[0]
            + s.gravity_ned[1] * s.mag_ned[1]
            + s.gravity_ned[2] * s.mag_ned[2]
        )
        h = math.sqrt(g.mag_n * g.mag_n + g.mag_d * g.mag_d)
        if math.fabs(dot / (g.gravity * h) - g.mag_d / h) < g.dip_gate:
            against = 1
    if against == 1:
        s.contradicted_s += s.mag_age_s
        for i in range(3):
            s.gravity_sum[i] += s.gravity_ned[i]
            s.mag_sum[i] += s.mag_ned[i]
    elif s.contradicted_s > 0.0:
        s.contradicted_s = 0.0
        for i in range(3):
            s.gravity_sum[i] = 0.0
            s.mag_sum[i] = 0.0
    if s.contradicted_s > g.contradicted_time_s:
        return WRONG
    return 0


def track_turned(s: State, g: Gains) -> int:
    """1 when a field of the right size and slope has long pointed to another north.

    Source: docs/derivation.md Eq. (3.18).
    """
    if s.mag_error < g.mag_gate or math.fabs(s.mag_ned[2] - g.mag_d) > g.mag_gate:
        s.mag_turned_s = 0.0
        return 0
    s.mag_turned_s += s.mag_age_s
    if s.mag_turned_s > g.mag_turned_time_s:
        return 1
    return 0


def take_heading(s: State, g: Gains) -> None:
    """Turns a heading that was tied to nothing to where the field shows north.

    Source: docs/derivation.md Eq. (3.17).
    """
    turn_world(s, 0.0, 0.0, -math.atan2(s.mag_ned[1], s.mag_ned[0]))
    for i in range(9):
        s.regressor[i] = 0.0
    s.gravity_lp_n = 0.0
    s.gravity_lp_e = 0.0
    s.variance_d = 1.0 / (g.mag_n * g.mag_n * g.mag_info)
    s.covariance_nd = 0.0
    s.heading_referenced = 1.0
    s.mag_accepted_age_s = 0.0
    s.mag_age_s = 0.0


def doubt_bias(s: State, g: Gains) -> None:
    """What led the attitude astray may have led the bias astray, beyond its covariance."""
    s.p_xx += g.bias_doubt
    s.p_yy += g.bias_doubt
    s.p_zz += g.bias_doubt
