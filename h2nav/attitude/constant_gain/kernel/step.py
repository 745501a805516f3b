"""One step of the constant-gain attitude filter in 32-bit integers with 16-bit factors.

Translates to C99 without a 64-bit product, a division or a branch. The frame n is north-east-down
with magnetic north. Formats and the proof of the ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (1) to (9).
"""

from h2nav.attitude.integer.motion import BIAS_LIMIT, propagate, rotation, unrotated
from h2nav.attitude.integer.triad import Q_LIMIT, UNIT_Q14, VECTOR_LIMIT, triad
from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    AGE_LIMIT_US,
    ALIGNED,
    CONTRADICTED_LIMIT_US,
    DISAGREES,
    FIELD_USED,
    FORCE_USED,
    MAX_BIAS_SHIFT,
    MAX_SHIFT,
    MIN_BIAS_SHIFT,
    MIN_SHIFT,
    SATURATED,
    SATURATIONS_LIMIT,
    Gains,
    Sample,
    State,
)

ONE_Q26 = 1 << 26
ZETA_LIMIT = 40960  # 1.25 in Q15
AGREE_FORCE = 28378  # cosine of 30 degrees, Q15
AGREE_FIELD = 12551 << 15  # cosine of 40 degrees, Q29
ALIGN_TOLERANCE = 1 << 24  # a quarter in Q26
NOSE_DOWN = 14189  # sine of 60 degrees, Q14


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


def boost_of(s: State, g: Gains) -> I32:
    """The power of two that raises the gain of a young attitude."""
    return clamp(g.boost - (s.age_us >> g.boost_shift), 0, 3)


def innovation(
    s: State,
    g: Gains,
    sample: Sample,
    r: list[I32],
    zeta: list[I32],
    boost: I32,
) -> I32:
    """Writes the disagreement of the trusted sensors with the attitude, n, Q15; returns which.

    Source: docs/fixed-point.md Eq. (2) to (4).
    """
    down = [0, 0, 0]
    field = [0, 0, 0]
    g_sane = sane(down, sample.gravity[0], sample.gravity[1], sample.gravity[2], g.accel_tolerance)
    f_sane = sane(field, sample.mag[0], sample.mag[1], sample.mag[2], g.mag_tolerance)
    g_x = rotated(r[0], r[1], r[2], down)
    f_x = rotated(r[0], r[1], r[2], field)
    g_y = rotated(r[3], r[4], r[5], down)
    f_y = rotated(r[3], r[4], r[5], field)
    g_z = rotated(r[6], r[7], r[8], down)
    f_z = rotated(r[6], r[7], r[8], field)

    # the field's dip is judged once the start-up is over
    dip_differs = (g.dip_tolerance - abs(f_z - 2 * g.mag_d)) >> 31
    settled = (boost - 1) >> 31
    f_used = f_sane & ~(dip_differs & settled)
    agreement = f_x * g.mag_n + f_z * g.mag_d
    contradiction = (g_z - AGREE_FORCE) & (agreement - AGREE_FIELD)
    contradicted = g_sane & f_sane & (contradiction >> 31)
    watch(s, sample.dt_us, contradicted, f_sane)

    # an attitude that both contradict is not corrected, and must not correct the bias
    g_used = g_sane & ~contradicted
    f_used &= ~contradicted
    g_x &= g_used
    g_y &= g_used
    f_x &= f_used
    f_y &= f_used
    f_z &= f_used
    z_x = g.accel_weight * g_y + g.mag_weight_d * f_y
    z_y = g.mag_weight_n * f_z - g.mag_weight_d * f_x - g.accel_weight * g_x
    # the weights add up to one (Lemma 3)
    zeta[0] = known((z_x + 8192) >> 14, -ZETA_LIMIT, ZETA_LIMIT)
    zeta[1] = known((z_y + 8192) >> 14, -ZETA_LIMIT, ZETA_LIMIT)
    # only the field shows the heading, so this one has no weight
    zeta[2] = (8192 - g.mag_n * f_y) >> 14
    return (g_used & FORCE_USED) | (f_used & FIELD_USED)


def watch(s: State, dt_us: I32, contradicted: I32, f_sane: I32) -> None:
    """Adds up the time of the samples in which both sensors have contradicted the attitude.

    A sample that agrees resets it; samples without a usable field change nothing.
    """
    duration = (s.contradicted_us + (dt_us & contradicted)) & (contradicted | ~f_sane)
    s.contradicted_us = clamp(duration, 0, CONTRADICTED_LIMIT_US + 1)


def weighted(gain: list[I32], z: list[I32], e: list[I32]) -> None:
    """Writes gain times disagreement; the gain couples x with z.

    Source: docs/fixed-point.md Eq. (5).
    """
    e[0] = (gain[0] * z[0] + gain[1] * z[2] + 16384) >> 15
    e[1] = (gain[2] * z[1] + 16384) >> 15
    e[2] = (gain[3] * z[0] + gain[4] * z[2] + 16384) >> 15


def correct_bias(s: State, axis: I32, correction: I32, shift: I32, met: list[I32]) -> None:
    """Moves one axis of the bias; what is below its resolution is carried to the next step.

    Source: docs/fixed-point.md Eq. (6).
    """
    due = correction + s.bias_carry[axis]
    s.bias_carry[axis] = due & ((1 << shift) - 1)
    bias = s.gyro_bias[axis] - (due >> shift)
    limited = clamp(bias, -BIAS_LIMIT, BIAS_LIMIT)
    s.gyro_bias[axis] = limited
    met[0] |= known(bias - limited, -(1 << 28), 1 << 28)  # Lemma 6


def step(s: State, g: Gains, sample: Sample) -> I32:
    """Takes one sample of an aligned filter; returns bits."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    zeta = [0, 0, 0]
    e = [0, 0, 0]
    met = [0]
    propagate(s.q_nb, s.gyro_bias, s.turn_carry, sample.gyro, sample.dt_us, met)
    rotation(s.q_nb, r)
    boost = boost_of(s, g)
    used = innovation(s, g, sample, r, zeta, boost)

    s.age_us = clamp(s.age_us + sample.dt_us, 0, AGE_LIMIT_US)
    # attitude, from the next step on
    weighted(g.attitude_gain, zeta, e)
    shift = known(g.attitude_shift - boost, MIN_SHIFT, MAX_SHIFT)  # Lemma 5
    s.turn_carry[0] += unrotated(r[0], r[3], r[6], e) >> shift
    s.turn_carry[1] += unrotated(r[1], r[4], r[7], e) >> shift
    s.turn_carry[2] += unrotated(r[2], r[5], r[8], e) >> shift

    # bias, whose gain grows with the square of the boost
    weighted(g.bias_gain, zeta, e)
    shift = known(g.bias_shift - 2 * boost, MIN_BIAS_SHIFT, MAX_BIAS_SHIFT)  # Lemma 5
    correct_bias(s, 0, unrotated(r[0], r[3], r[6], e), shift, met)
    correct_bias(s, 1, unrotated(r[1], r[4], r[7], e), shift, met)
    correct_bias(s, 2, unrotated(r[2], r[5], r[8], e), shift, met)

    saturated = (met[0] | -met[0]) >> 31
    s.saturations = clamp(s.saturations - saturated, 0, SATURATIONS_LIMIT)
    return used | (saturated & SATURATED)


def align(s: State, sample: Sample) -> I32:
    """Takes the attitude from one sample, if its vectors are usable; returns bits.

    Without a field the nose points north.
    """
    down = [0, 0, 0]
    north = [UNIT_Q14, 0, 0]
    if sane(down, sample.gravity[0], sample.gravity[1], sample.gravity[2], ALIGN_TOLERANCE) == 0:
        return 0
    if sample.has_mag != 0:
        if sane(north, sample.mag[0], sample.mag[1], sample.mag[2], ALIGN_TOLERANCE) == 0:
            return 0
    elif abs(down[0]) > NOSE_DOWN:
        north[0] = 0
        north[2] = UNIT_Q14
    if triad(down, north, s.q_nb) == 0:
        return 0
    s.turn_carry[0] = 0
    s.turn_carry[1] = 0
    s.turn_carry[2] = 0
    s.age_us = 0
    s.contradicted_us = 0
    return ALIGNED


def reset(s: State) -> None:
    """Makes a filter of zeros: not aligned."""
    s.q_nb[0] = Q_LIMIT - (1 << 19)
    s.age_us = -1


def restart(s: State) -> None:
    """Forgets the attitude, keeps the bias and the counter of saturations."""
    s.age_us = -1


def update(s: State, g: Gains, sample: Sample) -> I32:
    """Takes one sample: aligns, steps, or requests alignment by the next sample; returns bits."""
    if s.age_us < 0:
        return align(s, sample)
    bits = step(s, g, sample)
    if s.contradicted_us > CONTRADICTED_LIMIT_US:
        restart(s)
        bits |= DISAGREES
    return bits
