"""Linear models with unknowns of known size, compared by the likelihood of the measurements.

Rows are changes between noisy values, so that neighbours share a value; a second noise grows with
the length of a row. Columns come in two halves, north and east, of the same covariance. Unknowns
are integrated out.

Equations: docs/integrity.md, section 5.
"""

import math
from collections.abc import Sequence
from operator import mul
from typing import NamedTuple


class HypothesisFit(NamedTuple):
    """The fit of a hypothesis."""

    root: tuple[tuple[float, ...], ...] = ()  # lower triangle, row by row, of I + S A^T A S
    forward: tuple[float, ...] = ()  # its solution for S A^T z
    # its logarithm, up to a constant shared by all hypotheses of the same noise
    likelihood: float = 0.0
    sigmas: tuple[float, ...] = ()  # prior deviations of the unknowns

    @property
    def explained(self) -> float:
        """The part of the residuals' square that the unknowns explain."""
        return dot(self.forward, self.forward)

    def unknowns(self) -> list[float]:
        """The most probable ones."""
        root, found = self.root, [0.0] * len(self.root)
        for i in reversed(range(len(root))):
            rest = sum(root[k][i] * found[k] for k in range(i + 1, len(root)))
            found[i] = (self.forward[i] - rest) / root[i][i]
        return [sigma * part for sigma, part in zip(self.sigmas, found, strict=True)]

    def covariance(self, places: Sequence[int]) -> list[list[float]]:
        """The covariance of some unknowns."""
        solved = []
        for place in places:
            line = [0.0] * len(self.root)
            for i in range(place, len(line)):
                unit = 1.0 if i == place else 0.0
                line[i] = (unit - dot(self.root[i], line[:i])) / self.root[i][i]
            solved.append([self.sigmas[place] * part for part in line])
        return [[dot(one, other) for other in solved] for one in solved]


class LinearModel:
    """Whitened columns, and their normal equations.

    Args:
        lengths_s: of the rows.
        left: residuals, north and then east.
        columns: effect of each unknown on them.
        noise: deviation of single values, and density of the noise that grows with time.
    """

    def __init__(
        self,
        lengths_s: Sequence[float],
        left: Sequence[float],
        columns: Sequence[Sequence[float]],
        noise: tuple[float, float],
    ) -> None:
        self._factors = whitening(lengths_s, *noise)
        self._columns = [self._white(column, 0) for column in columns]
        self._left = self._white(left, 0)
        self._products = [
            [float(sum(map(mul, one, other))) for other in self._columns[: i + 1]]
            for i, one in enumerate(self._columns)
        ]
        self._right = [dot(one, self._left) for one in self._columns]
        self.square = dot(self._left, self._left)  # of the residuals
        # logarithm of the likelihood without unknowns, up to a constant
        self.level = 2.0 * sum(math.log(scale) for scale, _ in self._factors) - 0.5 * self.square

    def fit(self, sigmas: Sequence[float]) -> HypothesisFit:
        """Integrates the unknowns out, given their prior deviations.

        Source: docs/integrity.md Eq. (5).
        """
        root: list[tuple[float, ...]] = []
        forward: list[float] = []
        likelihood = 0.0
        for i, line in enumerate(self._products):
            scale, row = sigmas[i], _row(line[:i], sigmas, sigmas[i], root)
            pivot = math.sqrt(1.0 + scale * scale * line[i] - dot(row, row))
            solved = (scale * self._right[i] - dot(row, forward)) / pivot
            root.append((*row, pivot))
            forward.append(solved)
            likelihood += 0.5 * solved * solved - math.log(pivot)
        return HypothesisFit(tuple(root), tuple(forward), likelihood, tuple(sigmas))

    def since(self, begun: int, shapes: Sequence[Sequence[float]]) -> "Since":
        """Further unknowns that begin with a row, by their columns from there on."""
        white = [self._white(shape, begun) for shape in shapes]
        known, left = [column[2 * begun :] for column in self._columns], self._left[2 * begun :]
        crossed = [[float(sum(map(mul, one, other))) for other in known] for one in white]
        return Since(white, crossed, [dot(one, left) for one in white])

    def misfits(self, fit: HypothesisFit) -> list[float]:
        """Square of each row's residuals with the most probable unknowns, whitened."""
        left = self._left
        for unknown, column in zip(fit.unknowns(), self._columns, strict=True):
            left = [z - unknown * x for z, x in zip(left, column, strict=True)]
        return [
            north * north + east * east for north, east in zip(left[::2], left[1::2], strict=True)
        ]

    def _white(self, values: Sequence[float], begun: int) -> list[float]:
        """North and east in turn, whitened, of values from a row on."""
        factors = self._factors[begun:]
        count = len(factors)
        white = [0.0] * (2 * count)
        white[::2] = _whitened(values[:count], factors)
        white[1::2] = _whitened(values[count:], factors)
        return white


class Since:
    """Further unknowns of a model that begin with one of its rows.

    Args:
        white: their whitened columns.
        crossed: products with the model's own columns.
        right: products with the residuals.
    """

    def __init__(
        self, white: list[list[float]], crossed: list[list[float]], right: list[float]
    ) -> None:
        self._white, self._crossed, self._right = white, crossed, right
        self._solved: dict[tuple[int, int], list[float]] = {}

    def fit(self, base: HypothesisFit, places: Sequence[int], sigma: float) -> HypothesisFit:
        """Extends a fit of the model's own unknowns by some of these, with one prior deviation.

        Source: docs/integrity.md Eq. (5).
        """
        root, forward, likelihood = list(base.root), list(base.forward), base.likelihood
        count = len(root)
        for n, place in enumerate(places):
            row = [sigma * part for part in self._own(base, place)]
            for other, line in zip(places[:n], root[count:], strict=False):
                product = sigma * sigma * dot(self._white[place], self._white[other])
                row.append((product - dot(row, line)) / line[-1])
            size = dot(self._white[place], self._white[place])
            pivot = math.sqrt(1.0 + sigma * sigma * size - dot(row, row))
            solved = (sigma * self._right[place] - dot(row, forward)) / pivot
            root.append((*row, pivot))
            forward.append(solved)
            likelihood += 0.5 * solved * solved - math.log(pivot)
        sigmas = (*base.sigmas, *[sigma] * len(places))
        return HypothesisFit(tuple(root), tuple(forward), likelihood, sigmas)

    def _own(self, base: HypothesisFit, place: int) -> list[float]:
        """The part of a column that the model's own unknowns explain, in the axes of the root."""
        found = self._solved.get((id(base), place))
        if found is None:
            found = _row(self._crossed[place], base.sigmas, 1.0, base.root)
            self._solved[id(base), place] = found
        return found


def _row(
    products: Sequence[float],
    sigmas: Sequence[float],
    scale: float,
    root: Sequence[tuple[float, ...]],
) -> list[float]:
    """Another row of a root, but for its diagonal."""
    row: list[float] = []
    for product, sigma, line in zip(products, sigmas, root, strict=False):
        row.append((scale * product * sigma - sum(map(mul, row, line))) / line[-1])
    return row


def dot(a: Sequence[float], b: Sequence[float]) -> float:
    """Scalar product; of the shorter one."""
    return float(sum(map(mul, a, b)))


def mean(likelihoods: Sequence[float]) -> float:
    """Of likelihoods whose logarithms are given, as a logarithm."""
    best = max(likelihoods)
    return best + math.log(sum(math.exp(one - best) for one in likelihoods) / len(likelihoods))


def whitening(
    lengths_s: Sequence[float], noise: float, density: float
) -> list[tuple[float, float]]:
    """Factors of the covariance of changes between noisy values, plus a noisy rate.

    Neighbouring changes share a value: the covariance has one diagonal beside the main one, and so
    has its root. Source: docs/integrity.md Eq. (4).

    Returns:
        For each row its own scale, and the share of the previous white row.
    """
    variance, factors, before = noise * noise, [], math.inf
    for length_s in lengths_s:
        share = -variance / before
        scale = math.sqrt(2.0 * variance + density * length_s - share * share)
        factors.append((1.0 / scale, share))
        before = scale
    return factors


def _whitened(values: Sequence[float], factors: Sequence[tuple[float, float]]) -> list[float]:
    white, before = [], 0.0
    for value, (scale, share) in zip(values, factors, strict=True):
        before = scale * (value - share * before)
        white.append(before)
    return white
