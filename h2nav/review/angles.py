"""Angles of whole tracks of attitudes: arrays of quaternions body to NED, scalar first."""

from typing import NamedTuple

import numpy as np

from h2nav.flightlogs.context import Array


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


def at_times(t_s: Array, q_nb: Array, wanted_s: Array, longest_s: float) -> Array:
    """Attitudes between samples.

    Args:
        t_s: (N,) not decreasing.
        q_nb: (N, 4).
        wanted_s: (M,).
        longest_s: over longer gaps nothing is interpolated.

    Returns:
        (M, 4) NaN in gaps and outside of `t_s`.
    """
    if len(t_s) < 2:
        return np.full((len(wanted_s), 4), np.nan)
    after = np.searchsorted(t_s, wanted_s)
    is_inside = (after > 0) & (after < len(t_s))
    after = np.clip(after, 1, len(t_s) - 1)
    step_s = t_s[after] - t_s[after - 1]
    share = np.clip((wanted_s - t_s[after - 1]) / np.maximum(step_s, 1e-9), 0.0, 1.0)[:, None]
    first, second = q_nb[after - 1], q_nb[after]
    # q and -q are one attitude: the nearer one of the second is meant.
    second = second * np.where(np.sum(first * second, axis=1) < 0.0, -1.0, 1.0)[:, None]
    mixed = (1.0 - share) * first + share * second
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    mixed[~is_inside | (step_s > longest_s)] = np.nan
    return mixed


def tilt_and_heading(p_nb: Array, q_nb: Array) -> tuple[Array, Array]:
    """From attitudes p to attitudes q, as `h2nav.maths.quaternion.tilt_and_heading`.

    Args:
        p_nb: (N, 4).
        q_nb: (N, 4).

    Returns:
        (N,) tilt, 0 to pi, and (N,) heading, -pi to pi, rad.

    Source: docs/filter.md Eq. (29).
    """
    a, b, c, d = q_nb.T
    w, x, y, z = p_nb.T
    # q conj(p)
    turn_w = a * w + b * x + c * y + d * z
    turn_x = -a * x + b * w - c * z + d * y
    turn_y = -a * y + b * z + c * w - d * x
    turn_z = -a * z - b * y + c * x + d * w
    sign = np.where(turn_w < 0.0, -1.0, 1.0)
    tilt = 2.0 * np.arctan2(np.hypot(turn_x, turn_y), np.hypot(turn_w, turn_z))
    return tilt, 2.0 * np.arctan2(sign * turn_z, sign * turn_w)
