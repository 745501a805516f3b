"""One step of the disturbance-shaped filter, in the translatable subset.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_doubt import begin_anew, check_level, doubt_rate
from h2nav.attitude.kernels.shaped_field import use_field
from h2nav.attitude.kernels.shaped_layout import (
    MOST_LOST,
    SATURATED,
    X_FIELD_AGE,
    X_LOST,
    X_T_NO_FIELD,
    Z_AIDED,
    Z_CLIPPED,
    Z_DT,
    Z_FIX,
    Z_HAS_FIELD,
)
from h2nav.attitude.kernels.shaped_motion import predict_attitude, predict_velocity
from h2nav.attitude.kernels.shaped_rest import use_rest
from h2nav.attitude.kernels.shaped_theta import limit, predict_theta
from h2nav.attitude.kernels.shaped_velocity import use_bounded_velocity, use_fix


def step(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes one sample; returns bits.

    Source: docs/filter.md Eq. (4) - (26), (30) - (32).
    """
    bits = 0
    dt = z[Z_DT]
    predict_attitude(x, z)
    predict_theta(x, g, dt)
    x[X_FIELD_AGE] = x[X_FIELD_AGE] + dt
    if x[X_T_NO_FIELD] >= 0.0:
        x[X_T_NO_FIELD] = x[X_T_NO_FIELD] + dt
    if z[Z_CLIPPED] > 0.0:
        doubt_rate(x, z)
        bits = SATURATED
    else:
        if x[X_LOST] > MOST_LOST:
            bits = begin_anew(x, g, z)
        x[X_LOST] = 0.0
        predict_velocity(x, g, z)
        if z[Z_AIDED] > 0.0:
            if z[Z_FIX] > 0.0:
                bits = bits | use_fix(x, g, z)
        else:
            bits = bits | use_bounded_velocity(x, g, z)
        if z[Z_HAS_FIELD] > 0.0:
            bits = bits | use_field(x, g, z)
        bits = bits | use_rest(x, g, z) | check_level(x, g, z)
    return bits | limit(x, g)
