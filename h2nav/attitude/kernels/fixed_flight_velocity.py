"""First stage of the flight filter in integers: velocity, its levels, gain sets.

Source: docs/fixed-point.md Eq. (23) to (25); docs/filter.md Eq. (5), (8) to (11), (13), (14).
"""

from h2nav.attitude.kernels.fixed_flight_doubt import restart_tilt
from h2nav.attitude.kernels.fixed_flight_layout import (
    A_E,
    A_N,
    A_X,
    A_Y,
    A_Z,
    AGE_US,
    AIDED,
    C_E,
    C_MASK,
    C_N,
    CEILING,
    CORRELATION,
    DENIED,
    DRIFT_E,
    DRIFT_N,
    E_E,
    E_MOST,
    E_N,
    F_X,
    F_Y,
    F_Z,
    FIX_US,
    FLOOR,
    FRAME_US,
    GYRO,
    IMPOSSIBLE,
    IS_AIDED,
    K_TILT,
    K_VELOCITY,
    KT_M,
    KT_S,
    KV_M,
    KV_S,
    LEVEL_MOST,
    LOG_BOUNDS,
    LOG_EASE,
    LOG_GYRO,
    LOG_INFLATE,
    LOG_MOST,
    LOG_NOISE,
    LOG_START,
    LOG_VELOCITY,
    MISSES,
    MOST_MISSES,
    MOVING,
    NOSE,
    PHASE,
    S_E,
    S_MOST,
    S_N,
    SCALE_M,
    SCALE_S,
    SET,
    SETS,
    SHAKING,
    SUM_E,
    SUM_N,
    SUM_TURN,
    T_DRIFT_US,
    T_EASE_US,
    T_FRAME,
    T_LEVEL_US,
    TURNING,
    U_E,
    U_N,
    USE,
    V_E,
    V_MOST,
    V_N,
    Y_E,
    Y_MOST,
    Y_N,
)
from h2nav.attitude.kernels.fixed_flight_theta import forget_velocity
from h2nav.attitude.kernels.fixed_functions import (
    bits_of,
    limited,
    logarithm,
    mantissa,
    power2,
    product,
    ratio,
)
from h2nav.attitude.kernels.fixed_motion import DT_US
from h2nav.maths.fixedpoint import I32, clamp, known

ACCELERATION_MOST = 113600  # three axes at 16 g, Q12
Q24 = 24 << 8
EASE_MOST = 21 << 8


def accelerate(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """Velocity over one sample; what rounding leaves of force and acceleration comes next time.

    Source: docs/filter.md Eq. (5), (13).
    """
    x = sample[A_X] + state[F_X]
    y = sample[A_Y] + state[F_Y]
    z = sample[A_Z] + state[F_Z]
    state[F_X] = x & 511
    state[F_Y] = y & 511
    state[F_Z] = z & 511
    x = x >> 9
    y = y >> 9
    z = z >> 9
    north = ((r[0] * x) >> 1) + ((r[1] * y) >> 1) + ((r[2] * z) >> 1) + state[A_N]
    east = ((r[3] * x) >> 1) + ((r[4] * y) >> 1) + ((r[5] * z) >> 1) + state[A_E]
    state[A_N] = north & 8191
    state[A_E] = east & 8191
    # a turn keeps the length (Lemma 2); 1.0486 us is 2^-20 s
    time = (sample[DT_US] * 34360 + 16384) >> 15
    north = (known(north >> 13, -ACCELERATION_MOST, ACCELERATION_MOST) * time + 128) >> 8
    east = (known(east >> 13, -ACCELERATION_MOST, ACCELERATION_MOST) * time + 128) >> 8
    state[S_N] = limited(state[S_N] + north, S_MOST)
    state[S_E] = limited(state[S_E] + east, S_MOST)
    if sample[IS_AIDED] > 0:
        # only a measured velocity tells the heading: a bounded one is bounded in any direction
        state[V_N + 3] = limited(state[V_N + 3] - (east >> 1), V_MOST)
        state[V_E + 3] = limited(state[V_E + 3] + (north >> 1), V_MOST)
        state[C_N] = (state[C_N] + north) & C_MASK
        state[C_E] = (state[C_E] + east) & C_MASK


def change_aiding(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """The velocity before and the one after have nothing to do with each other."""
    forget_velocity(state)
    state[U_N + 3] = 0
    state[U_E + 3] = 0
    state[S_N] = known((sample[NOSE] * r[0]) >> 2, -S_MOST, S_MOST)
    state[S_E] = known((sample[NOSE] * r[3]) >> 2, -S_MOST, S_MOST)
    state[C_N] = 0
    state[C_E] = 0
    state[MISSES] = MOST_MISSES
    state[DENIED] = 0
    state[AIDED] = sample[IS_AIDED]
    state[FIX_US] = 0
    begin_frames(state)


def begin_frames(state: list[I32]) -> None:
    """No frame is complete yet, and no gain is known."""
    state[PHASE] = 1
    state[FRAME_US] = 0
    state[T_FRAME] = 0
    state[SUM_N] = 0
    state[SUM_E] = 0
    state[SUM_TURN] = 0
    state[USE] = 0
    state[KT_M] = 0
    state[KT_S] = 0
    state[KV_M] = 0
    state[KV_S] = 0


def correct_velocity(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """The constant gain for a velocity near zero, or near NOSE along the nose.

    Source: docs/filter.md Eq. (10); docs/fixed-point.md Eq. (23).
    """
    north = limited(((sample[NOSE] * r[0]) >> 2) - state[S_N], Y_MOST)
    east = limited(((sample[NOSE] * r[3]) >> 2) - state[S_E], Y_MOST)
    # at most sixteen samples since the sums were zero
    state[SUM_N] = known(state[SUM_N] + (north >> 4), -Y_MOST, Y_MOST)
    state[SUM_E] = known(state[SUM_E] + (east >> 4), -Y_MOST, Y_MOST)
    # without aiding the gains are those of a frame, never larger than one
    gain = state[KT_M]
    shift = known(state[KT_S], 0, 31)
    state[E_N] = limited(state[E_N] + (product(east << 1, gain) >> shift), E_MOST)
    state[E_E] = limited(state[E_E] - (product(north << 1, gain) >> shift), E_MOST)
    gain = state[KV_M]
    shift = known(state[KV_S], 0, 31)
    state[S_N] = limited(state[S_N] + (((product(north << 2, gain) >> shift) + 32) >> 6), S_MOST)
    state[S_E] = limited(state[S_E] + (((product(east << 2, gain) >> shift) + 32) >> 6), S_MOST)


def judge_bounded(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> I32:
    """Levels of the frame's innovation; restarts at impossible velocities.

    Returns 1 when the tilt has started anew. Source: docs/filter.md Eq. (11), (14).
    """
    square = square_of(state[Y_N], state[Y_E])
    if square > params[IMPOSSIBLE]:
        restart_tilt(state, sample, r)
        begin_frames(state)
        return 1
    time_us = (state[T_FRAME] * 15625) >> 11
    share = level_share(state, params, time_us)
    raise_level(state, MOVING, square, share)
    # an innovation that stays is a wrong bias rather than motion: it must not hide itself
    slow = ratio(time_us, params[T_DRIFT_US] + time_us)
    north = state[Y_N] - state[DRIFT_N]
    east = state[Y_E] - state[DRIFT_E]
    state[DRIFT_N] = limited(state[DRIFT_N] + product(north, slow), Y_MOST)
    state[DRIFT_E] = limited(state[DRIFT_E] + product(east, slow), Y_MOST)
    raise_level(state, SHAKING, square_of(north, east), share)
    return 0


def choose_bounded(state: list[I32], params: list[I32]) -> None:
    """Noise and gain set for the levels.

    Source: docs/filter.md Eq. (9), (11), (14).
    """
    floor = params[FLOOR]
    noise = density(floor, params[CORRELATION], params[CEILING], state[MOVING])
    state[LOG_VELOCITY] = logarithm(noise) - Q24
    select_set(state, params)
    set_frame_gains(state, params)
    # 1 / T + k_v, of which the second is small
    kept = state[KV_M] >> known(state[KV_S], 0, 31)
    log_rate = (17 << 8) - logarithm(state[T_FRAME] | 1) + ((kept * 369) >> 15)
    noise = density(floor, params[CORRELATION], params[CEILING], state[SHAKING])
    log_noise = logarithm(noise) - Q24 + params[LOG_INFLATE] + log_rate + state[LOG_EASE]
    state[LOG_NOISE] = clamp(log_noise, -LOG_MOST, LOG_MOST)


def square_of(north: I32, east: I32) -> I32:
    """Squared size of an innovation, Q24; each part counts for 7.9 s at most."""
    n = limited(north, 32400 << 12) >> 12
    e = limited(east, 32400 << 12) >> 12
    return n * n + e * e


def level_share(state: list[I32], params: list[I32], time_us: I32) -> I32:
    """Share that a time has in the levels, Q15; a young level is the mean so far."""
    span = params[T_LEVEL_US]
    if state[AGE_US] < span:
        span = state[AGE_US]
    return ratio(time_us, span + 1)


def raise_level(state: list[I32], level: I32, square: I32, share: I32) -> None:
    """Moves a level towards a new value by its share."""
    change = product(limited(square, LEVEL_MOST) - state[level], share)
    state[level] = clamp(state[level] + change, 0, LEVEL_MOST)


def density(floor: I32, correlation: I32, ceiling: I32, level: I32) -> I32:
    """Velocity noise for a level of the innovation, s^2/Hz, Q24.

    Source: docs/filter.md Eq. (14).
    """
    noise = floor + (limited(product(level, correlation), 1 << 26) << 3)
    if noise > ceiling:
        noise = ceiling
    return noise


def select_set(state: list[I32], params: list[I32]) -> None:
    """Gain set for the measured levels; sharper sets while the filter starts.

    Source: docs/filter.md Eq. (9), (14).
    """
    turning = product(state[TURNING] << 1, params[SCALE_M]) >> params[SCALE_S]
    state[LOG_GYRO] = logarithm(params[GYRO] + limited(turning, 1 << 30)) - (33 << 8)
    wanted = state[LOG_GYRO] - state[LOG_VELOCITY]
    ramp = (params[LOG_START] - logarithm(state[AGE_US] | 1)) << 2
    if wanted < ramp:
        wanted = ramp
    number = 0
    for i in range(SETS - 1):
        if wanted > params[LOG_BOUNDS + i]:
            number = i + 1
    state[SET] = number


def set_frame_gains(state: list[I32], params: list[I32]) -> None:
    """Gains of the set for the time of a frame.

    Source: docs/fixed-point.md Eq. (24).
    """
    time = state[T_FRAME] | 1
    digits = bits_of(time)
    m = mantissa(time, digits)
    # the frame lasts m 2^(digits - 32) s
    fall = 17 - digits
    gain = params[K_TILT + state[SET]]
    state[KT_M] = ((gain >> 5) * m) >> 15
    state[KT_S] = clamp((gain & 31) - 8 + fall, 0, 30)
    gain = params[K_VELOCITY + state[SET]]
    state[KV_M] = ((gain >> 5) * m) >> 15
    state[KV_S] = clamp((gain & 31) - 8 + fall, 0, 30)


def set_ease(state: list[I32], params: list[I32]) -> None:
    """Factor on all noises while the filter starts: the first tilt error is none of the bias.

    Source: docs/filter.md Eq. (14).
    """
    # 1 + (t_0 / t)^4 with 8 fraction bits
    ramp = (logarithm(params[T_EASE_US] | 1) - logarithm(state[AGE_US] | 1)) << 2
    ease = power2(clamp(ramp, -LOG_MOST, EASE_MOST) + (8 << 8)) + 256
    state[LOG_EASE] = clamp(logarithm(ease) - (8 << 8), 0, LOG_MOST)
