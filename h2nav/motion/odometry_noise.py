"""Noise of wheel odometry: slip per metre, and the resulting covariance."""

import math
from collections.abc import Sequence
from typing import NamedTuple

from h2nav.maths import se2
from h2nav.maths.se2 import Matrix3, Planar
from h2nav.motion.wheels import Chassis

ZERO3: Matrix3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Slip(NamedTuple):
    """Random slip; variances grow with the distance, so the sum does not depend on the steps."""

    wheel_m_rtm: float  # one sigma of each wheel's distance after 1 m, m / sqrt(m)
    side_m_rtm: float  # one sigma of the sideways shift after 1 m, m / sqrt(m)

    def covariance(self, chassis: Chassis, ways: Sequence[float]) -> Matrix3:
        """Covariance of the body increment for the wheels' distances.

        Source: docs/motion.md Eq. (21).
        """
        rows = chassis.jacobian()
        variances = [self.wheel_m_rtm**2 * abs(way) for way in ways]
        side = self.side_m_rtm**2 * math.hypot(*chassis.motion(ways)[:2])

        def element(i: int, j: int) -> float:
            total = sum(a * b * v for a, b, v in zip(rows[i], rows[j], variances, strict=True))
            return total + side if i == j == 1 else total

        xx, xy, xt = element(0, 0), element(0, 1), element(0, 2)
        yy, yt, tt = element(1, 1), element(1, 2), element(2, 2)
        return ((xx, xy, xt), (xy, yy, yt), (xt, yt, tt))


def propagate(before: Matrix3, pose: Planar, after: Planar, motion: Planar, Q: Matrix3) -> Matrix3:
    """Covariance of (x, y, heading) after one exact-arc step.

    Args:
        before: covariance before the step.
        pose: before the step.
        after: pose after it.
        motion: the step's body increment.
        Q: covariance of `motion`.

    Source: docs/motion.md Eq. (22), (23).
    """
    dx, dy = after[0] - pose[0], after[1] - pose[1]
    F: Matrix3 = ((1.0, 0.0, -dy), (0.0, 1.0, dx), (0.0, 0.0, 1.0))
    c, s = math.cos(after[2]), math.sin(after[2])
    turn: Matrix3 = ((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0))
    G = _product(turn, se2.right_jacobian(motion))
    old, new = _sandwich(F, before), _sandwich(G, Q)
    (a, b, c2), (_, d, e), (_, _, f) = (
        (p[0] + q[0], p[1] + q[1], p[2] + q[2]) for p, q in zip(old, new, strict=True)
    )
    return ((a, b, c2), (b, d, e), (c2, e, f))


def _product(A: Matrix3, B: Matrix3) -> Matrix3:
    a, b, c = (
        (
            r[0] * B[0][0] + r[1] * B[1][0] + r[2] * B[2][0],
            r[0] * B[0][1] + r[1] * B[1][1] + r[2] * B[2][1],
            r[0] * B[0][2] + r[1] * B[1][2] + r[2] * B[2][2],
        )
        for r in A
    )
    return (a, b, c)


def _sandwich(A: Matrix3, P: Matrix3) -> Matrix3:
    """A P A^T."""
    x, y, z = zip(*A, strict=True)
    return _product(_product(A, P), (x, y, z))
