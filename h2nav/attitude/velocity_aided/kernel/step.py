"""One step of the velocity-aided filter, in the translatable subset.

Equations: docs/filter.md.
"""

from ..memory import FORCE_LOST, SATURATED, Gains, Sample, State, Workspace
from .estimate import estimate
from .heading import use_field
from .prediction import LONGEST_STEP, predict_attitude, predict_shared, predict_velocity, warm_up
from .rest import doubt_steps, use_rest
from .theta import limit, predict_theta
from .tilt import carry_tilt, check_level, doubt_gap, doubt_rate, end_clipping
from .velocity import use_bounded_velocity, use_fix


def step(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Takes one sample; returns bits.

    Source: docs/filter.md Eq. (4) - (26), (30) - (32), (73).
    """
    bits = 0
    dt = sample.dt_s
    predict_attitude(s, w, sample)
    predict_theta(s, w, g, dt)
    if dt > LONGEST_STEP:
        doubt_gap(s, g, sample)
    s.mag_age_s = s.mag_age_s + dt
    if s.mag_accepted_age_s >= 0.0:
        s.mag_accepted_age_s = s.mag_accepted_age_s + dt
    if sample.clipped > 0.0:
        bits = carry(s, w, g, sample)
    else:
        s.unforced_s = 0.0
        if s.clipped_s > 0.0:
            bits = end_clipping(s, w, g, sample)
        predict_velocity(s, w, g, sample)
        if sample.aided > 0.0:
            if sample.has_fix > 0.0:
                bits = bits | use_fix(s, w, g, sample)
        else:
            bits = bits | use_bounded_velocity(s, w, g, sample)
        if sample.has_mag > 0.0:
            bits = bits | use_field(s, w, g, sample)
        doubt_steps(s, dt)
        bits = bits | use_rest(s, w, g, sample)
        bits = bits | check_level(s, w, g, sample)
    bits = bits | limit(s, g)
    if sample.asked > 0.0:
        bits = estimate(s, w, g, sample, bits)
    return bits


def carry(s: State, w: Workspace, g: Gains, sample: Sample) -> int:
    """Goes on by the rate alone, with a sample that is clipped or has no force; returns bits."""
    bits = SATURATED
    if sample.clipped < FORCE_LOST:
        doubt_rate(s, sample)
    if s.aided > 0.0:
        warm_up(s, g, sample.dt_s)
        predict_shared(s, w, g, sample.dt_s)
    if sample.clipped >= FORCE_LOST:
        carry_tilt(s, g, sample)
        if sample.has_mag > 0.0:
            # Theta knows what the gyro's bias does to the tilt.
            bits = bits | use_field(s, w, g, sample)
    return bits
