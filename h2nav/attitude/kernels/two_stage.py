"""One step of the two-stage filter on the rotation group, in the translatable subset.

`x` is the filter's memory, `g` its gains and limits, `z` one sample; the named constants are the
indices. The frame is magnetic NED: x north of the compass, z down. Angles are rad, rates rad/s,
forces m/s^2, fields microtesla, times s.

Equations: docs/derivation.md section 3.
"""

# ruff: noqa: PLR1730  (the subset has no min)

import math
from collections.abc import Sequence

# --- x: memory ---
X_Q = 0  # 4: attitude, body to magnetic NED, scalar first
X_BIAS = 4  # 3: gyro bias
X_U = 7  # 9: regressor, row by row: attitude error = -U (bias error)
X_P = 16  # 6: bias covariance: 00, 01, 02, 11, 12, 22
X_RES = 22  # 2: low-passed horizontal force, north and east
X_JITTER = 24  # variance of the horizontal force about its low-pass
X_LEVEL = 25  # low-passed square of X_RES: how much the vehicle accelerates
X_T_RUN = 26  # time since alignment
X_T_MOVING = 27  # time for which the gain level has not been 0
X_T_NO_FIELD = 28  # time since a field sample was believed
X_HEADING = 29  # 1: the heading is tied to north, 0: to nothing
X_T_WRONG = 30  # time for which both sensors have contradicted the attitude
X_SUM_FORCE = 31  # 3: sum of -force in NED over that time
X_SUM_FIELD = 34  # 3: sum of the field in NED over that time
X_T_FIELD_AGE = 37  # time since the last field sample, believed or not
X_CONVERGED = 38  # 1 after the start-up transient
X_RATE = 39  # 3: gyro sample before this one
X_VAR = 42  # 4: covariance of the bias-free attitude error: nn, ee, dd, nd
X_T_TURNED = 46  # time for which a sane field has contradicted nothing but the heading
X_T_CLIPPED = 47  # time since the last sample that was not clipped
X_MEAN = 48  # 2: slow mean of X_RES: tilt error, not acceleration
X_AGE = 50  # time over which X_LEVEL has been averaged
X_BIAS_0 = 51  # 3: bias at the start
X_P_0 = 54  # 6: its covariance
X_POWER = 60  # as X_LEVEL, without its cap
X_BLIND = 61  # 1: started in motion; the bias has never been learnt at rest
X_SIZE = 62
# results that are not memory
X_R = 62  # 9: attitude matrix before the correction, row by row
X_F = 71  # 3: -force in NED
X_M = 74  # 3: field in NED
X_ZETA = 77  # 3: weighted innovation
X_INFO = 80  # 4: its information: nn, ee, dd, nd
X_SHARE = 84  # force's honest weight as a share of its level's
X_SHARE_D = 85  # the same of the heading, whose field is seen from the force's tilt
X_APART = 86  # 1: force corrects only tilt and field only heading
X_HELD = 87  # 1: the field's innovation was cut and teaches no bias
X_FROZEN = 88  # 1: the force's innovation is too steady and teaches no bias
X_TOTAL = 89

# --- z: sample ---
Z_DT = 0
Z_RATE = 1
Z_FORCE = 4
Z_FIELD = 7
Z_HAS_FIELD = 10
Z_CLIPPED = 11
Z_SIZE = 12

# --- g: gains and limits ---
G_DT = 0  # nominal step
G_GRAVITY = 1
G_FIELD_N = 2  # reference field, north and down
G_FIELD_D = 3
G_FORCE_INFO = 4  # 1 / variance of one force sample
G_FIELD_INFO = 5  # 1 / variance of one field sample
G_BIAS_WALK = 6  # variance per second
G_MEAN_RATE = 7  # 1: gyro samples are means over the step before them; 0: instants
G_FORCE_GATE = 8  # m/s^2
G_FIELD_GATE = 9  # microtesla
G_NORM_SHARE = 10  # tolerated relative deviation of a norm
G_DIP_SHARE = 11  # tolerated deviation of the sine of the angle between force and field
G_T_RESIDUAL = 12  # time constants
G_T_LEVEL = 13
G_T_CONVERGE = 14
G_T_HOLD = 15  # a moving vehicle's force outside the gate is ignored for so long
G_T_TURNED = 16  # a sane field outside the gate sets the heading after so long
G_T_WRONG = 17
G_BIAS_STEP = 18  # limits of one bias step and of the bias
G_BIAS_LIMIT = 19
G_LEVEL_CAP = 20  # (m/s^2)^2
G_T_HEADING_LOST = 21  # a heading without field for so long is none
G_GYRO_WALK = 22  # variance of the attitude per second
G_FIELD_CUT = 23  # microtesla: longest innovation of the field that is taken whole
G_LAST_POWER = 24  # X_LEVEL for which the slowest level's weight is right
G_BIAS_DOUBT = 25  # variance that a contradicted attitude adds to the bias
G_T_MEAN = 26  # s: time constant of X_MEAN
G_T_ALIGN = 27  # s: for so long the field gives only heading: its dip is not known yet
G_T_STILL = 28  # s: a vehicle that has begun at rest has shown it after so long
G_STILL_2 = 29  # (m/s^2)^2: steadier force than this teaches no bias
G_FROZEN_WALK = 30  # variance per second of a bias that is not learnt though it might
G_LEVELS = 31  # then per level: threshold of X_LEVEL, weight, k_nn, k_ee, k_dd, k_nd
LEVELS = 7
LEVEL_SIZE = 6
G_SIZE = 73

# The constant gains serve once no variance is above its fixed point by more than this.
STEADY = 1.02

# Variances of the tilt, rad^2: (1.2 deg)^2 opens the gates again, beyond (30 deg)^2 the linear
# correction means nothing.
OPEN_VARIANCE = 4e-4
LOST_VARIANCE = 0.27

# --- bits of the result ---
FORCE_USED = 1
FIELD_USED = 2
WRONG = 4  # both sensors have contradicted the attitude for too long: align again
SATURATED = 8
MOVED = 32  # the vehicle was in motion when it was thought to start at rest: start again
LOST = 16  # the attitude is unknown after clipped samples: align with this sample


def step(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes one sample: propagates over `Z_DT`, then corrects. Returns bits.

    Source: docs/derivation.md Eq. (3.8) - (3.16).
    """
    propagate(x, g, z)
    measure(x, z)
    if z[Z_CLIPPED] > 0.0:
        pass_clipped(x, z)
        return 0
    x[X_T_CLIPPED] = 0.0
    if x[X_VAR] > LOST_VARIANCE and force_sane(x, g) == 1:
        return LOST
    level = track_force(x, g, z)
    if x[X_CONVERGED] < 1.0 and x[X_POWER] > 2.0 * g[G_LAST_POWER] and x[X_AGE] < g[G_T_STILL]:
        return MOVED
    if track_contradiction(x, g, z) == WRONG:
        return WRONG
    if z[Z_HAS_FIELD] > 0.0 and field_sane(x, g) == 1:
        if x[X_HEADING] < 1.0:
            take_heading(x, g)
            return FIELD_USED
        if track_turned(x, g) == 1:
            take_heading(x, g)
            doubt_bias(x, g)
            return FIELD_USED
    bits = weigh(x, g, z, level)
    if x[X_T_RUN] > g[G_T_CONVERGE] and force_near(x, g) == 1:
        x[X_CONVERGED] = 1.0
    return bits + correct(x, g, level)


def propagate(x: list[float], g: Sequence[float], z: Sequence[float]) -> None:
    """Attitude, regressor and bias covariance over one step; the attitude matrix into X_R.

    Source: docs/derivation.md Eq. (3.8), (3.9).
    """
    dt = z[Z_DT]
    # The part of the step that the new sample does not cover is bridged by the average of both.
    share = 0.5
    if g[G_MEAN_RATE] > 0.0:
        share = 0.0
        if dt > 1.5 * g[G_DT]:
            share = 0.5 * (1.0 - g[G_DT] / dt)
    phi_x = dt * (z[Z_RATE] + share * (x[X_RATE] - z[Z_RATE]) - x[X_BIAS])
    phi_y = dt * (z[Z_RATE + 1] + share * (x[X_RATE + 1] - z[Z_RATE + 1]) - x[X_BIAS + 1])
    phi_z = dt * (z[Z_RATE + 2] + share * (x[X_RATE + 2] - z[Z_RATE + 2]) - x[X_BIAS + 2])
    for i in range(3):
        x[X_RATE + i] = z[Z_RATE + i]
    turn_body(x, phi_x, phi_y, phi_z)
    for i in range(9):
        x[X_U + i] += dt * x[X_R + i]
    if x[X_T_NO_FIELD] > g[G_T_HEADING_LOST]:
        x[X_HEADING] = 0.0
    if x[X_HEADING] < 1.0:
        # Nothing will ever compare this heading with another: its sensitivity has no use.
        for i in range(3):
            x[X_U + 6 + i] = 0.0
    x[X_P] += g[G_BIAS_WALK] * dt
    x[X_P + 3] += g[G_BIAS_WALK] * dt
    x[X_P + 5] += g[G_BIAS_WALK] * dt
    for i in range(3):
        x[X_VAR + i] += g[G_GYRO_WALK] * dt
    x[X_T_RUN] += dt
    x[X_T_NO_FIELD] += dt
    x[X_T_FIELD_AGE] += dt


def pass_clipped(x: list[float], z: Sequence[float]) -> None:
    """A sample whose true rate is unknown: nothing is learnt, and the attitude gets uncertain.

    A rate that is wrong by its own size for T leaves an error of rate T.

    Source: docs/derivation.md Eq. (3.20).
    """
    for i in range(9):
        # What the rate does to the attitude must not be booked as bias.
        x[X_U + i] = 0.0
    rate_2 = z[Z_RATE] * z[Z_RATE] + z[Z_RATE + 1] * z[Z_RATE + 1] + z[Z_RATE + 2] * z[Z_RATE + 2]
    growth = rate_2 * z[Z_DT] * (2.0 * x[X_T_CLIPPED] + z[Z_DT])
    x[X_T_CLIPPED] += z[Z_DT]
    for i in range(3):
        x[X_VAR + i] += growth
    if x[X_VAR] > OPEN_VARIANCE:
        x[X_CONVERGED] = 0.0
        x[X_T_RUN] = 0.0


def turn_body(x: list[float], phi_x: float, phi_y: float, phi_z: float) -> None:
    """Turns the attitude about body axes: q <- q Exp(phi); its matrix into X_R.

    Source: docs/derivation.md Eq. (1.3), (1.4).
    """
    half = 0.5 * math.sqrt(phi_x * phi_x + phi_y * phi_y + phi_z * phi_z)
    c = math.cos(half)
    s = 0.5
    if half > 1e-8:
        s = 0.5 * math.sin(half) / half
    px = s * phi_x
    py = s * phi_y
    pz = s * phi_z
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + pz * qy - py * qz
    uy = c * qy + py * qw + px * qz - pz * qx
    uz = c * qz + pz * qw + py * qx - px * qy
    x[X_Q] = w
    x[X_Q + 1] = ux
    x[X_Q + 2] = uy
    x[X_Q + 3] = uz
    x[X_R] = 1.0 - 2.0 * (uy * uy + uz * uz)
    x[X_R + 1] = 2.0 * (ux * uy - w * uz)
    x[X_R + 2] = 2.0 * (ux * uz + w * uy)
    x[X_R + 3] = 2.0 * (ux * uy + w * uz)
    x[X_R + 4] = 1.0 - 2.0 * (ux * ux + uz * uz)
    x[X_R + 5] = 2.0 * (uy * uz - w * ux)
    x[X_R + 6] = 2.0 * (ux * uz - w * uy)
    x[X_R + 7] = 2.0 * (uy * uz + w * ux)
    x[X_R + 8] = 1.0 - 2.0 * (ux * ux + uy * uy)


def measure(x: list[float], z: Sequence[float]) -> None:
    """The measured vectors in NED: X_F = R y_a with y_a = -f_b, X_M = R y_m."""
    ax = -z[Z_FORCE]
    ay = -z[Z_FORCE + 1]
    az = -z[Z_FORCE + 2]
    x[X_F] = x[X_R] * ax + x[X_R + 1] * ay + x[X_R + 2] * az
    x[X_F + 1] = x[X_R + 3] * ax + x[X_R + 4] * ay + x[X_R + 5] * az
    x[X_F + 2] = x[X_R + 6] * ax + x[X_R + 7] * ay + x[X_R + 8] * az
    if z[Z_HAS_FIELD] > 0.0:
        mx = z[Z_FIELD]
        my = z[Z_FIELD + 1]
        mz = z[Z_FIELD + 2]
        x[X_M] = x[X_R] * mx + x[X_R + 1] * my + x[X_R + 2] * mz
        x[X_M + 1] = x[X_R + 3] * mx + x[X_R + 4] * my + x[X_R + 5] * mz
        x[X_M + 2] = x[X_R + 6] * mx + x[X_R + 7] * my + x[X_R + 8] * mz


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


def field_near(x: list[float], g: Sequence[float]) -> int:
    """1 when the field is the reference within the gate."""
    off_n = x[X_M] - g[G_FIELD_N]
    off_d = x[X_M + 2] - g[G_FIELD_D]
    if off_n * off_n + x[X_M + 1] * x[X_M + 1] + off_d * off_d < g[G_FIELD_GATE] * g[G_FIELD_GATE]:
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
    if force_near(x, g) + field_near(x, g) == 0 and force_sane(x, g) + field_sane(x, g) == 2:
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
    if field_near(x, g) == 1 or math.fabs(x[X_M + 2] - g[G_FIELD_D]) > g[G_FIELD_GATE]:
        x[X_T_TURNED] = 0.0
        return 0
    x[X_T_TURNED] += x[X_T_FIELD_AGE]
    if x[X_T_TURNED] > g[G_T_TURNED]:
        return 1
    return 0


def doubt_bias(x: list[float], g: Sequence[float]) -> None:
    """What led the attitude astray may have led the bias astray, beyond its covariance."""
    x[X_P] += g[G_BIAS_DOUBT]
    x[X_P + 3] += g[G_BIAS_DOUBT]
    x[X_P + 5] += g[G_BIAS_DOUBT]


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
    if x[X_CONVERGED] > 0.0 and level == 0 and force_near(x, g) == 1:
        freeze(x, g, z[Z_DT])
    x[X_APART] = 0.0
    if x[X_BLIND] > 0.0 or x[X_T_RUN] < g[G_T_ALIGN]:
        x[X_APART] = 1.0
    bits = 0
    if x[X_T_WRONG] <= 0.0:
        if (
            force_near(x, g) == 1
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
            and (field_near(x, g) == 1 or x[X_CONVERGED] < 1.0)
        ):
            bits = bits + FIELD_USED
            weigh_field(x, g, g[G_LEVELS + LEVEL_SIZE * level + 1])
    if z[Z_HAS_FIELD] > 0.0:
        x[X_T_FIELD_AGE] = 0.0
    return bits


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


def freeze(x: list[float], g: Sequence[float], dt: float) -> None:
    """Sets X_FROZEN while the force stands off its place by more than the bias explains."""
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
    """Adds the field; a sample that stands for several steps carries their information."""
    x[X_T_NO_FIELD] = 0.0
    steps = x[X_T_FIELD_AGE] / g[G_DT]
    if steps > 20.0:
        steps = 20.0
    off_n = x[X_M] - g[G_FIELD_N]
    off_e = x[X_M + 1]
    off_d = x[X_M + 2] - g[G_FIELD_D]
    size = math.sqrt(off_n * off_n + off_e * off_e + off_d * off_d)
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


def turn_world(x: list[float], eps_n: float, eps_e: float, eps_d: float) -> None:
    """Turns the attitude about NED axes, q <- Exp(eps) q, and restores its length.

    Source: docs/derivation.md Eq. (1.4), (3.13).
    """
    half = 0.5 * math.sqrt(eps_n * eps_n + eps_e * eps_e + eps_d * eps_d)
    c = math.cos(half)
    s = 0.5
    if half > 1e-8:
        s = 0.5 * math.sin(half) / half
    px = s * eps_n
    py = s * eps_e
    pz = s * eps_d
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    w = c * qw - px * qx - py * qy - pz * qz
    ux = c * qx + px * qw + py * qz - pz * qy
    uy = c * qy + py * qw + pz * qx - px * qz
    uz = c * qz + pz * qw + px * qy - py * qx
    # One Newton step for 1 / sqrt: the length never strays further than rounding.
    scale = 1.5 - 0.5 * (w * w + ux * ux + uy * uy + uz * uz)
    x[X_Q] = scale * w
    x[X_Q + 1] = scale * ux
    x[X_Q + 2] = scale * uy
    x[X_Q + 3] = scale * uz
