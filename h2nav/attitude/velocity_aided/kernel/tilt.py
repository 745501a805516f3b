"""Doubts about the tilt, and its re-initialization.

Equations: docs/filter.md.
"""

import math

from ..memory import (
    HEADING_LOST,
    MAX_REJECTED,
    ON_GROUND,
    RESTARTED,
    Gains,
    Sample,
    State,
    Workspace,
)
from .prediction import (
    follow_rate,
    forget_sensitivities,
    gyro_density,
    set_matrix,
    share_of_levels,
    turn,
    turn_body,
)

MAX_TILT_SIGMA = 1.57  # rad: nothing is known
AT_END = 0.99  # of the largest rate: another axis at the same end
LONGEST_PARABOLA = 0.25  # s: of clipped samples whose rate is still a parabola
MAX_CLIPPED = 0.2  # rad: after clipped samples that may have hidden more the tilt starts again
ALL_CLIPPED = 0.6  # rad: ... and the force is the better guess, even while accelerating
LEVEL_SIGMA = 0.1  # rad: of a tilt taken from the force alone
LEVEL_SIZE = 0.1  # relative, of the force's square: 5 % of g
AIR_COSINE = 0.87  # 30 deg: a steady turn whose force is within 5 % of g banks by 18 deg
GROUND_COSINE = 0.985  # 10 deg: no steady acceleration on the ground is that large


def doubt_rate(s: State, sample: Sample) -> None:
    """Doubts a clipped rate by its difference from the rates before it.

    Source: docs/filter.md Eq. (30).
    """
    dt = sample.dt_s
    square = 0.0
    most = 0.0
    for i in range(3):
        d = sample.gyro[i] - s.gyro_lp[i]
        square = square + d * d
        if math.fabs(sample.gyro[i]) > most:
            most = math.fabs(sample.gyro[i])
        if s.clipped_s == 0.0:
            s.clipped_slope[i] = s.gyro_step[i] / dt
            s.clipped_rate[i] = sample.gyro[i]
    for i in range(3):
        # An axis is at the end of its range if its rate is constant and the largest of all.
        if sample.gyro[i] != s.clipped_rate[i] or math.fabs(sample.gyro[i]) < AT_END * most:
            s.clipped_slope[i] = 0.0
    s.clipped_s = s.clipped_s + dt
    s.clipped_angle = s.clipped_angle + dt * math.sqrt(square)


def end_clipping(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """After clipped samples, adds the hidden rotation, or starts the tilt again.

    Over a short time the rate beyond the range is a parabola with the slopes at both ends; over a
    longer time it is unknown. Source: docs/filter.md Eq. (30), (49).
    """
    time = s.clipped_s
    s.clipped_s = 0.0
    bits = 0
    if time < LONGEST_PARABOLA:
        square = 0.0
        for i in range(3):
            sign = 1.0
            if s.clipped_rate[i] < 0.0:
                sign = -1.0
            before = sign * s.clipped_slope[i]
            # The rate came back between two samples: half of its fall is visible.
            after = 2.0 * sign * (s.clipped_rate[i] - sample.gyro[i]) / sample.dt_s
            w.dtheta[i] = 0.0
            if before > 0.0 and after > 0.0:
                hidden = sign * time * time * (before + after) / 12.0
                w.dtheta[i] = hidden
                square = square + hidden * hidden
        if square > 0.0:
            turn_body(s, w, w.dtheta[0], w.dtheta[1], w.dtheta[2])
            s.clipped_angle = 0.5 * math.sqrt(square)
    lost = s.clipped_angle
    raise_tilt_sigma(s, s.extra_tilt_sigma + lost)
    # The heading has been turned as well as the tilt; `limit` keeps it where theta is linear.
    s.heading_variance = s.heading_variance + lost * lost
    if lost > MAX_CLIPPED:
        bits = begin_anew(s, w, g, sample)
    s.clipped_angle = 0.0
    return bits


def doubt_gap(s: State, g: Gains, sample: Sample) -> None:
    """Doubts tilt and velocity after missing samples.

    In a gap the rate is taken to have changed evenly. How far that may be wrong is shown by the
    change itself, and by how much the rate varied before. Source: docs/filter.md Eq. (73).
    """
    square = s.turning
    for i in range(3):
        mean = s.gyro_lp[i] - s.gyro_bias[i]
        square = square - mean * mean
    if square < 0.0:
        square = 0.0
    for i in range(3):
        change = sample.gyro[i] - s.gyro_last[i]
        square = square + change * change
    lost = 0.5 * sample.dt_s * math.sqrt(square)
    raise_tilt_sigma(s, math.sqrt(s.extra_tilt_sigma * s.extra_tilt_sigma + lost * lost))
    if sample.aided > 0.0:
        # Within the time of the levels the loop shall correct as much, and no more: the rate has
        # changed by motion, not by noise. Nor is the force known: the next fix sets the velocity.
        s.gyro_jitter = s.gyro_jitter + lost * lost / (3.0 * g.level_time_s)
        for i in range(3):
            s.gyro_last[i] = sample.gyro[i]
            s.gyro_step[i] = 0.0
        s.fixes_rejected = MAX_REJECTED


def carry_tilt(s: State, g: Gains, sample: Sample) -> None:
    """Lets the deviation of a tilt without a force grow with the noise of the gyro.

    What the gyro's bias adds is theta's. Source: docs/filter.md Eq. (79).
    """
    follow_rate(s, sample, share_of_levels(s, g, sample.dt_s))
    s.unforced_s = s.unforced_s + sample.dt_s
    variance = s.extra_tilt_sigma * s.extra_tilt_sigma + sample.dt_s * gyro_density(s, g)
    raise_tilt_sigma(s, math.sqrt(variance))


def raise_tilt_sigma(s: State, angle: float) -> None:
    """Raises the deviation of the tilt to at least this, rad."""
    if angle > MAX_TILT_SIGMA:
        angle = MAX_TILT_SIGMA
    if angle > s.extra_tilt_sigma:
        s.extra_tilt_sigma = angle
    s.unused_variance = 0.0


def check_level(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Takes the tilt from a force of size g that contradicts it, once another sign agrees.

    Source: docs/filter.md Eq. (31), (32).
    """
    cosine = AIR_COSINE
    if s.tilt_suspect > 0.0:
        s.tilt_suspect = 0.0
    elif s.steady_s < g.rest_time_s:
        return 0
    elif sample.rest_prior >= ON_GROUND:
        cosine = GROUND_COSINE
    fx = s.accel_lp[0] - g.gravity * s.accel_bias[0]
    fy = s.accel_lp[1] - g.gravity * s.accel_bias[1]
    fz = s.accel_lp[2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    ratio = norm / g.gravity
    down = w.r_nb[6] * fx + w.r_nb[7] * fy + w.r_nb[8] * fz
    if math.fabs(ratio * ratio - 1.0) > LEVEL_SIZE or -down > cosine * norm:
        return 0
    level(s, w, fx, fy, fz, norm)
    restart_tilt(s, w, g, sample.forward_speed / g.gravity)
    s.extra_tilt_sigma = LEVEL_SIGMA
    return RESTARTED


def begin_anew(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Starts the tilt again after clipped samples that may have hidden a turn.

    Source: docs/filter.md Eq. (30).
    """
    fx = sample.accel[0] - g.gravity * s.accel_bias[0]
    fy = sample.accel[1] - g.gravity * s.accel_bias[1]
    fz = sample.accel[2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if s.clipped_angle > ALL_CLIPPED and norm > 0.0:
        level(s, w, fx, fy, fz, norm)
    restart_tilt(s, w, g, sample.forward_speed / g.gravity)
    return RESTARTED


def level(s: State, w: Workspace, fx: float, fy: float, fz: float, norm: float) -> None:
    """Turns the attitude so that a force, of size norm, points up; the next field sets the heading.

    Source: docs/filter.md Eq. (32).
    """
    # The smallest turn that does it: half its tangent along its axis.
    scale = norm - (w.r_nb[6] * fx + w.r_nb[7] * fy + w.r_nb[8] * fz)
    north = w.r_nb[0] * fx + w.r_nb[1] * fy + w.r_nb[2] * fz
    east = w.r_nb[3] * fx + w.r_nb[4] * fy + w.r_nb[5] * fz
    if scale < 0.001 * norm:
        # Upside down: about any horizontal axis.
        scale = 0.001 * norm
        north = norm
    turn(s, -east / scale, north / scale, 0.0)
    set_matrix(s, w, s.q_nb[0], s.q_nb[1], s.q_nb[2], s.q_nb[3])
    # The last heading rests on the wrong tilt: the next field gives it, as at the start.
    s.mag_accepted_age_s = HEADING_LOST


def restart_tilt(s: State, w: Workspace, g: Gains, nose: float) -> None:
    """Starts the tilt again after an impossible velocity; keeps bias and heading.

    Source: docs/filter.md Eq. (14).
    """
    forget_sensitivities(s, w)
    s.velocity_n = nose * w.r_nb[0]
    s.velocity_e = nose * w.r_nb[3]
    s.turning = 0.0
    s.innovation_power = 0.0
    s.innovation_mean_n = 0.0
    s.innovation_mean_e = 0.0
    s.innovation_variance = 0.0
    s.age_s = 0.0
    s.fixes_rejected = MAX_REJECTED
    s.tilt_suspect = 0.0
    s.steady_s = 0.0
