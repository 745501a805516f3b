"""Rate, predicted deviations and status bits of an estimate.

Equations: docs/filter.md.
"""

import math

from ..memory import CONVERGED, VELOCITY_USED, YAW_REFERENCED, Gains, Sample, State, Workspace

CONVERGED_S = 10.0  # of running: the start-up transient is over
REFERENCED_RAD = 15.0 * (math.pi / 180.0)  # predicted deviation of a heading tied to north
LOST_HEADING_RAD = 1.8137993642342178  # pi over the root of 3: of a heading that may be any
# The densities of the loop and of theta are upper limits.
TILT_SHARE = 0.85
HEADING_SHARE = 0.5
# Of the predicted variance: the mean of six squares is below a sixth of it by chance once in 2,000.
MAX_UNUSED = 0.84
# Of the field, until velocities have confirmed the heading: iron of a few percent turns it, and
# shows in norm and dip no more than the calibration's errors.
UNCONFIRMED = 0.05
FIELD_OFFSET = 0.01  # of the field: the error of its models


def estimate(s: State, w: Workspace, g: Gains, sample: Sample, bits: int) -> int:
    """Writes the rate without bias and the predicted deviations; returns the bits, completed.

    Source: docs/filter.md Eq. (11), (27), (30), (48).
    """
    for i in range(3):
        w.rate[i] = sample.gyro[i] - s.gyro_bias[i]
    w.sigma_tilt = tilt_deviation(s, g)
    known = 0.0
    # A small variance says nothing of a heading that nothing has shown: the model is linear.
    if s.mag_accepted_age_s >= 0.0 or s.heading_confirmed > 0.0 or s.heading_witnessed > 0.0:
        known = 1.0
    if s.heading_variance >= REFERENCED_RAD * REFERENCED_RAD or s.heading_unknown > 0.0:
        known = 0.0
    if known > 0.0:
        bits = bits | YAW_REFERENCED
    w.sigma_heading = LOST_HEADING_RAD
    if known > 0.0 or s.mag_accepted_age_s >= 0.0 or s.heading_witnessed > 0.0:
        deviation = heading_deviation(s)
        if not deviation > LOST_HEADING_RAD:
            w.sigma_heading = deviation
    if s.age_s > CONVERGED_S:
        bits = bits | CONVERGED
    if s.aided > 0.0:
        bits = bits | VELOCITY_USED
    return bits


def tilt_deviation(s: State, g: Gains) -> float:
    """Deviation of the tilt, rad: of the gain set, by the biases, and beyond these.

    Source: docs/filter.md Eq. (27), (63), (64).
    """
    variance = (
        s.p_xx * (s.dtilt_n[0] * s.dtilt_n[0] + s.dtilt_e[0] * s.dtilt_e[0])
        + s.p_yy * (s.dtilt_n[1] * s.dtilt_n[1] + s.dtilt_e[1] * s.dtilt_e[1])
        + s.p_zz * (s.dtilt_n[2] * s.dtilt_n[2] + s.dtilt_e[2] * s.dtilt_e[2])
    )
    gain_set = 2.0 * s.k_tilt * s.k_velocity * s.velocity_noise
    if s.aided > 0.0:
        # The gains at a fix are those per second times its period.
        unused = s.unused_variance
        if unused > MAX_UNUSED:
            unused = MAX_UNUSED
        gain_set = (1.0 - unused) * gain_set / (s.fix_period_s * s.fix_period_s)
        variance = (1.0 - unused) * variance + accel_variance(s, g, unused)
    variance = gain_set + variance
    if variance < 0.0:
        variance = 0.0
    return TILT_SHARE * math.sqrt(variance + s.extra_tilt_sigma * s.extra_tilt_sigma)


def accel_variance(s: State, g: Gains, unused: float) -> float:
    """Variance of the tilt by the accelerometer's bias, rad^2.

    Args:
        s: state.
        g: gains.
        unused: share of their predicted variance that the innovations do not show.

    Source: docs/filter.md Eq. (64).
    """
    if s.p_accel[0] == 0.0:
        return 0.0
    # Turns have shown the bias as accurately as the innovations, which are smaller than predicted;
    # what was known before the turns is as it was.
    before = 0.5 * (s.p_accel[0] + s.p_accel[2]) / g.accel_variance
    if before > 1.0:
        before = 1.0
    known = before + (1.0 - before) / (1.0 - unused)
    north = of_accel(s, s.dtilt_accel_n[0], s.dtilt_accel_n[1])
    return (north + of_accel(s, s.dtilt_accel_e[0], s.dtilt_accel_e[1])) / known


def of_accel(s: State, x: float, y: float) -> float:
    """Variance, by the accelerometer's bias, of a quantity with these sensitivities to it."""
    return s.p_accel[0] * x * x + 2.0 * s.p_accel[1] * x * y + s.p_accel[2] * y * y


def heading_deviation(s: State) -> float:
    """Deviation of the heading, rad: of theta, and by a constant disturbance."""
    hidden = FIELD_OFFSET * FIELD_OFFSET + 0.5 * (
        s.mag_offset_norm * s.mag_offset_norm + s.mag_offset_dip * s.mag_offset_dip
    )
    flat = math.cos(s.mag_ref_dip)
    variance = s.heading_variance
    if variance < 0.0:  # by rounding
        variance = 0.0
    if s.mag_ref_given > 0.0:
        unconfirmed = UNCONFIRMED * UNCONFIRMED
        shown = s.heading_confirmed * s.heading_confirmed * flat * flat
        if shown > 0.0 and shown < unconfirmed:
            unconfirmed = shown
        hidden = hidden + unconfirmed
    variance = HEADING_SHARE * HEADING_SHARE * variance + s.heading_off * s.heading_off
    return math.sqrt(variance + hidden / (flat * flat))
