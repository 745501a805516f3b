"""Many rotations at once, as columns: `maths.quaternion` with the same bits.

A quaternion is a tuple of four arrays, a vector one of three. What only multiplies and adds takes
columns as it is (`multiply`, `conjugate`, `rotate`); here is the rest. Functions of the C library
are called for each number, as in Python: those of numpy round otherwise on some processors.
"""

import math
from collections.abc import Callable
from itertools import repeat

import numpy as np
import numpy.typing as npt

from h2nav.maths.quaternion import GIMBAL_POLE, SMALL_ANGLE, to_matrix

Array = npt.NDArray[np.float64]
Vectors = tuple[Array, Array, Array]
Quats = tuple[Array, Array, Array, Array]


def each(function: Callable[..., float], *columns: Array | float) -> Array:
    """A function of numbers, for each row; a single number holds for all rows."""
    lists = [repeat(one) if isinstance(one, float) else one.tolist() for one in columns]
    return np.fromiter(map(function, *lists), dtype=np.float64)


def larger(a: Array, b: Array | float) -> Array:
    """As Python's ``max(a, b)``, also of what is not a number."""
    return np.where(b > a, b, a)


def exp(phi: Vectors) -> Quats:
    """See `quaternion.exp`."""
    x, y, z = phi
    half = 0.5 * np.sqrt(x * x + y * y + z * z)
    with np.errstate(all="ignore"):
        large = 0.5 * each(math.sin, half) / half
    scale = np.where(half < SMALL_ANGLE, 0.5 - half * half / 12.0, large)
    return each(math.cos, half), scale * x, scale * y, scale * z


def log(q: Quats) -> Vectors:
    """See `quaternion.log`."""
    is_long = q[0] < 0.0
    w, x, y, z = (np.where(is_long, -part, part) for part in q)
    sine = np.sqrt(x * x + y * y + z * z)
    with np.errstate(all="ignore"):
        ratio = sine / w
        small = 2.0 / w * (1.0 - ratio * ratio / 3.0)
        is_small = sine < SMALL_ANGLE * w
        scale = np.where(is_small, small, 2.0 * each(math.atan2, sine, w) / sine)
        is_none = (sine == 0.0) & ~is_small
        x, y, z = (np.where(is_none, 0.0, scale * part) for part in (x, y, z))
    return x, y, z


def normalize(q: Quats) -> Quats:
    """See `quaternion.normalize`; ValueError if any is not finite or has no length."""
    w, x, y, z = q
    length = np.sqrt(w * w + x * x + y * y + z * z)
    if not ((length > 0.0) & (length < math.inf)).all():
        raise ValueError("a quaternion has no direction")
    return w / length, x / length, y / length, z / length


def from_euler(roll: Array, pitch: Array, yaw: Array) -> Quats:
    """See `quaternion.from_euler`."""
    (cr, sr), (cp, sp), (cy, sy) = (
        (each(math.cos, 0.5 * angle), each(math.sin, 0.5 * angle)) for angle in (roll, pitch, yaw)
    )
    return (
        cy * cp * cr + sy * sp * sr,
        cy * cp * sr - sy * sp * cr,
        cy * sp * cr + sy * cp * sr,
        sy * cp * cr - cy * sp * sr,
    )


def to_euler(q: Quats) -> Vectors:
    """See `quaternion.to_euler`."""
    (nose_n, right_n, _), (nose_e, right_e, _), (nose_d, right_d, down_d) = to_matrix(q)
    horizontal = each(math.hypot, nose_n, nose_e)
    is_pole = horizontal < GIMBAL_POLE
    roll = np.where(is_pole, 0.0, each(math.atan2, right_d, down_d))
    north = np.where(is_pole, right_e, nose_n)
    yaw = each(math.atan2, np.where(is_pole, -right_n, nose_e), north)
    return roll, each(math.atan2, -nose_d, horizontal), yaw
