"""First stage of the velocity-aided filter in integers: velocity, its levels, gain sets.

Source: docs/fixed-point.md Eq. (23) to (25); docs/filter.md Eq. (5), (8) to (11), (13), (14).
"""

from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    CORRECTION_MAX,
    GAINED_MASK,
    INNOVATION_MAX,
    LEVEL_MAX,
    LOG_MAX,
    MAX_REJECTED,
    SETS,
    THETA_MAX,
    VELOCITY_MAX,
    Gains,
    Sample,
    State,
)
from .aiding import in_force
from .derived import begin_bias, forget_velocity
from .functions import bits_of, limited, logarithm, mantissa, power2, product, ratio
from .tilt import restart_tilt

FORCED_MAX = 113600  # three axes at 16 g, Q12
Q24 = 24 << 8
EASE_MAX = 21 << 8


def accelerate(s: State, sample: Sample, r: list[I32]) -> None:
    """Propagates the velocity over one sample; remainders of rounding are carried to the next.

    Source: docs/filter.md Eq. (5), (13).
    """
    x = sample.accel[0] + s.accel_carry[0] - in_force(s.accel_bias[0])
    y = sample.accel[1] + s.accel_carry[1] - in_force(s.accel_bias[1])
    z = sample.accel[2] + s.accel_carry[2]
    s.accel_carry[0] = x & 511
    s.accel_carry[1] = y & 511
    s.accel_carry[2] = z & 511
    x = x >> 9
    y = y >> 9
    z = z >> 9
    north = ((r[0] * x) >> 1) + ((r[1] * y) >> 1) + ((r[2] * z) >> 1) + s.velocity_carry_n
    east = ((r[3] * x) >> 1) + ((r[4] * y) >> 1) + ((r[5] * z) >> 1) + s.velocity_carry_e
    s.velocity_carry_n = north & 8191
    s.velocity_carry_e = east & 8191
    # a turn keeps the length (Lemma 2); 1.0486 us is 2^-20 s
    time = (sample.dt_us * 34360 + 16384) >> 15
    north = (known(north >> 13, -FORCED_MAX, FORCED_MAX) * time + 128) >> 8
    east = (known(east >> 13, -FORCED_MAX, FORCED_MAX) * time + 128) >> 8
    s.velocity_n = limited(s.velocity_n + north, VELOCITY_MAX)
    s.velocity_e = limited(s.velocity_e + east, VELOCITY_MAX)
    if sample.aided > 0:
        # only a measured velocity shows the heading: a bounded one is bounded in any direction
        s.dvelocity_n[3] = limited(s.dvelocity_n[3] - (east >> 1), THETA_MAX)
        s.dvelocity_e[3] = limited(s.dvelocity_e[3] + (north >> 1), THETA_MAX)
        s.gained_n = (s.gained_n + north) & GAINED_MASK
        s.gained_e = (s.gained_e + east) & GAINED_MASK


def change_aiding(s: State, g: Gains, sample: Sample, r: list[I32]) -> None:
    """Switches between bounded and measured velocity, which are unrelated."""
    forget_velocity(s)
    s.dtilt_n[3] = 0
    s.dtilt_e[3] = 0
    s.velocity_n = known((sample.forward_speed * r[0]) >> 2, -VELOCITY_MAX, VELOCITY_MAX)
    s.velocity_e = known((sample.forward_speed * r[3]) >> 2, -VELOCITY_MAX, VELOCITY_MAX)
    s.gained_n = 0
    s.gained_e = 0
    s.fixes_rejected = MAX_REJECTED
    s.tilt_suspect = 0
    s.aided = sample.aided
    s.fix_period_us = 0
    s.dfix_lag = 0
    s.accel_shows = 1
    for i in range(2):
        s.dtilt_lag[i] = 0
        s.daccel[i] = 0
    begin_bias(s)
    if s.aided > 0 and s.p_accel[0] == 0:
        s.p_accel[0] = g.accel_variance
        s.p_accel[2] = g.accel_variance
    if s.aided > 0 and s.fix_lag_variance == 0:
        s.fix_lag_variance = g.fix_lag_variance
    begin_frames(s)


def begin_frames(s: State) -> None:
    """Starts the frames again: none is complete, and no gain is known."""
    begin_sums(s)
    s.frame_time = 0
    s.k_tilt_m = 0
    s.k_tilt_s = 0
    s.k_velocity_m = 0
    s.k_velocity_s = 0


def begin_sums(s: State) -> None:
    """Starts the sums of a frame again, after its first part."""
    s.phase = 1
    s.frame_us = 0
    s.innovation_sum_n = 0
    s.innovation_sum_e = 0
    s.turning_sum = 0
    s.jitter_sum = 0
    s.force_sum = 0
    s.velocity_use = 0
    drop_held(s)
    begin_fields(s)


def drop_held(s: State) -> None:
    """No field waits."""
    s.mag_held = 0
    s.mag_held_us = 0
    for i in range(3):
        s.mag_held_sum[i] = 0


def begin_fields(s: State) -> None:
    """Starts the sums of a frame's fields again."""
    s.mag_count = 0
    s.mag_span_us = 0
    s.mag_waited_us = 0
    s.mag_due_sum = 0
    s.heading_added = 0
    for i in range(3):
        s.mag_sum[i] = 0
        s.mag_rate_sum[i] = 0


def correct_velocity(s: State, sample: Sample, r: list[I32]) -> None:
    """Applies the constant gain for a velocity near zero, or near the speed along the nose.

    Source: docs/filter.md Eq. (10); docs/fixed-point.md Eq. (23).
    """
    north = limited(((sample.forward_speed * r[0]) >> 2) - s.velocity_n, INNOVATION_MAX)
    east = limited(((sample.forward_speed * r[3]) >> 2) - s.velocity_e, INNOVATION_MAX)
    # at most sixteen samples since the sums were zero
    s.innovation_sum_n = known(s.innovation_sum_n + (north >> 4), -INNOVATION_MAX, INNOVATION_MAX)
    s.innovation_sum_e = known(s.innovation_sum_e + (east >> 4), -INNOVATION_MAX, INNOVATION_MAX)
    # without aiding the gains are those of a frame, never larger than one
    gain = s.k_tilt_m
    shift = known(s.k_tilt_s, 0, 31)
    s.correction[0] = limited(s.correction[0] + (product(east << 1, gain) >> shift), CORRECTION_MAX)
    s.correction[1] = limited(
        s.correction[1] - (product(north << 1, gain) >> shift), CORRECTION_MAX
    )
    gain = s.k_velocity_m
    shift = known(s.k_velocity_s, 0, 31)
    s.velocity_n = limited(
        s.velocity_n + (((product(north << 2, gain) >> shift) + 32) >> 6), VELOCITY_MAX
    )
    s.velocity_e = limited(
        s.velocity_e + (((product(east << 2, gain) >> shift) + 32) >> 6), VELOCITY_MAX
    )


def judge_bounded(s: State, g: Gains, sample: Sample, r: list[I32]) -> I32:
    """Updates the levels of the frame's innovation; restarts at impossible velocities.

    Returns 1 if the tilt has started again. Source: docs/filter.md Eq. (11), (14).
    """
    square = square_of(s.innovation_n, s.innovation_e)
    if square > g.impossible_velocity:
        restart_tilt(s, sample, r)
        begin_frames(s)
        return 1
    time_us = (s.frame_time * 15625) >> 11
    share = level_share(s, g, time_us)
    s.innovation_power = raised(s.innovation_power, square, share)
    # a lasting innovation is a bias error rather than motion, and must not raise its own noise
    slow = ratio(time_us, g.innovation_mean_time_us + time_us)
    north = s.innovation_n - s.innovation_mean_n
    east = s.innovation_e - s.innovation_mean_e
    s.innovation_mean_n = limited(s.innovation_mean_n + product(north, slow), INNOVATION_MAX)
    s.innovation_mean_e = limited(s.innovation_mean_e + product(east, slow), INNOVATION_MAX)
    s.innovation_variance = raised(s.innovation_variance, square_of(north, east), share)
    return 0


def choose_bounded(s: State, g: Gains) -> None:
    """Sets noise and gain set by the levels.

    Source: docs/filter.md Eq. (9), (11), (14).
    """
    floor = g.velocity_floor
    noise = density(floor, g.velocity_correlation, g.velocity_ceiling, s.innovation_power)
    s.log_velocity_noise = logarithm(noise) - Q24
    select_set(s, g)
    set_frame_gains(s, g)
    # 1 / T + k_v, of which the second is small
    kept = s.k_velocity_m >> known(s.k_velocity_s, 0, 31)
    log_rate = (17 << 8) - logarithm(s.frame_time | 1) + ((kept * 369) >> 15)
    noise = density(floor, g.velocity_correlation, g.velocity_ceiling, s.innovation_variance)
    log_noise = logarithm(noise) - Q24 + g.log_bias_inflation + log_rate + s.log_startup_inflation
    s.log_noise = clamp(log_noise, -LOG_MAX, LOG_MAX)


def square_of(north: I32, east: I32) -> I32:
    """Squared size of an innovation, Q24; each part counts for 7.9 s at most."""
    n = limited(north, 32400 << 12) >> 12
    e = limited(east, 32400 << 12) >> 12
    return n * n + e * e


def level_share(s: State, g: Gains, time_us: I32) -> I32:
    """Weight of a time in the levels, Q15; a young level is the mean so far."""
    span = g.level_time_us
    if s.age_us < span:
        span = s.age_us
    return ratio(time_us, span + 1)


def raised(level: I32, square: I32, share: I32) -> I32:
    """A level moved towards a new value by its share."""
    change = product(limited(square, LEVEL_MAX) - level, share)
    return clamp(level + change, 0, LEVEL_MAX)


def density(floor: I32, correlation: I32, ceiling: I32, level: I32) -> I32:
    """Velocity noise for a level of the innovation, s^2/Hz, Q24.

    Source: docs/filter.md Eq. (14).
    """
    noise = floor + (limited(product(level, correlation), 1 << 26) << 3)
    if noise > ceiling:
        noise = ceiling
    return noise


def select_set(s: State, g: Gains) -> None:
    """Selects the gain set for the measured levels; stronger sets during start-up.

    Source: docs/filter.md Eq. (9), (14).
    """
    turning = product(s.turning << 1, g.scale_noise_m) >> g.scale_noise_s
    noise = g.gyro_noise + (s.gyro_jitter >> 3) + limited(turning, 1 << 29)
    s.log_gyro_noise = logarithm(noise) - (33 << 8)
    wanted = s.log_gyro_noise - s.log_velocity_noise
    ramp = (g.log_start_factor - logarithm(s.age_us | 1)) << 2
    if wanted < ramp:
        wanted = ramp
    number = 0
    for i in range(SETS - 1):
        if wanted > g.log_set_bounds[i]:
            number = i + 1
    s.gain_set = number


def set_frame_gains(s: State, g: Gains) -> None:
    """Sets the gains of the set for the time of a frame.

    Source: docs/fixed-point.md Eq. (24).
    """
    time = s.frame_time | 1
    digits = bits_of(time)
    m = mantissa(time, digits)
    # the frame lasts m 2^(digits - 32) s
    fall = 17 - digits
    gain = g.k_tilt[s.gain_set]
    s.k_tilt_m = ((gain >> 5) * m) >> 15
    s.k_tilt_s = clamp((gain & 31) - 8 + fall, 0, 30)
    gain = g.k_velocity[s.gain_set]
    s.k_velocity_m = ((gain >> 5) * m) >> 15
    s.k_velocity_s = clamp((gain & 31) - 8 + fall, 0, 30)


def set_ease(s: State, g: Gains) -> None:
    """Sets the factor on all noises at start-up: the initial tilt error is not due to the bias.

    Source: docs/filter.md Eq. (14).
    """
    # 1 + (t_0 / t)^4 with 8 fraction bits
    ramp = (logarithm(g.startup_time_us | 1) - logarithm(s.age_us | 1)) << 2
    ease = power2(clamp(ramp, -LOG_MAX, EASE_MAX) + (8 << 8)) + 256
    s.log_startup_inflation = clamp(logarithm(ease) - (8 << 8), 0, LOG_MAX)
