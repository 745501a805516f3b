"""Angles of whole tracks of attitudes: arrays of quaternions body to NED, scalar first."""

from typing import NamedTuple

import numpy as np

from h2nav.maths.rows import product
from h2nav.recordings.context import Array
from h2nav.reviews.inertial import conjugate


class Euler(NamedTuple):
    """Roll, pitch and heading of the z-y-x sequence, rad, each (N,); the heading is 0 to 2 pi."""

    roll: Array
    pitch: Array
    heading: Array


def euler(q_nb: Array) -> Euler:
    """Of (N, 4) attitudes."""
    w, x, y, z = q_nb.T
    return Euler(
        np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
        np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)) % (2.0 * np.pi),
    )


def tilt_and_heading(p_nb: Array, q_nb: Array) -> tuple[Array, Array]:
    """From attitudes p to attitudes q, as `h2nav.maths.quaternion.tilt_and_heading`.

    Args:
        p_nb: (N, 4).
        q_nb: (N, 4).

    Returns:
        (N,) tilt, 0 to pi, and (N,) heading, -pi to pi, rad.

    Source: docs/filter.md Eq. (29).
    """
    turn_w, turn_x, turn_y, turn_z = product(q_nb, conjugate(p_nb)).T
    sign = np.where(turn_w < 0.0, -1.0, 1.0)
    tilt = 2.0 * np.arctan2(np.hypot(turn_x, turn_y), np.hypot(turn_w, turn_z))
    return tilt, 2.0 * np.arctan2(sign * turn_z, sign * turn_w)
