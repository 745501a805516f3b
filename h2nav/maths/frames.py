"""The only place where an axis flips: NED and ENU, forward-right-down and forward-left-up.

Letters: ``n`` north-east-down, ``e`` east-north-up, ``b`` forward-right-down, ``f``
forward-left-up. Inside h2nav only ``n`` and ``b`` exist; importers and exporters convert here.
Every change of frame is its own inverse.
"""

import math

from h2nav.maths.quaternion import Quat, Vec3, multiply

_HALF = math.sqrt(0.5)
# n and e: half a turn about the diagonal between north and east.
_Q_EN: Quat = (0.0, _HALF, _HALF, 0.0)
# b and f: half a turn about the nose.
_Q_FB: Quat = (0.0, 1.0, 0.0, 0.0)


def enu_from_ned(v_n: Vec3) -> Vec3:
    """(north, east, down) as (east, north, up)."""
    return (v_n[1], v_n[0], -v_n[2])


def ned_from_enu(v_e: Vec3) -> Vec3:
    """(east, north, up) as (north, east, down)."""
    return (v_e[1], v_e[0], -v_e[2])


def flu_from_frd(v_b: Vec3) -> Vec3:
    """(forward, right, down) as (forward, left, up)."""
    return (v_b[0], -v_b[1], -v_b[2])


def frd_from_flu(v_f: Vec3) -> Vec3:
    """(forward, left, up) as (forward, right, down)."""
    return (v_f[0], -v_f[1], -v_f[2])


def attitude_enu_flu_from_ned_frd(q_nb: Quat) -> Quat:
    """q_ef for q_nb, the convention of ROS and Foxglove (w >= 0)."""
    return _upper(multiply(multiply(_Q_EN, q_nb), _Q_FB))


def attitude_ned_frd_from_enu_flu(q_ef: Quat) -> Quat:
    """q_nb for q_ef: an attitude of ROS in h2nav's frames (w >= 0)."""
    return _upper(multiply(multiply(_Q_EN, q_ef), _Q_FB))


def attitude_ned_from_enu(q_es: Quat) -> Quat:
    """q_ns for q_es: changes the world frame, keeps the sensor axes (w >= 0)."""
    return _upper(multiply(_Q_EN, q_es))


def attitude_enu_from_ned(q_ns: Quat) -> Quat:
    """q_es for q_ns: changes the world frame, keeps the sensor axes (w >= 0)."""
    return _upper(multiply(_Q_EN, q_ns))


def _upper(q: Quat) -> Quat:
    """The one of q and -q, which are the same rotation, with w >= 0."""
    return q if q[0] >= 0.0 else (-q[0], -q[1], -q[2], -q[3])
