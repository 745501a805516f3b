"""Attitude from two directions (TRIAD, gravity first), averaged over a short window.

The gyro carries the window: every sample's vectors are turned into the body axes of the window's
start, so that a turning vehicle aligns as well as one at rest.
"""

import math
from typing import NamedTuple

from h2nav.attitude.samples import ImuSample, Quat, Vec3
from h2nav.maths.quaternion import IDENTITY, exp, from_matrix, multiply, rotate
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.maths.vectors import ZERO, cross, plus

# Sine of the angle between force and field below which they name no heading.
_MIN_ANGLE = 0.02


def triad(force_b: Vec3, field_b: Vec3 | None) -> Quat:
    """q_nb with north from the field: the force is exact, the field only gives the heading.

    Args:
        force_b: specific force (any length), body frame; it points up at rest.
        field_b: magnetic field (any length), body frame; None leaves the heading where a body
            whose nose lies in the north-down plane has it (yaw 0 unless the nose points down).

    Raises:
        ValueError: no usable force.

    Source: docs/derivation.md Eq. (3.17).
    """
    size = math.hypot(*force_b)
    if not 0.0 < size < math.inf:
        raise ValueError(f"force {force_b} has no direction")
    down = (-force_b[0] / size, -force_b[1] / size, -force_b[2] / size)
    east = None if field_b is None else _across(down, field_b)
    if east is None:
        east = _across(down, (1.0, 0.0, 0.0)) or _across(down, (0.0, 0.0, -down[0]))
    if east is None:
        raise ValueError(f"force {force_b} has no direction")
    return from_matrix((cross(east, down), east, down))


class Alignment(NamedTuple):
    """A window being averaged.

    Attributes:
        t_us: time of the newest sample.
        length_s: time covered so far.
        turn: attitude of the body against its attitude at the window's start.
        force, field: sums of the vectors in the axes of the window's start.
        forces, fields: their numbers; a field of zero shows no north and is none.
        rough_m_s2: by how much the size of a force has differed from gravity's, at most.
    """

    t_us: int
    length_s: float
    turn: Quat
    force: Vec3
    field: Vec3
    forces: int
    fields: int
    rough_m_s2: float = 0.0


def begin(sample: ImuSample) -> Alignment:
    """A window with its first sample."""
    empty = Alignment(sample.t_us, 0.0, IDENTITY, ZERO, ZERO, 0, 0)
    return _add(empty, sample)


def extend(window: Alignment, sample: ImuSample, bias_b: Vec3) -> Alignment:
    """The window with one more sample; `bias_b` is the gyro bias as far as known."""
    dt_s = (sample.t_us - window.t_us) * 1e-6
    w = sample.w_b
    phi = (dt_s * (w[0] - bias_b[0]), dt_s * (w[1] - bias_b[1]), dt_s * (w[2] - bias_b[2]))
    moved = window._replace(
        t_us=sample.t_us,
        length_s=window.length_s + dt_s,
        turn=multiply(window.turn, exp(phi)),
    )
    return _add(moved, sample)


def attitude(window: Alignment) -> Quat:
    """q_nb at the newest sample.

    Raises:
        ValueError: the window's forces cancel.
    """
    start = triad(window.force, window.field if window.fields else None)
    return multiply(start, window.turn)


def _add(window: Alignment, sample: ImuSample) -> Alignment:
    rough_m_s2 = window.rough_m_s2
    if sample.f_b != ZERO:
        rough_m_s2 = max(rough_m_s2, abs(math.hypot(*sample.f_b) - GRAVITY_M_S2))
    added = window._replace(
        force=plus(window.force, rotate(window.turn, sample.f_b)),
        forces=window.forces + 1,
        rough_m_s2=rough_m_s2,
    )
    if sample.m_b_ut is None or sample.m_b_ut == ZERO:
        return added
    field = plus(window.field, rotate(window.turn, sample.m_b_ut))
    return added._replace(field=field, fields=window.fields + 1)


def _across(down: Vec3, v: Vec3) -> Vec3 | None:
    """The unit vector of down x v; None if they are nearly parallel."""
    c = cross(down, v)
    sine = math.hypot(*c)
    if not sine > _MIN_ANGLE * math.hypot(*v):
        return None
    return (c[0] / sine, c[1] / sine, c[2] / sine)
