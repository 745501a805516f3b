"""Unit quaternions as plain tuples: Hamilton, scalar first.

``q_nb`` takes body coordinates to NED: ``v_n = rotate(q_nb, v_b)``; adjacent letters cancel in
products, ``q_nb = multiply(q_na, q_ab)``. A quaternion and its negative are the same rotation.
Angles are radians. Made for the per-sample path: no numpy, no allocation beyond the result.
"""

import math
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from h2nav.maths.rows import Array

# What only multiplies and adds takes columns, too (`maths.columns`).
Number = TypeVar("Number", float, "Array")
Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]
Matrix3 = tuple[Vec3, Vec3, Vec3]

IDENTITY: Quat = (1.0, 0.0, 0.0, 0.0)

# Below this half angle sin(x)/x is 1 - x^2/6 to the last bit, and x*x cannot underflow usefully.
SMALL_ANGLE = 1e-4
# Horizontal part of the nose below which a heading is rounding error.
GIMBAL_POLE = 1e-12


def multiply(
    p: tuple[Number, Number, Number, Number], q: tuple[Number, Number, Number, Number]
) -> tuple[Number, Number, Number, Number]:
    """The product p q: the rotation q followed by the rotation p.

    Source: docs/derivation.md Eq. (1.1).
    """
    pw, px, py, pz = p
    qw, qx, qy, qz = q
    return (
        pw * qw - px * qx - py * qy - pz * qz,
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
    )


def conjugate(
    q: tuple[Number, Number, Number, Number],
) -> tuple[Number, Number, Number, Number]:
    """The inverse rotation of a unit quaternion: q_bn for q_nb."""
    return (q[0], -q[1], -q[2], -q[3])


def rotate(
    q: tuple[Number, Number, Number, Number], v: tuple[Number, Number, Number]
) -> tuple[Number, Number, Number]:
    """The vector v of the inner frame in the outer one, as v_n from q_nb and v_b; any unit.

    Source: docs/derivation.md Eq. (1.2).
    """
    w, x, y, z = q
    a, b, c = v
    s = 2.0 * (y * c - z * b)
    t = 2.0 * (z * a - x * c)
    u = 2.0 * (x * b - y * a)
    return (
        a + w * s + y * u - z * t,
        b + w * t + z * s - x * u,
        c + w * u + x * t - y * s,
    )


def exp(phi: Vec3) -> Quat:
    """The rotation by |phi| radians about phi, accurate at every angle and near zero.

    Source: docs/derivation.md Eq. (1.4).
    """
    x, y, z = phi
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - half * half / 12.0 if half < SMALL_ANGLE else 0.5 * math.sin(half) / half
    return (math.cos(half), scale * x, scale * y, scale * z)


def turned(q: Quat, phi: Vec3) -> Quat:
    """``normalize(multiply(q, exp(phi)))``, bit for bit, in one call for the per-sample path.

    Args:
        q: a unit quaternion.
        phi: the turn to add, rad, in the inner frame.

    Raises:
        ValueError: the result is not finite.
    """
    pw, px, py, pz = q
    x, y, z = phi
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - half * half / 12.0 if half < SMALL_ANGLE else 0.5 * math.sin(half) / half
    c, x, y, z = math.cos(half), scale * x, scale * y, scale * z
    w = pw * c - px * x - py * y - pz * z
    a = pw * x + px * c + py * z - pz * y
    b = pw * y - px * z + py * c + pz * x
    d = pw * z + px * y - py * x + pz * c
    length = math.sqrt(w * w + a * a + b * b + d * d)
    if not 0.0 < length < math.inf:
        raise ValueError(f"quaternion {(w, a, b, d)} has no direction")
    return (w / length, a / length, b / length, d / length)


def log(q: Quat) -> Vec3:
    """The rotation vector of q, the short way: its length is at most pi.

    q and -q have the same logarithm (at exactly pi, where both axes are right, the axis of the
    representative that is given). q need not be normalised.

    Source: docs/derivation.md Eq. (1.5).
    """
    w, x, y, z = q
    if w < 0.0:
        w, x, y, z = -w, -x, -y, -z
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < SMALL_ANGLE * w:
        ratio = sine / w
        scale = 2.0 / w * (1.0 - ratio * ratio / 3.0)
    elif sine == 0.0:
        return (0.0, 0.0, 0.0)
    else:
        scale = 2.0 * math.atan2(sine, w) / sine
    return (scale * x, scale * y, scale * z)


def norm(q: Quat) -> float:
    """The length of q; 1 for a rotation."""
    return math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])


def normalize(q: Quat) -> Quat:
    """The same rotation with unit length.

    Raises:
        ValueError: q is zero or not finite, so it names no rotation.
    """
    w, x, y, z = q
    length = math.sqrt(w * w + x * x + y * y + z * z)
    if not 0.0 < length < math.inf:
        raise ValueError(f"quaternion {q} has no direction")
    return (w / length, x / length, y / length, z / length)


def angle(p: Quat, q: Quat) -> float:
    """The angle between two attitudes, 0 to pi rad; q and -q count as one."""
    x, y, z = log(multiply(conjugate(p), q))
    return math.sqrt(x * x + y * y + z * z)


def tilt_and_heading(turn_n: Quat) -> tuple[float, float]:
    """A turn in north, east, down as the tilt that is left when heading is free, and the heading.

    Args:
        turn_n: from one attitude to another, ``q_nb conj(p_nb)``.

    Returns:
        Tilt, 0 to pi rad, and heading, -pi to pi rad, positive to the right.

    Source: docs/filter.md Eq. (29).
    """
    w, x, y, z = turn_n
    if w < 0.0:
        w, z = -w, -z
    return 2.0 * math.atan2(math.hypot(x, y), math.hypot(w, z)), 2.0 * math.atan2(z, w)


def to_matrix(
    q: tuple[Number, Number, Number, Number],
) -> tuple[
    tuple[Number, Number, Number], tuple[Number, Number, Number], tuple[Number, Number, Number]
]:
    """Rows of the rotation matrix, ``R_nb`` for ``q_nb``. Source: docs/derivation.md Eq. (1.3)."""
    w, x, y, z = q
    return (
        (1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)),
    )


def from_matrix(R: Matrix3) -> Quat:
    """The quaternion of a rotation matrix, w >= 0; accurate at every angle (Shepperd).

    Raises:
        ValueError: the matrix is zero or not finite.
    """
    (a, b, c), (d, e, f), (g, h, i) = R
    trace = a + e + i
    q: Quat
    if trace >= max(a, e, i):
        q = (1.0 + trace, h - f, c - g, d - b)
    elif a >= e and a >= i:
        q = (h - f, 1.0 + a - e - i, b + d, c + g)
    elif e >= i:
        q = (c - g, b + d, 1.0 + e - a - i, f + h)
    else:
        q = (d - b, c + g, f + h, 1.0 + i - a - e)
    q = normalize(q)
    return q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])


def from_euler(roll: float, pitch: float, yaw: float) -> Quat:
    """The q_nb of the z-y-x sequence: yaw about down, then pitch, then roll."""
    cr, sr = math.cos(0.5 * roll), math.sin(0.5 * roll)
    cp, sp = math.cos(0.5 * pitch), math.sin(0.5 * pitch)
    cy, sy = math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


def to_euler(q: Quat) -> Vec3:
    """(roll, pitch, yaw) of q_nb: roll and yaw in [-pi, pi], pitch in [-pi/2, pi/2].

    At the poles (pitch +-90 deg) only a combination of roll and yaw exists: roll is then 0.
    """
    (nose_n, right_n, _), (nose_e, right_e, _), (nose_d, right_d, down_d) = to_matrix(q)
    horizontal = math.hypot(nose_n, nose_e)
    pitch = math.atan2(-nose_d, horizontal)
    if horizontal < GIMBAL_POLE:
        return (0.0, pitch, math.atan2(-right_n, right_e))
    return (math.atan2(right_d, down_d), pitch, math.atan2(nose_e, nose_n))
