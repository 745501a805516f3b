"""Which measurements the two-stage filter accepts: limits with physical meaning, and screening.

The decisions themselves are arithmetic and live in the kernel; this module names what they are
compared with.
"""

import math
from typing import NamedTuple

from h2nav.attitude.samples import EarthField, ImuSample, Vec3
from h2nav.attitude.two_stage.gains import TwoStageGains
from h2nav.attitude.two_stage.memory import LEVELS, Gains
from h2nav.maths.units import DEG

# No sensor reads beyond these; a sample that does is a fault of the wire or of units.
ABSURD_RATE_RAD_S = 100.0
ABSURD_FORCE_M_S2 = 1000.0
ABSURD_FIELD_UT = 1000.0
# Bounds of the earth's field with room for badly scaled magnetometers.
EARTH_FIELD_UT = (15.0, 90.0)


class TrustLimits(NamedTuple):
    """What measurements are compared with.

    Attributes:
        force_gate_m_s2: horizontal force that still counts as gravity; three times the force's
            own jitter (noise, vibration) are added.
        field_gate_share: distance from the reference field that still counts as the earth's, as
            a share of its norm (0.1 = about 6 deg, or 10 % of norm).
        norm_share: tolerated relative deviation of a norm.
        dip_tolerance_deg: tolerated deviation of the angle between force and field, when both
            are called as witnesses against the attitude.
        still_force_m_s2: rms horizontal force below which a vehicle counts as not accelerating.
        force_correlation_s: how long an acceleration lasts: rms acceleration a over it is noise
            of density a sqrt(2 tau).
        slowest_level: last gain level used; each doubles the time constant of the tilt.
        residual_s, level_s: time constants of the force's low-pass and of its power.
        converge_s: start-up during which no innovation gate closes.
        hold_s: for so long a vehicle that has begun to accelerate flies by gyro alone; then its
            force is accepted again with the weight of its level.
        turned_s: a field outside the gate, yet of the right norm and slope, sets the heading after
            so long.
        heading_cut_deg: a longer innovation of the field counts as one of this length, turns only
            the heading and teaches no bias.
        heading_lost_s: without any accepted field for so long, the heading starts anew.
        wrong_s: for so long both sensors contradict the attitude before it is aligned again.
        doubt_s: after that, one contradicting sensor is enough for so long.
        bias_start_deg_s: one-sigma gyro bias at the start.
        bias_doubt_deg_s: what a contradicted attitude adds to the bias's sigma.
        mean_s: time constant over which a steady horizontal force counts as error of the tilt.
        steady_force_m_s2, frozen_walk_deg_s_rts: a longer low-passed force than this, at rest,
            teaches no bias; meanwhile the bias's sigma grows by this walk.
        still_s: a vehicle that has not accelerated for so long did start at rest.
        start_force_m_s2: rms horizontal force to expect of a vehicle that starts in motion.
        bias_step_deg_s, bias_limit_deg_s: clamps of one bias step and of the bias.
        align_s: length of the start-up window.
    """

    force_gate_m_s2: float = 0.2
    field_gate_share: float = 0.1
    norm_share: float = 0.1
    dip_tolerance_deg: float = 6.0
    still_force_m_s2: float = 0.05
    force_correlation_s: float = 1.0
    slowest_level: int = 4
    residual_s: float = 0.15
    level_s: float = 5.0
    converge_s: float = 5.0
    hold_s: float = 21.0
    turned_s: float = 15.0
    heading_cut_deg: float = 3.0
    heading_lost_s: float = 120.0
    wrong_s: float = 1.0
    doubt_s: float = 60.0
    bias_start_deg_s: float = 1.0
    bias_doubt_deg_s: float = 0.1
    mean_s: float = 10.0
    steady_force_m_s2: float = 0.04
    frozen_walk_deg_s_rts: float = 0.002
    still_s: float = 2.0
    start_force_m_s2: float = 2.0
    bias_step_deg_s: float = 0.2
    bias_limit_deg_s: float = 10.0
    align_s: float = 0.5


def usable(sample: ImuSample) -> bool:
    """Whether rate and force are finite, possible, and the force is not the zero of a dead sensor.

    A zero rate is fine: autopilots truncate small rates to zero.
    """
    force_2 = _square(sample.f_b)
    return _square(sample.w_b) < ABSURD_RATE_RAD_S**2 and 0.0 < force_2 < ABSURD_FORCE_M_S2**2


def usable_field(m_b_ut: Vec3 | None) -> bool:
    """Whether there is a field that is finite, possible and not zero."""
    return m_b_ut is not None and 0.0 < _square(m_b_ut) < ABSURD_FIELD_UT**2


def kernel_gains(
    gains: TwoStageGains, reference: EarthField, limits: TrustLimits, *, mean_rate: bool
) -> Gains:
    """The gains and limits that the kernel takes.

    Args:
        gains: optimal for `reference`.
        reference: the field to expect; its declination plays no part.
        limits: what to accept.
        mean_rate: gyro samples are means over the step before them, not instants.
    """
    n = gains.densities
    g = Gains()
    g.dt_s = 1.0 / gains.rate_hz
    g.gravity = n.gravity_m_s2
    g.mag_n = reference.norm_ut * math.cos(reference.dip_rad)
    g.mag_d = reference.norm_ut * math.sin(reference.dip_rad)
    g.accel_info = 1.0 / (n.accelerometer**2 * gains.rate_hz)
    g.mag_info = 1.0 / (n.magnetometer**2 * gains.rate_hz)
    g.bias_walk = n.bias_walk**2
    g.gyro_is_mean = 1.0 if mean_rate else 0.0
    g.accel_gate = limits.force_gate_m_s2
    noise_ut = n.magnetometer * math.sqrt(gains.rate_hz)
    g.mag_gate = limits.field_gate_share * reference.norm_ut + 3.0 * noise_ut
    cut_rad = limits.heading_cut_deg * DEG
    g.mag_cut = max(cut_rad * abs(g.mag_n), 4.0 * noise_ut)
    g.norm_gate = limits.norm_share
    g.dip_gate = math.sin(limits.dip_tolerance_deg * DEG)
    g.lowpass_s = limits.residual_s
    g.level_time_s = limits.level_s
    g.converge_s = limits.converge_s
    g.hold_s = limits.hold_s
    g.mag_turned_time_s = limits.turned_s
    g.contradicted_time_s = limits.wrong_s
    g.bias_step_limit = limits.bias_step_deg_s * DEG
    g.bias_limit = limits.bias_limit_deg_s * DEG
    # Two m/s^2 for a moment must not count as two m/s^2 for ever.
    g.accel_power_cap = 4.0
    g.heading_lost_s = limits.heading_lost_s
    g.gyro_noise = n.gyro**2
    for number in range(LEVELS):
        # A file with fewer levels repeats its last.
        level = gains.levels[min(number, len(gains.levels) - 1)]
        g.level_power[number] = _threshold(gains, limits, number)
        g.level_weight[number] = level.force_weight
        g.k_n[number], g.k_e[number], g.k_d[number] = level.k_nn, level.k_ee, level.k_dd
        g.k_nd[number] = level.k_nd
    slowest = min(limits.slowest_level, len(gains.levels) - 1)
    g.last_power = _power(gains, limits, gains.levels[slowest].force_weight)
    g.bias_doubt = (limits.bias_doubt_deg_s * DEG) ** 2
    g.mean_time_s = limits.mean_s
    g.frozen_walk = (limits.frozen_walk_deg_s_rts * DEG) ** 2
    g.steady_accel = limits.steady_force_m_s2**2
    g.still_time_s = limits.still_s
    return g


def _threshold(gains: TwoStageGains, limits: TrustLimits, number: int) -> float:
    """Low-passed square of the horizontal force above which level `number` serves, (m/s^2)^2.

    A level begins half-way (in the logarithm) between its own weight and the one before.
    Source: docs/derivation.md Eq. (3.15).
    """
    if number == 0:
        return 0.0
    if number >= len(gains.levels) or number > limits.slowest_level:
        return math.inf
    weight = math.sqrt(gains.levels[number].force_weight * gains.levels[number - 1].force_weight)
    return _power(gains, limits, weight)


def _power(gains: TwoStageGains, limits: TrustLimits, weight: float) -> float:
    """Low-passed square of the horizontal force for which `weight` is right, (m/s^2)^2.

    Source: docs/derivation.md Eq. (3.14).
    """
    noise = gains.densities.accelerometer**2
    return limits.still_force_m_s2**2 + noise * (1.0 / weight - 1.0) / (
        2.0 * limits.force_correlation_s
    )


def _square(v: Vec3) -> float:
    """|v|^2; NaN and infinity fail every comparison with a limit from above."""
    return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]
