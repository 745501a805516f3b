"""Planar rigid motions SE(2) on plain numbers.

A pose is (x, y, angle): it maps points of the moving frame to the fixed one. A twist is the
constant motion (along x, along y, turn) over one step, in the moving frame. The y axis is a quarter
turn from x in the direction of positive angles; the caller chooses the side.
"""

import math

Planar = tuple[float, float, float]
Matrix3 = tuple[Planar, Planar, Planar]

IDENTITY: Planar = (0.0, 0.0, 0.0)
# Below this angle the series are exact to rounding: the first dropped term is angle^6 / 5040.
SMALL_ANGLE = 1e-2


def wrap(angle: float) -> float:
    """The same direction in (-pi, pi]."""
    wrapped = math.remainder(angle, math.tau)
    return math.pi if wrapped == -math.pi else wrapped


def compose(first: Planar, second: Planar) -> Planar:
    """The motion `second`, made in the frame that `first` leads to; angle wrapped."""
    c, s = math.cos(first[2]), math.sin(first[2])
    return (
        first[0] + c * second[0] - s * second[1],
        first[1] + s * second[0] + c * second[1],
        wrap(first[2] + second[2]),
    )


def advance(pose: Planar, motion: Planar) -> Planar:
    """The pose after one body increment, along the exact arc; angle wrapped.

    Source: docs/motion.md Eq. (20).
    """
    return compose(pose, exp(motion))


def inverse(pose: Planar) -> Planar:
    """The pose that undoes `pose`."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return (-c * pose[0] - s * pose[1], s * pose[0] - c * pose[1], wrap(-pose[2]))


def exp(twist: Planar) -> Planar:
    """The exact arc: the pose after a constant twist over one step; angle wrapped.

    Source: docs/motion.md Eq. (17).
    """
    a, b = _sinc_cosc(twist[2])
    return (a * twist[0] - b * twist[1], b * twist[0] + a * twist[1], wrap(twist[2]))


def log(pose: Planar) -> Planar:
    """The shortest constant twist that leads to `pose`; inverse of `exp` for |turn| <= pi.

    Source: docs/motion.md Eq. (18).
    """
    angle = wrap(pose[2])
    half = 0.5 * angle
    if abs(angle) < SMALL_ANGLE:
        a = 1.0 - angle * angle / 12.0 - angle**4 / 720.0
    else:
        a = half * math.cos(half) / math.sin(half)
    return (a * pose[0] + half * pose[1], -half * pose[0] + a * pose[1], angle)


def adjoint(pose: Planar) -> Matrix3:
    """Maps a twist in the moving frame to the same twist in the fixed frame."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    return ((c, -s, pose[1]), (s, c, -pose[0]), (0.0, 0.0, 1.0))


def right_jacobian(twist: Planar) -> Matrix3:
    """J with exp(twist + d) = exp(twist) exp(J d) to first order in d.

    Source: docs/motion.md Eq. (19).
    """
    x, y, angle = twist
    a, b = _sinc_cosc(angle)
    if abs(angle) < SMALL_ANGLE:
        u = angle / 6.0 - angle**3 / 120.0  # (angle - sin angle) / angle^2
        v = 0.5 - angle * angle / 24.0 + angle**4 / 720.0  # (1 - cos angle) / angle^2
    else:
        u = (1.0 - a) / angle
        v = b / angle
    return ((a, b, u * x - v * y), (-b, a, v * x + u * y), (0.0, 0.0, 1.0))


def _sinc_cosc(angle: float) -> tuple[float, float]:
    """sin(angle) / angle and (1 - cos(angle)) / angle."""
    if abs(angle) < SMALL_ANGLE:
        square = angle * angle
        return (
            1.0 - square / 6.0 + square * square / 120.0,
            angle * (0.5 - square / 24.0 + square * square / 720.0),
        )
    half = math.sin(0.5 * angle)
    return math.sin(angle) / angle, 2.0 * half * half / angle
