"""One step of the two-stage filter on the rotation group, in the translatable subset.

Arrays as in `two_stage_layout`; equations: docs/derivation.md section 3.
"""

from collections.abc import Sequence

from h2nav.attitude.kernels.two_stage_correction import (
    correct,
    weigh,
)
from h2nav.attitude.kernels.two_stage_layout import (
    FIELD_USED,
    G_LAST_POWER,
    G_T_CONVERGE,
    G_T_STILL,
    LOST,
    LOST_VARIANCE,
    MOVED,
    WRONG,
    X_AGE,
    X_CONVERGED,
    X_HEADING,
    X_POWER,
    X_T_CLIPPED,
    X_T_RUN,
    X_VAR,
    Z_CLIPPED,
    Z_HAS_FIELD,
)
from h2nav.attitude.kernels.two_stage_motion import (
    measure,
    pass_clipped,
    propagate,
)
from h2nav.attitude.kernels.two_stage_trust import (
    doubt_bias,
    field_sane,
    force_near,
    force_sane,
    take_heading,
    track_contradiction,
    track_force,
    track_turned,
)


def step(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes one sample: propagates over `Z_DT`, then corrects. Returns bits.

    Source: docs/derivation.md Eq. (3.8) - (3.22).
    """
    propagate(x, g, z)
    measure(x, g, z)
    if z[Z_CLIPPED] > 0.0:
        pass_clipped(x, z)
        return 0
    x[X_T_CLIPPED] = 0.0
    if x[X_VAR] > LOST_VARIANCE and force_sane(x, g) == 1:
        return LOST
    level = track_force(x, g, z)
    if x[X_CONVERGED] < 1.0 and x[X_POWER] > 2.0 * g[G_LAST_POWER] and x[X_AGE] < g[G_T_STILL]:
        return MOVED
    if track_contradiction(x, g, z) == WRONG:
        return WRONG
    if z[Z_HAS_FIELD] > 0.0 and field_sane(x, g) == 1:
        if x[X_HEADING] < 1.0:
            take_heading(x, g)
            return FIELD_USED
        if track_turned(x, g) == 1:
            take_heading(x, g)
            doubt_bias(x, g)
            return FIELD_USED
    bits = weigh(x, g, z, level)
    if x[X_T_RUN] > g[G_T_CONVERGE] and force_near(x, g) == 1:
        x[X_CONVERGED] = 1.0
    return bits + correct(x, g, level)
