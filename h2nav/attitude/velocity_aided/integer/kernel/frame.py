"""Second stage of the integer filter: one part of a frame per sample.

Source: docs/fixed-point.md Eq. (20); docs/filter.md Eq. (6) to (27).
"""

from h2nav.maths.fixedpoint import I32, clamp

from ..memory import (
    AGE_MAX_US,
    FIELD_USED,
    FRAME,
    LEVEL_MAX,
    RESTARTED,
    RESTING,
    THETA_MAX,
    Gains,
    Sample,
    State,
)
from .aiding import (
    apply_accel,
    apply_lag,
    find_fix_gain,
    find_spread,
    predict_innovation,
    show_accel,
    use_accel_gain,
    use_lag_gain,
)
from .derived import (
    adapt_walk,
    fade_aiding,
    fade_theta,
    follow_bias,
    match_variance,
    predict_accel,
    predict_covariance,
    predict_sensitivities,
    predict_shared,
)
from .fixes import apply_fix, choose_fix, judge_fix
from .functions import limited, product
from .heading import (
    CONTRADICTS,
    doubt_heading,
    find_errors,
    judge_field,
    judge_heading,
    learn_field,
    learn_latency,
    learn_turns,
    note_scatter,
    prepare_heading,
    resolve_field,
    weigh_heading,
)
from .theta import (
    apply_theta,
    fade_tilt_sigma,
    use_gain,
    use_level_gain,
    weigh_gain,
)
from .tilt import ask_force, choose_rest, find_rest_gain, judge_rest
from .velocity import (
    begin_sums,
    choose_bounded,
    drop_held,
    judge_bounded,
    level_share,
    raised,
    set_ease,
)

COAST_US = 230000  # of a frame that clipped samples interrupt: one of a length that is not usual


def second_stage(s: State, g: Gains, sample: Sample, r: list[I32]) -> I32:
    """Runs one of the sixteen parts of a frame; returns bits.

    Source: docs/fixed-point.md Eq. (20).
    """
    phase = s.phase
    s.phase = (phase + 1) & (FRAME - 1)
    if phase < 4:
        return judge_motion(s, g, sample, r, phase)
    if phase < 10:
        return use_motion(s, g, sample, r, phase)
    return use_field(s, g, r, phase)


def coast(s: State, g: Gains, r: list[I32]) -> None:
    """Propagates theta over clipped samples, which no part of a frame comes with.

    Source: docs/filter.md Eq. (6), (7), (12).
    """
    drop_held(s)
    if s.phase == 1:
        predict_sensitivities(s, r)
        if s.aided > 0:
            predict_shared(s, g, r)
        s.phase = 2
    elif s.frame_us > COAST_US:
        time_us = s.frame_us
        begin_sums(s)
        take_time(s, time_us)
        predict_covariance(s, g, r)


def judge_motion(s: State, g: Gains, sample: Sample, r: list[I32], phase: I32) -> I32:
    """Propagates theta over the frame; sets levels, noise and gains; returns bits."""
    if phase == 0:
        begin_frame(s, g, sample)
        predict_covariance(s, g, r)
    elif phase == 1:
        predict_sensitivities(s, r)
        if s.aided > 0:
            show_accel(s, r)
            predict_shared(s, g, r)
            predict_accel(s, r)
    elif phase == 2:
        if s.mag_learn_us > 0:
            learn_latency(s)
        return judge_velocity(s, g, sample, r)
    else:
        if s.velocity_use == 1:
            choose_bounded(s, g)
        elif s.velocity_use == 2:
            choose_fix(s, g)
        if rests(s, g) > 0:
            choose_rest(s, g)
        if s.mag_learn_us > 0:
            learn_turns(s)
    return 0


def use_motion(s: State, g: Gains, sample: Sample, r: list[I32], phase: I32) -> I32:
    """Corrects theta by the frame's velocity, or by rest instead; returns bits."""
    if phase == 4:
        find_motion_gain(s, g, sample, r, s.dvelocity_n, s.dvelocity_accel_n, s.innovation_n, 0)
    elif phase == 6:
        find_motion_gain(s, g, sample, r, s.dvelocity_e, s.dvelocity_accel_e, s.innovation_e, 1)
    elif phase == 8:
        if s.velocity_use > 0:
            fade_theta(s)
            if s.velocity_use == 2:
                fade_aiding(s)
    elif phase == 9:
        if s.velocity_use > 0:
            fade_tilt_sigma(s)
        if s.velocity_use == 2:
            apply_lag(s, g)
            apply_accel(s)
        if rests(s, g) > 0:
            return RESTING | apply_theta(s, g)
        return apply_theta(s, g)
    else:
        use_motion_gain(s, g, r, (phase >> 1) & 1)
        if phase == 7:
            judge_rest(s, g, sample)
            ask_force(s, g, sample, r)
        elif s.velocity_use == 2:
            apply_fix(s)
    return 0


def rests(s: State, g: Gains) -> I32:
    """Returns 1 if nothing has moved for long enough."""
    if s.rest_us > 0 and s.rest_us >= g.rest_time_us:
        return 1
    return 0


def find_motion_gain(
    s: State,
    g: Gains,
    sample: Sample,
    r: list[I32],
    row: list[I32],
    row_accel: list[I32],
    innovation: I32,
    axis: I32,
) -> None:
    """Finds the gain for one part of the frame's innovation, or for an axis of the rate at rest.

    Args:
        s: state.
        g: gains.
        sample: the newest one.
        r: rotation.
        row: how the innovation depends on theta.
        row_accel: how it depends on the bias of the accelerometer.
        innovation: north or east.
        axis: 0: north, 1: east.

    Source: docs/filter.md Eq. (18), (20).
    """
    if rests(s, g) > 0:
        find_rest_gain(s, sample, r)
    elif s.velocity_use == 2:
        find_fix_gain(s, row, row_accel, innovation, s.accel_e if axis > 0 else s.accel_n, axis)
    elif s.velocity_use == 1:
        nothing = [0, 0]
        explained = find_spread(s, row, nothing)
        weigh_gain(s, innovation - explained, s.log_noise)


def use_motion_gain(s: State, g: Gains, r: list[I32], axis: I32) -> None:
    """Applies the gain of `find_motion_gain`.

    A bounded velocity does not correct the heading, nor what moves it, if there is no field.

    Args:
        s: state.
        g: gains.
        r: rotation.
        axis: 0: north, 1: east.
    """
    if rests(s, g) > 0:
        use_gain(s)
        if s.aided > 0:
            use_accel_gain(s, 0)
    elif s.velocity_use == 2:
        predict_innovation(s, axis)
        use_followed_gain(s)
        use_lag_gain(s)
        use_accel_gain(s, s.accel_learns)
    elif s.velocity_use == 1:
        if s.field_silence_us > g.field_silence_us:
            use_level_gain(s, r)
        else:
            use_gain(s)


def use_followed_gain(s: State) -> None:
    """Applies a gain, and notes by how much it has corrected the bias.

    Source: docs/filter.md Eq. (74).
    """
    step = [0, 0, 0]
    x = s.p_xx
    y = s.p_yy
    z = s.p_zz
    for i in range(3):
        step[i] = s.dtheta[i]
    use_gain(s)
    for i in range(3):
        step[i] = limited(s.dtheta[i] - step[i], THETA_MAX)
    follow_bias(s, step, x, y, z)


def end_frame(s: State, g: Gains) -> None:
    """Does what nothing else in the frame needs.

    Source: docs/filter.md Eq. (63), (74).
    """
    if s.mag_accepted == 2 and s.aided > 0:
        # of the gain that the sample before has used
        use_accel_gain(s, 0)
    if s.velocity_use == 2:
        adapt_walk(s)
        if rests(s, g) == 0:
            match_variance(s, g)


def use_field(s: State, g: Gains, r: list[I32], phase: I32) -> I32:
    """Corrects theta by the heading of the newest field, if accepted; returns bits.

    The correction is applied with that by the next frame's velocity.
    """
    if phase == 10:
        s.mag_accepted = 0
        if s.mag_count > 0:
            resolve_field(s, g, r)
    elif phase == 11:
        if s.mag_frame_us > 0:
            judge_field(s, g)
            if s.mag_accepted > 0:
                note_scatter(s, g)
                prepare_heading(s, g)
    elif phase == 15:
        end_frame(s, g)
    elif s.mag_accepted > 0:
        if phase == 13:
            return accept_field(s, g)
        if s.mag_accepted == 2:
            measure_heading(s, g, phase)
    return 0


def measure_heading(s: State, g: Gains, phase: I32) -> None:
    """Corrects theta by the prepared heading, unless it fails its gate.

    Source: docs/filter.md Eq. (25), (39), (57).
    """
    if phase == 12:
        explained = find_spread(s, s.jacobian, s.jacobian_accel)
        s.heading_innovation = limited(s.heading_innovation - explained, THETA_MAX)
        judge_heading(s, g)
    elif phase == 14:
        weigh_heading(s, g)
        weigh_gain(s, s.heading_innovation, s.log_heading_noise)
        if s.aided > 0:
            use_followed_gain(s)
        else:
            use_gain(s)


def accept_field(s: State, g: Gains) -> I32:
    """Updates reference, latency and disturbance by a field; returns bits.

    Of one that contradicts the heading it asks which of them is wrong.

    Source: docs/filter.md Eq. (21), (23), (24), (76).
    """
    errors = [0, 0]
    find_errors(s, errors)
    if s.mag_accepted == CONTRADICTS:
        s.mag_accepted = 0
        doubt_heading(s, g, errors)
        return 0
    age_us = s.mag_frame_us
    s.mag_frame_us = 0
    s.heading_rejected_us = 0
    s.field_silence_us = 0
    if s.mag_accepted < 3:
        learn_field(s, g, age_us, errors)
        s.mag_learn_us = age_us
    return FIELD_USED


def begin_frame(s: State, g: Gains, sample: Sample) -> None:
    """Closes the sums of the frame before.

    Source: docs/fixed-point.md Eq. (20); docs/filter.md Eq. (8).
    """
    time_us = s.frame_us
    take_time(s, time_us)
    share = level_share(s, g, time_us)
    s.turning = raised(s.turning, clamp(s.turning_sum, 0, LEVEL_MAX), share)
    close_jitter(s, g, share)
    s.innovation_n = s.innovation_sum_n
    s.innovation_e = s.innovation_sum_e
    s.velocity_use = 1 - sample.aided
    s.frame_us = 0
    s.innovation_sum_n = 0
    s.innovation_sum_e = 0
    s.turning_sum = 0
    set_ease(s, g)


def take_time(s: State, time_us: I32) -> None:
    """Sets the time of the frame that is over."""
    # 2^17 / 1e6
    s.frame_time = (time_us * 8590 + 32768) >> 16
    s.field_silence_us = clamp(s.field_silence_us + time_us, 0, AGE_MAX_US)


def close_jitter(s: State, g: Gains, share: I32) -> None:
    """Updates the levels of the noise between samples, of rate and force.

    Source: docs/fixed-point.md Eq. (33); docs/filter.md Eq. (8).
    """
    density = product(limited(s.jitter_sum, 1 << 25) << 5, s.frame_time)
    density = limited(product(density, g.jitter_share), 1 << 21) << 8
    s.gyro_jitter = raised(s.gyro_jitter, density, share)
    s.jitter_sum = 0
    # Q16 to Q30, over 18 axes of second differences, 16 samples, and 16 of them in the time
    density = product(product(s.force_sum, s.frame_time), 29127)
    s.force_jitter = raised(s.force_jitter, density, share)
    s.force_sum = 0


def judge_velocity(s: State, g: Gains, sample: Sample, r: list[I32]) -> I32:
    """Updates the levels by the frame's innovation, and gates it; returns bits."""
    if s.aided > 0:
        if s.fix_period_us > 0:
            return judge_fix(s, g)
    elif s.velocity_use > 0 and judge_bounded(s, g, sample, r) > 0:
        return RESTARTED
    return 0
