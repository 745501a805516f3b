"""Least squares of a few values with slow ones beside them, such as a heading's error or the wind.

The slow ones are interpolated between knots, so that a row sees two knots and the few values. The
normal equations are a band with a border: solved in a time that grows with the length of a flight,
where a full matrix takes its third power.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded
from scipy.sparse import csr_array

Array = NDArray[np.floating[Any]]


class Knots(NamedTuple):
    """Where K knots lie among N rows."""

    place: NDArray[np.int64]  # (N,) the knot before each row
    share: Array  # (N,) 0 to 1, of the knot after it
    begins: NDArray[np.bool_]  # (K,) whether it is the first of a flight
    row: NDArray[np.int64]  # (K,) the first row after each knot
    step_s: Array  # (K,) distance to the next knot of the flight
    number: int  # K

    @classmethod
    def of(cls, flights: NDArray[np.int64], t_s: Array, apart_s: float) -> "Knots":
        """Spreads knots evenly over each flight, at most so far apart; two at least.

        Args:
            flights: (N,) number of each row's flight.
            t_s: (N,) increasing within each.
        """
        place, share = np.zeros(len(t_s), np.int64), np.zeros(len(t_s))
        begins, rows, steps, count = [], [], [], 0
        for flight in np.unique(flights):
            number = np.flatnonzero(flights == flight)
            own_s = t_s[number]
            own = max(2, math.ceil((own_s[-1] - own_s[0]) / apart_s) + 1)
            at_s = np.linspace(own_s[0], max(own_s[-1], own_s[0] + 1e-3), own)
            before = np.clip(np.searchsorted(at_s, own_s, side="right") - 1, 0, own - 2)
            place[number] = count + before
            share[number] = (own_s - at_s[before]) / (at_s[1] - at_s[0])
            begins.append(np.arange(own) == 0)
            rows.append(number[np.clip(np.searchsorted(own_s, at_s), 0, len(own_s) - 1)])
            steps.append(np.full(own, at_s[1] - at_s[0]))
            count += own
        row, step_s = np.concatenate(rows), np.concatenate(steps)
        return cls(place, share, np.concatenate(begins), row, step_s, count)

    def part(self, rows: NDArray[np.int64]) -> "Knots":
        """The same knots among some of the rows."""
        return self._replace(place=self.place[rows], share=self.share[rows])

    def at_rows(self, values: Array) -> Array:
        """(N, ...) of the values (K, ...) at the knots."""
        share = self.share.reshape(-1, *[1] * (values.ndim - 1))
        found: Array = (1.0 - share) * values[self.place] + share * values[self.place + 1]
        return found

    def gathered(self, rows: Array) -> Array:
        """(K, ...) sums of (N, ...) rows, each times its shares: the transpose of `at_rows`."""
        return self._sums((1.0 - self.share, self.share), rows)

    def squared(self, rows: Array) -> tuple[Array, Array]:
        """(K, ...) sums of rows times a share squared, and (K, ...) times it and the next one's."""
        later = self.share
        same = self._sums(((1.0 - later) ** 2, later**2), rows)
        return same, self._sums(((1.0 - later) * later, np.zeros_like(later)), rows)

    def variance(self, covariance: Array, kinds: int) -> Array:
        """(N, M) of what is interpolated, by the (K M, K M) covariance at the knots."""
        number = kinds * self.place[:, None] + np.arange(kinds)
        later, share = number + kinds, self.share[:, None]
        found: Array = (1.0 - share) ** 2 * covariance[number, number]
        found += share**2 * covariance[later, later]
        found += 2.0 * share * (1.0 - share) * covariance[number, later]
        return found

    def _sums(self, shares: tuple[Array, Array], rows: Array) -> Array:
        number = np.arange(len(rows))
        spread = csr_array(
            (
                np.concatenate(shares),
                (np.concatenate((self.place, self.place + 1)), np.concatenate((number, number))),
            ),
            shape=(self.number, len(rows)),
        )
        flat: Array = spread @ rows.reshape(len(rows), -1)
        return flat.reshape(self.number, *rows.shape[1:])


class Bordered(NamedTuple):
    """Normal equations of P values and of M at each of K knots; the latter in the knots' order."""

    own: Array  # (P, P)
    across: Array  # (K M, P)
    band: Array  # (2 M, K M) the diagonal and those below it
    own_gradient: Array  # (P,)
    gradient: Array  # (K M,)

    def plus(self, other: "Bordered", share: float = 1.0) -> "Bordered":
        """The sum of both, the other times a share."""
        return Bordered(*(a + share * b for a, b in zip(self, other, strict=True)))

    def times(self, factor: float) -> "Bordered":
        """All of it times a factor."""
        return Bordered(*(factor * each for each in self))

    def against(self, known: "Bordered", own: Array, knots: Array) -> "Bordered":
        """With the pull of what is known beforehand back from these values."""
        pulled, swung = known.product(own, knots)
        return self._replace(
            own_gradient=self.own_gradient - pulled, gradient=self.gradient - swung
        )

    def product(self, own: Array, knots: Array) -> tuple[Array, Array]:
        """(P,) and (K M,): the matrix times these values."""
        swing = self.band[0] * knots
        for k in range(1, len(self.band)):
            swing[k:] += self.band[k, :-k] * knots[:-k]
            swing[:-k] += self.band[k, :-k] * knots[k:]
        return self.own @ own + self.across.T @ knots, self.across @ own + swing

    def reduced(self) -> "Reduced":
        """What is left of them for the own values once the knots are eliminated."""
        sides = np.column_stack((self.across, self.gradient))
        solved = solveh_banded(self.band, sides, lower=True, check_finite=False)
        slope, at_zero = solved[:, :-1], solved[:, -1]
        return Reduced(
            self.own - self.across.T @ slope,
            self.own_gradient - self.across.T @ at_zero,
            slope,
            at_zero,
        )

    def covariance(self) -> Array:
        """(K M, K M) of the values at the knots, the own values being as uncertain as they are."""
        left = self.reduced()
        alone = solveh_banded(self.band, np.eye(len(self.gradient)), lower=True)
        found: Array = alone + left.slope @ np.linalg.solve(left.own, left.slope.T)
        return found


class Reduced(NamedTuple):
    """Normal equations of the own values, and the knots that belong to them."""

    own: Array  # (P, P) information; its inverse is the covariance
    gradient: Array  # (P,)
    slope: Array  # (K M, P)
    at_zero: Array  # (K M,)

    def solved(self, free: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """(P,) values, and (K M,) knots.

        Args:
            free: (P,) those to solve for; the others are 0. All without.
        """
        values = np.zeros(len(self.gradient))
        places = np.arange(len(values)) if free is None else np.flatnonzero(free)
        values[places] = np.linalg.solve(self.own[np.ix_(places, places)], self.gradient[places])
        return values, self.at_zero - self.slope @ values


def normal(own: Array, turned: Array, knots: Knots, w: Array, r: Array) -> Bordered:
    """Normal equations of weighted rows.

    Args:
        own: (N, C, P) derivatives of C components by the own values.
        turned: (N, C, M) by what is interpolated.
        w: (N,) weights.
        r: (N, C) residuals.
    """
    size = (own.shape[0] * own.shape[1], own.shape[2])
    weighted, pushed = own * w[:, None, None], turned * w[:, None, None]
    flat = weighted.reshape(size)
    across = knots.gathered(np.einsum("ncm,ncp->nmp", turned, weighted))
    same, later = knots.squared(np.einsum("nca,ncb->nab", turned, pushed))
    return Bordered(
        flat.T @ own.reshape(size),
        across.reshape(knots.number * turned.shape[2], size[1]),
        _band(same, later),
        flat.T @ r.ravel(),
        knots.gathered(np.einsum("ncm,nc->nm", pushed, r)).reshape(-1),
    )


def prior(sigma: Array, blocks: Sequence[tuple[Array, Array]]) -> Bordered:
    """Information of what is known beforehand, about 0.

    Args:
        sigma: (P,) deviations of the own values.
        blocks: of each of the M: (K,) diagonal, and (K,) with the next knot.
    """
    K, M = len(blocks[0][0]), len(blocks)
    same, later = np.zeros((K, M, M)), np.zeros((K, M, M))
    for m, (diagonal, beside) in enumerate(blocks):
        same[:, m, m], later[:, m, m] = diagonal, beside
    own, size = np.diag(sigma**-2), K * M
    return Bordered(
        own, np.zeros((size, len(own))), _band(same, later), np.zeros(len(own)), np.zeros(size)
    )


def _band(same: Array, later: Array) -> Array:
    """(2 M, K M) of the (K, M, M) blocks of the knots, and of each with the next."""
    K, M, _ = same.shape
    band = np.zeros((2 * M, K * M))
    for a in range(M):
        for b in range(M):
            if a >= b:
                band[a - b, b::M] = same[:, a, b]
            band[M + a - b, b : (K - 1) * M : M] = later[:-1, a, b]
    return band
