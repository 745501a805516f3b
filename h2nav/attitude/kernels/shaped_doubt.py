"""What the default filter doubts of its tilt, and how it finds the tilt anew.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    AIR_COSINE,
    ALL_LOST,
    G_GRAVITY,
    G_T_REST,
    GROUND_COSINE,
    HEADING_LOST,
    LEVEL_DOUBT,
    LEVEL_SIZE,
    MOST_DOUBT,
    MOST_MISSES,
    RESTARTED,
    X_DENIED,
    X_DOUBT,
    X_FORCE_LP,
    X_LOST,
    X_MISSES,
    X_P,
    X_Q,
    X_R,
    X_RATE_LP,
    X_S,
    X_T_NO_FIELD,
    X_T_RUN,
    X_T_STEADY,
    X_TURNING,
    X_UN,
    Z_DT,
    Z_FORCE,
    Z_NOSE,
    Z_RATE,
    Z_REST,
)
from h2nav.attitude.kernels.shaped_motion import set_matrix, turn


def doubt_rate(x: list[float], z: Sequence[float]) -> None:
    """A clipped rate is doubted by as much as it differs from the rates before it.

    Source: docs/filter.md Eq. (30).
    """
    square = 0.0
    for i in range(3):
        d = z[Z_RATE + i] - x[X_RATE_LP + i]
        square = square + d * d
    lost = z[Z_DT] * math.sqrt(square)
    x[X_LOST] = x[X_LOST] + lost
    doubt_tilt(x, x[X_DOUBT] + lost)
    # The heading has been turned as well as the tilt; `limit` keeps it where theta is linear.
    x[X_P + 9] = x[X_P + 9] + lost * (2.0 * x[X_LOST] - lost)


def doubt_tilt(x: list[float], angle: float) -> None:
    """The tilt is known no better than this, rad."""
    if angle > MOST_DOUBT:
        angle = MOST_DOUBT
    if angle > x[X_DOUBT]:
        x[X_DOUBT] = angle


def check_level(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Takes the tilt from a force of size g that contradicts it, once something else does too.

    Source: docs/filter.md Eq. (31), (32).
    """
    cosine = AIR_COSINE
    if x[X_DENIED] > 0.0:
        x[X_DENIED] = 0.0
    elif x[X_T_STEADY] < g[G_T_REST]:
        return 0
    elif z[Z_REST] == 2.0:
        cosine = GROUND_COSINE
    fx = x[X_FORCE_LP]
    fy = x[X_FORCE_LP + 1]
    fz = x[X_FORCE_LP + 2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    ratio = norm / g[G_GRAVITY]
    down = x[X_R + 6] * fx + x[X_R + 7] * fy + x[X_R + 8] * fz
    if math.fabs(ratio * ratio - 1.0) > LEVEL_SIZE or -down > cosine * norm:
        return 0
    level(x, fx, fy, fz, norm)
    restart_tilt(x, g, z[Z_NOSE] / g[G_GRAVITY])
    x[X_DOUBT] = LEVEL_DOUBT
    return RESTARTED


def begin_anew(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Starts the tilt again after clipped samples that may have hidden a turn.

    Source: docs/filter.md Eq. (30).
    """
    fx = z[Z_FORCE]
    fy = z[Z_FORCE + 1]
    fz = z[Z_FORCE + 2]
    norm = math.sqrt(fx * fx + fy * fy + fz * fz)
    if x[X_LOST] > ALL_LOST and norm > 0.0:
        level(x, fx, fy, fz, norm)
    restart_tilt(x, g, z[Z_NOSE] / g[G_GRAVITY])
    return RESTARTED


def level(x: list[float], fx: float, fy: float, fz: float, norm: float) -> None:
    """Turns the attitude so that a force, of size norm, points up; the heading is asked anew.

    Source: docs/filter.md Eq. (32).
    """
    # The smallest turn that does it: half its tangent along its axis.
    scale = norm - (x[X_R + 6] * fx + x[X_R + 7] * fy + x[X_R + 8] * fz)
    north = x[X_R] * fx + x[X_R + 1] * fy + x[X_R + 2] * fz
    east = x[X_R + 3] * fx + x[X_R + 4] * fy + x[X_R + 5] * fz
    if scale < 0.001 * norm:
        # Upside down: about any horizontal axis.
        scale = 0.001 * norm
        north = norm
    turn(x, -east / scale, north / scale, 0.0)
    set_matrix(x, x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3])
    # The field was seen through the wrong tilt: the next gives the heading, as at the start.
    x[X_T_NO_FIELD] = HEADING_LOST


def restart_tilt(x: list[float], g: Sequence[float], nose: float) -> None:
    """The velocity is impossible, so the tilt was wrong: find it anew, keep bias and heading.

    Source: docs/filter.md Eq. (14).
    """
    for i in range(16):
        x[X_UN + i] = 0.0
    x[X_S] = nose * x[X_R]
    x[X_S + 1] = nose * x[X_R + 3]
    for i in range(5):
        x[X_TURNING + i] = 0.0
    x[X_T_RUN] = 0.0
    x[X_MISSES] = MOST_MISSES
    x[X_DENIED] = 0.0
    x[X_T_STEADY] = 0.0
