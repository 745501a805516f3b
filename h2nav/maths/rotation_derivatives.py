"""Derivatives of rotations by right perturbations, and how wrong the first-order update is.

A right perturbation of R is R Exp(phi); every derivative here is by phi at 0. numpy, for offline
work and tests.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from h2nav.maths import so3

Array = NDArray[np.float64]


def conjugated(R: Array, phi: ArrayLike) -> Array:
    """R Exp(phi) R^T, which is Exp(R phi): the adjoint of SO(3) is the rotation itself.

    Source: docs/rotations.md Eq. (1).
    """
    return np.asarray(so3.exp(R @ np.asarray(phi, dtype=np.float64)))


def back_rotation_by_rotation(R: Array, p: ArrayLike) -> Array:
    """Derivative d(R^-1 p)/dR = (R^-1 p)^, (3, 3).

    Source: docs/rotations.md Eq. (2).
    """
    return np.asarray(so3.hat(R.T @ np.asarray(p, dtype=np.float64)))


def relative_log_by_second(R1: Array, R2: Array) -> Array:
    """Derivative d ln(R1 R2^-1)/dR2 = -Jr^-1(ln(R1 R2^-1)) R2, (3, 3); |ln| below pi.

    Source: docs/rotations.md Eq. (3).
    """
    return np.asarray(-so3.right_jacobian_inverse(so3.log(R1 @ R2.T)) @ R2)


def relative_log_by_first(R1: Array, R2: Array) -> Array:
    """Derivative d ln(R1 R2^-1)/dR1 = Jr^-1(ln(R1 R2^-1)) R2, (3, 3); |ln| below pi.

    Source: docs/rotations.md Eq. (4).
    """
    return np.asarray(so3.right_jacobian_inverse(so3.log(R1 @ R2.T)) @ R2)


def first_order_angle(angle: float) -> float:
    """Angle that the normalised update [1, w/2] turns by for |w| = angle: 2 atan(angle/2).

    Source: docs/rotations.md Eq. (5).
    """
    return float(2.0 * np.arctan(0.5 * angle))


def first_order_norm(angle: float) -> float:
    """The length of [1, w/2] for |w| = angle; a rotation would have 1.

    Source: docs/rotations.md Eq. (6).
    """
    return float(np.hypot(1.0, 0.5 * angle))
