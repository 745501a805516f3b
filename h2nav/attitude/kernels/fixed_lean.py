"""One step of the constant-gain attitude filter in 32-bit integers with 16-bit factors.

Translates to C99 without a 64-bit product, a division or a branch. The frame n is north-east-down
with magnetic north. Formats and the proof of the ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (1) to (9).
"""

from h2nav.attitude.kernels.fixed_motion import (
    B_X,
    B_Y,
    B_Z,
    BIAS_LIMIT,
    CORRECTION_LIMIT,
    DT_US,
    MOST_DT_US,
    Q_W,
    Q_X,
    Q_Y,
    Q_Z,
    T_X,
    T_Y,
    T_Z,
    propagate,
    rotation,
    unrotated,
)
from h2nav.attitude.kernels.fixed_triad import Q_LIMIT, UNIT_Q14, VECTOR_LIMIT, triad
from h2nav.maths.fixedpoint import I32, clamp, known

# state; the attitude, the bias and the turn to come stand in fixed_motion
C_X, C_Y, C_Z = range(7, 10)  # bias correction not yet applied
AGE_US = 13  # time since the alignment; -1: not aligned
DISAGREE_US = 14  # for how long both sensors have contradicted the attitude
SATURATIONS = 15  # samples in which a limit was met
STATE_SIZE = 16

# parameters
FIELD_X, FIELD_Z = range(2)  # direction of the earth field, Q14
WEIGHT_G, WEIGHT_FX, WEIGHT_FZ = range(2, 5)  # of gravity, of the field times its direction, Q14
P_XX, P_XZ, P_YY, P_ZX, P_ZZ, P_SHIFT = range(5, 11)  # attitude gain, Q(14 + shift)
I_XX, I_XZ, I_YY, I_ZX, I_ZZ, I_SHIFT = range(11, 17)  # bias gain, mantissas and shift
FORCE_TOLERANCE, FIELD_TOLERANCE, DIP_TOLERANCE = range(17, 20)  # Q26, Q26, Q15
BOOST, BOOST_SHIFT = range(20, 22)  # a young gain is 2^BOOST times as high, halved every 2^shift us
PARAMS_SIZE = 22

# sample; the rate and the time stand in fixed_motion
G_X, G_Y, G_Z = range(3, 6)  # opposite of the specific force in units of gravity, Q14
F_X, F_Y, F_Z = range(6, 9)  # magnetic field in units of its expected norm, Q14; 0 for none
HAS_FIELD = 9  # -1 when the sample brings a field, else 0; only the alignment asks
SAMPLE_SIZE = 11

# bits of the result
FORCE_USED = 1
FIELD_USED = 2
ALIGNED = 4  # this sample has given a first attitude
DISAGREES = 8  # both sensors have contradicted the attitude for a second: the next one aligns
SATURATED = 16  # a rate or the bias met its limit

ONE_Q26 = 1 << 26
ZETA_LIMIT = 40960  # 1.25 in Q15
GAIN_LIMIT = 8400  # two products with ZETA_LIMIT stay below TURN_LIMIT
TURN_LIMIT = 21000  # three products with R_LIMIT and a remainder fit 32 bits
LEAST_SHIFT = 5
LEAST_BIAS_SHIFT = 4
AGREE_FORCE = 28378  # cosine of 30 degrees, Q15
AGREE_FIELD = 12551 << 15  # cosine of 40 degrees, Q29
DISAGREE_LIMIT_US = 1000000
AGE_LIMIT_US = 1 << 30
ALIGN_TOLERANCE = 1 << 24  # a quarter in Q26
NOSE_DOWN = 14189  # sine of 60 degrees, Q14
SATURATIONS_LIMIT = 1 << 30

STATE_RANGES = (
    *(((-Q_LIMIT, Q_LIMIT),) * 4),
    *(((-BIAS_LIMIT, BIAS_LIMIT),) * 3),
    *(((0, (1 << 26) - 1),) * 3),
    *(((-CORRECTION_LIMIT, CORRECTION_LIMIT),) * 3),
    (-1, AGE_LIMIT_US),
    (0, DISAGREE_LIMIT_US + 1),
    (0, SATURATIONS_LIMIT),
)
PARAMS_RANGES = (
    *(((-UNIT_Q14, UNIT_Q14),) * 2),
    (0, UNIT_Q14),
    *(((-UNIT_Q14, UNIT_Q14),) * 2),
    *(((-GAIN_LIMIT, GAIN_LIMIT),) * 5),
    (LEAST_SHIFT, 24),
    *(((-GAIN_LIMIT, GAIN_LIMIT),) * 5),
    (LEAST_BIAS_SHIFT, 26),
    (0, ONE_Q26 >> 1),
    (0, ONE_Q26 >> 1),
    (0, 1 << 16),
    (0, 3),
    (0, 28),
)
SAMPLE_RANGES = (
    *(((-(1 << 31), (1 << 31) - 1),) * 3),
    *(((-32768, 32767),) * 6),
    (-1, 0),
    (0, MOST_DT_US),
)


def rotated(r0: I32, r1: I32, r2: I32, v: list[I32]) -> I32:
    """One coordinate in n of a sane vector in the body frame, Q15."""
    # a turn keeps the norm (Lemma 2)
    return known((r0 * v[0] + r1 * v[1] + r2 * v[2] + 8192) >> 14, -ZETA_LIMIT, ZETA_LIMIT)


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


def boost_of(state: list[I32], params: list[I32]) -> I32:
    """By which power of two the gain is raised; the younger the attitude, the more."""
    return clamp(params[BOOST] - (state[AGE_US] >> params[BOOST_SHIFT]), 0, 3)


def innovation(
    state: list[I32],
    params: list[I32],
    sample: list[I32],
    r: list[I32],
    zeta: list[I32],
    boost: I32,
) -> I32:
    """Writes the disagreement of the trusted sensors with the attitude, n, Q15; tells which.

    Source: docs/fixed-point.md Eq. (2) to (4).
    """
    g = [0, 0, 0]
    f = [0, 0, 0]
    g_sane = sane(g, sample[G_X], sample[G_Y], sample[G_Z], params[FORCE_TOLERANCE])
    f_sane = sane(f, sample[F_X], sample[F_Y], sample[F_Z], params[FIELD_TOLERANCE])
    g_x = rotated(r[0], r[1], r[2], g)
    f_x = rotated(r[0], r[1], r[2], f)
    g_y = rotated(r[3], r[4], r[5], g)
    f_y = rotated(r[3], r[4], r[5], f)
    g_z = rotated(r[6], r[7], r[8], g)
    f_z = rotated(r[6], r[7], r[8], f)

    # the field's dip is judged once the start-up is over
    dip_differs = (params[DIP_TOLERANCE] - abs(f_z - 2 * params[FIELD_Z])) >> 31
    settled = (boost - 1) >> 31
    f_used = f_sane & ~(dip_differs & settled)
    agreement = f_x * params[FIELD_X] + f_z * params[FIELD_Z]
    contradiction = (g_z - AGREE_FORCE) & (agreement - AGREE_FIELD)
    contradicted = g_sane & f_sane & (contradiction >> 31)
    watch(state, sample[DT_US], contradicted, f_sane)

    # an attitude that both contradict is not worth correcting, nor may it teach the bias
    g_used = g_sane & ~contradicted
    f_used &= ~contradicted
    g_x &= g_used
    g_y &= g_used
    f_x &= f_used
    f_y &= f_used
    f_z &= f_used
    z_x = params[WEIGHT_G] * g_y + params[WEIGHT_FZ] * f_y
    z_y = params[WEIGHT_FX] * f_z - params[WEIGHT_FZ] * f_x - params[WEIGHT_G] * g_x
    # the weights add up to one (Lemma 3)
    zeta[0] = known((z_x + 8192) >> 14, -ZETA_LIMIT, ZETA_LIMIT)
    zeta[1] = known((z_y + 8192) >> 14, -ZETA_LIMIT, ZETA_LIMIT)
    # only the field shows the heading, so this one has no weight
    zeta[2] = (8192 - params[FIELD_X] * f_y) >> 14
    return (g_used & FORCE_USED) | (f_used & FIELD_USED)


def watch(state: list[I32], dt_us: I32, contradicted: I32, f_sane: I32) -> None:
    """Adds up the time of the samples in which both sensors have contradicted the attitude.

    One that agrees begins anew; samples without a usable field change nothing.
    """
    duration = (state[DISAGREE_US] + (dt_us & contradicted)) & (contradicted | ~f_sane)
    state[DISAGREE_US] = clamp(duration, 0, DISAGREE_LIMIT_US + 1)


def weighted(params: list[I32], gain: I32, z: list[I32], e: list[I32]) -> None:
    """Writes gain times disagreement; the gain couples x with z.

    Source: docs/fixed-point.md Eq. (5).
    """
    e[0] = (params[gain] * z[0] + params[gain + 1] * z[2] + 16384) >> 15
    e[1] = (params[gain + 2] * z[1] + 16384) >> 15
    e[2] = (params[gain + 3] * z[0] + params[gain + 4] * z[2] + 16384) >> 15


def correct_bias(state: list[I32], axis: I32, correction: I32, shift: I32, met: list[I32]) -> None:
    """Moves one axis of the bias; what is below its resolution is carried to the next step.

    Source: docs/fixed-point.md Eq. (6).
    """
    due = correction + state[C_X + axis]
    state[C_X + axis] = due & ((1 << shift) - 1)
    bias = state[B_X + axis] - (due >> shift)
    limited = clamp(bias, -BIAS_LIMIT, BIAS_LIMIT)
    state[B_X + axis] = limited
    met[0] |= known(bias - limited, -(1 << 28), 1 << 28)  # Lemma 6


def step(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample of an aligned filter; returns what it rested on, as bits."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    zeta = [0, 0, 0]
    e = [0, 0, 0]
    met = [0]
    propagate(state, sample, met)
    rotation(state, r)
    boost = boost_of(state, params)
    used = innovation(state, params, sample, r, zeta, boost)

    state[AGE_US] = clamp(state[AGE_US] + sample[DT_US], 0, AGE_LIMIT_US)
    # attitude, from the next step on
    weighted(params, P_XX, zeta, e)
    shift = known(params[P_SHIFT] - boost, LEAST_SHIFT, 24)  # Lemma 5
    state[T_X] += unrotated(r[0], r[3], r[6], e) >> shift
    state[T_Y] += unrotated(r[1], r[4], r[7], e) >> shift
    state[T_Z] += unrotated(r[2], r[5], r[8], e) >> shift

    # bias, whose gain grows with the square of the boost
    weighted(params, I_XX, zeta, e)
    shift = known(params[I_SHIFT] - 2 * boost, LEAST_BIAS_SHIFT, 26)  # Lemma 5
    correct_bias(state, 0, unrotated(r[0], r[3], r[6], e), shift, met)
    correct_bias(state, 1, unrotated(r[1], r[4], r[7], e), shift, met)
    correct_bias(state, 2, unrotated(r[2], r[5], r[8], e), shift, met)

    saturated = (met[0] | -met[0]) >> 31
    state[SATURATIONS] = clamp(state[SATURATIONS] - saturated, 0, SATURATIONS_LIMIT)
    return used | (saturated & SATURATED)


def align(state: list[I32], sample: list[I32]) -> I32:
    """Takes the attitude that one sample shows, if its vectors are usable; returns bits.

    Without a field the nose points north.
    """
    g = [0, 0, 0]
    f = [UNIT_Q14, 0, 0]
    if sane(g, sample[G_X], sample[G_Y], sample[G_Z], ALIGN_TOLERANCE) == 0:
        return 0
    if sample[HAS_FIELD] != 0:
        if sane(f, sample[F_X], sample[F_Y], sample[F_Z], ALIGN_TOLERANCE) == 0:
            return 0
    elif abs(g[0]) > NOSE_DOWN:
        f[0] = 0
        f[2] = UNIT_Q14
    if triad(g, f, state) == 0:
        return 0
    state[T_X] = 0
    state[T_Y] = 0
    state[T_Z] = 0
    state[AGE_US] = 0
    state[DISAGREE_US] = 0
    return ALIGNED


def reset(state: list[I32]) -> None:
    """Forgets everything."""
    state[Q_W] = Q_LIMIT - (1 << 19)
    state[Q_X] = 0
    state[Q_Y] = 0
    state[Q_Z] = 0
    state[B_X] = 0
    state[B_Y] = 0
    state[B_Z] = 0
    state[C_X] = 0
    state[C_Y] = 0
    state[C_Z] = 0
    state[T_X] = 0
    state[T_Y] = 0
    state[T_Z] = 0
    state[AGE_US] = -1
    state[DISAGREE_US] = 0
    state[SATURATIONS] = 0


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
