"""Rigid motions SE(3) as 4 x 4 matrices, for batches and offline work.

A twist is (angular; linear), as in the sources: V = [w; v]. `T` maps points of the moving frame to
the fixed one. `h2nav.motion.rigid_step` is the per-sample counterpart.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from h2nav.maths import so3

Array = NDArray[np.float64]


def pose(R: ArrayLike, p: ArrayLike) -> Array:
    """T = [R p; 0 1].

    Args:
        R: (3, 3) rotation.
        p: (3,) position of the moving frame's origin, m.
    """
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = p
    return T


def inverse(T: Array) -> Array:
    """T^-1 = [R^T, -R^T p; 0 1]."""
    R = T[:3, :3]
    return pose(R.T, -R.T @ T[:3, 3])


def hat(twist: ArrayLike) -> Array:
    """The 4 x 4 matrix [V] of a twist (6,)."""
    V = np.asarray(twist, dtype=np.float64)
    matrix = np.zeros((4, 4))
    matrix[:3, :3] = so3.hat(V[:3])
    matrix[:3, 3] = V[3:]
    return matrix


def exp(twist: ArrayLike) -> Array:
    """The pose after a constant body twist (6,) for one second: the exponential of [V].

    Source: docs/motion.md Eq. (5).
    """
    V = np.asarray(twist, dtype=np.float64)
    return pose(so3.exp(V[:3]), so3.left_jacobian(V[:3]) @ V[3:])


def log(T: Array) -> Array:
    """The twist (6,) of the shortest rotation with exp(log(T)) = T; |angular part| <= pi."""
    phi = so3.log(T[:3, :3])
    return np.concatenate([phi, so3.left_jacobian_inverse(phi) @ T[:3, 3]])


def adjoint(T: Array) -> Array:
    """[Ad_T] (6, 6): a body twist to the spatial twist of the same motion.

    Source: docs/motion.md Eq. (1).
    """
    R = T[:3, :3]
    Ad = np.zeros((6, 6))
    Ad[:3, :3] = R
    Ad[3:, 3:] = R
    Ad[3:, :3] = so3.hat(T[:3, 3]) @ R
    return Ad
