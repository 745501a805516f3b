"""Measured velocities in the flight filter in integers.

Source: docs/filter.md Eq. (15), (16), (30).
"""

from h2nav.attitude.kernels.fixed_flight_doubt import doubt_tilt
from h2nav.attitude.kernels.fixed_flight_layout import (
    C_E,
    C_MASK,
    C_N,
    D_MOST,
    DENIED,
    DOUBT,
    FIX_C,
    FIX_CEILING,
    FIX_CORRELATION,
    FIX_FLOOR,
    FIX_PERIOD_US,
    FIX_PERIODS_US,
    FIX_SPAN_US,
    FIX_US,
    FIX_V,
    FIX_VAR,
    FIX_VARIANCE,
    FIX_Y_E,
    FIX_Y_N,
    K_FIX_TILT,
    K_FIX_VELOCITY,
    KT_M,
    KT_S,
    KV_M,
    KV_S,
    LOG_EASE,
    LOG_FIX_GATE,
    LOG_FIX_INFLATE,
    LOG_MOST,
    LOG_NOISE,
    LOG_VELOCITY,
    MISSES,
    MOST_MISSES,
    MOVING,
    PERIODS,
    S_E,
    S_MOST,
    S_N,
    SET,
    SETS,
    USE,
    VELOCITY_USED,
    Y_E,
    Y_N,
)
from h2nav.attitude.kernels.fixed_flight_theta import forget_velocity, turn
from h2nav.attitude.kernels.fixed_flight_velocity import (
    Q24,
    density,
    level_share,
    raise_level,
    select_set,
    square_of,
)
from h2nav.attitude.kernels.fixed_functions import limited, logarithm, power2, product, shifted
from h2nav.maths.fixedpoint import I32, clamp

LOG_SECOND = 5102  # log2 of 1e6
STARTED = 850  # log2 of ten: before, the low-passed force is older than the tilt
DENIED_DOUBT = 134217728  # 0.5 rad, Q28: refused fixes that need so large a tilt error


def note_fix(state: list[I32], sample: list[I32]) -> None:
    """Keeps the innovation of a fix, at the time for which it was true, for its frame.

    Source: docs/filter.md Eq. (15).
    """
    gained = ((state[C_N] - sample[FIX_C] + (1 << 27)) & C_MASK) - (1 << 27)
    state[FIX_Y_N] = limited(sample[FIX_V] - state[S_N] + gained, D_MOST)
    gained = ((state[C_E] - sample[FIX_C + 1] + (1 << 27)) & C_MASK) - (1 << 27)
    state[FIX_Y_E] = limited(sample[FIX_V + 1] - state[S_E] + gained, D_MOST)
    state[FIX_VAR] = sample[FIX_VARIANCE]
    state[FIX_US] = sample[FIX_PERIOD_US]


def judge_fix(state: list[I32], params: list[I32]) -> I32:
    """Gate and level for the fix that waits; returns bits.

    Source: docs/filter.md Eq. (15), (16), (30).
    """
    state[Y_N] = state[FIX_Y_N]
    state[Y_E] = state[FIX_Y_E]
    period_us = state[FIX_US]
    state[FIX_SPAN_US] = period_us
    state[FIX_US] = 0
    if state[MISSES] >= MOST_MISSES:
        believe_fixes(state)
        return VELOCITY_USED
    log_period = logarithm(period_us | 1) - LOG_SECOND
    square = square_of(state[Y_N], state[Y_E])
    floor = power2(logarithm(params[FIX_FLOOR]) - log_period) + state[FIX_VAR] + 1
    gate = limited(floor, 1 << 29) + state[MOVING]
    log_square = logarithm(square | 1)
    if log_square > state[LOG_EASE] + params[LOG_FIX_GATE] + logarithm(gate):
        state[MISSES] = clamp(state[MISSES] + 1, 0, MOST_MISSES)
        # the tilt that would explain it: y / (5 T), Q28
        doubt_tilt(state, power2(((log_square - Q24) >> 1) - log_period - 594 + (28 << 8)))
        return 0
    state[MISSES] = 0
    raise_level(state, MOVING, square, level_share(state, params, period_us))
    state[USE] = 2
    return VELOCITY_USED


def choose_fix(state: list[I32], params: list[I32]) -> None:
    """Noise and gains for a fix that is believed.

    Source: docs/filter.md Eq. (15), (16).
    """
    period_us = state[FIX_SPAN_US]
    log_period = logarithm(period_us | 1) - LOG_SECOND
    floor = params[FIX_FLOOR] + power2(logarithm(state[FIX_VAR] | 1) + log_period)
    noise = density(
        limited(floor, 1 << 29), params[FIX_CORRELATION], params[FIX_CEILING], state[MOVING]
    )
    state[LOG_VELOCITY] = logarithm(noise) - Q24
    select_set(state, params)
    set_fix_gains(state, params, period_us)
    kept = 32768 - shifted(state[KV_M], state[KV_S])
    log_span = log_period + logarithm(clamp(kept, 1, 32768)) - (15 << 8)
    state[LOG_NOISE] = clamp(
        state[LOG_EASE] + params[LOG_FIX_INFLATE] + state[LOG_VELOCITY] - log_span,
        -LOG_MOST,
        LOG_MOST,
    )


def believe_fixes(state: list[I32]) -> None:
    """Nothing is known of the velocity yet, or the fixes agree in contradicting it."""
    forget_velocity(state)
    state[S_N] = limited(state[S_N] + state[Y_N], S_MOST)
    state[S_E] = limited(state[S_E] + state[Y_E], S_MOST)
    state[MISSES] = 0
    if state[DOUBT] > DENIED_DOUBT and state[LOG_EASE] < STARTED:
        state[DENIED] = 1


def set_fix_gains(state: list[I32], params: list[I32], period_us: I32) -> None:
    """Gains of the set for the nearest period that gains were made for."""
    row = 0
    for i in range(PERIODS - 1):
        if period_us > params[FIX_PERIODS_US + i]:
            row = (i + 1) * SETS
    row += state[SET]
    gain = params[K_FIX_TILT + row]
    state[KT_M] = gain >> 5
    state[KT_S] = clamp((gain & 31) - 8, -3, 23)
    gain = params[K_FIX_VELOCITY + row]
    state[KV_M] = gain >> 5
    state[KV_S] = clamp((gain & 31) - 8, -3, 23)


def apply_fix(state: list[I32]) -> None:
    """The constant gain for a measured velocity.

    Source: docs/filter.md Eq. (16).
    """
    tilt_n = shifted(product(state[Y_N], state[KT_M]), state[KT_S] - 5)
    tilt_e = shifted(product(state[Y_E], state[KT_M]), state[KT_S] - 5)
    turn(state, tilt_n, tilt_e)
    north = shifted(product(state[Y_N], state[KV_M]), state[KV_S])
    east = shifted(product(state[Y_E], state[KV_M]), state[KV_S])
    state[S_N] = limited(state[S_N] + limited(north, 1 << 30), S_MOST)
    state[S_E] = limited(state[S_E] + limited(east, 1 << 30), S_MOST)
