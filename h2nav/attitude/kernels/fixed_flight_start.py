"""How the flight filter in integers finds its first attitude, forgets it, and begins anew.

Source: docs/filter.md Eq. (14), (26), (30), (32).
"""

from h2nav.attitude.kernels.fixed_flight_doubt import (
    ALL_LOST,
    LEVEL_DOUBT,
    level,
    restart_tilt,
    upright,
)
from h2nav.attitude.kernels.fixed_flight_field import forget_heading
from h2nav.attitude.kernels.fixed_flight_layout import (
    A_E,
    A_N,
    A_X,
    A_Y,
    A_Z,
    AGE_US,
    AIDED,
    ALIGNED,
    BIAS_VAR,
    CLIPPED,
    COS_DECLINATION,
    DECLINATION,
    DENIED,
    DOUBT,
    E_D,
    F_FIELD,
    F_X,
    FIELD_MOST_US,
    FIELD_US,
    FIX_US,
    HAS_FIELD,
    LOST,
    LP_FORCE,
    LP_RATE,
    NEW_US,
    NO_FIELD,
    P_LEAST,
    REST_US,
    RESTARTED,
    STATE_SIZE,
    D,
    P,
)
from h2nav.attitude.kernels.fixed_flight_velocity import begin_frames
from h2nav.attitude.kernels.fixed_functions import limited
from h2nav.attitude.kernels.fixed_motion import DT_US, Q_W, RATE_LIMIT, W_X, rotation
from h2nav.attitude.kernels.fixed_triad import Q_LIMIT, UNIT_Q14
from h2nav.maths.fixedpoint import I32, clamp

FIELD_WAIT_US = 250000
MOST_AT_ONCE = 1 << 29  # 2 rad, Q28: most of a declination that the start takes


def begin_anew(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """Starts the tilt again, from a force where the tilt is worth nothing.

    That is after clipped samples that may have hidden a turn, and when the low-passed force has
    denied the tilt. Source: docs/filter.md Eq. (30), (32).
    """
    if state[DENIED] == 2:
        level(state, state[LP_FORCE], state[LP_FORCE + 1], state[LP_FORCE + 2], r)
        state[DOUBT] = LEVEL_DOUBT
    elif state[LOST] > ALL_LOST:
        level(state, sample[A_X], sample[A_Y], sample[A_Z], r)
    state[LOST] = 0
    restart_tilt(state, sample, r)
    begin_frames(state)


def align(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes the attitude that one sample shows; returns bits.

    A field is waited for; without one the nose points north.
    """
    state[FIELD_US] = clamp(state[FIELD_US] + sample[DT_US], 0, FIELD_MOST_US)
    if sample[CLIPPED] > 0:
        return 0
    if sample[HAS_FIELD] == 0 and state[FIELD_US] < FIELD_WAIT_US:
        return 0
    north = [UNIT_Q14, 0, 0]
    if sample[HAS_FIELD] > 0:
        # half of it, a quarter of a strong one: its direction counts, and `triad` takes 1.25
        size = abs(sample[F_FIELD]) + abs(sample[F_FIELD + 1]) + abs(sample[F_FIELD + 2])
        for i in range(3):
            north[i] = sample[F_FIELD + i] >> (2 if size > 32767 else 1)
    elif abs(sample[A_X]) > abs(sample[A_Y]) + abs(sample[A_Z]):
        north[0] = 0
        north[2] = UNIT_Q14
    if upright(state, sample[A_X], sample[A_Y], sample[A_Z], north) == 0:
        return 0
    state[NO_FIELD] = 1 - sample[HAS_FIELD]
    begin(state, params, sample)
    return ALIGNED | RESTARTED


def begin(state: list[I32], params: list[I32], sample: list[I32]) -> None:
    """Everything but bias, its covariance, latency and references starts anew."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    rotation(state, r)
    restart_tilt(state, sample, r)
    begin_frames(state)
    forget_heading(state, params)
    for i in range(3):
        state[LP_RATE + i] = clamp(sample[W_X + i] >> 1, -RATE_LIMIT, RATE_LIMIT) << 4
        state[LP_FORCE + i] = sample[A_X + i] << 4
        state[F_X + i] = 0
    for i in range(4):
        state[D + i] = 0
    state[A_N] = 0
    state[A_E] = 0
    state[REST_US] = 0
    state[LOST] = 0
    state[DOUBT] = 0
    state[AIDED] = 0
    state[FIX_US] = 0
    state[FIELD_US] = 0
    state[NEW_US] = 0
    if sample[HAS_FIELD] > 0:
        # the attitude is that of magnetic north
        state[E_D] = limited(state[DECLINATION], MOST_AT_ONCE) * 2
        if abs(state[DECLINATION]) > MOST_AT_ONCE:
            # beside a pole: the fields to come give the rest
            state[NO_FIELD] = 1


def reset(state: list[I32]) -> None:
    """Forgets everything."""
    for i in range(STATE_SIZE):
        state[i] = 0
    state[Q_W] = Q_LIMIT - (1 << 19)
    state[P] = P_LEAST
    state[P + 4] = P_LEAST
    state[P + 7] = P_LEAST
    state[P + 9] = P_LEAST
    state[COS_DECLINATION] = UNIT_Q14
    state[AGE_US] = -1


def prepare(state: list[I32], params: list[I32]) -> None:
    """After `reset`: the bias is known as badly as the parameters say."""
    state[P] = params[BIAS_VAR]
    state[P + 4] = params[BIAS_VAR]
    state[P + 7] = params[BIAS_VAR]


def restart(state: list[I32]) -> None:
    """Forgets the attitude; keeps bias, references and the counter of saturations."""
    state[AGE_US] = -1
    state[FIELD_US] = 0
