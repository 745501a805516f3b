"""Angles to quaternions and back, of whole tracks."""

import numpy as np
from numpy.typing import NDArray

from h2nav.recordings.context import Array

UNIT_WITHIN = 0.05


def quaternions(angles: Array) -> Array:
    """(N, 3) roll, pitch, yaw of the z-y-x sequence, rad -> (N, 4) body to NED, scalar first."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(0.5 * angles.T), np.sin(0.5 * angles.T)
    return np.stack(
        (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ),
        axis=1,
    )


def roll_pitch_heading(q_nb: Array) -> Array:
    """(N, 4) body to NED, scalar first -> (N, 3) angles of the z-y-x sequence, rad."""
    w, x, y, z = q_nb.T
    return np.stack(
        (
            np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
            np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
            np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
        ),
        axis=1,
    )


def are_units(q: Array) -> NDArray[np.bool_]:
    """(N,) whether (N, 4) quaternions are of length 1, but for rounding."""
    return np.asarray(np.abs(np.nan_to_num(np.linalg.norm(q, axis=1)) - 1.0) < UNIT_WITHIN)


def normalized(q: Array) -> Array:
    """(N, 4) quaternions of length 1."""
    return np.asarray(q / np.linalg.norm(q, axis=1)[:, None])
