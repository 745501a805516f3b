"""Rotation of an attitude in integers by the gyro and a correction, and its matrix.

Shared by the filters in integers. No product is wider than 32 bits. Formats and the proof of the
ranges: docs/fixed-point.md.

Source: docs/fixed-point.md Eq. (1), (7) to (9).
"""

from h2nav.attitude.integer.triad import Q_LIMIT
from h2nav.maths.fixedpoint import I32, clamp, known

R_LIMIT = 32767  # Q15
RATE_LIMIT = 19241453  # 35 rad/s
BIAS_LIMIT = 900719925  # 0.2 rad/s
BIAS_BITS = 13  # of the bias below the resolution of the rate
MAX_DT_US = 12500  # with RATE_LIMIT 0.22 half radians per step
CARRY_LIMIT = 65000000  # 0.06 half radians
NORM_Q26 = (1 << 26) - (1 << 15)  # the norm's target lies below one by what rounding may add
THIRD_Q15 = 10923


def rotation(q: list[I32], r: list[I32]) -> None:
    """Writes the matrix that takes body coordinates to n, by rows, Q15.

    Source: docs/fixed-point.md Eq. (1).
    """
    w = (q[0] + 8192) >> 14
    x = (q[1] + 8192) >> 14
    y = (q[2] + 8192) >> 14
    z = (q[3] + 8192) >> 14
    ww = w * w + 16384
    xx = x * x
    yy = y * y
    zz = z * z
    # no entry of a rotation exceeds one (Lemma 2)
    r[0] = known((ww + xx - yy - zz) >> 15, -R_LIMIT, R_LIMIT)
    r[4] = known((ww - xx + yy - zz) >> 15, -R_LIMIT, R_LIMIT)
    r[8] = known((ww - xx - yy + zz) >> 15, -R_LIMIT, R_LIMIT)
    wx = w * x
    yz = y * z + 8192
    r[5] = known((yz - wx) >> 14, -R_LIMIT, R_LIMIT)
    r[7] = known((yz + wx) >> 14, -R_LIMIT, R_LIMIT)
    wy = w * y
    xz = x * z + 8192
    r[2] = known((xz + wy) >> 14, -R_LIMIT, R_LIMIT)
    r[6] = known((xz - wy) >> 14, -R_LIMIT, R_LIMIT)
    wz = w * z
    xy = x * y + 8192
    r[1] = known((xy - wz) >> 14, -R_LIMIT, R_LIMIT)
    r[3] = known((xy + wz) >> 14, -R_LIMIT, R_LIMIT)


def unrotated(r0: I32, r3: I32, r6: I32, e: list[I32]) -> I32:
    """One coordinate in the body frame of a vector in n, with 15 more fraction bits."""
    return r0 * e[0] + r3 * e[1] + r6 * e[2]


def half_turn(rate: I32, dt_us: I32) -> I32:
    """Half the angle turned in `dt_us`, Q30; the product is made of two halves."""
    return (rate >> 10) * dt_us + (((rate & 1023) * dt_us + 512) >> 10)


def half_angle(gyro: I32, bias: I32, carry: I32, dt_us: I32, met: list[I32]) -> I32:
    """Half the angle to turn about one axis in this step, Q30.

    Source: docs/fixed-point.md Eq. (7).
    """
    raw = gyro >> 1
    rate = clamp(raw, -RATE_LIMIT, RATE_LIMIT)
    met[0] |= known(raw - rate, -(1 << 30), (1 << 30) - 1)  # Lemma 6
    return half_turn(rate - (bias >> BIAS_BITS), dt_us) + carry


def tangent(carry: list[I32], axis: I32, h: I32, third: I32) -> I32:
    """The tangent of the half angle `h`, Q16; what is below is carried to the next step.

    Source: docs/fixed-point.md Eq. (8).
    """
    due = h + (((h >> 14) * third) >> 6) + 8192
    carry[axis] = (due & 16383) - 8192
    return due >> 14


def propagate(
    q: list[I32], bias: list[I32], carry: list[I32], gyro: list[I32], dt_us: I32, met: list[I32]
) -> None:
    """Turns the attitude by the gyro and the last correction; one Newton step keeps its norm.

    Args:
        q: attitude, Q2.29.
        bias: gyro bias, half radians per microsecond, Q53.
        carry: correction and rest of a turn for the next step, half radians, Q30.
        gyro: angular rate, radians per microsecond, Q40.
        dt_us: time since the sample before, at most MAX_DT_US.
        met: its first number becomes other than zero when a rate meets its limit.

    Source: docs/fixed-point.md Eq. (7) to (9).
    """
    h_x = half_angle(gyro[0], bias[0], carry[0], dt_us, met)
    h_y = half_angle(gyro[1], bias[1], carry[1], dt_us, met)
    h_z = half_angle(gyro[2], bias[2], carry[2], dt_us, met)
    third = (h_x >> 14) * (h_x >> 14) + (h_y >> 14) * (h_y >> 14) + (h_z >> 14) * (h_z >> 14)
    third = ((third >> 13) * THIRD_Q15) >> 14
    t_x = tangent(carry, 0, h_x, third)
    t_y = tangent(carry, 1, h_y, third)
    t_z = tangent(carry, 2, h_z, third)

    w = (q[0] + 8192) >> 14
    x = (q[1] + 8192) >> 14
    y = (q[2] + 8192) >> 14
    z = (q[3] + 8192) >> 14
    q_w = q[0] - ((x * t_x + y * t_y + z * t_z + 2) >> 2)
    q_x = q[1] + ((w * t_x + y * t_z - z * t_y + 2) >> 2)
    q_y = q[2] + ((w * t_y + z * t_x - x * t_z + 2) >> 2)
    q_z = q[3] + ((w * t_z + x * t_y - y * t_x + 2) >> 2)

    w = (q_w + 32768) >> 16
    x = (q_x + 32768) >> 16
    y = (q_y + 32768) >> 16
    z = (q_z + 32768) >> 16
    excess = NORM_Q26 - w * w - x * x - y * y - z * z
    # one step turns by less than a radian (Lemma 1)
    scale = known(excess, -(1 << 24), 1 << 22) >> 10
    # n (3 - n)^2 / 4 never exceeds one (Lemma 1)
    q[0] = known(q_w + ((w * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    q[1] = known(q_x + ((x * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    q[2] = known(q_y + ((y * scale) >> 1), -Q_LIMIT, Q_LIMIT)
    q[3] = known(q_z + ((z * scale) >> 1), -Q_LIMIT, Q_LIMIT)
