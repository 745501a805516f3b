"""The sums of linear models: whitening, products, roots. All in flat arrays of doubles.

The extension has the same functions under the same names (`native/likelihood.c`), with the same
bits: sums are added one by one, from the first on. Triangles are packed, row by row. A root of n
unknowns belongs to I + S A^T A S, with S their prior deviations.

Equations: docs/integrity.md, section 5.
"""

import math
from array import array
from collections.abc import Iterable
from functools import reduce
from operator import add, mul


def whiten(factors: "array[float]", values: "array[float]", white: "array[float]") -> None:
    """Whitens columns, each north and then east; written north and east in turn.

    Args:
        factors: of each row its own scale, and the share of the previous white row.
        values: of the columns, one after the other.
        white: written.
    """
    wide = len(factors)
    scales, shares = factors[::2], factors[1::2]
    for at in range(0, len(values), wide):
        for axis in (0, 1):
            begun, before = at + axis * len(scales), 0.0
            place = at + axis
            for value, scale, share in zip(
                values[begun : begun + len(scales)], scales, shares, strict=True
            ):
                white[place] = before = scale * (value - share * before)
                place += 2


def products(
    one: "array[float]", other: "array[float]", length: int, skipped: int, found: "array[float]"
) -> None:
    """Scalar products of each column of one with each of the other.

    Args:
        one: columns of this length.
        other: columns that are longer, by what is skipped at their beginning.
        found: written, a row for each column of `one`.
    """
    wide = length + skipped
    columns = [one[i : i + length].tolist() for i in range(0, len(one), length)]
    others = [other[j + skipped : j + wide].tolist() for j in range(0, len(other), wide)]
    count = len(others)
    for i, column in enumerate(columns):
        for j, each in enumerate(others):
            mirrored = one is other and j < i
            found[i * count + j] = found[j * count + i] if mirrored else _dot(column, each)


def fit(
    crossed: "array[float]",
    right: "array[float]",
    sigmas: "array[float]",
    root: "array[float]",
    forward: "array[float]",
) -> float:
    """Integrates all unknowns out; returns the logarithm of the likelihood, up to a constant.

    Args:
        crossed: products of the columns with each other.
        right: and with the residuals.
        sigmas: prior deviations.
        root: written.
        forward: written, the root's solution for S A^T z.
    """
    count, likelihood = len(sigmas), 0.0
    for i, scale in enumerate(sigmas):
        line = crossed[i * count : i * count + i + 1]
        row = _row(line[:i], sigmas, scale, root)
        likelihood += _append_row(row, scale * scale * line[i], scale * right[i], root, forward)
    return likelihood


def extend(
    base: "tuple[array[float], float]",
    further: "tuple[array[float], array[float], array[float]]",
    places: bytes,
    sigma: float,
    grown: "tuple[array[float], array[float]]",
) -> float:
    """Extends a fit by further unknowns of one prior deviation; returns the new likelihood.

    Args:
        base: deviations of the unknowns that are fitted already, and the likelihood of the fit.
        further: products of the further columns with those of the fit, with each other, and with
            the residuals.
        places: which of them to add.
        sigma: their deviation.
        grown: root and forward solution of the fit, with room for the new rows, which are written.
    """
    (sigmas, likelihood), (crossed, own, right), (root, forward) = base, further, grown
    known, shapes = len(sigmas), len(right)
    for n, place in enumerate(places):
        of_known = crossed[place * known : (place + 1) * known]
        row = [sigma * part for part in _row(of_known, sigmas, 1.0, root)]
        for i, other in enumerate(places[:n], known):
            line = root[_begin(i) : _begin(i + 1)]
            product = sigma * sigma * own[place * shapes + other]
            row.append((product - _dot(row, line)) / line[-1])
        size = sigma * sigma * own[place * shapes + place]
        likelihood += _append_row(row, size, sigma * right[place], root, forward)
    return likelihood


def likelihoods(
    base: "tuple[array[float], float, array[float], array[float]]",
    further: "tuple[array[float], array[float], array[float]]",
    wanted: bytes,
    sizes: "array[float]",
    found: "array[float]",
) -> None:
    """Writes the likelihoods of a fit that is extended in several ways.

    Args:
        base: deviations, likelihood, root and forward solution of the fit.
        further: as for `extend`.
        wanted: of each extension how many unknowns it adds, and which.
        sizes: their deviation, of each.
        found: written.
    """
    sigmas, likelihood, root, forward = base
    at = 0
    for n, sigma in enumerate(sizes):
        more = wanted[at]
        places, at = wanted[at + 1 : at + 1 + more], at + 1 + more
        known = len(sigmas)
        rows = array("d", bytes(8 * (_begin(known + more) - _begin(known))))
        grown = root + rows, forward + array("d", bytes(8 * more))
        found[n] = extend((sigmas, likelihood), further, places, sigma, grown)


def unknowns(
    root: "array[float]", forward: "array[float]", sigmas: "array[float]", found: "array[float]"
) -> None:
    """Writes the most probable unknowns of a fit."""
    count = len(forward)
    solved = [0.0] * count
    for i in reversed(range(count)):
        rest = _dot((root[_begin(k) + i] for k in range(i + 1, count)), solved[i + 1 :])
        solved[i] = (forward[i] - rest) / root[_begin(i) + i]
        found[i] = sigmas[i] * solved[i]


def spread(
    root: "array[float]", sigmas: "array[float]", places: bytes, solved: "array[float]"
) -> None:
    """Writes a line for each of some unknowns; their products are the covariance of these."""
    count = len(sigmas)
    for n, place in enumerate(places):
        line = [0.0] * count
        for i in range(place, count):
            row = root[_begin(i) : _begin(i + 1)]
            line[i] = ((1.0 if i == place else 0.0) - _dot(row, line[:i])) / row[-1]
        solved[n * count : (n + 1) * count] = array("d", (sigmas[place] * part for part in line))


def _row(
    crossed: "array[float]", sigmas: "array[float]", scale: float, root: "array[float]"
) -> list[float]:
    """Another row of a root, but for its diagonal."""
    row: list[float] = []
    for i, (product, sigma) in enumerate(zip(crossed, sigmas, strict=False)):
        line = root[_begin(i) : _begin(i + 1)]
        row.append((scale * product * sigma - _dot(row, line)) / line[-1])
    return row


def _append_row(
    row: list[float], size: float, right: float, root: "array[float]", forward: "array[float]"
) -> float:
    """Closes a row by its diagonal and its forward solution; what it adds to the likelihood."""
    end = len(row)
    pivot = math.sqrt(1.0 + size - _dot(row, row))
    solved = (right - _dot(row, forward[:end])) / pivot
    root[_begin(end) : _begin(end + 1)] = array("d", (*row, pivot))
    forward[end] = solved
    return 0.5 * solved * solved - math.log(pivot)


def _begin(row: int) -> int:
    """Place of a row in a packed triangle."""
    return row * (row + 1) // 2


def _dot(a: Iterable[float], b: Iterable[float]) -> float:
    """Scalar product; of the shorter one. From Python 3.12 on, `sum` adds otherwise."""
    return reduce(add, map(mul, a, b), 0.0)
