"""One step of the constant-gain attitude filter in 32-bit integers with 16-bit factors.

Translates to C99 without a 64-bit product, a division or a branch. The frame n is north-east-down
with magnetic north. Formats and the proof of the ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (1) to (9).
"""

from h2nav.maths.fixedpoint import I32, clamp, known, known

# state
Q_W, Q_X, Q_Y, Q_Z = range(4)  # attitude, Q2.29
B_X, B_Y, B_Z = range(4, 7)  # gyro bias, half radians per microsecond, Q54
C_X, C_Y, C_Z = range(7, 10)  # bias correction not yet applied
T_X, T_Y, T_Z = range(10, 13)  # turn not yet applied, half radians, Q30
AGE_US = 13  # time since the alignment; -1: not aligned
DISAGREE_US = 14  # for how long both sensors have contradicted the attitude
SATURATIONS = 15  # samples in which a limit was met
STATE_SIZE = 16

# parameters
FIELD_X, FIELD_Z = range(2)  # direction of the earth field, Q14
WEIGHT_G, WEIGHT_FX, WEIGHT_FZ = range(2, 5)  # of gravity, of the field times its direction, Q14
P_XX, P_XZ, P_YY, P_ZZ, P_SHIFT = range(5, 10)  # attitude gain, Q(14 + shift)
I_XX, I_XZ, I_YY, I_ZZ, I_SHIFT = range(10, 15)  # bias gain, mantissa and shift
FORCE_TOLERANCE, FIELD_TOLERANCE, DIP_TOLERANCE = range(15, 18)  # Q26, Q26, Q14
BOOST_1_US, BOOST_2_US, BOOST_3_US = range(18, 21)  # until when the gain is 2, 4, 8 times as high
PARAMS_SIZE = 21

# sample
W_X, W_Y, W_Z = range(3)  # angular rate, radians per microsecond, Q40
G_X, G_Y, G_Z = range(3, 6)  # opposite of the specific force in units of gravity, Q14
F_X, F_Y, F_Z = range(6, 9)  # magnetic field in units of its expected norm, Q14
HAS_FIELD = 9  # -1 when the sample brings a new field, else 0
DT_US = 10  # time since the sample before
SAMPLE_SIZE = 11

# bits of the result
FORCE_USED = 1
FIELD_USED = 2
ALIGNED = 4  # this sample has given a first attitude
DISAGREES = 8  # both sensors have contradicted the attitude for a second: the next one aligns
SATURATED = 16  # a rate, a turn or the bias met its limit

ONE_Q26 = 1 << 26
Q_LIMIT = 32767 << 14  # Q29; the norm stays below one (Lemma 1)
R_LIMIT = 32767  # Q15
VECTOR_LIMIT = 20480  # 1.25 in Q14: longest vector that passes the gate
RATE_LIMIT = 19241453  # 35 rad/s
BIAS_LIMIT = 900719925  # 0.2 rad/s
BIAS_BITS = 13  # of the bias below the resolution of the rate
ZETA_LIMIT = 40960  # 1.25 in Q15
GAIN_LIMIT = 8400  # two products with ZETA_LIMIT, brought to TURN_LIMIT
TURN_LIMIT = 21000  # three products with R_LIMIT and a remainder fit 32 bits
STEP_LIMIT = 1 << 28  # half a radian per step
NORM_Q26 = (1 << 26) - (1 << 15)  # the norm's target lies below one by what rounding may add
THIRD_Q16 = 21845
AGREE_FORCE = 14189  # cosine of 30 degrees, Q14
AGREE_FIELD = 12551 << 14  # cosine of 40 degrees, Q28
DISAGREE_LIMIT_US = 1000000
AGE_LIMIT_US = 1 << 30
ALIGN_TOLERANCE = 1 << 24  # a quarter in Q26
NOSE_DOWN = 14189  # sine of 60 degrees, Q14
SATURATIONS_LIMIT = 1 << 30

STATE_RANGES = (
    *(((-Q_LIMIT, Q_LIMIT),) * 4),
    *(((-BIAS_LIMIT, BIAS_LIMIT),) * 3),
    *(((0, (1 << 26) - 1),) * 3),
    *(((-8192, 8191),) * 3),
    (-1, AGE_LIMIT_US),
    (0, DISAGREE_LIMIT_US + 1),
    (0, SATURATIONS_LIMIT),
)
PARAMS_RANGES = (
    *(((-UNIT_Q14, UNIT_Q14),) * 2),
    (0, UNIT_Q14),
    *(((-UNIT_Q14, UNIT_Q14),) * 2),
    *(((-GAIN_LIMIT, GAIN_LIMIT),) * 4),
    (5, 24),
    *(((-GAIN_LIMIT, GAIN_LIMIT),) * 4),
    (4, 26),
    (0, ONE_Q26 >> 1),
    (0, ONE_Q26 >> 1),
    (0, 1 << 16),
    *(((0, 1 << 29),) * 3),
)
SAMPLE_RANGES = (
    *(((-(1 << 31), (1 << 31) - 1),) * 3),
    *(((-32768, 32767),) * 6),
    (-1, 0),
    (0, 65535),
)


def rotation(state: list[I32], q: list[I32], r: list[I32]) -> None:
    """Writes the attitude in Q15 and its matrix from body to n, by rows, Q15.

    Source: docs/fixed-point.md Eq. (1).
    """
    w = (state[Q_W] + 8192) >> 14
    x = (state[Q_X] + 8192) >> 14
    y = (state[Q_Y] + 8192) >> 14
    z = (state[Q_Z] + 8192) >> 14
    q[0] = w
    q[1] = x
    q[2] = y
    q[3] = z
    ww = w * w + 16384
    xx = x * x
    yy = y * y
    zz = z * z
    # no entry of a rotation exceeds one (Lemma 2)
    r[0] = known((ww + xx - yy - zz) >> 15, -R_LIMIT, R_LIMIT)
    r[4] = known((ww - xx + yy - zz) >> 15, -R_LIMIT, R_LIMIT)
    r[8] = known((ww - xx - yy + zz) >> 15, -R_LIMIT, R_LIMIT)
    wx = w * x
    yz = y * z + 8192
    r[5] = known((yz - wx) >> 14, -R_LIMIT, R_LIMIT)
    r[7] = known((yz + wx) >> 14, -R_LIMIT, R_LIMIT)
    wy = w * y
    xz = x * z + 8192
    r[2] = known((xz + wy) >> 14, -R_LIMIT, R_LIMIT)
    r[6] = known((xz - wy) >> 14, -R_LIMIT, R_LIMIT)
    wz = w * z
    xy = x * y + 8192
    r[1] = known((xy - wz) >> 14, -R_LIMIT, R_LIMIT)
    r[3] = known((xy + wz) >> 14, -R_LIMIT, R_LIMIT)


def rotated(r0: I32, r1: I32, r2: I32, v: list[I32]) -> I32:
    """One coordinate in n of a sane vector in the body frame, Q14."""
    # a turn keeps the norm (Lemma 2)
    return known((r0 * v[0] + r1 * v[1] + r2 * v[2] + 16384) >> 15, -VECTOR_LIMIT, VECTOR_LIMIT)


def unrotated(r0: I32, r3: I32, r6: I32, e: list[I32]) -> I32:
    """One coordinate in the body frame of a vector in n, with 15 more fraction bits."""
    return r0 * e[0] + r3 * e[1] + r6 * e[2]


def sane(v: list[I32], x: I32, y: I32, z: I32, tolerance: I32) -> I32:
    """Writes the vector if its squared norm is one within `tolerance` (Q26), else zeros.

    Returns -1 for a sane vector, else 0.
    """
    norm = (x >> 1) * (x >> 1) + (y >> 1) * (y >> 1) + (z >> 1) * (z >> 1)
    gate = (abs(norm - ONE_Q26) - tolerance) >> 31
    # the tolerance is at most a half (Lemma 2)
    v[0] = known(x & gate, -VECTOR_LIMIT, VECTOR_LIMIT)
    v[1] = known(y & gate, -VECTOR_LIMIT, VECTOR_LIMIT)
    v[2] = known(z & gate, -VECTOR_LIMIT, VECTOR_LIMIT)
    return gate


def innovation(
    state: list[I32], params: list[I32], sample: list[I32], r: list[I32], zeta: list[I32]
) -> I32:
    """Writes the disagreement of the trusted sensors with the attitude, n, Q15; tells which.

    Source: docs/fixed-point.md Eq. (2) to (4).
    """
    g = [0, 0, 0]
    f = [0, 0, 0]
    g_sane = sane(g, sample[G_X], sample[G_Y], sample[G_Z], params[FORCE_TOLERANCE])
    f_sane = sane(f, sample[F_X], sample[F_Y], sample[F_Z], params[FIELD_TOLERANCE])
    f_sane &= sample[HAS_FIELD]
    g_x = rotated(r[0], r[1], r[2], g)
    g_y = rotated(r[3], r[4], r[5], g)
    g_z = rotated(r[6], r[7], r[8], g)
    f_x = rotated(r[0], r[1], r[2], f)
    f_y = rotated(r[3], r[4], r[5], f)
    f_z = rotated(r[6], r[7], r[8], f)

    # the field's dip is judged once the start-up is over
    dip_differs = (params[DIP_TOLERANCE] - abs(f_z - params[FIELD_Z])) >> 31
    settled = (params[BOOST_1_US] - state[AGE_US]) >> 31
    f_used = f_sane & ~(dip_differs & settled)
    agreement = f_x * params[FIELD_X] + f_z * params[FIELD_Z]
    contradiction = (g_z - AGREE_FORCE) & (agreement - AGREE_FIELD)
    watch(state, sample, g_sane & f_sane & (contradiction >> 31))

    f_x &= f_used
    f_y &= f_used
    f_z &= f_used
    z_x = params[WEIGHT_G] * g_y + params[WEIGHT_FZ] * f_y
    z_y = params[WEIGHT_FX] * f_z - params[WEIGHT_FZ] * f_x - params[WEIGHT_G] * g_x
    z_z = params[WEIGHT_FX] * f_y
    # the weights add up to one (Lemma 3)
    zeta[0] = known((z_x + 4096) >> 13, -ZETA_LIMIT, ZETA_LIMIT)
    zeta[1] = known((z_y + 4096) >> 13, -ZETA_LIMIT, ZETA_LIMIT)
    zeta[2] = known((4096 - z_z) >> 13, -ZETA_LIMIT, ZETA_LIMIT)
    return (g_sane & FORCE_USED) | (f_used & FIELD_USED)


def watch(state: list[I32], sample: list[I32], contradicted: I32) -> None:
    """Counts for how long both sensors have contradicted the attitude without a break.

    Samples without a field continue what the last field began.
    """
    begun = -state[DISAGREE_US] >> 31
    counted = sample[DT_US] & (contradicted | (begun & ~sample[HAS_FIELD]))
    kept = contradicted | ~sample[HAS_FIELD]
    duration = (state[DISAGREE_US] + counted) & kept
    state[DISAGREE_US] = clamp(duration, 0, DISAGREE_LIMIT_US + 1)


def weighted(xx: I32, xz: I32, yy: I32, zz: I32, z: list[I32], e: list[I32]) -> None:
    """Writes gain times disagreement; the gain couples x with z.

    Source: docs/fixed-point.md Eq. (5).
    """
    e[0] = (xx * z[0] + xz * z[2] + 16384) >> 15
    e[1] = (yy * z[1] + 16384) >> 15
    e[2] = (xz * z[0] + zz * z[2] + 16384) >> 15


def correct_bias(
    state: list[I32], axis: I32, correction: I32, shift: I32, met: list[I32]
) -> None:
    """Moves one axis of the bias; what is below its resolution is carried to the next step.

    Source: docs/fixed-point.md Eq. (6).
    """
    mask = (1 << shift) - 1
    due = correction + (state[C_X + axis] & mask)
    state[C_X + axis] = due & mask
    bias = state[B_X + axis] - (due >> shift)
    limited = clamp(bias, -BIAS_LIMIT, BIAS_LIMIT)
    state[B_X + axis] = limited
    met[0] |= bias - limited


def half_turn(rate: I32, dt_us: I32) -> I32:
    """Half the angle turned in `dt_us`, Q30; the product is made of two halves."""
    return (rate >> 10) * dt_us + (((rate & 1023) * dt_us + 512) >> 10)


def limited_rate(sample: list[I32], axis: I32, met: list[I32]) -> I32:
    """The angular rate of one axis, half radians per microsecond, Q40."""
    rate = sample[W_X + axis] >> 1
    limited = clamp(rate, -RATE_LIMIT, RATE_LIMIT)
    met[0] |= rate - limited
    return limited


def limited_turn(rate: I32, dt_us: I32, correction: I32, met: list[I32]) -> I32:
    """Half the angle of one axis in this step, Q30.

    Source: docs/fixed-point.md Eq. (7).
    """
    angle = half_turn(rate, dt_us) + correction
    limited = clamp(angle, -STEP_LIMIT, STEP_LIMIT)
    met[0] |= angle - limited
    return limited


def carry(state: list[I32], axis: I32, h: I32, third: I32) -> I32:
    """The tangent of the half angle `h`, Q16; what is below is carried to the next step.

    Source: docs/fixed-point.md Eq. (8).
    """
    due = h + (((h >> 14) * third) >> 6) + state[T_X + axis] + 8192
    state[T_X + axis] = (due & 16383) - 8192
    return due >> 14


def turn(state: list[I32], q: list[I32], t_x: I32, t_y: I32, t_z: I32) -> None:
    """Turns the attitude by tangents of half angles, Q16; one Newton step keeps its norm.

    Source: docs/fixed-point.md Eq. (8) and (9).
    """
    q_w = state[Q_W] - ((q[1] * t_x + q[2] * t_y + q[3] * t_z + 2) >> 2)
    q_x = state[Q_X] + ((q[0] * t_x + q[2] * t_z - q[3] * t_y + 2) >> 2)
    q_y = state[Q_Y] + ((q[0] * t_y + q[3] * t_x - q[1] * t_z + 2) >> 2)
    q_z = state[Q_Z] + ((q[0] * t_z + q[1] * t_y - q[2] * t_x + 2) >> 2)
    w = (q_w + 32768) >> 16
    x = (q_x + 32768) >> 16
    y = (q_y + 32768) >> 16
    z = (q_z + 32768) >> 16
    excess = NORM_Q26 - w * w - x * x - y * y - z * z
    # one step turns by less than a radian (Lemma 1)
    scale = known(excess, -(1 << 24), 1 << 22) >> 10
    # n (3 - n)^2 / 4 never exceeds one (Lemma 1)
    state[Q_W] = known(q_w + ((w * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    state[Q_X] = known(q_x + ((x * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    state[Q_Y] = known(q_y + ((y * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    state[Q_Z] = known(q_z + ((z * scale) >> 1), -Q_LIMIT, Q_LIMIT)


def boosted(state: list[I32], params: list[I32], dt_us: I32) -> I32:
    """The shift of the attitude gain: the younger the attitude, the higher the gain."""
    age = state[AGE_US]
    state[AGE_US] = clamp(age + dt_us, 0, AGE_LIMIT_US)
    boost = ((age - params[BOOST_1_US]) >> 31) + ((age - params[BOOST_2_US]) >> 31)
    return params[P_SHIFT] + boost + ((age - params[BOOST_3_US]) >> 31)


def step(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample of an aligned filter; returns what it rested on, as bits."""
    q = [0, 0, 0, 0]
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    zeta = [0, 0, 0]
    e = [0, 0, 0]
    met = [0]
    dt_us = sample[DT_US]
    rotation(state, q, r)
    used = innovation(state, params, sample, r, zeta)

    # attitude
    weighted(params[P_XX], params[P_XZ], params[P_YY], params[P_ZZ], zeta, e)
    shift = boosted(state, params, dt_us)
    rate = limited_rate(sample, 0, met) - (state[B_X] >> BIAS_BITS)
    h_x = limited_turn(rate, dt_us, unrotated(r[0], r[3], r[6], e) >> shift, met)
    rate = limited_rate(sample, 1, met) - (state[B_Y] >> BIAS_BITS)
    h_y = limited_turn(rate, dt_us, unrotated(r[1], r[4], r[7], e) >> shift, met)
    rate = limited_rate(sample, 2, met) - (state[B_Z] >> BIAS_BITS)
    h_z = limited_turn(rate, dt_us, unrotated(r[2], r[5], r[8], e) >> shift, met)

    # bias
    weighted(params[I_XX], params[I_XZ], params[I_YY], params[I_ZZ], zeta, e)
    shift = params[I_SHIFT]
    correct_bias(state, 0, unrotated(r[0], r[3], r[6], e), shift, met)
    correct_bias(state, 1, unrotated(r[1], r[4], r[7], e), shift, met)
    correct_bias(state, 2, unrotated(r[2], r[5], r[8], e), shift, met)

    # tangent of the half angle
    third = (h_x >> 14) * (h_x >> 14) + (h_y >> 14) * (h_y >> 14) + (h_z >> 14) * (h_z >> 14)
    third = ((third >> 13) * THIRD_Q16) >> 15
    t_x = carry(state, 0, h_x, third)
    t_y = carry(state, 1, h_y, third)
    t_z = carry(state, 2, h_z, third)
    turn(state, q, t_x, t_y, t_z)

    folded = (met[0] >> 16) | (met[0] & 65535)
    saturated = (folded | -folded) >> 31
    state[SATURATIONS] = clamp(state[SATURATIONS] - saturated, 0, SATURATIONS_LIMIT)
    return used | (saturated & SATURATED)


def align(state: list[I32], sample: list[I32]) -> I32:
    """Takes the attitude that one sample shows, if its vectors are usable; returns bits.

    Without a field the nose points north.
    """
    g = [0, 0, 0]
    f = [UNIT_Q14, 0, 0]
    q = [0, 0, 0, 0]
    if sane(g, sample[G_X], sample[G_Y], sample[G_Z], ALIGN_TOLERANCE) == 0:
        return 0
    if sample[HAS_FIELD] != 0:
        if sane(f, sample[F_X], sample[F_Y], sample[F_Z], ALIGN_TOLERANCE) == 0:
            return 0
    elif abs(g[0]) > NOSE_DOWN:
        f[0] = 0
        f[2] = UNIT_Q14
    if triad(g, f, q) == 0:
        return 0
    for i in range(4):
        state[Q_W + i] = clamp(q[i], -Q_LIMIT, Q_LIMIT)
    for i in range(3):
        state[T_X + i] = 0
    state[AGE_US] = 0
    state[DISAGREE_US] = 0
    return ALIGNED


def reset(state: list[I32]) -> None:
    """Forgets everything."""
    for i in range(STATE_SIZE):
        state[i] = 0
    state[Q_W] = Q_LIMIT - (1 << 19)
    state[AGE_US] = -1


def restart(state: list[I32]) -> None:
    """Forgets the attitude, keeps the bias and the counter of saturations."""
    state[AGE_US] = -1


def update(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample: aligns, or steps, or asks the next sample to align; returns bits."""
    if state[AGE_US] < 0:
        return align(state, sample)
    bits = step(state, params, sample)
    if state[DISAGREE_US] > DISAGREE_LIMIT_US:
        restart(state)
        bits |= DISAGREES
    return bits
