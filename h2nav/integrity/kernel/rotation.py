"""Unit quaternions, scalar first, as `h2nav.maths.quaternion` has them."""

import math


def turn(rate: list[float], time_s: float, out: list[float]) -> None:
    """Writes the rotation by a constant rate over a time."""
    x = time_s * rate[0]
    y = time_s * rate[1]
    z = time_s * rate[2]
    half = 0.5 * math.sqrt(x * x + y * y + z * z)
    scale = 0.5 - half * half / 12.0
    if half >= 1e-4:
        scale = 0.5 * math.sin(half) / half
    out[0] = math.cos(half)
    out[1] = scale * x
    out[2] = scale * y
    out[3] = scale * z


def multiply(p: list[float], q: list[float], out: list[float]) -> None:
    """Writes the product p q into another quaternion."""
    out[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3]
    out[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2]
    out[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1]
    out[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]


def rotate(q: list[float], v: list[float], out: list[float]) -> None:
    """Writes a vector of the inner frame in the outer one."""
    s = 2.0 * (q[2] * v[2] - q[3] * v[1])
    t = 2.0 * (q[3] * v[0] - q[1] * v[2])
    u = 2.0 * (q[1] * v[1] - q[2] * v[0])
    out[0] = v[0] + q[0] * s + q[2] * u - q[3] * t
    out[1] = v[1] + q[0] * t + q[3] * s - q[1] * u
    out[2] = v[2] + q[0] * u + q[1] * t - q[2] * s


def normalize(q: list[float]) -> None:
    """Makes the length 1."""
    size = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for i in range(4):
        q[i] = q[i] / size
