"""Rotations as 3x3 matrices with numpy: exponential, logarithm and their Jacobians.

For offline work and batches; the per-sample path uses `h2nav.maths.quaternion`. `exp` and the
Jacobians accept complex vectors, so a complex step differentiates through them.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]
# Real, or complex for a complex-step derivative.
Vector = npt.NDArray[Any]

# Below this angle (rad) the series beat the closed forms, which cancel; six terms reach 1e-16.
_SERIES_BELOW = 0.5


def hat(v: npt.ArrayLike) -> Vector:
    """[v]x, the (3, 3) matrix with [v]x u = v x u."""
    x, y, z = np.asarray(v)
    return np.array([[0.0 * x, -z, y], [z, 0.0 * x, -x], [-y, x, 0.0 * x]])


def vee(M: npt.ArrayLike) -> Vector:
    """The (3,) vector of a skew matrix; of another matrix, of its skew part."""
    M = np.asarray(M)
    return 0.5 * np.array([M[2, 1] - M[1, 2], M[0, 2] - M[2, 0], M[1, 0] - M[0, 1]])


def exp(phi: npt.ArrayLike) -> Vector:
    """The (3, 3) rotation by |phi| radians about phi. Source: docs/derivation.md Eq. (1.6)."""
    K = hat(phi)
    sinc, cosc, _ = _coefficients(_squared(phi))
    R: Vector = np.eye(3) + sinc * K + cosc * (K @ K)
    return R


def log(R: npt.ArrayLike) -> Matrix:
    """The (3,) rotation vector of R, the short way: length at most pi.

    At exactly pi both directions of the axis are right; one of them is returned.
    Source: docs/derivation.md Eq. (1.7).
    """
    R = np.asarray(R, dtype=np.float64)
    skew = vee(R)
    sine = float(np.linalg.norm(skew))
    cosine = 0.5 * (float(np.trace(R)) - 1.0)
    angle = float(np.arctan2(sine, cosine))
    if cosine > -0.5:
        # arcsin(s)/s from the same atan2: no cancellation on this side of 120 deg.
        scale = angle / sine if sine > 1e-150 else 1.0
        return scale * skew
    # Near pi the axis comes from the symmetric part, its sign from the skew one.
    symmetric = 0.5 * (R + R.T) - cosine * np.eye(3)
    column = symmetric[:, int(np.argmax(np.diag(symmetric)))]
    axis = column / np.linalg.norm(column)
    if axis @ skew < 0.0:
        axis = -axis
    result: Matrix = angle * axis
    return result


def left_jacobian(phi: npt.ArrayLike) -> Vector:
    """J_l: exp(phi + d) = exp(J_l d) exp(phi) to first order.

    Source: docs/derivation.md Eq. (1.8).
    """
    K = hat(phi)
    _, cosc, cubic = _coefficients(_squared(phi))
    J: Vector = np.eye(3) + cosc * K + cubic * (K @ K)
    return J


def right_jacobian(phi: npt.ArrayLike) -> Vector:
    """J_r: exp(phi + d) = exp(phi) exp(J_r d) to first order.

    Source: docs/derivation.md Eq. (1.9).
    """
    return left_jacobian(-np.asarray(phi))


def left_jacobian_inverse(phi: npt.ArrayLike) -> Vector:
    """J_l^-1, good up to just below 2 pi, where J_l is singular.

    Source: docs/derivation.md Eq. (1.10).
    """
    K = hat(phi)
    J: Vector = np.eye(3) - 0.5 * K + _inverse_coefficient(_squared(phi)) * (K @ K)
    return J


def right_jacobian_inverse(phi: npt.ArrayLike) -> Vector:
    """J_r^-1, good up to just below 2 pi, where J_r is singular.

    Source: docs/derivation.md Eq. (1.10).
    """
    return left_jacobian_inverse(-np.asarray(phi))


def _squared(phi: npt.ArrayLike) -> Any:
    """phi.phi without conjugation, as a complex step needs it."""
    x, y, z = np.asarray(phi)
    return x * x + y * y + z * z


def _coefficients(a2: Any) -> tuple[Any, Any, Any]:
    """The quotients sin a / a, (1 - cos a) / a^2, (a - sin a) / a^3 for the squared angle a2."""
    if abs(a2) < _SERIES_BELOW**2:
        return (
            _alternating(a2, (1.0, 6.0, 20.0, 42.0, 72.0, 110.0, 156.0)),
            _alternating(a2, (2.0, 12.0, 30.0, 56.0, 90.0, 132.0, 182.0)),
            _alternating(a2, (6.0, 20.0, 42.0, 72.0, 110.0, 156.0, 210.0)),
        )
    a = np.sqrt(a2)
    half = np.sin(0.5 * a) / a
    return np.sin(a) / a, 2.0 * half * half, (a - np.sin(a)) / (a2 * a)


def _alternating(a2: Any, divisors: tuple[float, ...]) -> Any:
    """1/d0 (1 - a2/d1 (1 - a2/d2 (1 - ...))), the common form of the three series."""
    total: Any = 1.0
    for divisor in reversed(divisors[1:]):
        total = 1.0 - a2 / divisor * total
    return total / divisors[0]


def _inverse_coefficient(a2: Any) -> Any:
    """(1 - (a/2) cot(a/2)) / a^2; finite at pi, where the quotient of sines is not."""
    if abs(a2) < _SERIES_BELOW**2:
        # Bernoulli numbers: x cot x = 1 - x^2/3 - x^4/45 - 2 x^6/945 - ...
        terms = (1 / 12, 1 / 720, 1 / 30240, 1 / 1209600, 1 / 47900160, 691 / 1307674368000)
        total: Any = 0.0
        for term in reversed(terms):
            total = term + a2 * total
        return total
    half = 0.5 * np.sqrt(a2)
    return (1.0 - half * np.cos(half) / np.sin(half)) / a2
