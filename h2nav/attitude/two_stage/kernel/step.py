"""One step of the two-stage filter on the rotation group, in the translatable subset.

Equations: docs/derivation.md section 3.
"""

from ..memory import FIELD_USED, LOST, MOVED, WRONG, Gains, Sample, State
from .correction import correct, weigh
from .motion import measure, pass_clipped, propagate
from .trust import (
    doubt_bias,
    field_sane,
    force_near,
    force_sane,
    take_heading,
    track_contradiction,
    track_force,
    track_turned,
)

# Variance of the tilt, rad^2: beyond (30 deg)^2 the linear correction means nothing.
LOST_VARIANCE = 0.27


def step(s: State, g: Gains, sample: Sample) -> int:
    """Takes one sample: propagates over its time, then corrects. Returns bits.

    Source: docs/derivation.md Eq. (3.8) - (3.22).
    """
    propagate(s, g, sample)
    measure(s, g, sample)
    if sample.clipped > 0.0:
        pass_clipped(s, sample)
        return 0
    s.clipped_s = 0.0
    if s.variance_n > LOST_VARIANCE and force_sane(s, g) == 1:
        return LOST
    level = track_force(s, g, sample)
    if (
        s.converged < 1.0
        and s.accel_power_uncapped > 2.0 * g.last_power
        and s.power_age_s < g.still_time_s
    ):
        return MOVED
    if track_contradiction(s, g, sample) == WRONG:
        return WRONG
    if sample.has_mag > 0.0 and field_sane(s, g) == 1:
        if s.heading_referenced < 1.0:
            take_heading(s, g)
            return FIELD_USED
        if track_turned(s, g) == 1:
            take_heading(s, g)
            doubt_bias(s, g)
            return FIELD_USED
    bits = weigh(s, g, sample, level)
    if s.age_s > g.converge_s and force_near(s, g) == 1:
        s.converged = 1.0
    return bits + correct(s, g, level)
