"""What a program tells the velocity-aided filter in integers: the field, how late fixes are.

Source: docs/filter.md Eq. (23) to (26), (37).
"""

from h2nav.maths.fixedpoint import I16, I32, clamp

from ..memory import LATENCY_MAX, NORM_MAX, Gains, State
from .functions import HALF_TURN_Q28, limited, polar, signed_ratio
from .heading import turn_heading

MAX_TURNED = 1 << 28  # 1 rad, Q28: what `turn_heading` turns by


def set_place(s: State, g: Gains, north: I16, east: I16, down: I16) -> None:
    """Norm and dip become the gate's reference; a change of declination turns the heading.

    Args:
        s: state.
        g: gains.
        north: field of a model, true north, Q14 = 64 uT.
        east: the same.
        down: the same.
    """
    flat = [0, 0]
    whole = [0, 0]
    polar(north, east, flat)
    declination = 0
    if flat[0] > 0:
        declination = limited(flat[1], HALF_TURN_Q28)
    level = clamp(flat[0], 0, NORM_MAX)
    polar(level, down, whole)
    change = declination - s.declination
    s.declination = declination
    s.declination_sine = (signed_ratio(east, level | 1) + 1) >> 1
    s.declination_cosine = (signed_ratio(north, level | 1) + 1) >> 1
    # Q14 to Q26
    s.mag_ref_horizontal = level << 12
    s.mag_ref_down = down * 4096
    s.mag_ref_norm = clamp(whole[0], 0, NORM_MAX) << 12
    s.mag_ref_given = 1
    s.mag_new_us = 0
    if s.age_us >= 0 and s.heading_reset == 0 and s.aided == 0:
        turn_heading(s, g, change)
        if abs(change) > MAX_TURNED:
            # beside a pole: the fields to come give the rest
            s.heading_reset = 1


def remove_fix_delay(s: State, g: Gains, removed: I32) -> None:
    """So much of the fixes' delay has been taken off their times: what is left is less by as much.

    It may be less than none, if too much was taken off.

    Args:
        s: state.
        g: gains.
        removed: in all, s, Q30, from 0 to half a second.
    """
    removed = limited(removed, LATENCY_MAX)
    if removed < 0:
        removed = 0
    lag = s.fix_lag + s.fix_removed - removed
    s.fix_removed = removed
    s.fix_lag = clamp(lag, -removed, g.fix_lag_limit)
