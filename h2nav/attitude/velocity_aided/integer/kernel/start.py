"""Alignment, restart and reset of the velocity-aided filter in integers.

Source: docs/filter.md Eq. (14), (26), (30), (32).
"""

from h2nav.attitude.integer.motion import RATE_LIMIT, rotation
from h2nav.attitude.integer.triad import Q_LIMIT, UNIT_Q14
from h2nav.maths.fixedpoint import I32, clamp

from ..memory import (
    AGE_MAX_US,
    ALIGNED,
    FIELD_MAX_US,
    RESTARTED,
    VARIANCE_MIN,
    Gains,
    Sample,
    State,
)
from .aiding import in_force
from .functions import limited
from .heading import forget_heading
from .tilt import AIR_TILT_SIGMA, ALL_CLIPPED, LEVEL_SIGMA, level, restart_tilt, upright
from .velocity import begin_frames

FIELD_WAIT_US = 250000
MAX_AT_ONCE = 1 << 29  # 2 rad, Q28: largest declination applied at the start


def begin_anew(s: State, sample: Sample, r: list[I32]) -> None:
    """Starts the tilt again, from a force if the tilt is unknown.

    Called after clipped samples that may have hidden a turn, and when the low-passed force has
    contradicted the tilt. Source: docs/filter.md Eq. (30), (32).
    """
    x = in_force(s.accel_bias[0])
    y = in_force(s.accel_bias[1])
    if s.tilt_suspect == 2:
        level(s, s.accel_lp[0] - (x << 4), s.accel_lp[1] - (y << 4), s.accel_lp[2], r)
        s.extra_tilt_sigma = LEVEL_SIGMA
    elif s.clipped_angle > ALL_CLIPPED:
        level(s, sample.accel[0] - x, sample.accel[1] - y, sample.accel[2], r)
    s.clipped_angle = 0
    restart_tilt(s, sample, r)
    begin_frames(s)


def align(s: State, g: Gains, sample: Sample) -> I32:
    """Takes the attitude from one sample; returns bits.

    Waits for a field; without one the nose points north.
    """
    s.mag_age_us = clamp(s.mag_age_us + sample.dt_us, 0, FIELD_MAX_US)
    if sample.clipped > 0:
        return 0
    if sample.has_mag == 0 and s.mag_age_us < FIELD_WAIT_US:
        return 0
    north = [UNIT_Q14, 0, 0]
    if sample.has_mag > 0:
        # half of it, a quarter of a strong one: its direction counts, and `triad` takes 1.25
        size = abs(sample.mag[0]) + abs(sample.mag[1]) + abs(sample.mag[2])
        for i in range(3):
            north[i] = sample.mag[i] >> (2 if size > 32767 else 1)
    elif abs(sample.accel[0]) > abs(sample.accel[1]) + abs(sample.accel[2]):
        north[0] = 0
        north[2] = UNIT_Q14
    if upright(s, sample.accel[0], sample.accel[1], sample.accel[2], north) == 0:
        return 0
    s.heading_reset = 1 - sample.has_mag
    if sample.has_mag == 0 and s.p_zz > g.vertical_bias_variance:
        # the drift of the heading is not observable: its prior decides
        s.p_zz = g.vertical_bias_variance
        s.p_xz = 0
        s.p_yz = 0
    begin(s, g, sample, LEVEL_SIGMA)
    if sample.has_mag > 0:
        # the attitude is that of magnetic north
        s.correction[2] = limited(s.declination, MAX_AT_ONCE) * 2
        if abs(s.declination) > MAX_AT_ONCE:
            # beside a pole: the fields to come give the rest
            s.heading_reset = 1
    return ALIGNED | RESTARTED


def resume(s: State, g: Gains, sample: Sample) -> I32:
    """Takes the first sample after a gap; returns bits.

    On the ground the filter aligns again. In the air the attitude before the gap is a better guess
    of the tilt than a force: it is kept and doubted, and the next field gives the heading.
    """
    if s.age_us < 0 or sample.rest_prior > 0:
        restart(s)
        return align(s, g, sample)
    if s.heading_reset == 0:
        s.heading_reset = 2
    s.mag_frame_us = 0
    begin(s, g, sample, AIR_TILT_SIGMA)
    return RESTARTED


def begin(s: State, g: Gains, sample: Sample, tilt_sigma: I32) -> None:
    """Resets everything except attitude, bias, its covariance, latency and references."""
    r = [0, 0, 0, 0, 0, 0, 0, 0, 0]
    rotation(s.q_nb, r)
    restart_tilt(s, sample, r)
    begin_frames(s)
    forget_heading(s, g)
    for i in range(3):
        s.gyro_lp[i] = clamp(sample.gyro[i] >> 1, -RATE_LIMIT, RATE_LIMIT) << 4
        s.accel_lp[i] = sample.accel[i] << 4
        s.accel_carry[i] = 0
        s.gyro_last[i] = s.gyro_lp[i] >> 12
        s.gyro_step[i] = 0
        s.gap_gyro[i] = s.gyro_lp[i] >> 3
        s.accel_last[i] = sample.accel[i] >> 12
        s.accel_step[i] = 0
    for i in range(4):
        s.dtheta[i] = 0
    s.velocity_carry_n = 0
    s.velocity_carry_e = 0
    s.rest_us = 0
    s.clipped_angle = 0
    s.extra_tilt_sigma = tilt_sigma
    s.gained_n = 0
    s.gained_e = 0
    s.aided = 0
    s.fix_period_us = 0
    s.dfix_lag = 0
    s.daccel[0] = 0
    s.daccel[1] = 0
    s.mag_age_us = 0
    s.mag_new_us = 0
    s.heading_rejected_us = 0
    s.heading_witnessed = 0
    s.field_silence_us = 0
    if s.heading_reset > 0:
        s.field_silence_us = AGE_MAX_US


def reset(s: State, g: Gains) -> None:
    """Makes a filter of zeros: not aligned, with the biases' initial variance of the gains."""
    s.q_nb[0] = Q_LIMIT - (1 << 19)
    s.p_xx = g.bias_variance
    s.p_yy = g.bias_variance
    s.p_zz = g.bias_variance
    s.heading_variance = VARIANCE_MIN
    s.declination_cosine = UNIT_Q14
    s.age_us = -1


def restart(s: State) -> None:
    """Forgets the attitude; keeps bias, references and the counter of saturations."""
    s.age_us = -1
    s.mag_age_us = 0
