"""Linear models with unknowns of known size, compared by the likelihood of the measurements.

Rows are changes between noisy values, so that neighbours share a value; a second noise grows with
the length of a row. Columns come in two halves, north and east, of the same covariance. Unknowns
are integrated out.

Equations: docs/integrity.md, section 5.
"""

import math
from array import array
from collections.abc import Iterable, Sequence
from itertools import chain
from operator import mul
from types import ModuleType
from typing import NamedTuple

from h2nav.attitude.native import compiled_or
from h2nav.integrity import normal_equations

NOTHING = array("d")


class HypothesisFit(NamedTuple):
    """The fit of a hypothesis."""

    root: "array[float]" = NOTHING  # lower triangle, row by row, of I + S A^T A S
    forward: "array[float]" = NOTHING  # its solution for S A^T z
    # its logarithm, up to a constant shared by all hypotheses of the same noise
    likelihood: float = 0.0
    sigmas: "array[float]" = NOTHING  # prior deviations of the unknowns
    sums: ModuleType = normal_equations  # that made it: compiled, or in Python

    @property
    def explained(self) -> float:
        """The part of the residuals' square that the unknowns explain."""
        return dot(self.forward, self.forward)

    def unknowns(self) -> list[float]:
        """The most probable ones."""
        found = _numbers(len(self.forward))
        self.sums.unknowns(self.root, self.forward, self.sigmas, found)
        return found.tolist()

    def covariance(self, places: Sequence[int]) -> list[list[float]]:
        """The covariance of some unknowns."""
        sums, count = self.sums, len(self.forward)
        solved, found = _numbers(len(places) * count), _numbers(len(places) ** 2)
        sums.spread(self.root, self.sigmas, bytes(places), solved)
        sums.products(solved, solved, count, 0, found)
        return [found[i : i + len(places)].tolist() for i in range(0, len(found), len(places))]


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
        self._sums, self._rows = compiled_or(normal_equations), len(lengths_s)
        factors = whitening(lengths_s, *noise)
        self._factors = array("d", chain.from_iterable(factors))
        self._columns = self._white(columns, 0)
        self._left = self._white([left], 0)
        self._products = self._crossed(self._columns, self._columns, 0)
        self._right = self._crossed(self._columns, self._left, 0)
        self.square = dot(self._left, self._left)  # of the residuals
        # logarithm of the likelihood without unknowns, up to a constant
        self.level = 2.0 * sum(math.log(scale) for scale, _ in factors) - 0.5 * self.square

    @property
    def values(self) -> int:
        """How many residuals there are."""
        return 2 * self._rows

    def fit(self, sigmas: Sequence[float]) -> HypothesisFit:
        """Integrates the unknowns out, given their prior deviations.

        Source: docs/integrity.md Eq. (5).
        """
        prior, count = array("d", sigmas), len(sigmas)
        root, forward = _numbers(count * (count + 1) // 2), _numbers(count)
        likelihood = self._sums.fit(self._products, self._right, prior, root, forward)
        return HypothesisFit(root, forward, likelihood, prior, self._sums)

    def since(self, begun: int, shapes: Sequence[Sequence[float]]) -> "Since":
        """Further unknowns that begin with a row, by their columns from there on."""
        white = self._white(shapes, begun)
        return Since(
            self._crossed(white, self._columns, begun),
            self._crossed(white, white, begun, are_short=True),
            self._crossed(white, self._left, begun),
        )

    def misfits(self, fit: HypothesisFit) -> list[float]:
        """Square of each row's residuals with the most probable unknowns, whitened."""
        left, wide = self._left.tolist(), 2 * self._rows
        for number, unknown in enumerate(fit.unknowns()):
            column = self._columns[number * wide : (number + 1) * wide]
            left = [z - unknown * x for z, x in zip(left, column, strict=True)]
        return [
            north * north + east * east for north, east in zip(left[::2], left[1::2], strict=True)
        ]

    def _white(self, columns: Iterable[Sequence[float]], begun: int) -> "array[float]":
        """Columns north and east in turn, whitened, of values from a row on."""
        values = array("d", chain.from_iterable(columns))
        white = _numbers(len(values))
        self._sums.whiten(self._factors[2 * begun :], values, white)
        return white

    def _crossed(
        self, one: "array[float]", other: "array[float]", begun: int, *, are_short: bool = False
    ) -> "array[float]":
        """Products of columns from a row on with others, from the first row on or as short."""
        length = 2 * (self._rows - begun)
        skipped = 0 if are_short else 2 * begun
        found = _numbers(len(one) // length * (len(other) // (length + skipped)))
        self._sums.products(one, other, length, skipped, found)
        return found


def model_of_one_noise(left: Sequence[float], columns: Sequence[Sequence[float]]) -> LinearModel:
    """The model of values of any number that all have the same noise, of deviation 1."""
    # Its values come in pairs.
    missing = [0.0] * (len(left) % 2)
    wide = [[*values, *missing] for values in (left, *columns)]
    return LinearModel([1.0] * (len(wide[0]) // 2), wide[0], wide[1:], (0.0, 1.0))


class NoiseSearch(NamedTuple):
    """How the noise of rows is found."""

    first: float  # what it is taken for before
    least: float  # what it is at least
    fits: int  # how often


def fit_of_unknown_noise(
    model: LinearModel, sigmas: Sequence[float], search: NoiseSearch
) -> tuple[HypothesisFit, float, float]:
    """Fits unknowns to values whose noise, of deviation 1 in the model, is what they leave.

    Returns:
        The last fit, the noise that it was given, and the one that it leaves.
    """
    noise, fit, left = search.first, HypothesisFit(), search.first
    for _ in range(search.fits):
        noise = left
        fit = model.fit([sigma / noise for sigma in sigmas])
        rest = max(model.square - fit.explained, 0.0)
        left = max(math.sqrt(rest / model.values), search.least)
    return fit, noise, left


class Since:
    """Further unknowns of a model that begin with one of its rows.

    Args:
        crossed: products of their columns with the model's own columns.
        own: and with each other.
        right: and with the residuals.
    """

    def __init__(self, crossed: "array[float]", own: "array[float]", right: "array[float]") -> None:
        self._further = crossed, own, right

    def fit(self, base: HypothesisFit, places: Sequence[int], sigma: float) -> HypothesisFit:
        """Extends a fit of the model's own unknowns by some of these, with one prior deviation.

        Source: docs/integrity.md Eq. (5).
        """
        known, count = len(base.forward), len(base.forward) + len(places)
        root = base.root + _numbers(count * (count + 1) // 2 - len(base.root))
        forward = base.forward + _numbers(count - known)
        likelihood = base.sums.extend(
            (base.sigmas, base.likelihood), self._further, bytes(places), sigma, (root, forward)
        )
        sigmas = base.sigmas + array("d", [sigma] * len(places))
        return HypothesisFit(root, forward, likelihood, sigmas, base.sums)

    def likelihoods(
        self, base: HypothesisFit, extensions: Sequence[tuple[Sequence[int], float]]
    ) -> "array[float]":
        """Those of `fit` for several places and deviations."""
        sizes, found = array("d", [sigma for _, sigma in extensions]), _numbers(len(extensions))
        wanted = b"".join(bytes((len(places), *places)) for places, _ in extensions)
        known = base.sigmas, base.likelihood, base.root, base.forward
        base.sums.likelihoods(known, self._further, wanted, sizes, found)
        return found


def _numbers(count: int) -> "array[float]":
    """Zeros, to be written."""
    return array("d", bytes(8 * count))


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
