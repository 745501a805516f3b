"""Corrections of both stages by a velocity, bounded or measured.

Equations: docs/filter.md.
"""

import math

from ..memory import (
    FORCE_USED,
    MAX_REJECTED,
    OLDEST_FIELD,
    PERIODS,
    RESTARTED,
    SETS,
    VELOCITY_USED,
    Gains,
    Sample,
    State,
    Workspace,
)
from .aiding import (
    accel_tilt_e,
    accel_tilt_n,
    correct_accel,
    match_variance,
    measure_all,
    use_gains,
)
from .field_offset import correct_offset, forget_offset
from .prediction import forget_velocity, gyro_density
from .theta import SETTLED, adapt_walk, apply_theta, follow_bias, measure_level, measure_theta
from .tilt import raise_tilt_sigma, restart_tilt

DOUBTED_TILT = 0.0153  # rad: 0.15 m/s^2 over g, a bias as usual; fixes show a larger doubt first
SUSPECT_TILT = 0.5  # rad: rejected fixes that need so large a tilt error to be explained
# rad, per fix rejected in a row: no tilt turns a force into more than 2 g of velocity.
MAX_EXPLAINED = 2.0 / MAX_REJECTED
NEVER_S = 1e9  # since the last field where there was none: as long as a gain file may wait for one
STARTED = 10.0  # of startup_inflation: before, the low-passed force is older than the tilt


def use_bounded_velocity(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Corrects tilt, velocity and bias by a velocity near zero, or near the speed along the nose.

    Source: docs/filter.md Eq. (9) - (11), (14).
    """
    dt = sample.dt_s
    nose = sample.forward_speed / g.gravity
    north = nose * w.r_nb[0] - s.velocity_n
    east = nose * w.r_nb[3] - s.velocity_e
    square = north * north + east * east
    if square > g.impossible_velocity:
        restart_tilt(s, w, g, nose)
        return RESTARTED
    time = g.level_time_s
    if s.age_s < time:
        time = s.age_s
    share = dt / time
    s.innovation_power = s.innovation_power + share * (square - s.innovation_power)
    # A lasting innovation is a bias error rather than motion, and must not raise its own noise.
    slow = dt / (g.innovation_mean_time_s + dt)
    d = north - s.innovation_mean_n
    s.innovation_mean_n = s.innovation_mean_n + slow * d
    square = d * d
    d = east - s.innovation_mean_e
    s.innovation_mean_e = s.innovation_mean_e + slow * d
    s.innovation_variance = s.innovation_variance + share * (square + d * d - s.innovation_variance)
    density = g.velocity_floor + g.velocity_correlation * s.innovation_variance
    if density > g.velocity_ceiling:
        density = g.velocity_ceiling
    noise = g.bias_inflation * density
    density = g.velocity_floor + g.velocity_correlation * s.innovation_power
    if density > g.velocity_ceiling:
        density = g.velocity_ceiling
    s.velocity_noise = density
    number = select_set(s, g, density)
    s.k_tilt = g.k_tilt[number]
    s.k_velocity = g.k_velocity[number]
    keep = dt
    if dt * s.k_velocity > 0.5:
        keep = 0.5 / s.k_velocity
    noise = s.startup_inflation * noise * (1.0 / dt + s.k_velocity)
    knows_heading = 1.0
    silence = s.mag_accepted_age_s
    if silence < 0.0:
        silence = NEVER_S
    if silence > g.field_silence_s:
        knows_heading = 0.0
    correct_velocity(s, w, north, east, noise, keep * s.k_tilt, keep * s.k_velocity, knows_heading)
    return FORCE_USED


def use_fix(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Corrects tilt, velocity, bias and heading by a measured velocity.

    Source: docs/filter.md Eq. (15), (16).
    """
    north = sample.fix_velocity_n / g.gravity + s.gained_n - sample.fix_gained_n - s.velocity_n
    east = sample.fix_velocity_e / g.gravity + s.gained_e - sample.fix_gained_e - s.velocity_e
    north = north + s.fix_lag_s * sample.fix_accel_n
    east = east + s.fix_lag_s * sample.fix_accel_e
    square = north * north + east * east
    period = sample.fix_period_s
    s.fix_period_s = period
    variance = sample.fix_variance / (g.gravity * g.gravity)
    if s.fixes_rejected >= MAX_REJECTED:
        # The velocity is unknown yet, or consistent fixes contradict it.
        forget_velocity(s)
        s.velocity_n = s.velocity_n + north
        s.velocity_e = s.velocity_e + east
        s.fixes_rejected = 0.0
        if s.extra_tilt_sigma > SUSPECT_TILT and s.startup_inflation < STARTED:
            s.tilt_suspect = 1.0
        return VELOCITY_USED
    floor = g.fix_floor / period + variance
    if square > s.startup_inflation * g.fix_gate * (floor + s.innovation_power):
        s.fixes_rejected = s.fixes_rejected + 1.0
        s.unused_variance = 0.0
        angle = math.sqrt(square) / (period * MAX_REJECTED)
        if angle <= MAX_EXPLAINED * s.fixes_rejected:
            raise_tilt_sigma(s, angle)
        return 0
    s.fixes_rejected = 0.0
    time = g.level_time_s
    if s.age_s < time:
        time = s.age_s
    share = 1.0
    if period < time:
        share = period / time
    s.innovation_power = s.innovation_power + share * (square - s.innovation_power)
    density = g.fix_floor + period * variance + g.fix_correlation * s.innovation_power
    # With an unknown heading a velocity tilts the wrong way: it must not hold the tilt tightly.
    if density > g.fix_ceiling or s.heading_unknown > 0.0:
        density = g.fix_ceiling
    s.velocity_noise = density
    number = select_set(s, g, density)
    row = 0
    for i in range(PERIODS - 1):
        if period > g.fix_periods[i]:
            row = SETS * (i + 1)
    s.k_tilt = g.k_fix_tilt[row + number]
    s.k_velocity = g.k_fix_velocity[row + number]
    inflation = g.fix_inflation
    if s.iron_shown > 0.0 and s.mag_age_s < OLDEST_FIELD:
        # A wrong heading moves the velocity within seconds; the fixes' colour is slower.
        inflation = 1.0
    noise = s.startup_inflation * inflation * density / (period * (1.0 - s.k_velocity))
    correct_by_fix(s, w, g, sample, north, east, noise)
    return FORCE_USED | VELOCITY_USED


def select_set(s: State, g: Gains, density: float) -> int:
    """Number of the gain set for the measured noise levels; stronger sets during start-up.

    Source: docs/filter.md Eq. (9), (14).
    """
    wanted = gyro_density(s, g) / density
    ramp = g.start_factor / s.age_s
    ramp = ramp * ramp
    ramp = ramp * ramp
    if wanted < ramp:
        wanted = ramp
    number = 0
    for i in range(SETS - 1):
        if wanted > g.set_bounds[i]:
            number = i + 1
    s.gain_set = number
    return number


def correct_by_fix(
    s: State, w: Workspace, g: Gains, sample: Sample, north: float, east: float, noise: float
) -> None:
    """Corrects both stages by a measured velocity.

    Source: docs/filter.md Eq. (16) - (19), (37) - (39).
    """
    for i in range(4):
        w.dtheta[i] = 0.0
    w.daccel[0] = 0.0
    w.daccel[1] = 0.0
    w.dfix_lag = 0.0
    forget_offset(w)
    xx = s.p_xx
    yy = s.p_yy
    zz = s.p_zz
    learns = 0.0
    # Until the gyro's biases and the tilt have settled, and while the tilt is doubted, their errors
    # would be taken for another's; the noise of the force, integrated over the loop's time, counts
    # as noise of the fixes here.
    doubt = s.extra_tilt_sigma * s.extra_tilt_sigma
    is_known = 0.0
    if doubt < DOUBTED_TILT * DOUBTED_TILT or doubt < s.p_accel[0] + s.p_accel[2]:
        is_known = 1.0
    if s.age_s > SETTLED and is_known > 0.0:
        rate = g.gravity * s.k_velocity / s.fix_period_s
        own = noise * s.fix_period_s * rate * rate
        learns = own / (own + 2.0 * s.accel_jitter)
    heading_variance = s.heading_variance
    row_lag = s.dvelocity_lag[0] - sample.fix_accel_n
    measure_all(s, w, s.dvelocity_n, s.dvelocity_accel_n, row_lag, north, noise, learns)
    predicted = w.predicted
    row_lag = s.dvelocity_lag[1] - sample.fix_accel_e
    measure_all(s, w, s.dvelocity_e, s.dvelocity_accel_e, row_lag, east, noise, learns)
    follow_bias(s, w, xx, yy, zz)
    adapt_walk(s, s.fix_period_s)
    if s.rest_s >= g.rest_time_s:
        # No acceleration shows the heading: it only adds uncertainty.
        s.heading_variance = heading_variance
        w.dtheta[3] = 0.0
    match_variance(s, g, north, east, predicted + w.predicted, s.fix_period_s)
    use_gains(s, sample.fix_accel_n, sample.fix_accel_e, s.k_tilt, s.k_velocity)
    correct_accel(s, w, g)
    correct_offset(s, w)
    use_constant_gain(
        s, w, north, east, s.k_tilt, s.k_velocity, accel_tilt_n(s, w), accel_tilt_e(s, w)
    )


def correct_velocity(
    s: State,
    w: Workspace,
    north: float,
    east: float,
    noise: float,
    kt: float,
    kv: float,
    knows_heading: float,
) -> None:
    """Corrects both stages: tilt and velocity by the constant gain, theta by its covariance.

    Args:
        s: state.
        w: workspace.
        north: innovation of the velocity over g.
        east: the same.
        noise: variance of either innovation without the error of theta, s^2.
        kt: tilt per innovation, 1/s.
        kv: velocity per innovation.
        knows_heading: 0: there is no heading reference; the states that move it are not learnt.

    Source: docs/filter.md Eq. (10), (17) - (19), (30).
    """
    for i in range(4):
        w.dtheta[i] = 0.0
    if knows_heading > 0.0:
        measure_theta(s, w, s.dvelocity_n, north, noise)
        measure_theta(s, w, s.dvelocity_e, east, noise)
    else:
        measure_level(s, w, s.dvelocity_n, north, noise)
        measure_level(s, w, s.dvelocity_e, east, noise)
    use_constant_gain(s, w, north, east, kt, kv, 0.0, 0.0)


def use_constant_gain(
    s: State,
    w: Workspace,
    north: float,
    east: float,
    kt: float,
    kv: float,
    tilt_n: float,
    tilt_e: float,
) -> None:
    """Applies the constant gain to tilt and velocity, and all corrections."""
    for i in range(4):
        s.dtilt_n[i] = s.dtilt_n[i] - kt * s.dvelocity_n[i]
        s.dvelocity_n[i] = s.dvelocity_n[i] - kv * s.dvelocity_n[i]
        s.dtilt_e[i] = s.dtilt_e[i] - kt * s.dvelocity_e[i]
        s.dvelocity_e[i] = s.dvelocity_e[i] - kv * s.dvelocity_e[i]
    s.velocity_n = s.velocity_n + kv * north
    s.velocity_e = s.velocity_e + kv * east
    apply_theta(s, w, kt * north + tilt_n, kt * east + tilt_e)
    s.extra_tilt_sigma = s.extra_tilt_sigma - 0.5 * kv * s.extra_tilt_sigma
    s.innovation[0] = kt * east
    s.innovation[1] = -kt * north
