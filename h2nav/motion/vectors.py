"""Vectors of three plain numbers, for the per-sample path."""

from h2nav.maths.quaternion import Vec3

ZERO: Vec3 = (0.0, 0.0, 0.0)


def plus(u: Vec3, v: Vec3) -> Vec3:
    """The sum u + v."""
    return (u[0] + v[0], u[1] + v[1], u[2] + v[2])


def minus(u: Vec3, v: Vec3) -> Vec3:
    """The difference u - v."""
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2])


def scaled(s: float, u: Vec3) -> Vec3:
    """The multiple s u."""
    return (s * u[0], s * u[1], s * u[2])


def cross(u: Vec3, v: Vec3) -> Vec3:
    """The vector product u x v."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
