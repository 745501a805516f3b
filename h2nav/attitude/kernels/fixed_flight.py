"""The flight filter in 32-bit integers: all that the default filter does, without a division.

The first stage runs with every sample. The second stage runs once per frame of eight samples, one
part of it with each, so that no sample costs much more than another. Around it stands what finds
the first attitude. Formats and the proof of the ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (15) to (29); docs/filter.md.
"""

from h2nav.attitude.kernels.fixed_flight_doubt import (
    ALL_LOST,
    LEVEL_DOUBT,
    MOST_LOST,
    ask_force,
    doubt_rate,
    find_rest_gain,
    judge_rest,
    level,
    restart_tilt,
    upright,
    watch_rest,
)
from h2nav.attitude.kernels.fixed_flight_field import (
    forget_heading,
    judge_field,
    learn_field,
    learn_latency,
    prepare_heading,
    resolve_field,
    take_field,
)
from h2nav.attitude.kernels.fixed_flight_layout import (
    A_E,
    A_N,
    A_X,
    A_Y,
    A_Z,
    AGE_MOST_US,
    AGE_US,
    AIDED,
    ALIGNED,
    BELIEVED,
    BIAS_VAR,
    CLIPPED,
    COS_DECLINATION,
    DECLINATION,
    DENIED,
    DOUBT,
    E_D,
    E_MOST,
    E_N,
    ERROR,
    F_FIELD,
    F_X,
    FIELD_AGE_US,
    FIELD_MOST_US,
    FIELD_US,
    FIELD_USED,
    FIX_US,
    FORCE_USED,
    FRAME,
    FRAME_MOST_US,
    FRAME_US,
    HAS_FIELD,
    HAS_FIX,
    IS_AIDED,
    LEVEL_MOST,
    LOG_HEADING,
    LOG_NOISE,
    LOST,
    LP_FORCE,
    LP_RATE,
    NEW_US,
    NO_FIELD,
    P_LEAST,
    PHASE,
    REST_US,
    RESTARTED,
    RESTING,
    ROW,
    SATURATED,
    SATURATIONS,
    SEEN_US,
    STATE_SIZE,
    SUM_E,
    SUM_N,
    SUM_TURN,
    T_FRAME,
    T_REST_US,
    TURNING,
    USE,
    V_E,
    V_N,
    Y_E,
    Y_N,
    D,
    P,
)
from h2nav.attitude.kernels.fixed_flight_theta import (
    apply_theta,
    ease_doubt,
    fade,
    find_gain,
    predict_covariance,
    predict_sensitivities,
    use_gain,
)
from h2nav.attitude.kernels.fixed_flight_velocity import (
    accelerate,
    apply_fix,
    begin_frames,
    change_aiding,
    choose_bounded,
    choose_fix,
    correct_velocity,
    judge_bounded,
    judge_fix,
    level_share,
    note_fix,
    raise_level,
    set_ease,
)
from h2nav.attitude.kernels.fixed_functions import limited
from h2nav.attitude.kernels.fixed_motion import (
    B_X,
    BIAS_BITS,
    CORRECTION_LIMIT,
    DT_US,
    Q_W,
    RATE_LIMIT,
    T_X,
    W_X,
    propagate,
    rotation,
    unrotated,
)
from h2nav.attitude.kernels.fixed_triad import Q_LIMIT, UNIT_Q14
from h2nav.maths.fixedpoint import I32, clamp, known

STEP_MOST = 18000  # of a correction in one step, half radians Q19: 3.9 degrees per axis
FIELD_WAIT_US = 250000
MOST_AT_ONCE = 1 << 29  # 2 rad, Q28: most of a declination that the start takes
SATURATIONS_MOST = 1 << 30


def update(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample: aligns or steps; returns bits."""
    if state[AGE_US] < 0:
        return align(state, params, sample)
    return step(state, params, sample)


def step(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample of an aligned filter; returns what it rested on, as bits."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    w = [0, 0, 0]
    met = [0]
    bits = 0
    propagate(state, sample, met)
    rotation(state, r)
    dt_us = sample[DT_US]
    state[AGE_US] = clamp(state[AGE_US] + dt_us, 0, AGE_MOST_US)
    state[FIELD_US] = clamp(state[FIELD_US] + dt_us, 0, FIELD_MOST_US)
    state[FRAME_US] = clamp(state[FRAME_US] + dt_us, 0, FRAME_MOST_US)
    if sample[CLIPPED] > 0:
        doubt_rate(state, params, sample)
        met[0] = 1
    else:
        if state[LOST] > MOST_LOST:
            begin_anew(state, sample, r)
            bits = RESTARTED
        state[LOST] = 0
        if sample[IS_AIDED] != state[AIDED]:
            change_aiding(state, sample, r)
        rates(state, sample, w)
        accelerate(state, sample, r)
        if sample[IS_AIDED] > 0:
            if sample[HAS_FIX] > 0:
                note_fix(state, sample)
        else:
            correct_velocity(state, sample, r)
            bits |= FORCE_USED
        if sample[HAS_FIELD] > 0:
            take_field(state, sample, r, w)
        watch_rest(state, params, sample)
        if bits & RESTARTED == 0:
            bits |= second_stage(state, params, sample, r)
        else:
            # it has joined the sums of a new frame, without the part that predicts over none
            state[PHASE] = 2
    drain(state, r)
    if met[0] != 0 or bits & SATURATED != 0:
        state[SATURATIONS] = clamp(state[SATURATIONS] + 1, 0, SATURATIONS_MOST)
        bits |= SATURATED
    return bits


def rates(state: list[I32], sample: list[I32], w: list[I32]) -> None:
    """Rate less bias, 1e6 2^-29 rad/s; its square joins the frame's mean.

    Source: docs/filter.md Eq. (8).
    """
    square = 0
    for i in range(3):
        rate = clamp(sample[W_X + i] >> 1, -RATE_LIMIT, RATE_LIMIT)
        w[i] = (rate - (state[B_X + i] >> BIAS_BITS)) >> 10
        square += w[i] * w[i]
    # at most sixteen samples since the sum was zero
    state[SUM_TURN] = known(state[SUM_TURN] + (square >> 5), 0, 1 << 30)


def drain(state: list[I32], r: list[I32]) -> None:
    """Hands the correction to come to the next turn, at most STEP_MOST of it.

    Source: docs/fixed-point.md Eq. (7).
    """
    e = [0, 0, 0]
    for i in range(3):
        e[i] = clamp(state[E_N + i] >> 11, -STEP_MOST, STEP_MOST)
        state[E_N + i] = known(state[E_N + i] - (e[i] << 11), -E_MOST, E_MOST)  # Lemma 6
    # a turn keeps the length (Lemma 2)
    for i in range(3):
        part = state[T_X + i] + (unrotated(r[i], r[3 + i], r[6 + i], e) >> 4)
        state[T_X + i] = known(part, -CORRECTION_LIMIT, CORRECTION_LIMIT)


def second_stage(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> I32:
    """One of the sixteen parts of a frame; returns bits.

    Source: docs/fixed-point.md Eq. (20).
    """
    if state[DENIED] == 2:
        level(state, state[LP_FORCE], state[LP_FORCE + 1], state[LP_FORCE + 2], r)
        restart_tilt(state, sample, r)
        begin_frames(state)
        state[DOUBT] = LEVEL_DOUBT
        return RESTARTED
    phase = state[PHASE]
    state[PHASE] = (phase + 1) & (FRAME - 1)
    if phase < 4:
        return judge_motion(state, params, sample, r, phase)
    if phase < 10:
        return use_motion(state, params, sample, r, phase)
    return use_field(state, params, phase)


def judge_motion(
    state: list[I32], params: list[I32], sample: list[I32], r: list[I32], phase: I32
) -> I32:
    """Theta over the frame; levels, noise and gains for its velocity; returns bits."""
    if phase == 0:
        begin_frame(state, params, sample)
        predict_covariance(state, params, r)
    elif phase == 1:
        predict_sensitivities(state, r)
    elif phase == 2:
        return judge_velocity(state, params, sample, r)
    elif state[USE] == 1:
        choose_bounded(state, params)
    elif state[USE] == 2:
        choose_fix(state, params)
    return 0


def use_motion(
    state: list[I32], params: list[I32], sample: list[I32], r: list[I32], phase: I32
) -> I32:
    """Theta from the frame's velocity, or from rest in its place; returns bits."""
    if phase == 4:
        find_motion_gain(state, params, V_N, Y_N)
    elif phase == 6:
        find_motion_gain(state, params, V_E, Y_E)
    elif phase == 8:
        if state[USE] > 0:
            fade(state)
            ease_doubt(state)
            if state[USE] == 2:
                apply_fix(state)
    elif phase == 9:
        if rests(state, params) > 0:
            return RESTING | apply_theta(state, params)
        return apply_theta(state, params)
    else:
        if state[USE] > 0 or rests(state, params) > 0:
            use_gain(state)
        if phase == 7:
            judge_rest(state, params, sample)
            ask_force(state, params, sample, r)
    return 0


def rests(state: list[I32], params: list[I32]) -> I32:
    """1 when nothing has moved for long enough."""
    if state[REST_US] > 0 and state[REST_US] >= params[T_REST_US]:
        return 1
    return 0


def find_motion_gain(state: list[I32], params: list[I32], row: I32, innovation: I32) -> None:
    """Gain for one part of the frame's innovation, or for an axis of the rate at rest.

    Source: docs/filter.md Eq. (18), (20).
    """
    if rests(state, params) > 0:
        find_rest_gain(state, params)
    elif state[USE] > 0:
        find_gain(state, row, state[innovation], state[LOG_NOISE])


def use_field(state: list[I32], params: list[I32], phase: I32) -> I32:
    """Theta from the heading of the newest field, if that is believed; returns bits.

    What it finds is applied with what the next frame's velocity finds.
    """
    if phase == 10:
        state[BELIEVED] = 0
        if state[FIELD_AGE_US] > 0:
            resolve_field(state, params)
    elif phase == 11:
        if state[SEEN_US] > 0:
            judge_field(state, params)
    elif state[BELIEVED] > 0:
        if phase == 12:
            learn_field(state, params)
        elif phase == 13:
            learn_latency(state)
            prepare_heading(state, params)
            state[SEEN_US] = 0
            return FIELD_USED
        elif state[BELIEVED] == 2:
            measure_heading(state, phase)
    return 0


def measure_heading(state: list[I32], phase: I32) -> None:
    """Theta from the heading that has been prepared."""
    if phase == 14:
        find_gain(state, ROW, state[ERROR], state[LOG_HEADING])
    else:
        use_gain(state)


def begin_frame(state: list[I32], params: list[I32], sample: list[I32]) -> None:
    """Closes the sums of the frame before.

    Source: docs/fixed-point.md Eq. (20); docs/filter.md Eq. (8).
    """
    time_us = state[FRAME_US]
    # 2^17 / 1e6
    state[T_FRAME] = (time_us * 8590 + 32768) >> 16
    raise_level(
        state, TURNING, clamp(state[SUM_TURN], 0, LEVEL_MOST), level_share(state, params, time_us)
    )
    state[Y_N] = state[SUM_N]
    state[Y_E] = state[SUM_E]
    state[USE] = 1 - sample[IS_AIDED]
    state[FRAME_US] = 0
    state[SUM_N] = 0
    state[SUM_E] = 0
    state[SUM_TURN] = 0
    set_ease(state, params)


def judge_velocity(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> I32:
    """Levels, noise and gains for the innovation of the frame; returns bits."""
    if state[AIDED] > 0:
        if state[FIX_US] > 0:
            return judge_fix(state, params)
    elif state[USE] > 0 and judge_bounded(state, params, sample, r) > 0:
        return RESTARTED
    return 0


def begin_anew(state: list[I32], sample: list[I32], r: list[I32]) -> None:
    """Starts the tilt again after clipped samples that may have hidden a turn.

    Source: docs/filter.md Eq. (30).
    """
    if state[LOST] > ALL_LOST:
        level(state, sample[A_X], sample[A_Y], sample[A_Z], r)
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
