"""The velocity-aided filter in 32-bit integers, without a division.

The first stage runs with every sample. The second stage runs once per frame of sixteen samples, one
part with each, so that all samples cost about the same. Formats and the proof of the ranges:
docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (15) to (29); docs/filter.md.
"""

from h2nav.attitude.integer.motion import (
    BIAS_BITS,
    CARRY_LIMIT,
    RATE_LIMIT,
    propagate,
    rotation,
    unrotated,
)
from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    AGE_MAX_US,
    CORRECTION_MAX,
    FIELD_MAX_US,
    FORCE_LOST,
    FORCE_USED,
    FRAME,
    FRAME_MAX_US,
    GAINED_MASK,
    RATE_IS_FINE,
    RESTARTED,
    SATURATED,
    WEIGHED_MAX,
    Gains,
    Sample,
    State,
)
from .fixes import note_fix
from .frame import coast, second_stage
from .heading import has_time, note_field, turn_fields
from .start import align, begin_anew
from .tilt import MAX_CLIPPED, doubt_gap, doubt_rate, watch_rest
from .velocity import accelerate, change_aiding, correct_velocity

STEP_MAX = 18000  # of a correction in one step, half radians Q19: 3.9 degrees per axis
SATURATIONS_MAX = 1 << 30
SQUARE_MAX = 1 << 24  # of a second difference of the force: (16 g)^2


def update(s: State, g: Gains, sample: Sample) -> I32:
    """Takes one sample: aligns or steps; returns bits."""
    if s.age_us < 0:
        return align(s, g, sample)
    return step(s, g, sample)


def step(s: State, g: Gains, sample: Sample) -> I32:
    """Takes one sample of an aligned filter; returns bits."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    met = [0]
    bits = 0
    if sample.gap_us > 0:
        if sample.is_held == 0:
            doubt_gap(s, g, sample)
        propagate(s.q_nb, s.gyro_bias, s.turn_carry, s.gap_gyro, sample.dt_us, met)
    else:
        propagate(s.q_nb, s.gyro_bias, s.turn_carry, sample.gyro, sample.dt_us, met)
    rotation(s.q_nb, r)
    dt_us = sample.dt_us
    if sample.clipped == 0:
        s.age_us = clamp(s.age_us + dt_us, 0, AGE_MAX_US)
    s.mag_age_us = clamp(s.mag_age_us + dt_us, 0, FIELD_MAX_US)
    s.frame_us = clamp(s.frame_us + dt_us, 0, FRAME_MAX_US)
    if sample.clipped > 0:
        if sample.clipped < FORCE_LOST:
            doubt_rate(s, g, sample)
        met[0] = 1
        coast(s, g, r)
    elif s.clipped_angle > MAX_CLIPPED or s.tilt_suspect == 2:
        begin_anew(s, sample, r)
        bits = RESTARTED
    else:
        s.clipped_angle = 0
        bits = use_sample(s, g, sample, r)
    drain(s, r)
    if met[0] != 0 or bits & SATURATED != 0:
        s.saturations = clamp(s.saturations + 1, 0, SATURATIONS_MAX)
        bits |= SATURATED
    return bits


def use_sample(s: State, g: Gains, sample: Sample, r: list[I32]) -> I32:
    """Uses force, field and fix of one sample, and runs its part of the frame; returns bits."""
    rate = [0, 0, 0]
    w = [0, 0, 0]
    bits = 0
    has_mag = sample.has_mag
    if sample.aided != s.aided:
        change_aiding(s, g, sample, r)
        has_mag = 0  # that is enough for one sample
    rates(s, sample, rate, w)
    accelerate(s, sample, r)
    if sample.aided > 0:
        if sample.has_fix > 0:
            note_fix(s, sample)
    else:
        correct_velocity(s, sample, r)
        bits = FORCE_USED
    if has_mag > 0:
        note_field(s, sample)
    if s.mag_held > 0 and has_time(s, sample) > 0:
        turn_fields(s, w, r)
    watch_rest(s, g, sample, rate)
    return bits | second_stage(s, g, sample, r)


def rates(s: State, sample: Sample, within: list[I32], w: list[I32]) -> None:
    """Writes the rate within its limits, and less bias; adds to the frame's sums of both.

    Args:
        s: state.
        sample: with the rate.
        within: the rate, 1e6 2^-39 rad/s.
        w: the same less the bias, 1e6 2^-29 rad/s.

    Source: docs/filter.md Eq. (8).
    """
    change = [0, 0, 0]
    square = 0
    jitter = 0
    for i in range(3):
        rate = clamp(sample.gyro[i] >> 1, -RATE_LIMIT, RATE_LIMIT)
        within[i] = rate
        change[i] = (rate >> 8) - s.gyro_last[i]
        s.gyro_last[i] = rate >> 8
        jolt = (change[i] - s.gyro_step[i] + 8) >> 4
        jitter += jolt * jolt
        w[i] = (rate - (s.gyro_bias[i] >> BIAS_BITS)) >> 10
        square += w[i] * w[i]
    # at most sixteen samples since the sums were zero
    s.turning_sum = known(s.turning_sum + (square >> 5), 0, 1 << 30)
    if sample.is_held > 0:
        return
    jitter = weighed(jitter, sample.parts)
    s.jitter_sum = known(s.jitter_sum + jitter, 0, FRAME * WEIGHED_MAX)
    if s.rate_shows < RATE_IS_FINE and change[0] | change[1] | change[2] != 0:
        s.rate_shows = 1
        for i in range(3):
            # one unit of two in a step
            if abs(change[i]) == 1:
                s.rate_shows = RATE_IS_FINE
    for i in range(3):
        s.gyro_step[i] = change[i]
    note_force(s, sample)


def weighed(square: I32, parts: I32) -> I32:
    """A squared second difference, which counts by the square of its sample's time.

    Source: docs/fixed-point.md Eq. (33).
    """
    if square > SQUARE_MAX:
        square = SQUARE_MAX
    if parts > 1:
        square = square * (parts * parts)
        if square > WEIGHED_MAX:
            square = WEIGHED_MAX
    return square


def note_force(s: State, sample: Sample) -> None:
    """Adds to the frame's mean square of the force's second differences; a loop would cost more.

    Source: docs/filter.md Eq. (8).
    """
    x = (sample.accel[0] >> 12) - s.accel_last[0]
    y = (sample.accel[1] >> 12) - s.accel_last[1]
    z = (sample.accel[2] >> 12) - s.accel_last[2]
    jolt_x = x - s.accel_step[0]
    jolt_y = y - s.accel_step[1]
    jolt_z = z - s.accel_step[2]
    s.accel_last[0] = sample.accel[0] >> 12
    s.accel_last[1] = sample.accel[1] >> 12
    s.accel_last[2] = sample.accel[2] >> 12
    s.accel_step[0] = x
    s.accel_step[1] = y
    s.accel_step[2] = z
    square = jolt_x * jolt_x + jolt_y * jolt_y + jolt_z * jolt_z
    s.force_sum = known(s.force_sum + weighed(square, sample.parts), 0, FRAME * WEIGHED_MAX)


def drain(s: State, r: list[I32]) -> None:
    """Moves the pending correction to the next turn, at most STEP_MAX of it.

    Source: docs/fixed-point.md Eq. (7).
    """
    e = [0, 0, 0]
    for i in range(3):
        e[i] = clamp(s.correction[i] >> 11, -STEP_MAX, STEP_MAX)
        s.correction[i] = known(
            s.correction[i] - (e[i] << 11), -CORRECTION_MAX, CORRECTION_MAX
        )  # Lemma 6
    s.heading_turned = (s.heading_turned + e[2]) & GAINED_MASK
    # a turn keeps the length (Lemma 2)
    for i in range(3):
        part = s.turn_carry[i] + (unrotated(r[i], r[3 + i], r[6 + i], e) >> 4)
        s.turn_carry[i] = known(part, -CARRY_LIMIT, CARRY_LIMIT)
