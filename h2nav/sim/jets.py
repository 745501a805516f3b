"""Functions of time with their first three derivatives: motions are exact to their jerk.

A jet is the tuple (x, x', x'', x''') at one instant. The scenarios are sums and products of the few
jets below; derivatives then follow by the product rule and are never differenced.
"""

import math
from collections.abc import Sequence

Jet = tuple[float, float, float, float]

ZERO: Jet = (0.0, 0.0, 0.0, 0.0)


def constant(x: float) -> Jet:
    """The constant function x."""
    return (x, 0.0, 0.0, 0.0)


def sinusoid(t_s: float, amplitude: float, omega_rad_s: float, phase_rad: float = 0.0) -> Jet:
    """``amplitude * sin(omega t + phase)``."""
    s = amplitude * math.sin(omega_rad_s * t_s + phase_rad)
    c = amplitude * math.cos(omega_rad_s * t_s + phase_rad)
    w = omega_rad_s
    return (s, w * c, -w * w * s, -w * w * w * c)


def step(t_s: float, start_s: float, length_s: float) -> Jet:
    """A rise from 0 to 1 between `start_s` and `start_s + length_s`, three times differentiable.

    The polynomial of degree seven whose first three derivatives vanish at both ends.
    """
    x = (t_s - start_s) / length_s
    if x <= 0.0:
        return ZERO
    if x >= 1.0:
        return (1.0, 0.0, 0.0, 0.0)
    y = 1.0 - x
    x2 = x * x
    return (
        x2 * x2 * (35.0 + x * (-84.0 + x * (70.0 - 20.0 * x))),
        140.0 * x2 * x * y * y * y / length_s,
        420.0 * x2 * y * y * (1.0 - 2.0 * x) / length_s**2,
        840.0 * x * y * (1.0 - 5.0 * x + 5.0 * x2) / length_s**3,
    )


def ramp(t_s: float, start_s: float, length_s: float) -> Jet:
    """The integral of `step`: zero, then a smooth bend, then slope one."""
    x = (t_s - start_s) / length_s
    if x <= 0.0:
        return ZERO
    value = length_s * x**5 * (7.0 + x * (-14.0 + x * (10.0 - 2.5 * x)))
    if x >= 1.0:
        value = t_s - start_s - 0.5 * length_s
    rise = step(t_s, start_s, length_s)
    return (value, rise[0], rise[1], rise[2])


def scaled(a: Jet, factor: float) -> Jet:
    """``factor * a``."""
    return (factor * a[0], factor * a[1], factor * a[2], factor * a[3])


def total(terms: Sequence[Jet]) -> Jet:
    """The sum of `terms`."""
    x = dx = ddx = dddx = 0.0
    for term in terms:
        x += term[0]
        dx += term[1]
        ddx += term[2]
        dddx += term[3]
    return (x, dx, ddx, dddx)


def product(a: Jet, b: Jet) -> Jet:
    """``a * b`` by Leibniz' rule."""
    return (
        a[0] * b[0],
        a[1] * b[0] + a[0] * b[1],
        a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2],
        a[3] * b[0] + 3.0 * (a[2] * b[1] + a[1] * b[2]) + a[0] * b[3],
    )
