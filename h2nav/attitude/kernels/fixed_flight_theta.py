"""Second stage of the flight filter in integers: covariance and sensitivities of bias and heading.

Factors are scaled to 15 digits, each group by its largest, and the powers of two are followed
beside them: the covariance spans nine decades, a product never more than 32 bits.

Source: docs/fixed-point.md Eq. (20) to (24); docs/filter.md Eq. (6), (7), (12), (17) to (19).
"""

from h2nav.attitude.kernels.fixed_flight_layout import (
    BIAS_MOST,
    BIAS_VAR,
    BIAS_WALK,
    D_MOST,
    DOUBT,
    DOUBT_MOST,
    E_D,
    E_E,
    E_MOST,
    E_N,
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

NOISE_ORIGIN = 57 << 8  # log2 of 2^57: unit of the innovation's variance before scaling
MOST_NOISE = 29 << 8


def predict_theta(state: list[I32], params: list[I32], r: list[I32]) -> None:
    """Covariance of theta and the sensitivities over one frame.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    time = state[T_FRAME]
    # what one unit of bias turns in the frame, units of heading, Q23
    unit = (time * 15625) >> 14
    x = (unit * r[6] + 16384) >> 15
    y = (unit * r[7] + 16384) >> 15
    z = (unit * r[8] + 16384) >> 15
    predict_covariance(state, params, x, y, z)
    carry_velocity(state, V_N, U_N, x, y, z)
    carry_velocity(state, V_E, U_E, x, y, z)
    carry_tilt(state, U_N, unit * r[3], unit * r[4], unit * r[5], x, y, z)
    carry_tilt(state, U_E, -unit * r[0], -unit * r[1], -unit * r[2], x, y, z)


def predict_covariance(state: list[I32], params: list[I32], x: I32, y: I32, z: I32) -> None:
    """P <- F P F^T + Q; x, y, z is the heading that one unit of each bias gives in the frame."""
    time = state[T_FRAME]
    a = heading_of(state[P], state[P + 1], state[P + 2], x, y, z)
    b = heading_of(state[P + 1], state[P + 4], state[P + 5], x, y, z)
    c = heading_of(state[P + 2], state[P + 5], state[P + 7], x, y, z)
    both = heading_of(a, b, c, x, y, z)
    both -= 2 * heading_of(state[P + 3], state[P + 6], state[P + 8], x, y, z)
    noise = params[GYRO] + (product(state[TURNING] << 1, params[HEADING_M]) >> params[HEADING_S])
    both += product(limited(noise, 1 << 30), time) >> 6
    state[P + 3] = limited(state[P + 3] - a, P_MOST)
    state[P + 6] = limited(state[P + 6] - b, P_MOST)
    state[P + 8] = limited(state[P + 8] - c, P_MOST)
    state[P + 9] = clamp(state[P + 9] + both, P_LEAST, P_MOST)
    walk = (product(params[BIAS_WALK], time) >> 3) + 1
    grow(state, params, 0, walk)
    grow(state, params, 4, walk)
    grow(state, params, 7, walk)


def heading_of(a: I32, b: I32, c: I32, x: I32, y: I32, z: I32) -> I32:
    """A x + b y + c z, the second factors Q23."""
    return (product(a, x) >> 8) + (product(b, y) >> 8) + (product(c, z) >> 8)


def grow(state: list[I32], params: list[I32], i: I32, walk: I32) -> None:
    """Raises one variance of the bias as long as it is below its start."""
    if state[P + i] < params[BIAS_VAR]:
        state[P + i] = clamp(state[P + i] + walk, P_LEAST, P_MOST)


def carry_velocity(state: list[I32], v: I32, u: I32, x: I32, y: I32, z: I32) -> None:
    """Sensitivity of a velocity over one frame."""
    time = state[T_FRAME]
    heading = state[v + 3]
    state[v] = carried(state[v], product(state[u], time) >> 7, heading, x)
    state[v + 1] = carried(state[v + 1], product(state[u + 1], time) >> 7, heading, y)
    state[v + 2] = carried(state[v + 2], product(state[u + 2], time) >> 7, heading, z)
    state[v + 3] = limited(heading + (product(state[u + 3], time) >> 7), V_MOST)


def carry_tilt(
    state: list[I32], u: I32, turn_x: I32, turn_y: I32, turn_z: I32, x: I32, y: I32, z: I32
) -> None:
    """Sensitivity of a tilt over one frame, in which a unit of bias tilts by turn 2^-39."""
    heading = state[u + 3]
    state[u] = carried(state[u], turn_x >> 11, heading, x)
    state[u + 1] = carried(state[u + 1], turn_y >> 11, heading, y)
    state[u + 2] = carried(state[u + 2], turn_z >> 11, heading, z)


def carried(value: I32, change: I32, heading: I32, turn: I32) -> I32:
    """A sensitivity after its change; it refers to the heading error where that is now."""
    return limited(value + change + (product(heading, turn) >> 8), U_MOST)


def surplus(a: I32, b: I32, c: I32, d: I32) -> I32:
    """Number of digits that the largest of four numbers has beyond 15."""
    return clamp(bits_of(abs(a) | abs(b) | abs(c) | abs(d)) - 15, 0, 16)


def measure(state: list[I32], a: list[I32], innovation: I32, log_noise: I32) -> None:
    """One scalar measurement a . theta with noise; adds to D and takes from P.

    Args:
        state: memory.
        a: sensitivities, Q24 of their unit; scaled in place.
        innovation: the same unit, Q24.
        log_noise: of its variance without the error of theta.

    Source: docs/fixed-point.md Eq. (20) to (22).
    """
    scale = surplus(a[0], a[1], a[2], a[3])
    for i in range(4):
        a[i] = known(a[i] >> scale, -32768, 32767)
    h = [0, 0, 0, 0]
    h[0] = row_times(state, P, P + 1, P + 2, P + 3, a)
    h[1] = row_times(state, P + 1, P + 4, P + 5, P + 6, a)
    h[2] = row_times(state, P + 2, P + 5, P + 7, P + 8, a)
    h[3] = row_times(state, P + 3, P + 6, P + 8, P + 9, a)
    fall = surplus(h[0], h[1], h[2], h[3])
    variance = 0
    known_already = 0
    for i in range(4):
        h[i] = known(h[i] >> fall, -32768, 32767)
        variance += (a[i] * h[i]) >> 2
        known_already += product(state[D + i], a[i]) >> 2
    variance = clamp(variance, 0, 1 << 30)
    # the noise in the unit of the variance; if it is too large for that, both in a larger one
    log_noise += NOISE_ORIGIN - ((2 * scale + fall) << 8)
    excess = 0
    if log_noise > MOST_NOISE:
        excess = (log_noise >> 8) - 28
    if excess > 30:
        return
    variance = (variance >> excess) + power2(log_noise - (excess << 8)) + 1
    digits = bits_of(variance)
    inverse = reciprocal(mantissa(variance, digits))
    lost = digits + excess

    explained = limited(shifted(known_already, 11 - scale), D_MOST)
    y = limited(limited(innovation, D_MOST) - explained, D_MOST)
    y_scale = surplus(y, 0, 0, 0)
    e = (known(y >> y_scale, -32768, 32767) * inverse + 16384) >> 15
    shift = clamp(lost + scale - 27 - y_scale, -12, 31)
    for i in range(4):
        state[D + i] = limited(state[D + i] + shifted(h[i] * e, shift), D_MOST)
    shrink(state, h, inverse, clamp(lost - fall - 16, -12, 31))


def row_times(state: list[I32], i: I32, j: I32, k: I32, l: I32, a: list[I32]) -> I32:  # noqa: E741
    """A row of P, given by its places, times a; a quarter of 2^15 less."""
    return (
        (product(state[i], a[0]) >> 2)
        + (product(state[j], a[1]) >> 2)
        + (product(state[k], a[2]) >> 2)
        + (product(state[l], a[3]) >> 2)
    )


def shrink(state: list[I32], h: list[I32], inverse: I32, shift: I32) -> None:
    """P <- P - h h^T / S; what is taken from a variance is rounded down."""
    k = (h[0] * inverse + 16384) >> 15
    lower_variance(state, P, shifted(k * h[0], shift))
    lower(state, P + 1, shifted(k * h[1], shift))
    lower(state, P + 2, shifted(k * h[2], shift))
    lower(state, P + 3, shifted(k * h[3], shift))
    k = (h[1] * inverse + 16384) >> 15
    lower_variance(state, P + 4, shifted(k * h[1], shift))
    lower(state, P + 5, shifted(k * h[2], shift))
    lower(state, P + 6, shifted(k * h[3], shift))
    k = (h[2] * inverse + 16384) >> 15
    lower_variance(state, P + 7, shifted(k * h[2], shift))
    lower(state, P + 8, shifted(k * h[3], shift))
    k = (h[3] * inverse + 16384) >> 15
    lower_variance(state, P + 9, shifted(k * h[3], shift))


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


def apply_theta(state: list[I32], params: list[I32], met: list[I32]) -> None:
    """Moves bias, velocity and attitude by the correction D, which is forgotten.

    Source: docs/filter.md Eq. (19).
    """
    scale = surplus(state[D], state[D + 1], state[D + 2], state[D + 3])
    d = [0, 0, 0, 0]
    for i in range(4):
        d[i] = known(state[D + i] >> scale, -32768, 32767)
    for i in range(3):
        bias = state[B_X + i] + (state[D + i] >> 2)
        state[B_X + i] = clamp(bias, -params[BIAS_MOST], params[BIAS_MOST])
        met[0] |= bias - state[B_X + i]
    heading = state[D + 3]
    for i in range(4):
        state[D + i] = 0
    state[S_N] = limited(state[S_N] + shifted(times(state, V_N, d), 11 - scale), S_MOST)
    state[S_E] = limited(state[S_E] + shifted(times(state, V_E, d), 11 - scale), S_MOST)
    turn(
        state, shifted(times(state, U_N, d), 10 - scale), shifted(times(state, U_E, d), 10 - scale)
    )
    state[E_D] = limited(state[E_D] + heading, E_MOST)
    limit_heading(state, params)


def times(state: list[I32], row: I32, d: list[I32]) -> I32:
    """Sensitivities times the scaled correction; a quarter of 2^15 less."""
    return (
        (product(state[row], d[0]) >> 2)
        + (product(state[row + 1], d[1]) >> 2)
        + (product(state[row + 2], d[2]) >> 2)
        + (product(state[row + 3], d[3]) >> 2)
    )


def turn(state: list[I32], tilt_n: I32, tilt_e: I32) -> None:
    """Adds a tilt north and east (half radians, Q30) to the correction to come."""
    state[E_N] = limited(state[E_N] + limited(tilt_e, 1 << 29), E_MOST)
    state[E_E] = limited(state[E_E] - limited(tilt_n, 1 << 29), E_MOST)


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
