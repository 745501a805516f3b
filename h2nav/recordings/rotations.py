"""Angles to quaternions and back, of whole tracks."""

import numpy as np

from h2nav.recordings.context import Array


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
