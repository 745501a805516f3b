"""Second stage of the flight filter in integers: covariance and sensitivities of bias and heading.

Factors are scaled to 15 digits, each group by its largest, and the powers of two are followed
beside them: the covariance spans nine decades, a product never more than 32 bits.

Source: docs/fixed-point.md Eq. (19) to (22); docs/filter.md Eq. (6), (7), (12), (17) to (19).
"""

from h2nav.attitude.kernels.fixed_flight_layout import (
    BIAS_MOST,
    BIAS_VAR,
    BIAS_WALK,
    D_MOST,
    DOUBT,
    DOUBT_MOST,
    DUE,
    E_D,
    E_E,
    E_MOST,
    E_N,
    GAIN_D_SHIFT,
    GAIN_E,
    GAIN_H,
    GAIN_INVERSE,
    GAIN_P_SHIFT,
    GYRO,
    HEADING_M,
    HEADING_S,
    HEADING_VAR,
    KT_M,
    KT_S,
    KV_M,
    KV_S,
    P_LEAST,
    P_MOST,
    S_E,
    S_MOST,
    S_N,
    SATURATED,
    T_FRAME,
    TURNING,
    U_E,
    U_MOST,
    U_N,
    V_E,
    V_MOST,
    V_N,
    D,
    P,
)
from h2nav.attitude.kernels.fixed_functions import (
    bits_of,
    limited,
    logarithm,
    mantissa,
    power2,
    product,
    reciprocal,
    shifted,
)
from h2nav.attitude.kernels.fixed_motion import B_X
from h2nav.maths.fixedpoint import I32, clamp, known

NOISE_ORIGIN = 61 << 8  # unit of the innovation's variance before scaling: 2^-61
MOST_NOISE = 29 << 8


def heading_turn(state: list[I32], r: list[I32], turn: list[I32]) -> None:
    """Writes the heading that one unit of each bias gives in the frame, Q22 of its unit."""
    unit = (state[T_FRAME] * 15625) >> 14
    for i in range(3):
        turn[i] = (unit * r[6 + i] + 16384) >> 15


def predict_covariance(state: list[I32], params: list[I32], r: list[I32]) -> None:
    """P <- F P F^T + Q over one frame.

    Source: docs/filter.md Eq. (12).
    """
    turn = [0, 0, 0]
    heading_turn(state, r, turn)
    x = turn[0]
    y = turn[1]
    z = turn[2]
    time = state[T_FRAME]
    a = heading_of(state[P], state[P + 1], state[P + 2], x, y, z)
    b = heading_of(state[P + 1], state[P + 4], state[P + 5], x, y, z)
    c = heading_of(state[P + 2], state[P + 5], state[P + 7], x, y, z)
    both = heading_of(a, b, c, x, y, z)
    both -= 2 * heading_of(state[P + 3], state[P + 6], state[P + 8], x, y, z)
    noise = params[GYRO] + (product(state[TURNING] << 1, params[HEADING_M]) >> params[HEADING_S])
    both += product(limited(noise, 1 << 30), time) >> 5
    state[P + 3] = limited(state[P + 3] - a, P_MOST)
    state[P + 6] = limited(state[P + 6] - b, P_MOST)
    state[P + 8] = limited(state[P + 8] - c, P_MOST)
    state[P + 9] = clamp(state[P + 9] + both, P_LEAST, P_MOST)
    walk = (product(params[BIAS_WALK], time) >> 2) + 1
    grow(state, params, 0, walk)
    grow(state, params, 4, walk)
    grow(state, params, 7, walk)


def heading_of(a: I32, b: I32, c: I32, x: I32, y: I32, z: I32) -> I32:
    """Sum of a x, b y and c z, the second factors Q22."""
    return (product(a, x) >> 7) + (product(b, y) >> 7) + (product(c, z) >> 7)


def grow(state: list[I32], params: list[I32], i: I32, walk: I32) -> None:
    """Raises one variance of the bias as long as it is below its start."""
    if state[P + i] < params[BIAS_VAR]:
        state[P + i] = clamp(state[P + i] + walk, P_LEAST, P_MOST)


def predict_sensitivities(state: list[I32], r: list[I32]) -> None:
    """Sensitivities of velocity and tilt over one frame.

    Source: docs/filter.md Eq. (6), (7).
    """
    turn = [0, 0, 0]
    heading_turn(state, r, turn)
    unit = (state[T_FRAME] * 15625) >> 14
    for i in range(3):
        carry(state, U_N, V_N, i, (unit * r[3 + i]) >> 10, turn[i])
        carry(state, U_E, V_E, i, -((unit * r[i]) >> 10), turn[i])
    carry_heading(state, U_N, V_N)
    carry_heading(state, U_E, V_E)


def carry(state: list[I32], tilt: I32, velocity: I32, axis: I32, change: I32, turn: I32) -> None:
    """Sensitivities to one bias; they refer to the heading error where that is now."""
    u = state[tilt + axis]
    v = state[velocity + axis] + (product(u, state[T_FRAME]) >> 6)
    v += product(state[velocity + 3], turn) >> 7
    state[velocity + axis] = limited(v, V_MOST)
    u += change + (product(state[tilt + 3], turn) >> 7)
    state[tilt + axis] = limited(u, U_MOST)


def carry_heading(state: list[I32], tilt: I32, velocity: I32) -> None:
    """Sensitivity of a velocity to the heading error."""
    v = state[velocity + 3] + (product(state[tilt + 3], state[T_FRAME]) >> 6)
    state[velocity + 3] = limited(v, V_MOST)


def size_of(a: I32) -> I32:
    """Size of a number, or one less: as many binary digits as it."""
    return known(a ^ (a >> 31), 0, 2147483647)


def digits_of(a: I32, b: I32, c: I32, d: I32) -> I32:
    """Number of binary digits of the largest of four numbers."""
    return bits_of(size_of(a) | size_of(b) | size_of(c) | size_of(d))


def find_gain(state: list[I32], row: I32, innovation: I32, log_noise: I32) -> None:
    """Gain for one scalar measurement of theta; `use_gain` applies it with the next sample.

    Args:
        state: memory.
        row: place of the sensitivities, Q24 of the measurement's unit.
        innovation: the same unit, Q24.
        log_noise: of its variance without the error of theta.

    Source: docs/fixed-point.md Eq. (20), (21).
    """
    scale = clamp(digits_of(state[row], state[row + 1], state[row + 2], state[row + 3]) - 13, 0, 18)
    a = [0, 0, 0, 0]
    for i in range(4):
        a[i] = known(state[row + i] >> scale, -8192, 8191)
    h0 = row_times(state, P, P + 1, P + 2, P + 3, a)
    h1 = row_times(state, P + 1, P + 4, P + 5, P + 6, a)
    h2 = row_times(state, P + 2, P + 5, P + 7, P + 8, a)
    h3 = row_times(state, P + 3, P + 6, P + 8, P + 9, a)
    fall = clamp(digits_of(h0, h1, h2, h3) - 15, 0, 16)
    h0 = known(h0 >> fall, -32768, 32767)
    h1 = known(h1 >> fall, -32768, 32767)
    h2 = known(h2 >> fall, -32768, 32767)
    h3 = known(h3 >> fall, -32768, 32767)
    variance = a[0] * h0 + a[1] * h1 + a[2] * h2 + a[3] * h3
    # what the correction so far explains already
    explained = times(state, D, a)
    state[GAIN_H] = h0
    state[GAIN_H + 1] = h1
    state[GAIN_H + 2] = h2
    state[GAIN_H + 3] = h3
    y = innovation - limited(shifted(explained, 13 - scale), D_MOST)
    log_noise += NOISE_ORIGIN - ((2 * scale + fall) << 8)
    weigh_gain(state, clamp(variance, 0, 1 << 30), y, log_noise, scale, fall)


def weigh_gain(
    state: list[I32], variance: I32, y: I32, log_noise: I32, scale: I32, fall: I32
) -> None:
    """Divides by the variance of the innovation, noise included.

    Args:
        state: memory.
        variance: without noise.
        y: innovation.
        log_noise: of the noise, in the unit of the variance.
        scale: digits that the sensitivities have lost.
        fall: digits that H has lost.

    Source: docs/fixed-point.md Eq. (21), (22).
    """
    # noise that is too large for the unit of the variance: both in a larger one
    excess = 0
    if log_noise > MOST_NOISE:
        excess = (log_noise >> 8) - 28
    if excess > 30:
        state[GAIN_INVERSE] = 0
        state[GAIN_E] = 0
        return
    variance = (variance >> excess) + power2(log_noise - (excess << 8)) + 1
    digits = bits_of(variance)
    inverse = reciprocal(mantissa(variance, digits))
    lost = digits + excess
    y_scale = clamp(bits_of(size_of(y)) - 15, 0, 16)
    state[GAIN_INVERSE] = inverse
    state[GAIN_E] = (known(y >> y_scale, -32768, 32767) * inverse + 16384) >> 15
    # a step that would need a shift to the left is beyond what theta can be
    state[GAIN_D_SHIFT] = clamp(lost + scale - 29 - y_scale, 0, 31)
    state[GAIN_P_SHIFT] = clamp(lost - fall - 16, 0, 31)


def row_times(state: list[I32], i: I32, j: I32, k: I32, l: I32, a: list[I32]) -> I32:  # noqa: E741
    """A row of P, given by its places, times a, over 2^15."""
    return (
        product(state[i], a[0])
        + product(state[j], a[1])
        + product(state[k], a[2])
        + product(state[l], a[3])
    )


def use_gain(state: list[I32]) -> None:
    """Correction and covariance with the gain that was found: D += h e, P <- P - h h^T / S.

    What is taken from a variance is rounded down. Source: docs/fixed-point.md Eq. (22).
    """
    h0 = state[GAIN_H]
    h1 = state[GAIN_H + 1]
    h2 = state[GAIN_H + 2]
    h3 = state[GAIN_H + 3]
    e = state[GAIN_E]
    shift = state[GAIN_D_SHIFT]
    state[D] = limited(state[D] + (h0 * e >> shift), D_MOST)
    state[D + 1] = limited(state[D + 1] + (h1 * e >> shift), D_MOST)
    state[D + 2] = limited(state[D + 2] + (h2 * e >> shift), D_MOST)
    state[D + 3] = limited(state[D + 3] + (h3 * e >> shift), D_MOST)
    inverse = state[GAIN_INVERSE]
    shift = state[GAIN_P_SHIFT]
    k = (h0 * inverse + 16384) >> 15
    lower_variance(state, P, k * h0 >> shift)
    lower(state, P + 1, k * h1 >> shift)
    lower(state, P + 2, k * h2 >> shift)
    lower(state, P + 3, k * h3 >> shift)
    k = (h1 * inverse + 16384) >> 15
    lower_variance(state, P + 4, k * h1 >> shift)
    lower(state, P + 5, k * h2 >> shift)
    lower(state, P + 6, k * h3 >> shift)
    k = (h2 * inverse + 16384) >> 15
    lower_variance(state, P + 7, k * h2 >> shift)
    lower(state, P + 8, k * h3 >> shift)
    k = (h3 * inverse + 16384) >> 15
    lower_variance(state, P + 9, k * h3 >> shift)


def lower(state: list[I32], i: I32, fall: I32) -> None:
    """Takes something from a covariance."""
    state[i] = limited(state[i] - fall, P_MOST)


def lower_variance(state: list[I32], i: I32, fall: I32) -> None:
    """Takes something from a variance, which stays positive."""
    rest = limited(state[i] - fall, P_MOST)
    if rest < P_LEAST:
        rest = P_LEAST
    state[i] = rest


def fade(state: list[I32]) -> None:
    """The constant gain has worked on the sensitivities too.

    Source: docs/filter.md Eq. (17).
    """
    for i in range(4):
        fade_one(state, U_N + i, V_N + i)
        fade_one(state, U_E + i, V_E + i)


def fade_one(state: list[I32], u: I32, v: I32) -> None:
    """One sensitivity of tilt and velocity."""
    value = state[v]
    state[u] = limited(state[u] - shifted(product(value, state[KT_M]), state[KT_S] - 4), U_MOST)
    state[v] = limited(value - shifted(product(value, state[KV_M]), state[KV_S]), V_MOST)


def apply_theta(state: list[I32], params: list[I32]) -> I32:
    """Moves bias, velocity and attitude by the correction D, which is forgotten.

    Returns SATURATED when the bias meets its limit, else 0.

    Source: docs/filter.md Eq. (19).
    """
    scale = clamp(digits_of(state[D], state[D + 1], state[D + 2], state[D + 3]) - 13, 0, 18)
    d = [0, 0, 0, 0]
    for i in range(4):
        d[i] = known(state[D + i] >> scale, -8192, 8191)
    bits = 0
    for i in range(3):
        bias = state[B_X + i] + (state[D + i] >> 2)
        state[B_X + i] = limited(bias, params[BIAS_MOST])
        if state[B_X + i] != bias:
            bits = SATURATED
    heading = state[D + 3]
    for i in range(4):
        state[D + i] = 0
    state[S_N] = limited(state[S_N] + shifted(times(state, V_N, d), 13 - scale), S_MOST)
    state[S_E] = limited(state[S_E] + shifted(times(state, V_E, d), 13 - scale), S_MOST)
    turn(
        state, shifted(times(state, U_N, d), 12 - scale), shifted(times(state, U_E, d), 12 - scale)
    )
    add_heading(state, heading)
    limit_heading(state, params)
    return bits


def times(state: list[I32], row: I32, d: list[I32]) -> I32:
    """Four numbers of the memory times four of 13 digits, over 2^15."""
    return row_times(state, row, row + 1, row + 2, row + 3, d)


def turn(state: list[I32], tilt_n: I32, tilt_e: I32) -> None:
    """Adds a tilt north and east (half radians, Q30) to the correction to come."""
    state[E_N] = limited(state[E_N] + limited(tilt_e, 1 << 29), E_MOST)
    state[E_E] = limited(state[E_E] - limited(tilt_n, 1 << 29), E_MOST)


def add_heading(state: list[I32], angle: I32) -> None:
    """Adds a heading (half radians, Q30) to the correction to come."""
    state[E_D] = limited(state[E_D] + angle, E_MOST)
    state[DUE] = limited(state[DUE] + angle, E_MOST)


def limit_heading(state: list[I32], params: list[I32]) -> None:
    """Keeps the heading's variance where theta is linear; correlations stay what they are."""
    most = params[HEADING_VAR]
    if state[P + 9] > most:
        keep = clamp(
            power2(((logarithm(most) - logarithm(state[P + 9])) >> 1) + (15 << 8)), 0, 32767
        )
        state[P + 3] = product(state[P + 3], keep)
        state[P + 6] = product(state[P + 6], keep)
        state[P + 8] = product(state[P + 8], keep)
        state[P + 9] = most


def forget_velocity(state: list[I32]) -> None:
    """The velocity begins anew: no error of theta has worked on it yet."""
    for i in range(8):
        state[V_N + i] = 0


def forget_sensitivities(state: list[I32]) -> None:
    """Tilt and velocity begin anew."""
    for i in range(16):
        state[U_N + i] = 0


def ease_doubt(state: list[I32]) -> None:
    """Doubt of the tilt fades at the speed of the loop's poles.

    Source: docs/filter.md Eq. (30).
    """
    doubt = state[DOUBT]
    doubt -= shifted(product(doubt, state[KV_M]), state[KV_S] + 1)
    state[DOUBT] = clamp(doubt, 0, DOUBT_MOST)
