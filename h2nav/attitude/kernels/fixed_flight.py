"""The flight filter in 32-bit integers: all that the default filter does, without a division.

The first stage runs with every sample. The second stage runs once per frame of eight samples, one
part of it with each, so that no sample costs much more than another. Around it stands what finds
the first attitude. Formats and the proof of the ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (15) to (29); docs/filter.md.
"""

from h2nav.attitude.kernels.fixed_flight_doubt import MOST_LOST, doubt_rate, watch_rest
from h2nav.attitude.kernels.fixed_flight_field import take_field
from h2nav.attitude.kernels.fixed_flight_fixes import note_fix
from h2nav.attitude.kernels.fixed_flight_frame import second_stage
from h2nav.attitude.kernels.fixed_flight_layout import (
    AGE_MOST_US,
    AGE_US,
    AIDED,
    CLIPPED,
    DENIED,
    E_MOST,
    E_N,
    FIELD_MOST_US,
    FIELD_US,
    FORCE_USED,
    FRAME_MOST_US,
    FRAME_US,
    HAS_FIELD,
    HAS_FIX,
    IS_AIDED,
    LOST,
    RESTARTED,
    SATURATED,
    SATURATIONS,
    SUM_TURN,
)
from h2nav.attitude.kernels.fixed_flight_start import align, begin_anew
from h2nav.attitude.kernels.fixed_flight_velocity import accelerate, change_aiding, correct_velocity
from h2nav.attitude.kernels.fixed_motion import (
    B_X,
    BIAS_BITS,
    CORRECTION_LIMIT,
    DT_US,
    RATE_LIMIT,
    T_X,
    W_X,
    propagate,
    rotation,
    unrotated,
)
from h2nav.maths.fixedpoint import I32, clamp, known

STEP_MOST = 18000  # of a correction in one step, half radians Q19: 3.9 degrees per axis
SATURATIONS_MOST = 1 << 30


def update(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample: aligns or steps; returns bits."""
    if state[AGE_US] < 0:
        return align(state, params, sample)
    return step(state, params, sample)


def step(state: list[I32], params: list[I32], sample: list[I32]) -> I32:
    """Takes one sample of an aligned filter; returns what it rested on, as bits."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
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
    elif state[LOST] > MOST_LOST or state[DENIED] == 2:
        begin_anew(state, sample, r)
        bits = RESTARTED
    else:
        state[LOST] = 0
        bits = use_sample(state, params, sample, r)
    drain(state, r)
    if met[0] != 0 or bits & SATURATED != 0:
        state[SATURATIONS] = clamp(state[SATURATIONS] + 1, 0, SATURATIONS_MOST)
        bits |= SATURATED
    return bits


def use_sample(state: list[I32], params: list[I32], sample: list[I32], r: list[I32]) -> I32:
    """Force, field and fix of one sample, and the frame's part that comes with it; returns bits."""
    w = [0, 0, 0]
    bits = 0
    if sample[IS_AIDED] != state[AIDED]:
        change_aiding(state, sample, r)
    rates(state, sample, w)
    accelerate(state, sample, r)
    if sample[IS_AIDED] > 0:
        if sample[HAS_FIX] > 0:
            note_fix(state, sample)
    else:
        correct_velocity(state, sample, r)
        bits = FORCE_USED
    if sample[HAS_FIELD] > 0:
        take_field(state, sample, r, w)
    watch_rest(state, params, sample)
    return bits | second_stage(state, params, sample, r)


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
