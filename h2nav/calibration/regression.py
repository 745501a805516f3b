"""Shared parts of the calibrations' fits: slow errors, robust weights, realistic variances.

Rows are weighted by their residuals (Geman-McClure); covariances allow for correlated residuals;
attitude errors are an Ornstein-Uhlenbeck process at knots, as wide as the attitude's own deviation
and no faster than a gyro drifts.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

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


class Wander(NamedTuple):
    """A slowly changing error angle of an attitude."""

    hats: Array  # (N, K) share of each knot in each row
    information: Array  # (K, K) of the knots, rad^-2

    @property
    def knots(self) -> int:
        """How many."""
        return len(self.information)

    @classmethod
    def of(cls, flights: NDArray[np.int64], t_s: Array, sigma_rad: Array, least: float) -> "Wander":
        """Places knots in each flight.

        Args:
            flights: (N,) number of each row's flight.
            t_s: (N,) increasing within each.
            sigma_rad: (N,) deviation of the attitude; infinite if unknown.
            least: lower limit of that, rad.
        """
        hats, blocks = [], []
        for flight in np.unique(flights):
            number = np.flatnonzero(flights == flight)
            own_s = t_s[number]
            count = max(2, math.ceil((own_s[-1] - own_s[0]) / KNOT_S) + 1)
            at_s = np.linspace(own_s[0], max(own_s[-1], own_s[0] + 1e-3), count)
            place = np.clip(np.searchsorted(at_s, own_s, side="right") - 1, 0, count - 2)
            share = (own_s - at_s[place]) / (at_s[1] - at_s[0])
            hat = np.zeros((len(t_s), count))
            hat[number, place], hat[number, place + 1] = 1.0 - share, share
            near = np.clip(np.searchsorted(own_s, at_s), 0, len(own_s) - 1)
            sigma = sigma_rad[number][near]
            sigma = np.where(np.isfinite(sigma), sigma, LARGEST_SIGMA_RAD)
            hats.append(hat)
            blocks.append(_process(sigma.clip(least, LARGEST_SIGMA_RAD), float(at_s[1] - at_s[0])))
        return cls(np.hstack(hats), block_diagonal(blocks))


def _process(sigma_rad: Array, step_s: float) -> Array:
    """Information matrix of knots at this distance."""
    hold = math.exp(-step_s / HOLDS_S)
    count = len(sigma_rad)
    # x / sigma is a stationary process: its first value, and each step.
    rows = np.eye(count)
    rows[np.arange(1, count), np.arange(count - 1)] = -hold
    rows[1:] /= math.sqrt(1.0 - hold**2)
    rows /= sigma_rad[None, :]
    drift = np.diff(np.eye(count), axis=0) / (DRIFT_RAD_S * step_s)
    information: Array = rows.T @ rows + drift.T @ drift
    return information


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


def block_diagonal(blocks: list[Array]) -> Array:
    """Block-diagonal matrix of square blocks."""
    size = sum(map(len, blocks))
    found = np.zeros((size, size))
    first = 0
    for block in blocks:
        found[first : first + len(block), first : first + len(block)] = block
        first += len(block)
    return found


def normal(J: Array, w: Array, r: Array) -> tuple[Array, Array]:
    """(P, P) information and (P,) gradient of weighted rows."""
    flat = J.reshape(-1, J.shape[2])
    weighted = (J * w).reshape(flat.shape)
    return weighted.T @ flat, weighted.T @ r.ravel()


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
