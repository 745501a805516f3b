"""Prediction of attitude and velocity, and rotations of the attitude.

Equations: docs/filter.md.
"""

import math

from ..memory import MAX_REJECTED, Gains, Sample, State, Workspace
from .field_offset import begin_offset, predict_offset

# rad/s^2: a MEMS gyro warms up by 0.05 to 0.5 deg/s per minute.
WARM_UP = 0.05 / 60.0 * (math.pi / 180.0)
LONGEST_STEP = 0.15  # s: samples come at 10 Hz at least, so that of a longer step some are missing


def predict_attitude(s: State, w: Workspace, sample: Sample) -> None:
    """Propagates the attitude, and its matrix, over one step.

    Source: docs/filter.md Eq. (4), (73).
    """
    dt = sample.dt_s
    x = sample.gyro[0]
    y = sample.gyro[1]
    z = sample.gyro[2]
    if dt > LONGEST_STEP:
        x = 0.5 * (s.gyro_last[0] + x)
        y = 0.5 * (s.gyro_last[1] + y)
        z = 0.5 * (s.gyro_last[2] + z)
    turn_body(
        s,
        w,
        dt * (x - s.gyro_bias[0]),
        dt * (y - s.gyro_bias[1]),
        dt * (z - s.gyro_bias[2]),
    )


def turn_body(s: State, w: Workspace, px: float, py: float, pz: float) -> None:
    """Turns the attitude in body axes: q <- q Exp(p), and its matrix."""
    half = 0.5 * math.sqrt(px * px + py * py + pz * pz)
    c = math.cos(half)
    k = 0.5
    if half > 1e-9:
        k = 0.5 * math.sin(half) / half
    px = k * px
    py = k * py
    pz = k * pz
    qw = s.q_nb[0]
    qx = s.q_nb[1]
    qy = s.q_nb[2]
    qz = s.q_nb[3]
    nw = c * qw - px * qx - py * qy - pz * qz
    nx = c * qx + px * qw + pz * qy - py * qz
    ny = c * qy + py * qw + px * qz - pz * qx
    nz = c * qz + pz * qw + py * qx - px * qy
    # One Newton step towards unit length: the length is never far from 1.
    k = 1.5 - 0.5 * (nw * nw + nx * nx + ny * ny + nz * nz)
    nw = k * nw
    nx = k * nx
    ny = k * ny
    nz = k * nz
    s.q_nb[0] = nw
    s.q_nb[1] = nx
    s.q_nb[2] = ny
    s.q_nb[3] = nz
    set_matrix(s, w, nw, nx, ny, nz)


def set_matrix(s: State, w: Workspace, nw: float, nx: float, ny: float, nz: float) -> None:
    """The matrix of an attitude, row by row, into r_nb."""
    w.r_nb[0] = 1.0 - 2.0 * (ny * ny + nz * nz)
    w.r_nb[1] = 2.0 * (nx * ny - nw * nz)
    w.r_nb[2] = 2.0 * (nx * nz + nw * ny)
    w.r_nb[3] = 2.0 * (nx * ny + nw * nz)
    w.r_nb[4] = 1.0 - 2.0 * (nx * nx + nz * nz)
    w.r_nb[5] = 2.0 * (ny * nz - nw * nx)
    w.r_nb[6] = 2.0 * (nx * nz - nw * ny)
    w.r_nb[7] = 2.0 * (ny * nz + nw * nx)
    w.r_nb[8] = 1.0 - 2.0 * (nx * nx + ny * ny)


def turn(s: State, a: float, b: float, c: float) -> None:
    """Turns the attitude in NED by the vector whose half is given: q <- Exp(2 (a, b, c)) q.

    q is normalized afterwards: large turns shrink, and pi is a limit instead of a wrap. Source:
    docs/filter.md Eq. (19).
    """
    qw = s.q_nb[0]
    qx = s.q_nb[1]
    qy = s.q_nb[2]
    qz = s.q_nb[3]
    k = 1.0 / math.sqrt(1.0 + a * a + b * b + c * c)
    s.heading_turned = s.heading_turned + 2.0 * math.atan2(c, 1.0)
    s.q_nb[0] = k * (qw - a * qx - b * qy - c * qz)
    s.q_nb[1] = k * (qx + a * qw + b * qz - c * qy)
    s.q_nb[2] = k * (qy + b * qw + c * qx - a * qz)
    s.q_nb[3] = k * (qz + c * qw + a * qy - b * qx)


def predict_velocity(s: State, w: Workspace, g: Gains, sample: Sample) -> None:
    """Propagates velocity, noise levels and start-up; switches between kinds of velocity.

    Source: docs/filter.md Eq. (5), (8), (13).
    """
    dt = sample.dt_s
    fx = sample.accel[0] / g.gravity - s.accel_bias[0]
    fy = sample.accel[1] / g.gravity - s.accel_bias[1]
    fz = sample.accel[2] / g.gravity
    north = dt * (w.r_nb[0] * fx + w.r_nb[1] * fy + w.r_nb[2] * fz)
    east = dt * (w.r_nb[3] * fx + w.r_nb[4] * fy + w.r_nb[5] * fz)
    if sample.aided != s.aided:
        # A measured and a bounded velocity are unrelated.
        forget_velocity(s)
        s.dtilt_n[3] = 0.0
        s.dtilt_e[3] = 0.0
        s.velocity_n = sample.forward_speed * w.r_nb[0] / g.gravity
        s.velocity_e = sample.forward_speed * w.r_nb[3] / g.gravity
        s.gained_n = 0.0
        s.gained_e = 0.0
        s.fixes_rejected = MAX_REJECTED
        s.tilt_suspect = 0.0
        s.aided = sample.aided
        begin_bias(s, w, g)
    if sample.aided > 0.0:
        # Only a measured velocity shows the heading: a bounded one is bounded in any direction. At
        # rest nothing accelerates; what is felt then is a wrong tilt.
        if s.rest_s < g.rest_time_s:
            s.dvelocity_n[3] = s.dvelocity_n[3] - east
            s.dvelocity_e[3] = s.dvelocity_e[3] + north
        s.gained_n = s.gained_n + north
        s.gained_e = s.gained_e + east
        warm_up(s, g, dt)
        predict_shared(s, w, g, dt)
        predict_accel(s, w, dt)
    s.velocity_n = s.velocity_n + north
    s.velocity_e = s.velocity_e + east
    s.age_s = s.age_s + dt
    # The initial tilt error is not due to the bias: the second stage waits until it has passed.
    ease = g.startup_time_s / s.age_s
    ease = ease * ease
    s.startup_inflation = 1.0 + ease * ease
    share = share_of_levels(s, g, dt)
    follow_rate(s, sample, share)
    jitter = jolt_of(s.accel_last, s.accel_step, sample.accel)
    s.accel_jitter = s.accel_jitter + share * (dt * jitter - s.accel_jitter)


def share_of_levels(s: State, g: Gains, dt: float) -> float:
    """Share of one sample in the levels of noise and motion."""
    time = g.level_time_s
    if s.age_s < time:
        time = s.age_s
    if time < dt:  # no force has come since the tilt was found
        time = dt
    return dt / time


def follow_rate(s: State, sample: Sample, share: float) -> None:
    """Updates the noise of the rate and how fast the vehicle turns by a sample with this share.

    Source: docs/filter.md Eq. (8).
    """
    jitter = jolt_of(s.gyro_last, s.gyro_step, sample.gyro)
    s.gyro_jitter = s.gyro_jitter + share * (sample.dt_s * jitter - s.gyro_jitter)
    wx = sample.gyro[0] - s.gyro_bias[0]
    wy = sample.gyro[1] - s.gyro_bias[1]
    wz = sample.gyro[2] - s.gyro_bias[2]
    s.turning = s.turning + share * (wx * wx + wy * wy + wz * wz - s.turning)


def jolt_of(last: list[float], step: list[float], now: list[float]) -> float:
    """Variance of the white noise in a sensor's axes, by one second difference of each.

    Source: docs/filter.md Eq. (8).
    """
    square = 0.0
    for i in range(3):
        change = now[i] - last[i]
        jolt = change - step[i]
        square = square + jolt * jolt
        step[i] = change
        last[i] = now[i]
    # A second difference has six times the variance of white noise, and there are three axes.
    return square / 18.0


def gyro_density(s: State, g: Gains) -> float:
    """Density of the gyro's noise as it acts on the tilt, squared, rad^2/s.

    Source: docs/filter.md Eq. (8).
    """
    return g.gyro_noise + g.scale_noise * s.turning + g.jitter_share * s.gyro_jitter


def forget_sensitivities(s: State, w: Workspace) -> None:
    """Clears the sensitivities: a new tilt and velocity do not depend on theta yet."""
    forget_velocity(s)
    for i in range(4):
        s.dtilt_n[i] = 0.0
        s.dtilt_e[i] = 0.0
    level_sensitivities(s, w)


def level_sensitivities(s: State, w: Workspace) -> None:
    """Sets the sensitivities of a tilt taken from a resting accelerometer to its bias.

    Source: docs/filter.md Eq. (35).
    """
    for i in range(2):
        s.dtilt_accel_n[i] = w.r_nb[i]
        s.dtilt_accel_e[i] = w.r_nb[3 + i]
        s.dtilt_lag[i] = 0.0


def forget_velocity(s: State) -> None:
    """Starts the velocity again."""
    for i in range(4):
        s.dvelocity_n[i] = 0.0
        s.dvelocity_e[i] = 0.0
    for i in range(2):
        s.dvelocity_accel_n[i] = 0.0
        s.dvelocity_accel_e[i] = 0.0
        s.dvelocity_lag[i] = 0.0
    s.unused_variance = 0.0


def begin_bias(s: State, w: Workspace, g: Gains) -> None:
    """Begins to learn, or freezes, bias and latency when measured velocities begin or end.

    Source: docs/filter.md Eq. (35), (36).
    """
    for i in range(4):
        s.p_accel_x[i] = 0.0
        s.p_accel_y[i] = 0.0
    begin_offset(s, w, g)
    for i in range(3):
        # Nothing shows yet how the biases move.
        s.bias_moved[i] = 0.0
        s.bias_trend[i] = 0.0
        s.bias_expected[i] = 0.0
        s.bias_usual[i] = 0.0
        s.bias_walk[i] = 0.0
    level_sensitivities(s, w)
    s.fix_period_s = 1.0
    s.k_tilt = 0.0
    if s.aided > 0.0 and s.p_accel[0] == 0.0:
        s.p_accel[0] = g.accel_variance
        s.p_accel[2] = g.accel_variance
        s.fix_lag_variance = g.fix_lag_variance


def warm_up(s: State, g: Gains, dt: float) -> None:
    """Lets the deviation of a vertical bias that no field shows grow as a warm-up does.

    Source: docs/filter.md Eq. (80).
    """
    if s.mag_accepted_age_s < 0.0 and s.p_zz > 0.0 and s.p_zz < g.bias_variance:
        s.p_zz = s.p_zz + 2.0 * dt * WARM_UP * math.sqrt(s.p_zz)


def predict_shared(s: State, w: Workspace, g: Gains, dt: float) -> None:
    """Propagates the covariances of what only measured velocities show over one step.

    They share the heading's error with theta: where theta's covariance is propagated, so are they.

    Source: docs/filter.md Eq. (34), (36), (60).
    """
    predict_offset(s, w, g, dt)
    dx = dt * w.r_nb[6]
    dy = dt * w.r_nb[7]
    dz = dt * w.r_nb[8]
    s.p_accel_x[3] = s.p_accel_x[3] - (
        dx * s.p_accel_x[0] + dy * s.p_accel_x[1] + dz * s.p_accel_x[2]
    )
    s.p_accel_y[3] = s.p_accel_y[3] - (
        dx * s.p_accel_y[0] + dy * s.p_accel_y[1] + dz * s.p_accel_y[2]
    )
    walk = g.accel_walk * dt
    if s.p_accel[0] < g.accel_variance:
        s.p_accel[0] = s.p_accel[0] + walk
    if s.p_accel[2] < g.accel_variance:
        s.p_accel[2] = s.p_accel[2] + walk
    if s.fix_lag_variance < g.fix_lag_variance:
        s.fix_lag_variance = s.fix_lag_variance + g.fix_lag_walk * dt


def predict_accel(s: State, w: Workspace, dt: float) -> None:
    """Propagates the sensitivities to accelerometer bias and latency over one step.

    Source: docs/filter.md Eq. (34), (38).
    """
    for i in range(2):
        s.dvelocity_accel_n[i] = s.dvelocity_accel_n[i] + dt * (s.dtilt_accel_n[i] - w.r_nb[i])
        s.dvelocity_accel_e[i] = s.dvelocity_accel_e[i] + dt * (s.dtilt_accel_e[i] - w.r_nb[3 + i])
        s.dvelocity_lag[i] = s.dvelocity_lag[i] + dt * s.dtilt_lag[i]
