"""Large errors of the tilt, and rest, in the velocity-aided filter in integers.

Source: docs/filter.md Eq. (14), (20), (30) to (32).
"""

from h2nav.attitude.integer.motion import RATE_LIMIT
from h2nav.attitude.integer.triad import UNIT_Q14, VECTOR_LIMIT, triad
from h2nav.maths.fixedpoint import I32, clamp, known

from ..memory import (
    AGE_MAX_US,
    FORCE_MAX,
    LEVEL_MAX,
    LOG_MAX,
    MAX_REJECTED,
    ON_GROUND,
    RATE_IS_FINE,
    THETA_MAX,
    TILT_SIGMA_MAX,
    TURNABLE,
    VARIANCE_MIN,
    VELOCITY_MAX,
    Gains,
    Sample,
    State,
)
from .aiding import find_spread
from .functions import bits_of, limited, logarithm, power2, product, square_q28
from .theta import forget_sensitivities, limit_heading, weigh_gain

MAX_CLIPPED = 53687091  # 0.2 rad, Q28: start again after clipped samples that may have hidden more
ALL_CLIPPED = 161061274  # 0.6 rad: ... and the force is the better guess
LEVEL_SIGMA = 26843546  # 0.1 rad: of a tilt taken from the force alone
AIR_TILT_SIGMA = 93702386  # 20 deg: of a tilt that was not followed for a while, in flight
LEVEL_SIZE = 6710886  # 0.1, Q26, of the force's square: 5 % of g
AIR_COSINE_2 = 24802  # square of 0.87, Q15: a steady turn within 5 % of g banks by 18 deg
GROUND_COSINE_2 = 31792  # square of 0.985: no steady acceleration on the ground is that large
REST_FLOOR = 3627000  # (0.1 deg/s)^2 in units of theta, Q28
# of the bias where the rate stands still: a step of 1 mrad/s over the root of 3, as REST_FLOOR
HIDDEN = 398950
UPRIGHT = 16384  # cosine, Q15: an axis within 60 deg of the vertical
REST_SIGMAS_2 = 9  # a rate this far from the known bias is not a bias
ONE_Q26 = 1 << 26
# Q28 to Q36, us to s, a third, and the unit of jitter_share: 8 + log2(1e6 / 3 / 827.6)
JITTER_OF_GAP = 4263


def watch_rest(s: State, g: Gains, sample: Sample, rates: list[I32]) -> None:
    """Low-passes rate and force; notes a sample that is far from either.

    Args:
        s: state.
        g: gains.
        sample: with the force.
        rates: within their limits, 1e6 2^-39 rad/s.

    Source: docs/fixed-point.md Eq. (26).
    """
    shift = g.rest_lowpass_shift
    rate = 0
    force = 0
    for i in range(3):
        d = (known(rates[i], -RATE_LIMIT, RATE_LIMIT) << 4) - s.gyro_lp[i]
        # between the two
        after = s.gyro_lp[i] + (d >> shift)
        s.gyro_lp[i] = known(after, -(RATE_LIMIT << 4), RATE_LIMIT << 4)
        rate += (d >> 15) * (d >> 15)
        d = (sample.accel[i] << 4) - s.accel_lp[i]
        after = s.accel_lp[i] + (d >> shift)
        s.accel_lp[i] = known(after, -(FORCE_MAX << 4), FORCE_MAX << 4)
        force += (d >> 15) * (d >> 15)
    s.unsteady |= ((g.rest_gyro - rate) | (g.rest_accel - force)) >> 31


def judge_rest(s: State, g: Gains, sample: Sample) -> None:
    """Updates the time at rest.

    Source: docs/filter.md Eq. (20), (31).
    """
    time_us = (s.frame_time * 15625) >> 11
    most = g.bias_limit >> 9
    is_steady = 1 + s.unsteady
    for i in range(3):
        if abs(s.gyro_lp[i]) > most:
            is_steady = 0
    s.unsteady = 0
    if s.rate_shows == 0:
        doubt_steps(s)
    if s.rate_shows < RATE_IS_FINE:
        s.rate_shows = 0
    if is_steady == 0:
        s.steady_us = 0
        s.rest_us = 0
        return
    s.steady_us = clamp(s.steady_us + time_us, 0, AGE_MAX_US)
    still = sample.rest_prior
    # a slow turn looks like rest in these signals: the bias must not jump by it
    if still == 1 and moves(s, 0, s.p_xx) + moves(s, 1, s.p_yy) + moves(s, 2, s.p_zz) > 0:
        still = 0
    s.rest_us = clamp(s.rest_us + time_us, 0, AGE_MAX_US)
    if still == 0:
        s.rest_us = 0


def doubt_steps(s: State) -> None:
    """Keeps the bias as uncertain as the resolution of a constant rate.

    Source: docs/filter.md Eq. (59).
    """
    if s.p_xx < HIDDEN:
        s.p_xx = HIDDEN
    if s.p_yy < HIDDEN:
        s.p_yy = HIDDEN
    if s.p_zz < HIDDEN:
        s.p_zz = HIDDEN


def bias_error(s: State, axis: I32) -> I32:
    """Low-passed rate less bias, units of theta, Q24."""
    return limited(s.gyro_lp[axis] - (s.gyro_bias[axis] >> 9), 1 << 22) << 7


def moves(s: State, axis: I32, variance: I32) -> I32:
    """Returns 1 if the low-passed rate contradicts the bias, within its deviation."""
    d = limited(bias_error(s, axis), 32767 << 10) >> 10
    known_to = limited(variance + REST_FLOOR, 119000000)
    if d * d > REST_SIGMAS_2 * known_to:
        return 1
    return 0


def turns(s: State, r: list[I32], axis: I32) -> I32:
    """Returns 1 if an armed vehicle's slow turn on the ground may be in this axis' rate.

    A rotor turns it about the vertical. A bias that is known less well, or that no field will show,
    is learnt all the same.

    Source: docs/filter.md Eq. (31).
    """
    variance = s.p_xx
    if axis == 1:
        variance = s.p_yy
    elif axis == 2:
        variance = s.p_zz
    if s.heading_reset == 0 and variance < REST_FLOOR and abs(r[6 + axis]) > UPRIGHT:
        return 1
    return 0


def find_rest_gain(s: State, sample: Sample, r: list[I32]) -> None:
    """Finds the gain for one axis of the low-passed rate taken as bias; the axes take turns.

    Source: docs/filter.md Eq. (20).
    """
    axis = s.rest_axis
    s.rest_axis = axis + 1 if axis < 2 else 0
    if sample.rest_prior == TURNABLE and turns(s, r, axis) > 0:
        s.gain_inverse = 0
        s.gain_innovation = 0
        return
    for i in range(4):
        s.jacobian[i] = 0
    s.jacobian[axis] = 1 << 24
    nothing = [0, 0]
    explained = find_spread(s, s.jacobian, nothing)
    weigh_gain(s, bias_error(s, axis) - explained, s.log_noise)


def choose_rest(s: State, g: Gains) -> None:
    """Sets the noise of the rate at rest, in place of that of a velocity.

    Two of three axes are used in a frame: each has the noise of one and a half. Nothing
    accelerates: what is felt is a wrong tilt, and says nothing of the heading.

    Source: docs/filter.md Eq. (13), (20).
    """
    s.dvelocity_n[3] = 0
    s.dvelocity_e[3] = 0
    log_time = logarithm(s.frame_time * 3 + 1) - (18 << 8)
    s.log_noise = limited(g.log_rest_noise - log_time, LOG_MAX)


def restart_tilt(s: State, sample: Sample, r: list[I32]) -> None:
    """Starts the tilt again; keeps bias and heading.

    Source: docs/filter.md Eq. (14).
    """
    forget_sensitivities(s)
    s.velocity_n = known((sample.forward_speed * r[0]) >> 2, -VELOCITY_MAX, VELOCITY_MAX)
    s.velocity_e = known((sample.forward_speed * r[3]) >> 2, -VELOCITY_MAX, VELOCITY_MAX)
    s.turning = 0
    s.innovation_power = 0
    s.innovation_variance = 0
    s.innovation_mean_n = 0
    s.innovation_mean_e = 0
    s.age_us = 0
    s.fixes_rejected = MAX_REJECTED
    s.tilt_suspect = 0
    s.steady_us = 0


def doubt_rate(s: State, g: Gains, sample: Sample) -> None:
    """Doubts a clipped rate by its difference from the rates before it.

    Source: docs/filter.md Eq. (30).
    """
    square = 1
    for i in range(3):
        value = clamp(sample.gyro[i] >> 1, -RATE_LIMIT, RATE_LIMIT) << 4
        d = (value - s.gyro_lp[i]) >> 15
        square += d * d
    # the difference in 1e6 2^-28 rad/s times microseconds: rad, Q28
    lost = limited(power2(logarithm(square) >> 1), 33000) * sample.dt_us
    before = s.clipped_angle
    s.clipped_angle = clamp(before + lost, 0, 1 << 30)
    raise_tilt_sigma(s, s.extra_tilt_sigma + lost)
    # the heading has been turned as well as the tilt
    squares = product(
        limited(lost, 1 << 28) << 2, (limited(2 * limited(before, 1 << 27) + lost, 1 << 28)) >> 14
    )
    s.heading_variance = clamp(
        s.heading_variance + (limited(squares, 1 << 28) << 1), VARIANCE_MIN, THETA_MAX
    )
    limit_heading(s, g)


def raise_tilt_sigma(s: State, angle: I32) -> None:
    """Raises the deviation of the tilt to at least this, rad, Q28."""
    if angle > TILT_SIGMA_MAX:
        angle = TILT_SIGMA_MAX
    if angle > s.extra_tilt_sigma:
        s.extra_tilt_sigma = angle
    s.unused_variance = 0


def doubt_gap(s: State, g: Gains, sample: Sample) -> None:
    """Doubts tilt and velocity after missing samples, and takes the rate between them.

    It is taken to have changed evenly. How far that may be wrong is shown by its change, and by how
    much it varied before.

    Source: docs/fixed-point.md Eq. (38); docs/filter.md Eq. (73).
    """
    time = sample.gap_us >> 5
    varied = s.turning >> 1
    changed = 0
    for i in range(3):
        mean = (s.gyro_lp[i] - (s.gyro_bias[i] >> 9)) >> 15
        varied -= mean * mean
        rate = clamp(sample.gyro[i] >> 1, -RATE_LIMIT, RATE_LIMIT)
        s.gap_gyro[i] = rate + (s.gyro_last[i] << 8) + 128
        change = ((rate >> 8) - s.gyro_last[i]) >> 3
        changed += change * change
        s.gyro_last[i] = rate >> 8
        s.gyro_step[i] = 0
    square = clamp(varied, 0, 1 << 29) + changed
    # half the time times the rate: 1e6 2^-28 rad/s times microseconds is rad, Q28
    lost = time * limited(power2(logarithm(square | 1) >> 1), 44000)
    lost = limited(lost, TILT_SIGMA_MAX >> 4) << 4
    lost_2 = square_q28(lost) + 1
    square = square_q28(s.extra_tilt_sigma) + lost_2 + 1
    raise_tilt_sigma(s, power2((logarithm(square | 1) >> 1) + (14 << 8)))
    if sample.aided > 0:
        # within the time of the levels the loop shall correct as much, and no more; nor is the
        # force known: the next fix sets the velocity, and one that waits is of before
        log_level = logarithm(lost_2 | 1) - logarithm(g.level_time_us)
        more = power2(log_level + logarithm(g.jitter_share | 1) + JITTER_OF_GAP)
        s.gyro_jitter = limited(s.gyro_jitter + limited(more, LEVEL_MAX), LEVEL_MAX)
        s.fixes_rejected = MAX_REJECTED
        s.fix_period_us = 0


def ask_force(s: State, g: Gains, sample: Sample, r: list[I32]) -> None:
    """Notes a low-passed force of size g that contradicts the tilt, once another sign agrees.

    Source: docs/filter.md Eq. (31).
    """
    cosine_2 = AIR_COSINE_2
    if s.tilt_suspect > 0:
        s.tilt_suspect = 0
    elif s.steady_us < g.rest_time_us:
        return
    elif sample.rest_prior >= ON_GROUND:
        cosine_2 = GROUND_COSINE_2
    x = limited(s.accel_lp[0] >> 10, 32767)
    y = limited(s.accel_lp[1] >> 10, 32767)
    z = limited(s.accel_lp[2] >> 10, 32767)
    square = (x >> 1) * (x >> 1) + (y >> 1) * (y >> 1) + (z >> 1) * (z >> 1)
    down = (((r[6] * x) >> 1) + ((r[7] * y) >> 1) + ((r[8] * z) >> 1)) >> 15
    if abs(square - ONE_Q26) > LEVEL_SIZE:
        return
    # half the force shows down, Q14 >> 1; its square is compared with that of the whole
    if down >= 0 or limited(down, 32767) * limited(down, 32767) <= product(square, cosine_2):
        s.tilt_suspect = 2


def upright(s: State, x: I32, y: I32, z: I32, north: list[I32]) -> I32:
    """Takes the attitude in which a force points up and `north` about north; returns 1 if it can.

    Args:
        s: state.
        x: specific force, body frame, any unit, below 2^30.
        y: the same.
        z: the same.
        north: a vector whose horizontal part points north, body frame, Q14.
    """
    scale = bits_of(abs(x) | abs(y) | abs(z)) - 14
    if scale < -13:
        return 0
    down = [0, 0, 0]
    if scale >= 0:
        down[0] = known(-(x >> scale), -UNIT_Q14, UNIT_Q14)
        down[1] = known(-(y >> scale), -UNIT_Q14, UNIT_Q14)
        down[2] = known(-(z >> scale), -UNIT_Q14, UNIT_Q14)
    else:
        down[0] = known(-(known(x, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
        down[1] = known(-(known(y, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
        down[2] = known(-(known(z, -8192, 8192) << -scale), -UNIT_Q14, UNIT_Q14)
    # the largest is half a unit or more: its length is within what `triad` scales, or twice that
    if (down[0] >> 1) * (down[0] >> 1) + (down[1] >> 1) * (down[1] >> 1) + (down[2] >> 1) * (
        down[2] >> 1
    ) > ONE_Q26:
        for i in range(3):
            down[i] = down[i] >> 1
    if triad(down, north, s.q_nb) == 0:
        return 0
    s.turn_carry[0] = 0
    s.turn_carry[1] = 0
    s.turn_carry[2] = 0
    s.correction[0] = 0
    s.correction[1] = 0
    s.correction[2] = 0
    # a waiting field was rotated by another attitude
    s.mag_frame_us = 0
    s.mag_learn_us = 0
    return 1


def level(s: State, x: I32, y: I32, z: I32, r: list[I32]) -> None:
    """Takes the tilt from a force, unless it is along the nose; the next field gives the heading.

    Source: docs/filter.md Eq. (32).
    """
    north = [0, 0, 0]
    for i in range(3):
        north[i] = known(r[i] >> 1, -VECTOR_LIMIT, VECTOR_LIMIT)
    if upright(s, x, y, z, north) > 0:
        # the last heading rests on the wrong tilt: the next field gives it, as at the start
        s.heading_reset = 2
