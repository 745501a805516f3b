"""What the flight filter in integers does when its tilt is wrong by far, and at rest.

Source: docs/filter.md Eq. (14), (20), (30) to (32).
"""

from h2nav.attitude.kernels.fixed_flight_layout import (
    A_X,
    AGE_MOST_US,
    AGE_US,
    BIAS_MOST,
    DENIED,
    DOUBT,
    DOUBT_MOST,
    DRIFT_N,
    E_D,
    E_E,
    E_N,
    FIELD_AGE_US,
    FORCE_MOST,
    LOG_REST,
    LOST,
    LP_FORCE,
    LP_RATE,
    LP_SHIFT,
    MISSES,
    MOST_MISSES,
    MOVING,
    NO_FIELD,
    NOSE,
    P_LEAST,
    P_MOST,
    REST,
    REST_AXIS,
    REST_FORCE,
    REST_RATE,
    REST_US,
    ROW,
    S_E,
    S_MOST,
    S_N,
    SEEN_US,
    SHAKING,
    STEADY_US,
    T_FRAME,
    T_REST_US,
    TURNING,
    UNSTEADY,
    P,
)
from h2nav.attitude.kernels.fixed_flight_theta import find_gain, forget_sensitivities, limit_heading
from h2nav.attitude.kernels.fixed_functions import bits_of, limited, logarithm, power2, product
from h2nav.attitude.kernels.fixed_motion import (
    B_X,
    DT_US,
    RATE_LIMIT,
    T_X,
    T_Y,
    T_Z,
    W_X,
)
from h2nav.attitude.kernels.fixed_triad import UNIT_Q14, VECTOR_LIMIT, triad
from h2nav.maths.fixedpoint import I32, clamp, known

MOST_LOST = 53687091  # 0.2 rad, Q28: after clipped samples that may have hidden more, start anew
ALL_LOST = 161061274  # 0.6 rad: ... and the force is the better guess
LEVEL_DOUBT = 26843546  # 0.1 rad: of a tilt taken from the force alone
LEVEL_SIZE = 6710886  # 0.1, Q26, of the force's square: 5 % of g
AIR_COSINE_2 = 24802  # square of 0.87, Q15: a steady turn within 5 % of g banks by 18 deg
GROUND_COSINE_2 = 31792  # square of 0.985: no steady acceleration on the ground is that large
REST_FLOOR = 3627000  # (0.1 deg/s)^2 in units of theta, Q28
REST_SIGMAS_2 = 9  # a rate that is this far from the known bias is no bias
ONE_Q26 = 1 << 26


def watch_rest(state: list[I32], params: list[I32], sample: list[I32]) -> None:
    """Low-passes rate and force; notes a sample that is far from either.

    Source: docs/fixed-point.md Eq. (26).
    """
    shift = params[LP_SHIFT]
    rate = 0
    force = 0
    for i in range(3):
        value = clamp(sample[W_X + i] >> 1, -RATE_LIMIT, RATE_LIMIT) << 4
        d = value - state[LP_RATE + i]
        # between the two
        after = state[LP_RATE + i] + (d >> shift)
        state[LP_RATE + i] = known(after, -(RATE_LIMIT << 4), RATE_LIMIT << 4)
        rate += (d >> 15) * (d >> 15)
        d = (sample[A_X + i] << 4) - state[LP_FORCE + i]
        after = state[LP_FORCE + i] + (d >> shift)
        state[LP_FORCE + i] = known(after, -(FORCE_MOST << 4), FORCE_MOST << 4)
        force += (d >> 15) * (d >> 15)
    state[UNSTEADY] |= ((params[REST_RATE] - rate) | (params[REST_FORCE] - force)) >> 31


def judge_rest(state: list[I32], params: list[I32], sample: list[I32]) -> None:
    """How long nothing has been felt to move.

    Source: docs/filter.md Eq. (20), (31).
    """
    time_us = (state[T_FRAME] * 15625) >> 11
    most = params[BIAS_MOST] >> 9
    is_steady = 1 + state[UNSTEADY]
    for i in range(3):
        if abs(state[LP_RATE + i]) > most:
            is_steady = 0
    state[UNSTEADY] = 0
    if is_steady == 0:
        state[STEADY_US] = 0
        state[REST_US] = 0
        return
    state[STEADY_US] = clamp(state[STEADY_US] + time_us, 0, AGE_MOST_US)
    still = sample[REST]
    # by the signals alone a slow turn looks like rest: the bias must not jump by it
    if still == 1 and moves(state, 0, P) + moves(state, 1, P + 4) + moves(state, 2, P + 7) > 0:
        still = 0
    state[REST_US] = clamp(state[REST_US] + time_us, 0, AGE_MOST_US)
    if still == 0:
        state[REST_US] = 0


def bias_error(state: list[I32], axis: I32) -> I32:
    """Low-passed rate less bias, units of theta, Q24."""
    return limited(state[LP_RATE + axis] - (state[B_X + axis] >> 9), 1 << 22) << 7


def moves(state: list[I32], axis: I32, variance: I32) -> I32:
    """1 when the low-passed rate contradicts the bias as far as it is known."""
    d = limited(bias_error(state, axis), 32767 << 10) >> 10
    known_to = limited(state[variance] + REST_FLOOR, 119000000)
    if d * d > REST_SIGMAS_2 * known_to:
        return 1
    return 0


def find_rest_gain(state: list[I32], params: list[I32]) -> None:
    """Gain for one axis of the low-passed rate taken as bias; the axes take turns.

    Source: docs/filter.md Eq. (20).
    """
    axis = state[REST_AXIS]
    state[REST_AXIS] = axis + 1 if axis < 2 else 0
    for i in range(4):
        state[ROW + i] = 0
    state[ROW + axis] = 1 << 24
    # two of three axes in a frame: each has the noise of one and a half
    log_time = logarithm(state[T_FRAME] * 3 + 1) - (18 << 8)
    find_gain(state, ROW, bias_error(state, axis), params[LOG_REST] - log_time)


def restart_tilt(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """The tilt was wrong: find it anew, keep bias and heading.

    Source: docs/filter.md Eq. (14).
    """
    forget_sensitivities(state)
    state[S_N] = known((sample[NOSE] * r[0]) >> 2, -S_MOST, S_MOST)
    state[S_E] = known((sample[NOSE] * r[3]) >> 2, -S_MOST, S_MOST)
    state[TURNING] = 0
    state[MOVING] = 0
    state[SHAKING] = 0
    state[DRIFT_N] = 0
    state[DRIFT_N + 1] = 0
    state[AGE_US] = 0
    state[MISSES] = MOST_MISSES
    state[DENIED] = 0
    state[STEADY_US] = 0


def doubt_rate(state: list[I32], params: list[I32], sample: list[I32]) -> None:
    """A clipped rate is doubted by as much as it differs from the rates before it.

    Source: docs/filter.md Eq. (30).
    """
    square = 1
    for i in range(3):
        value = clamp(sample[W_X + i] >> 1, -RATE_LIMIT, RATE_LIMIT) << 4
        d = (value - state[LP_RATE + i]) >> 15
        square += d * d
    # the difference in 1e6 2^-28 rad/s times microseconds: rad, Q28
    lost = limited(power2(logarithm(square) >> 1), 33000) * sample[DT_US]
    before = state[LOST]
    state[LOST] = clamp(before + lost, 0, 1 << 30)
    doubt_tilt(state, state[DOUBT] + lost)
    # the heading has been turned as well as the tilt
    squares = product(
        limited(lost, 1 << 28) << 2, (limited(2 * limited(before, 1 << 27) + lost, 1 << 28)) >> 14
    )
    state[P + 9] = clamp(state[P + 9] + (limited(squares, 1 << 28) << 1), P_LEAST, P_MOST)
    limit_heading(state, params)


def doubt_tilt(state: list[I32], angle: I32) -> None:
    """The tilt is known no better than this, rad, Q28."""
    if angle > DOUBT_MOST:
        angle = DOUBT_MOST
    if angle > state[DOUBT]:
        state[DOUBT] = angle


def ask_force(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> None:
    """Notes when a low-passed force of size g denies the tilt, once something else does too.

    Source: docs/filter.md Eq. (31).
    """
    cosine_2 = AIR_COSINE_2
    if state[DENIED] > 0:
        state[DENIED] = 0
    elif state[STEADY_US] < params[T_REST_US]:
        return
    elif sample[REST] == 2:
        cosine_2 = GROUND_COSINE_2
    x = limited(state[LP_FORCE] >> 10, 32767)
    y = limited(state[LP_FORCE + 1] >> 10, 32767)
    z = limited(state[LP_FORCE + 2] >> 10, 32767)
    square = (x >> 1) * (x >> 1) + (y >> 1) * (y >> 1) + (z >> 1) * (z >> 1)
    down = (((r[6] * x) >> 1) + ((r[7] * y) >> 1) + ((r[8] * z) >> 1)) >> 15
    if abs(square - ONE_Q26) > LEVEL_SIZE:
        return
    # half the force shows down, Q14 >> 1; its square is compared with that of the whole
    if down >= 0 or limited(down, 32767) * limited(down, 32767) <= product(square, cosine_2):
        state[DENIED] = 2


def upright(state: list[I32], x: I32, y: I32, z: I32, north: list[I32]) -> I32:
    """Takes the attitude in which a force points up and `north` about north; returns 1 if it can.

    Args:
        state: memory.
        x: specific force, body frame, any unit, below 2^30.
        y: the same.
        z: the same.
        north: what shows north when gravity is taken away, body frame, Q14.
    """
    scale = bits_of(abs(x) | abs(y) | abs(z)) - 14
    if scale < -13:
        return 0
    g = [0, 0, 0]
    if scale >= 0:
        g[0] = known(-(x >> scale), -UNIT_Q14, UNIT_Q14)
        g[1] = known(-(y >> scale), -UNIT_Q14, UNIT_Q14)
        g[2] = known(-(z >> scale), -UNIT_Q14, UNIT_Q14)
    else:
        g[0] = known(-(known(x, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
        g[1] = known(-(known(y, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
        g[2] = known(-(known(z, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
    # the largest is half a unit or more: its length is within what `triad` scales, or twice that
    if (g[0] >> 1) * (g[0] >> 1) + (g[1] >> 1) * (g[1] >> 1) + (g[2] >> 1) * (g[2] >> 1) > ONE_Q26:
        for i in range(3):
            g[i] = g[i] >> 1
    if triad(g, north, state) == 0:
        return 0
    state[T_X] = 0
    state[T_Y] = 0
    state[T_Z] = 0
    state[E_N] = 0
    state[E_E] = 0
    state[E_D] = 0
    # a field that waits was turned by another attitude
    state[FIELD_AGE_US] = 0
    state[SEEN_US] = 0
    return 1


def level(state: list[I32], x: I32, y: I32, z: I32, r: list[I32]) -> None:
    """Takes the tilt from a force, unless it shows along the nose; the heading is asked anew.

    Source: docs/filter.md Eq. (32).
    """
    north = [0, 0, 0]
    for i in range(3):
        north[i] = known(r[i] >> 1, -VECTOR_LIMIT, VECTOR_LIMIT)
    if upright(state, x, y, z, north) > 0:
        # the field was seen through the wrong tilt: the next gives the heading, as at the start
        state[NO_FIELD] = 2
