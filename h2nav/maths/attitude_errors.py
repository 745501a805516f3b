"""Errors of an estimated attitude against the truth: total, heading and inclination.

The split is that of the comparison papers: with e = q_est conj(q_true), both to east-north-up (or
any frame with a vertical z axis), the inclination is the smallest rotation left for free heading.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from h2nav.maths.rows import Array, product, wrapped

_DEG = 180.0 / np.pi
BEYOND = 3.0


class AttitudeErrors(NamedTuple):
    """Errors of every sample, degrees; heading with sign, the others >= 0."""

    total: Array
    heading: Array
    inclination: Array


class Rms(NamedTuple):
    """Root mean squares over the scored samples, degrees."""

    total: float
    heading: float
    inclination: float


def errors(
    q_est: Array, q_true: Array, mask: npt.NDArray[np.bool_], heading_fixed: bool
) -> AttitudeErrors:
    """Errors of every sample, including those outside the mask.

    Args:
        q_est: (N, 4) estimate, sensor to earth, scalar first.
        q_true: (N, 4) truth, the same.
        mask: (N,) samples that determine a free heading offset.
        heading_fixed: False removes the circular mean of the heading error first.

    Source: docs/filter.md Eq. (29).
    """
    e = product(q_est, q_true * np.array([1.0, -1.0, -1.0, -1.0]))
    if not heading_fixed:
        headings = 2.0 * np.arctan2(e[mask, 3], e[mask, 0])
        offset = 0.5 * float(np.angle(np.mean(np.exp(1j * headings))))
        turn = np.array([[np.cos(offset), 0.0, 0.0, -np.sin(offset)]])
        e = product(turn, e)
    w, x, y, z = e.T
    heading = wrapped(2.0 * np.arctan2(z, w))
    tilt = np.hypot(x, y)
    # Arc tangents: an arc cosine near 1 loses half the digits of a small angle.
    return AttitudeErrors(
        total=2.0 * np.arctan2(np.hypot(tilt, z), np.abs(w)) * _DEG,
        heading=heading * _DEG,
        inclination=2.0 * np.arctan2(tilt, np.hypot(w, z)) * _DEG,
    )


def rms(found: AttitudeErrors, mask: npt.NDArray[np.bool_]) -> Rms:
    """Root mean squares over the samples of the mask."""
    return Rms(*(root_mean_square(values[mask]) for values in found))


def root_mean_square(values: Array) -> float:
    """Root mean square of all values."""
    return float(np.sqrt(np.mean(values**2)))


def honesty(name: str, error_deg: Array, sigma_deg: Array) -> dict[str, float | None]:
    """Consistency of predicted deviations: ``nees_NAME`` and ``NAME_beyond_3_sigma``.

    The first is the mean of (error / deviation) squared, 1 for a consistent prediction and more for
    an optimistic one; the second is the share of samples beyond three deviations. None without
    predictions. The predicted tilt deviation is that of both axes together (docs/filter.md Eq.
    (27)), so the expected square of the whole angle is its square, as for the heading.

    Args:
        sigma_deg: (N,) predicted deviations; NaN where there is none.
    """
    is_known = np.isfinite(sigma_deg) & (sigma_deg > 0.0)
    if not is_known.any():
        return {f"nees_{name}": None, f"{name}_beyond_3_sigma": None}
    ratio = np.abs(error_deg[is_known]) / sigma_deg[is_known]
    return {
        f"nees_{name}": float(np.mean(ratio**2)),
        f"{name}_beyond_3_sigma": float(np.mean(ratio > BEYOND)),
    }
