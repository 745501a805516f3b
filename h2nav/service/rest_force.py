"""The accelerometer's bias along the force at rest, by its size.

At rest the force is the local gravity g. By how much the mean force is larger is the bias b along
its direction u, and the scale's error s:

    |f| - g = u . b + s g + n

Both cannot be told apart; b has the same deviation along every axis, so that the most probable one
is along u. In level flight an error of the scale is one along z, too: what is wrong is removed
either way.
"""

import math

from h2nav.attitude.samples import Vec3
from h2nav.maths.units import GRAVITY_M_S2

# Mean over this long: the noise is nothing beside the scale.
LENGTH_US = 10_000_000
# ICM-42688-P: zero-g offset of a soldered part 20 mg, scale 0.5 %; gravity's anomalies.
BIAS_M_S2 = 0.020 * GRAVITY_M_S2
SCALE_M_S2 = 0.005 * GRAVITY_M_S2
ANOMALY_M_S2 = 0.003
SHARE = BIAS_M_S2**2 / (BIAS_M_S2**2 + SCALE_M_S2**2 + ANOMALY_M_S2**2)
# More is no accelerometer within its data sheet (60 mg), or no rest.
MAX_BIAS_M_S2 = 0.060 * GRAVITY_M_S2


class RestForce:
    """Averages the force at rest."""

    def __init__(self) -> None:
        self._begun_us: int | None = None
        self._count = 0
        self._sum = [0.0, 0.0, 0.0]

    def interrupt(self) -> None:
        """Forgets the samples: the vehicle moves."""
        self._begun_us = None

    def add(self, t_us: int, f_b: Vec3, gravity_m_s2: float) -> Vec3 | None:
        """Takes a force at rest.

        Returns:
            The accelerometer's bias, m/s^2, at the end of each window; None otherwise, and if the
            force is not that of a sound sensor at rest.
        """
        if self._begun_us is None:
            self._begun_us, self._count, self._sum = t_us, 0, [0.0, 0.0, 0.0]
        self._count += 1
        for axis, force in enumerate(f_b):
            self._sum[axis] += force
        if t_us - self._begun_us < LENGTH_US:
            return None
        self._begun_us = None
        size = math.hypot(*self._sum) / self._count
        excess = size - gravity_m_s2
        if abs(excess) > MAX_BIAS_M_S2:
            return None
        scale = SHARE * excess / (size * self._count)
        x, y, z = self._sum
        return scale * x, scale * y, scale * z
