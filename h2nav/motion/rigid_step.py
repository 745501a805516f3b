"""Exact steps of a rigid body on plain numbers: constant rates over the step, no small angles."""

import math
from typing import NamedTuple

from h2nav.maths import quaternion
from h2nav.maths.quaternion import Quat, Vec3
from h2nav.maths.vectors import cross, plus, scaled

SMALL_ANGLE_SQUARED = 1e-4


class RigidState(NamedTuple):
    """Position, attitude and velocity of the body."""

    t_us: int  # time
    q_ob: Quat  # attitude, body to the fixed frame
    p_o: Vec3  # position, m
    v_b: Vec3  # velocity in the body, m/s


def left_jacobian_times(phi: Vec3, v: Vec3) -> Vec3:
    """J_l(phi) v: the mean of v over the step while it turns by phi.

    Source: docs/motion.md Eq. (5).
    """
    square = phi[0] * phi[0] + phi[1] * phi[1] + phi[2] * phi[2]
    if square < SMALL_ANGLE_SQUARED:
        a = 0.5 - square / 24.0
        b = 1.0 / 6.0 - square / 120.0
    else:
        angle = math.sqrt(square)
        half_sine = math.sin(0.5 * angle)
        a = 2.0 * half_sine * half_sine / square
        b = (angle - math.sin(angle)) / (square * angle)
    c1 = cross(phi, v)
    c2 = cross(phi, c1)
    return (
        v[0] + a * c1[0] + b * c2[0],
        v[1] + a * c1[1] + b * c2[1],
        v[2] + a * c1[2] + b * c2[2],
    )


def with_velocity(state: RigidState, t_us: int, w_b: Vec3, v_b: Vec3) -> RigidState:
    """Moves with a constant body twist until `t_us`.

    Source: docs/motion.md Eq. (5).
    """
    dt_s = (t_us - state.t_us) * 1e-6
    phi = scaled(dt_s, w_b)
    way_b = left_jacobian_times(phi, scaled(dt_s, v_b))
    return RigidState(t_us, _turned(state.q_ob, phi), _moved(state, way_b), v_b)


def with_acceleration(state: RigidState, t_us: int, w_b: Vec3, a_b: Vec3) -> RigidState:
    """Moves with a constant body rate and an acceleration that is constant in the body.

    Exact in attitude and velocity; the position is exact to third order in the step.

    Args:
        t_us: end of the step.
        w_b: angular rate, rad/s.
        a_b: acceleration of the body (specific force plus gravity), m/s^2.

    Source: docs/motion.md Eq. (11).
    """
    dt_s = (t_us - state.t_us) * 1e-6
    phi = scaled(dt_s, w_b)
    gain_b = left_jacobian_times(phi, scaled(dt_s, a_b))
    way_b = scaled(dt_s, plus(state.v_b, scaled(0.5, gain_b)))
    v_b = quaternion.rotate(quaternion.exp(scaled(-1.0, phi)), plus(state.v_b, gain_b))
    return RigidState(t_us, _turned(state.q_ob, phi), _moved(state, way_b), v_b)


def _turned(q_ob: Quat, phi: Vec3) -> Quat:
    w, x, y, z = quaternion.multiply(q_ob, quaternion.exp(phi))
    # One Newton step keeps unit length: the product leaves it by rounding only.
    scale = 1.5 - 0.5 * (w * w + x * x + y * y + z * z)
    return (w * scale, x * scale, y * scale, z * scale)


def _moved(state: RigidState, way_b: Vec3) -> Vec3:
    return plus(state.p_o, quaternion.rotate(state.q_ob, way_b))
