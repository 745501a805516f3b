"""The source's own form of the twist observer: spatial errors, powers component by component.

A reference for documents and tests, not for flight: its error is scaled by the lever arm |p| of
the adjoint, and with 30 m of it and steps of 10 ms it diverges (pinned in tests/agreement).
`TwistObserver` is the estimator.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from h2nav.maths import se3
from h2nav.motion.finite_time import FiniteTimeGains

Array = NDArray[np.float64]


def sig(e: Array, power: float) -> Array:
    """|e|^power with the sign of e, component by component."""
    return np.sign(e) * np.abs(e) ** power


class SpatialTwistObserver:
    """V_s^ = Ad_T^ (V_imu - b^) - k1 sig^a1(e), b^' = k2 Ad_T^^T sig^a2(e), e = log(T^ T^-1).

    Source: docs/motion.md Eq. (2).

    Attributes:
        T: (4, 4) pose estimate, relative to the local origin.
        bias: (6,) estimated bias of (rad/s; m/s).

    Args:
        gains: of the error system.
        T: (4, 4) first pose estimate.
        origin: (3,) local origin; the errors see the lever arm from here only.
    """

    def __init__(self, gains: FiniteTimeGains, T: Array, origin: ArrayLike = (0, 0, 0)) -> None:
        self._gains = gains
        self._to_local = se3.pose(np.eye(3), -np.asarray(origin, dtype=np.float64))
        self.T = self._to_local @ T
        self.bias = np.zeros(6)

    def update(self, twist: ArrayLike, T_measured: Array, dt_s: float) -> Array:
        """One explicit Euler step of the source's equations.

        Args:
            twist: (6,) measured body twist (rad/s; m/s), bias still in it.
            T_measured: (4, 4) measured pose at the same time.
            dt_s: step.

        Returns:
            (6,) spatial twist estimate about the local origin.
        """
        e = se3.log(self.T @ se3.inverse(self._to_local @ T_measured))
        Ad = se3.adjoint(self.T)
        gains = self._gains
        V_s = Ad @ (np.asarray(twist) - self.bias) - gains.k1 * sig(e, gains.a1)
        self.bias = self.bias + dt_s * gains.k2 * Ad.T @ sig(e, gains.a2)
        self.T = se3.exp(dt_s * V_s) @ self.T
        return V_s
