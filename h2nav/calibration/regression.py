"""Shared parts of the calibrations' fits: slow errors, robust weights, realistic variances.

Rows are weighted by their residuals (Geman-McClure); covariances allow for correlated residuals;
attitude errors are an Ornstein-Uhlenbeck process at knots, as wide as the attitude's own deviation
and no faster than a gyro drifts.
"""

import math
from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from h2nav.calibration.knots import Knots

Array = NDArray[np.floating[Any]]
Columns = TypeVar("Columns", bound=tuple[Any, ...])

# Knots, correlation time of the attitude's error, and drift of a gyro with estimated bias.
KNOT_S, HOLDS_S, DRIFT_RAD_S = 10.0, 60.0, math.radians(0.15)
LARGEST_SIGMA_RAD = math.pi / 2.0
# From coarse to fine: factors on the scale of the robust weights.
STARTS, ROUNDS, LAST_ROUNDS = (8.0, 4.0, 2.0), 2, 8
OUTLIER = 3.0
# Residuals are correlated over less than this; no flight has so many blocks.
BLOCK_S, BLOCKS = 30.0, 1_000_000
SETTLED = 1e-4


def wander(knots: Knots, sigma_rad: Array, least: float) -> tuple[Array, Array]:
    """Information on a slowly changing error angle of an attitude, rad^-2.

    Args:
        knots: where the angle is a value.
        sigma_rad: (N,) deviation of the attitude; infinite if unknown.
        least: lower limit of that, rad.

    Returns:
        (K,) of each knot, and (K,) with the next one.
    """
    sigma = sigma_rad[knots.row]
    sigma = np.where(np.isfinite(sigma), sigma, LARGEST_SIGMA_RAD).clip(least, LARGEST_SIGMA_RAD)
    begins, ends = knots.begins, np.roll(knots.begins, -1)
    # angle / sigma is a stationary process: its first value, and each step.
    hold = np.exp(-knots.step_s / HOLDS_S)
    fresh = 1.0 / (1.0 - hold**2)
    own = np.where(begins, 1.0, fresh) + np.where(ends, 0.0, fresh * hold**2)
    drift = (DRIFT_RAD_S * knots.step_s) ** -2
    diagonal = own / sigma**2 + drift * (2.0 - begins - ends)
    beside = -(fresh * hold / (sigma * np.roll(sigma, -1)) + drift)
    return diagonal, np.where(ends, 0.0, beside)


def together(rows: Sequence[Columns]) -> Columns:
    """Concatenates the rows of several flights."""
    made: Columns = type(rows[0])(*(np.concatenate(each) for each in zip(*rows, strict=True)))
    return made


def part_of(rows: Columns, wanted: NDArray[Any]) -> Columns:
    """The selected rows."""
    made: Columns = type(rows)(*(column[wanted] for column in rows))
    return made


def halves_of(rows: Columns) -> tuple[Columns, Columns]:
    """The first half and the second."""
    places = np.arange(len(rows[0]))
    later = places >= len(places) // 2
    return part_of(rows, ~later), part_of(rows, later)


def noise_of(length: Array, balance: Array) -> float:
    """Deviation of one axis by the weighted median of the residuals' lengths."""
    order = np.argsort(length)
    total = np.cumsum(balance[order])
    middle = length[order[min(np.searchsorted(total, 0.5 * total[-1]), len(order) - 1)]]
    return float(middle) / 1.538  # the median length of three unit normals


def robust(length: Array, noise: float | Array, start: float) -> Array:
    """(N,) weights, 0 to 1, of rows with these residuals."""
    weight: Array = (1.0 + (length / (OUTLIER * start * noise)) ** 2) ** -2
    return weight


def longer(
    flights: NDArray[np.int64], t_s: Array, residual: Array, weight: Array, count: int
) -> float:
    """Factor on the variance for correlated residuals.

    Compares sums over blocks of the flight with those of independent rows, less the part absorbed
    by the parameters.
    """
    block = np.floor(t_s / BLOCK_S).astype(np.int64) + BLOCKS * flights
    _, place = np.unique(block, return_inverse=True)
    sums = np.zeros((int(place.max()) + 1, residual.shape[1]))
    np.add.at(sums, place.ravel(), residual * weight[:, None])
    alone = float(weight**2 @ (residual**2).sum(axis=1))
    taken = sums.size / max(sums.size - count, 0.25 * sums.size)
    return max(1.0, taken * float((sums**2).sum()) / max(alone, 1e-12))
