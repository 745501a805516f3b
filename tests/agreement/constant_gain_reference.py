"""The constant-gain filter in floats: the equations of docs/fixed-point.md with nothing rounded.

Every function is the unlimited counterpart of the integer kernel: exact exponential, exact norm.
"""

import math
from collections.abc import Sequence

import numpy as np

from h2nav.attitude.constant_gain.gains import (
    DIP_TOLERANCE,
    FIELD_TOLERANCE,
    FORCE_TOLERANCE,
    ConstantGains,
    Matrix,
)


def _matrix(entries: Matrix) -> np.ndarray:
    xx, xz, yy, zx, zz = entries
    return np.array([[xx, 0.0, xz], [0.0, yy, 0.0], [zx, 0.0, zz]])


def rotation(q: np.ndarray) -> np.ndarray:
    w, x, y, z = q
    return np.array(
        [
            [w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z],
        ]
    )


class ConstantGainReference:
    """Attitude and bias by constant gains.

    Args:
        gains: the gains; those of the integer image compare the arithmetic alone.
        q: first attitude, body to magnetic NED.
        boost_s: for so long each the attitude gain is 8, 4, 2 times as high.
    """

    def __init__(self, gains: ConstantGains, q: Sequence[float], boost_s: float) -> None:
        self.q = np.array(q) / np.linalg.norm(q)
        self.bias = np.zeros(3)
        self._pending = np.zeros(3)
        self._age_s = 0.0
        self._boost_s = boost_s
        self._attitude = _matrix(gains.attitude)
        self._bias_gain = _matrix(gains.bias)
        self._weight = gains.gravity_weight
        self._h = np.array([math.cos(gains.dip_rad), 0.0, math.sin(gains.dip_rad)])

    def update(
        self, w_b: np.ndarray, gravity: np.ndarray, field: np.ndarray | None, dt_s: float
    ) -> None:
        """Takes one sample, vectors in units of their norms."""
        turn = (w_b - self.bias) * dt_s + self._pending
        angle = float(np.linalg.norm(turn))
        half = np.concatenate([[math.cos(angle / 2)], 0.5 * np.sinc(angle / (2 * np.pi)) * turn])
        w, x, y, z = half
        self.q = np.array([[w, -x, -y, -z], [x, w, z, -y], [y, -z, w, x], [z, y, -x, w]]) @ self.q
        r = rotation(self.q)
        zeta = np.zeros(3)
        f = np.zeros(3) if field is None else r @ field
        if abs(gravity @ gravity - 1.0) <= FORCE_TOLERANCE:
            zeta += self._weight * np.cross(r @ gravity, [0.0, 0.0, 1.0])
        if field is not None and abs(field @ field - 1.0) <= FIELD_TOLERANCE:
            f = r @ field
            if abs(f[2] - self._h[2]) <= DIP_TOLERANCE or self._age_s < 3.0 * self._boost_s:
                share = 1.0 - self._weight
                zeta += np.array([share, share, 1.0]) * np.cross(f, self._h)
        boost = 2.0 ** max(0, 3 - math.floor(self._age_s / self._boost_s))
        self._age_s += dt_s
        self._pending = boost * (r.T @ self._attitude @ zeta)
        self.bias = self.bias - boost**2 * (r.T @ self._bias_gain @ zeta)
