"""Vectors of three plain numbers, for the per-sample path."""

from collections.abc import Collection

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


def dot(u: Vec3, v: Vec3) -> float:
    """The scalar product u . v."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def square(u: Vec3) -> float:
    """The square of the length of u."""
    return u[0] * u[0] + u[1] * u[1] + u[2] * u[2]


def middle(u: Vec3, v: Vec3) -> Vec3:
    """The middle of u and v."""
    return 0.5 * (u[0] + v[0]), 0.5 * (u[1] + v[1]), 0.5 * (u[2] + v[2])


def mean(vectors: Collection[Vec3]) -> Vec3:
    """The mean of one vector or more."""
    x, y, z = (sum(axis) / len(vectors) for axis in zip(*vectors, strict=True))
    return x, y, z
