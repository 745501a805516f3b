"""Attitudes as rows of arrays: vectorised `maths.quaternion` and `maths.frames`."""

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from h2nav.maths import columns, frames

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.floating[Any]]
Record = TypeVar("Record", bound=tuple[Any, ...])


def product(p: Floats, q: Floats) -> Array:
    """(N, 4) Hamilton products of rows; a single row is broadcast."""
    w, x, y, z = p.T
    a, b, c, d = q.T
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=1,
    )


def cross(a: Floats, b: Floats) -> Array:
    """(N, 3) cross products of rows, with the bits of `np.cross`; a single row is broadcast."""
    (p, q, r), (x, y, z) = a.T, b.T
    return np.stack((q * z - r * y, r * x - p * z, p * y - q * x), axis=1)


def from_euler(angles: Array) -> Array:
    """(N, 4) q_nb of (N, 3) roll, pitch, yaw, rad."""
    roll, pitch, yaw = angles.T
    return np.stack(columns.from_euler(roll, pitch, yaw), axis=1)


def to_euler(q_nb: Array) -> Array:
    """(N, 3) roll, pitch, yaw, rad, of (N, 4) attitudes."""
    w, x, y, z = q_nb.T
    return np.stack(columns.to_euler((w, x, y, z)), axis=1)


def enu_from_ned(q_ns: npt.ArrayLike) -> Array:
    """(N, 4) q_es of (N, 4) attitudes against north-east-down."""
    rows = np.asarray(q_ns).tolist()
    return np.array([frames.attitude_enu_from_ned(tuple(q)) for q in rows]).reshape(-1, 4)


def ned_from_nwu(q: Array) -> Array:
    """(N, 4) attitudes with the world rotated by half a turn about north; its own inverse."""
    w, x, y, z = q.T
    return np.stack((-x, w, -z, y), axis=1)


def wrapped(angles: Array) -> Array:
    """The angles, rad, in [-pi, pi)."""
    result: Array = (angles + np.pi) % (2.0 * np.pi) - np.pi
    return result


def select_rows(record: Record, wanted: npt.NDArray[Any] | slice) -> Record:
    """A named tuple with the same rows of each of its arrays; its other fields stay."""
    values = (each[wanted] if isinstance(each, np.ndarray) else each for each in record)
    return tuple.__new__(type(record), values)
