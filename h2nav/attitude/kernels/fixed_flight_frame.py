"""Second stage of the flight filter in integers: one part of a frame with each of its samples.

Source: docs/fixed-point.md Eq. (20); docs/filter.md Eq. (6) to (27).
"""

from h2nav.attitude.kernels.fixed_flight_doubt import ask_force, find_rest_gain, judge_rest
from h2nav.attitude.kernels.fixed_flight_field import (
    judge_field,
    learn_field,
    learn_latency,
    prepare_heading,
    resolve_field,
)
from h2nav.attitude.kernels.fixed_flight_fixes import apply_fix, choose_fix, judge_fix
from h2nav.attitude.kernels.fixed_flight_layout import (
    AIDED,
    BELIEVED,
    ERROR,
    FIELD_AGE_US,
    FIELD_USED,
    FIX_US,
    FRAME,
    FRAME_US,
    IS_AIDED,
    LEVEL_MOST,
    LOG_HEADING,
    LOG_NOISE,
    PHASE,
    REST_US,
    RESTARTED,
    RESTING,
    ROW,
    SEEN_US,
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
    choose_bounded,
    judge_bounded,
    level_share,
    raise_level,
    set_ease,
)
from h2nav.maths.fixedpoint import I32, clamp


def second_stage(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> I32:
    """One of the sixteen parts of a frame; returns bits.

    Source: docs/fixed-point.md Eq. (20).
    """
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
        elif state[USE] == 2:
            apply_fix(state)
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
    """Levels and gate for the innovation of the frame; returns bits."""
    if state[AIDED] > 0:
        if state[FIX_US] > 0:
            return judge_fix(state, params)
    elif state[USE] > 0 and judge_bounded(state, params, sample, r) > 0:
        return RESTARTED
    return 0
