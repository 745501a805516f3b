"""What the default filter takes from the magnetometer: heading, latency, reference.

Arrays as in `shaped_layout`; equations: docs/filter.md.
"""

import math
from collections.abc import Sequence

from h2nav.attitude.kernels.shaped_layout import (
    FIELD_USED,
    G_DIP_GATE,
    G_FIELD,
    G_FIELD_CORRELATION,
    G_GYRO,
    G_HEADING_VAR,
    G_LAG_MOST,
    G_LAG_PRIOR,
    G_NEW_TURN,
    G_NORM_GATE,
    G_SCALE,
    G_T_LEVEL,
    G_T_NEW,
    G_T_REFERENCE,
    HEADING_LOST,
    MOST_MISSES,
    OLDEST_FIELD,
    X_BIAS,
    X_D,
    X_DECLINATION,
    X_EASE,
    X_FIELD,
    X_FIELD_AGE,
    X_INNOVATION,
    X_LAG_DEN,
    X_LAG_NUM,
    X_M,
    X_MAGNETIC,
    X_MISSES,
    X_NEW_DIP,
    X_NEW_NORM,
    X_NEW_T,
    X_NEW_TURN,
    X_NV2,
    X_P,
    X_Q,
    X_R,
    X_REF_DIP,
    X_REF_GIVEN,
    X_REF_NORM,
    X_ROW,
    X_S,
    X_T_NO_FIELD,
    X_TURNING,
    X_UE,
    X_UN,
    Z_FIELD,
    Z_RATE,
)
from h2nav.attitude.kernels.shaped_theta import apply_theta, measure_theta


def use_field(x: list[float], g: Sequence[float], z: Sequence[float]) -> int:
    """Heading, and theta through it, from a new field.

    Source: docs/filter.md Eq. (21) - (26).
    """
    new = 0.0
    for i in range(3):
        if z[Z_FIELD + i] != x[X_FIELD + i]:
            new = 1.0
        x[X_FIELD + i] = z[Z_FIELD + i]
    if new == 0.0:
        # Held by the sensor's driver: it was used when it was new.
        return 0
    age = x[X_FIELD_AGE]
    x[X_FIELD_AGE] = 0.0
    if age > OLDEST_FIELD:
        age = OLDEST_FIELD
    lag = rotate_field(x, g, z)
    north = x[X_M]
    east = x[X_M + 1]
    down = x[X_M + 2]
    flat = math.sqrt(north * north + east * east)
    norm = math.sqrt(flat * flat + down * down)
    if norm == 0.0:
        return 0
    dip = math.atan2(down, flat)
    if x[X_REF_NORM] == 0.0:
        x[X_REF_NORM] = norm
        x[X_REF_DIP] = dip
    lost = x[X_T_NO_FIELD]
    if lost > HEADING_LOST:
        if not_believed(x, g, norm, dip, age) > 0.0:
            return 0
        learn_field(x, g, norm, dip, flat, age, lag)
    innovation = x[X_DECLINATION] - math.atan2(east, north)
    if innovation > math.pi:
        innovation = innovation - 2.0 * math.pi
    if innovation < -math.pi:
        innovation = innovation + 2.0 * math.pi
    x[X_INNOVATION + 2] = innovation
    x[X_T_NO_FIELD] = 0.0
    if lost < 0.0:
        turn_heading(x, g, innovation)
        return FIELD_USED
    # Only the disturbance in the heading counts; norm and dip show the other two components.
    noise = g[G_FIELD] + g[G_FIELD_CORRELATION] * x[X_MAGNETIC]
    measure_heading(x, g, innovation, noise, age)
    return FIELD_USED


def rotate_field(x: list[float], g: Sequence[float], z: Sequence[float]) -> float:
    """The field in NED, its latency undone, into X_M; its change per second of latency into X_D.

    Returns the latency, s. Source: docs/filter.md Eq. (21).
    """
    wx = z[Z_RATE] - x[X_BIAS]
    wy = z[Z_RATE + 1] - x[X_BIAS + 1]
    wz = z[Z_RATE + 2] - x[X_BIAS + 2]
    mx = z[Z_FIELD]
    my = z[Z_FIELD + 1]
    mz = z[Z_FIELD + 2]
    # What the rotation since the sample was taken has done to it.
    lx = wy * mz - wz * my
    ly = wz * mx - wx * mz
    lz = wx * my - wy * mx
    lag = x[X_LAG_NUM] / (x[X_LAG_DEN] + g[G_LAG_PRIOR])
    if lag < 0.0:
        lag = 0.0
    if lag > g[G_LAG_MOST]:
        lag = g[G_LAG_MOST]
    for i in range(3):
        a = x[X_R + 3 * i]
        b = x[X_R + 3 * i + 1]
        c = x[X_R + 3 * i + 2]
        x[X_D + i] = a * lx + b * ly + c * lz
        x[X_M + i] = a * mx + b * my + c * mz - lag * x[X_D + i]
    return lag


def not_believed(x: list[float], g: Sequence[float], norm: float, dip: float, age: float) -> float:
    """1 while the field contradicts its reference; a steady new field becomes the reference.

    Source: docs/filter.md Eq. (22), (26).
    """
    if (
        math.fabs(norm - x[X_REF_NORM]) < g[G_NORM_GATE] * x[X_REF_NORM]
        and math.fabs(dip - x[X_REF_DIP]) < g[G_DIP_GATE]
    ):
        x[X_NEW_T] = 0.0
        return 0.0
    if (
        x[X_NEW_T] > 0.0
        and math.fabs(norm - x[X_NEW_NORM]) < 0.5 * g[G_NORM_GATE] * x[X_NEW_NORM]
        and math.fabs(dip - x[X_NEW_DIP]) < 0.5 * g[G_DIP_GATE]
    ):
        share = age / (x[X_NEW_T] + age)
        x[X_NEW_T] = x[X_NEW_T] + age
        x[X_NEW_TURN] = x[X_NEW_TURN] + age * math.sqrt(x[X_TURNING])
        x[X_NEW_NORM] = x[X_NEW_NORM] + share * (norm - x[X_NEW_NORM])
        x[X_NEW_DIP] = x[X_NEW_DIP] + share * (dip - x[X_NEW_DIP])
    else:
        x[X_NEW_T] = age
        x[X_NEW_TURN] = 0.0
        x[X_NEW_NORM] = norm
        x[X_NEW_DIP] = dip
    if x[X_NEW_T] < g[G_T_NEW] or x[X_NEW_TURN] < g[G_NEW_TURN]:
        return 1.0
    x[X_REF_NORM] = x[X_NEW_NORM]
    x[X_REF_DIP] = x[X_NEW_DIP]
    x[X_REF_GIVEN] = 0.0
    x[X_NEW_T] = 0.0
    x[X_LAG_NUM] = 0.0
    x[X_LAG_DEN] = 0.0
    x[X_P + 3] = 0.0
    x[X_P + 6] = 0.0
    x[X_P + 8] = 0.0
    x[X_P + 9] = g[G_HEADING_VAR]
    return 0.0


def learn_field(
    x: list[float],
    g: Sequence[float],
    norm: float,
    dip: float,
    flat: float,
    age: float,
    lag: float,
) -> None:
    """Latency, level of disturbance and reference from a field that is believed.

    Source: docs/filter.md Eq. (21), (23), (24).
    """
    reference = x[X_REF_NORM]
    more_norm = (norm - reference) / reference
    more_dip = dip - x[X_REF_DIP]
    # Vertical and horizontal size do not depend on the heading; flat > 0 inside the dip gate.
    down_rate = x[X_D + 2]
    flat_rate = (x[X_M] * x[X_D] + x[X_M + 1] * x[X_D + 1]) / (flat + 0.001 * norm)
    down = x[X_M + 2] + lag * down_rate - reference * math.sin(x[X_REF_DIP])
    level = flat + lag * flat_rate - reference * math.cos(x[X_REF_DIP])
    weight = age / (reference * reference)
    x[X_LAG_NUM] = x[X_LAG_NUM] + weight * (down * down_rate + level * flat_rate)
    x[X_LAG_DEN] = x[X_LAG_DEN] + weight * (down_rate * down_rate + flat_rate * flat_rate)
    cosine = flat / norm
    shown = 0.5 * (more_norm * more_norm + more_dip * more_dip) / (cosine * cosine + 0.01)
    share = age / (g[G_T_LEVEL] + age)
    x[X_MAGNETIC] = x[X_MAGNETIC] + share * (shown - x[X_MAGNETIC])
    if x[X_REF_GIVEN] == 0.0:
        share = age / (g[G_T_REFERENCE] + age)
        x[X_REF_NORM] = reference + share * (norm - reference)
        x[X_REF_DIP] = x[X_REF_DIP] + share * more_dip


def measure_heading(
    x: list[float], g: Sequence[float], innovation: float, density: float, age: float
) -> None:
    """Theta from a heading that is seen through the tilt error.

    Source: docs/filter.md Eq. (25).
    """
    # A tilt about magnetic north turns the dipping field sideways; theta's part of it is known.
    slope = math.tan(x[X_REF_DIP])
    north = slope * math.sin(x[X_DECLINATION])
    east = -slope * math.cos(x[X_DECLINATION])
    for i in range(4):
        x[X_ROW + i] = north * x[X_UN + i] + east * x[X_UE + i]
        x[X_D + i] = 0.0
    x[X_ROW + 3] = x[X_ROW + 3] + 1.0
    tilt = math.sqrt((g[G_GYRO] + g[G_SCALE] * x[X_TURNING]) * x[X_NV2])
    noise = x[X_EASE] * (density + 2.0 * slope * slope * tilt) / age
    measure_theta(x, X_ROW, innovation, noise)
    apply_theta(x, 0.0, 0.0)


def turn_heading(x: list[float], g: Sequence[float], angle: float) -> None:
    """Takes a heading that nothing was known of from the field alone."""
    c = math.cos(0.5 * angle)
    s = math.sin(0.5 * angle)
    qw = x[X_Q]
    qx = x[X_Q + 1]
    qy = x[X_Q + 2]
    qz = x[X_Q + 3]
    x[X_Q] = c * qw - s * qz
    x[X_Q + 1] = c * qx - s * qy
    x[X_Q + 2] = c * qy + s * qx
    x[X_Q + 3] = c * qz + s * qw
    # Velocity and sensitivities were in the frame that has turned.
    for i in range(16):
        x[X_UN + i] = 0.0
    x[X_S] = 0.0
    x[X_S + 1] = 0.0
    x[X_MISSES] = MOST_MISSES
    x[X_P + 3] = 0.0
    x[X_P + 6] = 0.0
    x[X_P + 8] = 0.0
    x[X_P + 9] = g[G_HEADING_VAR]
