"""Measured velocities in the velocity-aided filter in integers.

Source: docs/filter.md Eq. (15), (16), (30).
"""

from h2nav.maths.fixedpoint import I32, clamp

from ..memory import (
    GAINED_MASK,
    LOG_MAX,
    MAX_REJECTED,
    PERIODS,
    SETS,
    THETA_MAX,
    VELOCITY_MAX,
    VELOCITY_USED,
    Gains,
    Sample,
    State,
)
from .aiding import Q26
from .derived import (
    forget_velocity,
)
from .functions import limited, logarithm, power2, product, ratio, shifted
from .theta import (
    turn,
)
from .tilt import raise_tilt_sigma
from .velocity import Q24, density, level_share, raised, select_set, square_of

LOG_SECOND = 5102  # log2 of 1e6
SETTLED_US = 30000000  # ten times the start-up time
Q30 = 30 << 8
STARTED = 850  # log2 of ten: before, the low-passed force is older than the tilt
MAX_EXPLAINED = 107374182  # 0.4 rad, Q28, per rejected fix, as in floats
DOUBTED_TILT = 4105920  # rad, Q28: 0.15 m/s^2 over g, a usual bias; fixes show a larger one first
SUSPECT_TILT = 134217728  # 0.5 rad, Q28: rejected fixes that need so large a tilt error


def note_fix(s: State, sample: Sample) -> None:
    """Keeps the innovation of a fix, at the time for which it was true, for its frame.

    Source: docs/filter.md Eq. (15), (37).
    """
    gained = ((s.gained_n - sample.fix_gained_n + (1 << 27)) & GAINED_MASK) - (1 << 27)
    s.fix_accel_n = sample.fix_accel_n >> 11
    s.fix_accel_e = sample.fix_accel_e >> 11
    gained += product(s.fix_lag, s.fix_accel_n) >> 4
    s.fix_innovation_n = limited(sample.fix_velocity_n - s.velocity_n + gained, THETA_MAX)
    gained = ((s.gained_e - sample.fix_gained_e + (1 << 27)) & GAINED_MASK) - (1 << 27)
    gained += product(s.fix_lag, s.fix_accel_e) >> 4
    s.fix_innovation_e = limited(sample.fix_velocity_e - s.velocity_e + gained, THETA_MAX)
    s.fix_variance = sample.fix_variance
    s.fix_period_us = sample.fix_period_us


def judge_fix(s: State, g: Gains) -> I32:
    """Applies gate and level to the waiting fix; returns bits.

    Source: docs/filter.md Eq. (15), (16), (30).
    """
    s.innovation_n = s.fix_innovation_n
    s.innovation_e = s.fix_innovation_e
    s.accel_n = s.fix_accel_n
    s.accel_e = s.fix_accel_e
    period_us = s.fix_period_us
    s.fix_span_us = period_us
    s.fix_period_us = 0
    if s.fixes_rejected >= MAX_REJECTED:
        accept_fixes(s)
        return VELOCITY_USED
    log_period = logarithm(period_us | 1) - LOG_SECOND
    square = square_of(s.innovation_n, s.innovation_e)
    floor = power2(logarithm(g.fix_floor) - log_period) + s.fix_variance + 1
    gate = limited(floor, 1 << 29) + s.innovation_power
    log_square = logarithm(square | 1)
    if log_square > s.log_startup_inflation + g.log_fix_gate + logarithm(gate):
        s.fixes_rejected = clamp(s.fixes_rejected + 1, 0, MAX_REJECTED)
        s.unused_variance = 0
        # the tilt error that would explain it: y / (5 T), Q28
        angle = power2(((log_square - Q24) >> 1) - log_period - 594 + (28 << 8))
        if angle <= MAX_EXPLAINED * s.fixes_rejected:
            raise_tilt_sigma(s, angle)
        return 0
    s.fixes_rejected = 0
    share = level_share(s, g, period_us)
    s.innovation_power = raised(s.innovation_power, square, share)
    s.velocity_use = 2
    return VELOCITY_USED


def choose_fix(s: State, g: Gains) -> None:
    """Sets noise and gains for an accepted fix.

    Source: docs/filter.md Eq. (15), (16).
    """
    period_us = s.fix_span_us
    log_period = logarithm(period_us | 1) - LOG_SECOND
    floor = g.fix_floor + power2(logarithm(s.fix_variance | 1) + log_period)
    noise = density(limited(floor, 1 << 29), g.fix_correlation, g.fix_ceiling, s.innovation_power)
    s.log_velocity_noise = logarithm(noise) - Q24
    select_set(s, g)
    set_fix_gains(s, g, period_us)
    kept = 32768 - shifted(s.k_velocity_m, s.k_velocity_s)
    log_span = log_period + logarithm(clamp(kept, 1, 32768)) - (15 << 8)
    s.log_noise = clamp(
        s.log_startup_inflation + g.log_fix_inflation + s.log_velocity_noise - log_span,
        -LOG_MAX,
        LOG_MAX,
    )
    s.fix_noise = limited(power2(s.log_noise + Q26), 1 << 29)
    weigh_force(s, log_period)


def weigh_force(s: State, log_period: I32) -> None:
    """Sets the share of the gains that the accelerometer's bias and the fixes' latency learn by.

    The noise of the force, integrated over the loop's time, counts as noise of the fixes here.
    Until the errors of the start have passed, and while the tilt is doubted, they would be taken
    for another's.

    Source: docs/filter.md Eq. (39).
    """
    s.accel_learns = 0
    if s.age_us > SETTLED_US and s.extra_tilt_sigma < DOUBTED_TILT:
        log_rate = logarithm(s.k_velocity_m | 1) - ((15 + s.k_velocity_s) << 8) - log_period
        own = limited(power2(s.log_noise + log_period + 2 * log_rate + Q30), 1 << 29)
        s.accel_learns = ratio(own, own + 2 * s.force_jitter + 1)


def accept_fixes(s: State) -> None:
    """Accepts fixes again: the velocity is unknown yet, or consistent fixes contradict it."""
    forget_velocity(s)
    s.velocity_n = limited(s.velocity_n + s.innovation_n, VELOCITY_MAX)
    s.velocity_e = limited(s.velocity_e + s.innovation_e, VELOCITY_MAX)
    s.fixes_rejected = 0
    if s.extra_tilt_sigma > SUSPECT_TILT and s.log_startup_inflation < STARTED:
        s.tilt_suspect = 1


def set_fix_gains(s: State, g: Gains, period_us: I32) -> None:
    """Sets the gains of the set for the nearest period of the gain file."""
    row = 0
    for i in range(PERIODS - 1):
        if period_us > g.fix_periods_us[i]:
            row = (i + 1) * SETS
    row += s.gain_set
    gain = g.k_fix_tilt[row]
    s.k_tilt_m = gain >> 5
    s.k_tilt_s = clamp((gain & 31) - 8, -3, 23)
    gain = g.k_fix_velocity[row]
    s.k_velocity_m = gain >> 5
    s.k_velocity_s = clamp((gain & 31) - 8, -3, 23)


def apply_fix(s: State) -> None:
    """Applies the constant gain for a measured velocity.

    Source: docs/filter.md Eq. (16).
    """
    tilt_n = shifted(product(s.innovation_n, s.k_tilt_m), s.k_tilt_s - 5)
    tilt_e = shifted(product(s.innovation_e, s.k_tilt_m), s.k_tilt_s - 5)
    turn(s, tilt_n, tilt_e)
    north = shifted(product(s.innovation_n, s.k_velocity_m), s.k_velocity_s)
    east = shifted(product(s.innovation_e, s.k_velocity_m), s.k_velocity_s)
    s.velocity_n = limited(s.velocity_n + limited(north, 1 << 30), VELOCITY_MAX)
    s.velocity_e = limited(s.velocity_e + limited(east, 1 << 30), VELOCITY_MAX)
