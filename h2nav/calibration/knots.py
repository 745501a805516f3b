"""Least squares of a few values with slow ones beside them, such as a heading's error or the wind.

The slow ones are interpolated between knots, so that a row sees two knots and the few values. The
normal equations are blocks along a diagonal with a border: solved in a time that grows with the
length of a flight, where a full matrix takes its third power.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

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

    def variance(self, covariance: Array) -> Array:
        """(N, M) of what is interpolated, by the (K, M, K, M) covariance at the knots."""
        kinds, place, share = (
            np.arange(covariance.shape[1]),
            self.place[:, None],
            self.share[:, None],
        )
        found: Array = (1.0 - share) ** 2 * covariance[place, kinds, place, kinds]
        found += share**2 * covariance[place + 1, kinds, place + 1, kinds]
        found += 2.0 * share * (1.0 - share) * covariance[place, kinds, place + 1, kinds]
        return found

    def _sums(self, shares: tuple[Array, Array], rows: Array) -> Array:
        size = math.prod(rows.shape[1:])
        flat = rows.reshape(len(rows), size)
        number = self.place[:, None] * size + np.arange(size)
        sums: Array = np.zeros(self.number * size)
        for share, place in zip(shares, (number, number + size), strict=True):
            sums += np.bincount(place.ravel(), (share[:, None] * flat).ravel(), len(sums))
        return sums.reshape(self.number, *rows.shape[1:])


class Bordered(NamedTuple):
    """Normal equations of P values and of M at each of K knots."""

    own: Array  # (P, P)
    across: Array  # (K, M, P)
    same: Array  # (K, M, M) of each knot
    later: Array  # (K, M, M) with the next one, symmetric; the last is 0
    own_gradient: Array  # (P,)
    gradient: Array  # (K, M)

    def plus(self, other: "Bordered", share: float = 1.0) -> "Bordered":
        """The sum of both, the other times a share."""
        return Bordered(*(a + share * b for a, b in zip(self, other, strict=True)))

    def times(self, factor: float) -> "Bordered":
        """All of it times a factor."""
        return Bordered(*(factor * each for each in self))

    def product(self, own: Array, knots: Array) -> tuple[Array, Array]:
        """(P,) and (K, M): the matrix times these values."""
        swing = np.einsum("kab,kb->ka", self.same, knots) + self.across @ own
        swing[1:] += np.einsum("kab,kb->ka", self.later[:-1], knots[:-1])
        swing[:-1] += np.einsum("kab,kb->ka", self.later[:-1], knots[1:])
        return self.own @ own + np.einsum("kmp,km->p", self.across, knots), swing

    def against(self, known: "Bordered", own: Array, knots: Array) -> "Bordered":
        """With the pull of what is known beforehand back from these values."""
        pulled, swung = known.product(own, knots)
        return self._replace(
            own_gradient=self.own_gradient - pulled, gradient=self.gradient - swung
        )

    def reduced(self) -> "Reduced":
        """What is left of them for the own values once the knots are eliminated."""
        sides = np.concatenate((self.across, self.gradient[:, :, None]), axis=2)
        solved = _solved(self.same, self.later[:-1], sides)
        slope, at_zero = solved[:, :, :-1], solved[:, :, -1]
        return Reduced(
            self.own - np.einsum("kmp,kmq->pq", self.across, slope),
            self.own_gradient - np.einsum("kmp,km->p", self.across, at_zero),
            slope,
            at_zero,
        )

    def covariance(self) -> Array:
        """(K, M, K, M) of the knots, the own values being as uncertain as they are."""
        left = self.reduced()
        K, M = self.gradient.shape
        alone = _solved(self.same, self.later[:-1], np.eye(K * M).reshape(K, M, K * M))
        slope = left.slope.reshape(K * M, -1)
        both = alone.reshape(K * M, K * M) + slope @ np.linalg.solve(left.own, slope.T)
        return both.reshape(K, M, K, M)


class Reduced(NamedTuple):
    """Normal equations of the own values, and the knots that belong to them."""

    own: Array  # (P, P) information; its inverse is the covariance
    gradient: Array  # (P,)
    slope: Array  # (K, M, P)
    at_zero: Array  # (K, M)

    def solved(self, free: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """(P,) values, and (K, M) knots.

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
    return Bordered(
        flat.T @ own.reshape(size),
        knots.gathered(np.einsum("ncm,ncp->nmp", turned, weighted)),
        *knots.squared(np.einsum("nca,ncb->nab", turned, pushed)),
        flat.T @ r.ravel(),
        knots.gathered(np.einsum("ncm,nc->nm", pushed, r)),
    )


def prior(sigma: Array, blocks: Sequence[tuple[Array, Array]]) -> Bordered:
    """Information of what is known beforehand, about 0.

    Args:
        sigma: (P,) deviations of the own values.
        blocks: of each of the M: (K,) diagonal, and (K,) with the next knot.
    """
    P, K, M = len(sigma), len(blocks[0][0]), len(blocks)
    same, later = np.zeros((K, M, M)), np.zeros((K, M, M))
    for m, (diagonal, beside) in enumerate(blocks):
        same[:, m, m], later[:, m, m] = diagonal, beside
    own = np.diag(np.asarray(sigma) ** -2.0)
    return Bordered(own, np.zeros((K, M, P)), same, later, np.zeros(P), np.zeros((K, M)))


def _solved(same: Array, later: Array, sides: Array) -> Array:
    """Solves a symmetric positive definite block tridiagonal system by cyclic reduction.

    Every second block is eliminated, all of them at once, until one is left.

    Args:
        same: (K, M, M) the diagonal.
        later: (K - 1, M, M) below it.
        sides: (K, M, R) right-hand sides.
    """
    if len(same) == 1:
        alone: Array = np.linalg.solve(same, sides)
        return alone
    M, found = same.shape[1], np.empty_like(sides)
    # Of each odd block, with the one before it, and of the one after it with that; the last odd
    # block may have none after it.
    before, after = later[0::2], later[1::2]
    above = np.concatenate((after.mT, np.zeros((len(before) - len(after), M, M))))
    parts = np.linalg.solve(same[1::2], np.concatenate((before, above, sides[1::2]), axis=2))
    to_before, to_after, free = parts[:, :, :M], parts[:, :, M : 2 * M], parts[:, :, 2 * M :]
    kept, left = same[0::2].copy(), sides[0::2].copy()
    kept[: len(before)] -= before.mT @ to_before
    left[: len(before)] -= before.mT @ free
    kept[1:] -= after @ to_after[: len(after)]
    left[1:] -= after @ free[: len(after)]
    found[0::2] = _solved(kept, -(after @ to_before[: len(after)]), left)
    even = found[0::2]
    found[1::2] = free - to_before @ even[: len(before)]
    found[1::2][: len(after)] -= to_after[: len(after)] @ even[1:]
    return found
