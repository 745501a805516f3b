"""Uniform quintic B-splines: smooth motions with exact derivatives at any time, vectorised."""

import math

import numpy as np

from h2nav.maths.rows import Array

DEGREE = 5
# Rows: powers of u in [0, 1); columns: the six control points that act there. The basis of the
# uniform quintic B-spline, e.g. de Boor, A Practical Guide to Splines, ch. IX.
_BASIS = (
    np.array(
        [
            [1, 26, 66, 26, 1, 0],
            [-5, -50, 0, 50, 5, 0],
            [10, 20, -60, 20, 10, 0],
            [-10, 20, 0, -20, 10, 0],
            [5, -20, 30, -20, 5, 0],
            [-1, 5, -10, 10, -5, 1],
        ],
        dtype=np.float64,
    )
    / 120.0
)
DERIVATIVES = 4


class UniformSpline:
    """A curve over time; constant control points give a constant curve, exactly.

    Args:
        points: (K, C) control points; the curve is near the k-th at `step_s` k.
        step_s: between them.
    """

    def __init__(self, points: Array, step_s: float) -> None:
        self._points = np.concatenate((points[:1], points[:1], points, *[points[-1:]] * 4))
        self._step_s = step_s
        self._highest = len(self._points) - DEGREE - 1

    def jet(self, t_s: Array) -> Array:
        """(4, N, C) the curve and its first three derivatives, at (N,) times."""
        place = np.clip(t_s / self._step_s, 0.0, self._highest)
        knot = np.minimum(place.astype(np.int64), self._highest)
        u = place - knot
        near = self._points[knot[:, None] + np.arange(DEGREE + 1)]
        found = np.empty((DERIVATIVES, len(t_s), self._points.shape[1]))
        for order in range(DERIVATIVES):
            powers = np.zeros((len(t_s), DEGREE + 1))
            for n in range(order, DEGREE + 1):
                powers[:, n] = math.perm(n, order) * u ** (n - order)
            weights = powers @ _BASIS / self._step_s**order
            found[order] = np.einsum("nk,nkc->nc", weights, near)
        return found


def smoothed(points: Array, width: int) -> Array:
    """(K, C) moving means of control points."""
    if width <= 1:
        return points
    before = np.repeat(points[:1], width // 2, axis=0)
    after = np.repeat(points[-1:], width - 1 - width // 2, axis=0)
    sums = np.cumsum(np.concatenate((np.zeros_like(points[:1]), before, points, after)), axis=0)
    means: Array = (sums[width:] - sums[:-width]) / width
    return means
