"""The finite-time correction of the twist observer: its error system and the exact flow of a step.

A correction acts along the error and depends only on its length u = |e|, so both the decay of u and
the integral that moves the bias have closed forms. The sampled correction cannot overshoot.
"""

import math
from typing import NamedTuple

from h2nav.maths.quaternion import Vec3

# Below this length the direction of an error is noise.
TINY = 1e-150


class Correction(NamedTuple):
    """The effect of a step of length T on an error of length u."""

    remaining: float  # the error's length after the step
    bias_step: float  # how far the bias estimate moves along the error


class FiniteTimeGains(NamedTuple):
    """Gains and exponent of the error system."""

    k1: float  # of the error, 1/s for a1 = 1
    k2: float  # of the bias, 1/s^2 for a1 = 1
    a1: float  # exponent, 1/2 < a1 <= 1; 1 is the linear observer

    @property
    def a2(self) -> float:
        """The bias exponent that makes the error system homogeneous: 2 a1 - 1."""
        return 2.0 * self.a1 - 1.0

    def correction(self, u: float, step_s: float) -> Correction:
        """The exact flow of u' = -k1 u^a1, b' = k2 u^a2 over a step.

        Args:
            u: length of the error, rad or m.
            step_s: length of the step.

        Source: docs/motion.md Eq. (9), (10).
        """
        k1, k2, a1 = self
        if u < TINY:
            return Correction(0.0, 0.0)
        if a1 == 1.0:
            remaining = u * math.exp(-k1 * step_s)
            return Correction(remaining, k2 / k1 * (u - remaining))
        left = u ** (1.0 - a1) - (1.0 - a1) * k1 * step_s
        remaining = left ** (1.0 / (1.0 - a1)) if left > 0.0 else 0.0
        return Correction(remaining, k2 / (k1 * a1) * (u**a1 - remaining**a1))

    def rates(self, e: Vec3, f: Vec3) -> tuple[Vec3, Vec3]:
        """(e', f') of one channel of the error system, at zero angular rate.

        Args:
            e: pose error (rotation vector or position), estimate against truth.
            f: bias estimate less true bias.

        Source: docs/motion.md Eq. (6).
        """
        length = math.hypot(*e)
        if length < TINY:
            return (-f[0], -f[1], -f[2]), (0.0, 0.0, 0.0)
        s1 = self.k1 * length ** (self.a1 - 1.0)
        s2 = self.k2 * length ** (self.a2 - 1.0)
        return (
            (-f[0] - s1 * e[0], -f[1] - s1 * e[1], -f[2] - s1 * e[2]),
            (s2 * e[0], s2 * e[1], s2 * e[2]),
        )

    def energy(self, e: Vec3, f: Vec3) -> float:
        """One channel's part of the Lyapunov function, which never increases.

        Source: docs/motion.md Eq. (7).
        """
        power = 1.0 + self.a2
        return self.k2 / power * math.pow(math.hypot(*e), power) + 0.5 * math.hypot(*f) ** 2
