"""One-sigma figures for a nonlinear observer, by statistical linearisation at its innovations."""

import math
from typing import NamedTuple

from h2nav.maths.quaternion import Vec3
from h2nav.motion.finite_time import FiniteTimeGains

# The innovations' statistics average over about this many poses.
MEMORY_POSES = 30.0
# 95 % of chi-square with three degrees of freedom, per degree.
CHANCE = 2.6
# No pose source is assumed to be better than this (rad or m, one sigma per axis).
FLOOR = 1e-4


class Innovations(NamedTuple):
    """Running statistics of one channel's errors against the measured pose."""

    mean_square: float = 0.0  # per axis, of the error less its running mean
    mean: Vec3 = (0.0, 0.0, 0.0)  # running mean, which is the error that has not yet converged
    step_s: float = 0.0  # running mean of the time between poses
    poses: int = 0  # number of poses so far

    def seen(self, e: Vec3, step_s: float) -> "Innovations":
        """Updates the statistics with the error `e`, `step_s` after the previous one."""
        poses = self.poses + 1
        share = 1.0 / min(float(poses), MEMORY_POSES)
        d = (e[0] - self.mean[0], e[1] - self.mean[1], e[2] - self.mean[2])
        spread = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]) / 3.0
        return Innovations(
            # (1 - share) d is the part of d that remains relative to the new mean.
            (1.0 - share) * (self.mean_square + share * spread),
            (
                self.mean[0] + share * d[0],
                self.mean[1] + share * d[1],
                self.mean[2] + share * d[2],
            ),
            self.step_s + share * (step_s - self.step_s),
            poses,
        )

    def sigmas(self, gains: FiniteTimeGains) -> tuple[float, float]:
        """One-sigma errors per axis of (pose, rate) right after a pose.

        Source: docs/motion.md Eq. (12).
        """
        spread = max(self.mean_square, FLOOR * FLOOR)
        mean_square = (self.mean[0] ** 2 + self.mean[1] ** 2 + self.mean[2] ** 2) / 3.0
        # Noise alone leaves this much in an exponential mean; only the rest is bias of the mean.
        chance = CHANCE * spread / max(min(float(self.poses), 2.0 * MEMORY_POSES - 1.0), 1.0)
        mean_square = max(mean_square - chance, 0.0)
        length = math.sqrt(3.0 * (spread + mean_square))
        k1 = gains.k1 * length ** (gains.a1 - 1.0)
        k2 = gains.k2 * length ** (gains.a2 - 1.0)
        bandwidth = 0.5 * (k1 * k1 + k2) / k1
        noise = spread / (1.0 + self.step_s * bandwidth) * self.step_s
        pose = noise * bandwidth + mean_square
        rate = noise * 0.5 * k2 * k2 / k1 + k1 * k1 * mean_square
        return math.sqrt(pose), math.sqrt(rate)
