"""Bias of the velocity-aided filter from the gyro at rest.

Equations: docs/filter.md.
"""

import math

from ..memory import REST, TURNABLE, Gains, Sample, State, Workspace
from .aiding import measure_all
from .field_offset import correct_offset, forget_offset
from .theta import apply_theta, measure_theta

SIGMAS_2 = 9.0  # a rate this far from the known bias is not a bias
FLOOR = 3.0e-6  # (0.1 deg/s)^2
UPRIGHT_2 = 0.25  # squared cosine: an axis within 60 deg of the vertical
# MAVLink's rates are whole mrad/s, rounded towards zero: without noise they hide up to 1 mrad/s,
# with a deviation of 1 over the root of 3. A noise of 0.5 mrad/s shows it.
HIDDEN = 3.3e-7  # (rad/s)^2
DITHER = 2.5e-7  # (rad/s)^2
FINE = 0.0005  # rad/s: a smaller step is not MAVLink's


def use_rest(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Corrects the bias by the low-passed rate at rest; updates the time at rest.

    Source: docs/filter.md Eq. (20), (31).
    """
    dt = sample.dt_s
    share = dt / (g.rest_lowpass_s + dt)
    rate = 0.0
    force = 0.0
    slow = 1.0
    for i in range(3):
        d = sample.gyro[i] - s.gyro_lp[i]
        rate = rate + d * d
        s.gyro_lp[i] = s.gyro_lp[i] + share * d
        d = sample.accel[i] - s.accel_lp[i]
        force = force + d * d
        s.accel_lp[i] = s.accel_lp[i] + share * d
        if math.fabs(s.gyro_lp[i]) > g.bias_limit:
            slow = 0.0
    still = slow * sample.rest_prior
    if still == 1.0:
        # A slow turn looks like rest in these signals: the bias must not jump by it.
        still = 1.0 - moves(s, 0, s.p_xx) - moves(s, 1, s.p_yy) - moves(s, 2, s.p_zz)
    if slow <= 0.0 or rate > g.rest_gyro or force > g.rest_accel:
        s.steady_s = 0.0
        s.rest_s = 0.0
        return 0
    s.steady_s = s.steady_s + dt
    if still <= 0.0:
        s.rest_s = 0.0
        return 0
    s.rest_s = s.rest_s + dt
    if s.rest_s < g.rest_time_s:
        return 0
    noise = g.rest_noise / dt
    if turns(s, w, sample, 0, s.p_xx) == 0.0:
        measure_bias(s, w, 0, noise)
    if turns(s, w, sample, 1, s.p_yy) == 0.0:
        measure_bias(s, w, 1, noise)
    if turns(s, w, sample, 2, s.p_zz) == 0.0:
        measure_bias(s, w, 2, noise)
    return REST


def turns(s: State, w: Workspace, sample: Sample, axis: int, variance: float) -> float:
    """Returns 1 if an armed vehicle's slow turn on the ground may be in this axis' rate.

    A rotor's torque turns a helicopter on its skids by some tenths of a degree per second, about
    the vertical. A bias that is known less well, or that no field will show, is learnt all the
    same.
    """
    if sample.rest_prior < TURNABLE:
        return 0.0
    upright = w.r_nb[6 + axis]
    if s.mag_accepted_age_s >= 0.0 and variance < FLOOR and upright * upright > UPRIGHT_2:
        return 1.0
    return 0.0


def doubt_steps(s: State, dt: float) -> None:
    """Keeps the bias as uncertain as the rate's resolution, where no noise dithers it.

    In flight noise dithers the rate, and its bias jumps by the hidden part. A rate that has once
    changed by less than half a step, such as HIGHRES_IMU's or a log's, is not in steps. Source:
    docs/filter.md Eq. (59).
    """
    for i in range(3):
        change = math.fabs(s.gyro_step[i])
        if change > 0.0 and change < FINE:
            s.rate_is_fine = 1.0
    if s.rate_is_fine > 0.0 or s.gyro_jitter > DITHER * dt:
        return
    if s.p_xx < HIDDEN:
        s.p_xx = HIDDEN
    if s.p_yy < HIDDEN:
        s.p_yy = HIDDEN
    if s.p_zz < HIDDEN:
        s.p_zz = HIDDEN


def moves(s: State, axis: int, variance: float) -> float:
    """Returns 1 if the low-passed rate contradicts the bias, within its deviation."""
    d = s.gyro_lp[axis] - s.gyro_bias[axis]
    if d * d > SIGMAS_2 * (variance + FLOOR):
        return 1.0
    return 0.0


def measure_bias(s: State, w: Workspace, axis: int, noise: float) -> None:
    """Corrects theta by one axis of the low-passed rate, whose variance is `noise`."""
    row = [0.0, 0.0, 0.0, 0.0]
    row[axis] = 1.0
    nothing = [0.0, 0.0]
    for i in range(4):
        w.dtheta[i] = 0.0
    innovation = s.gyro_lp[axis] - s.gyro_bias[axis]
    if s.aided > 0.0:
        # The covariance of theta with the accelerometer's bias follows.
        forget_offset(w)
        measure_all(s, w, row, nothing, 0.0, innovation, noise, 0.0)
        correct_offset(s, w)
    else:
        measure_theta(s, w, row, innovation, noise)
    apply_theta(s, w, 0.0, 0.0)
