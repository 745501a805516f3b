"""The sums of linear models: compiled and in Python they have the same bits."""

import random
from array import array
from types import ModuleType
from typing import Any

import pytest

from h2nav.attitude.native import native_kernels
from h2nav.integrity import likelihood, normal_equations
from h2nav.integrity.likelihood import LinearModel
from tests.needs import absent

UNKNOWNS, SHAPES = 16, 13


@pytest.fixture
def compiled() -> ModuleType:
    native = native_kernels()
    if native is None:
        absent("the extension is not built, or older")
    return native


def results(rng: random.Random) -> list[float]:
    """All that a model of made-up rows gives, with unknowns from its beginning and from a row."""
    rows = rng.randint(6, 30)
    lengths_s = [rng.uniform(0.35, 0.5) for _ in range(rows)]
    left = [rng.gauss(0.0, 10.0 ** rng.randint(-3, 2)) for _ in range(2 * rows)]
    columns = [[rng.gauss(0.0, 1.0) for _ in range(2 * rows)] for _ in range(UNKNOWNS)]
    model = LinearModel(lengths_s, left, columns, (rng.uniform(0.05, 1.0), rng.random()))
    known = model.fit([abs(rng.gauss(0.0, 1.0)) for _ in range(UNKNOWNS)])
    begun = rng.randrange(rows - 1)
    shapes = [[rng.gauss(0.0, 1.0) for _ in range(2 * (rows - begun))] for _ in range(SHAPES)]
    since = model.since(begun, shapes)
    fits = [known, since.fit(known, (11, 12, 3, 4), 0.7), since.fit(known, (0,), 2.0)]
    found = [model.square, model.level, *model.misfits(known)]
    extensions = [((11, 12, 3, 4), 0.7), ((0,), 2.0), ((), 1.0), ((5, 6), 0.3)]
    found += since.likelihoods(known, extensions)
    assert found[-4:-2] == [one.likelihood for one in fits[1:]]
    assert found[-2] == known.likelihood
    for fit in fits:
        found += [fit.likelihood, fit.explained, *fit.unknowns(), *fit.root, *fit.sigmas]
    return found + [part for line in known.covariance((3, 5)) for part in line]


@pytest.mark.parametrize("seed", range(20))
def test_compiled_and_python_give_the_same_bits(
    seed: int, compiled: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    found: list[Any] = []
    for sums in (compiled, normal_equations):
        monkeypatch.setattr(likelihood, "compiled_or", lambda _, sums=sums: sums)
        found.append(results(random.Random(seed)))
    assert found[0] == found[1]


def test_a_fit_solves_the_normal_equations() -> None:
    # (I + S A^T A S) u = S A^T z with one white row of each axis
    model = LinearModel([1.0], [3.0, 4.0], [[1.0, 0.0], [1.0, 2.0]], (0.0, 1.0))
    fit = model.fit([2.0, 0.5])
    u, v = fit.unknowns()
    assert u / 4.0 + (u + v) == pytest.approx(3.0)
    assert v / 0.25 + (u + v) + 4.0 * v == pytest.approx(3.0 + 8.0)


def test_buffers_that_do_not_fit_are_refused(compiled: ModuleType) -> None:
    def some(count: int) -> "array[float]":
        return array("d", [1.0] * count)

    calls: list[tuple[str, tuple[Any, ...]]] = [
        ("whiten", (some(4), some(7), some(7))),
        ("whiten", (some(0), some(0), some(0))),
        ("products", (some(4), some(6), 2, 1, some(3))),
        ("products", (some(4), some(6), 0, 3, some(4))),
        ("products", (some(4), some(6), 2, -2, some(4))),
        ("fit", (some(3), some(2), some(2), some(3), some(2))),
        ("unknowns", (some(3), some(2), some(2), some(1))),
        ("unknowns", (some(65 * 33), some(65), some(65), some(65))),
    ]
    calls += [
        ("spread", (some(3), some(2), bytes([2]), some(2))),
        ("spread", (some(3), some(2), bytes([0, 1]), some(2))),
    ]
    further, grown = (some(2), some(1), some(1)), (some(6), some(3))
    calls += [
        ("extend", ((some(2), 0.0), further, bytes([1]), 1.0, grown)),
        ("extend", ((some(2), 0.0), further, bytes([0, 0]), 1.0, grown)),
        ("extend", ((some(1), 0.0), further, bytes([0]), 1.0, grown)),
    ]
    base = some(2), 0.0, some(3), some(2)
    calls += [
        ("likelihoods", (base, further, bytes([1, 1]), some(1), some(1))),  # of one shape
        ("likelihoods", (base, further, bytes([2, 0]), some(1), some(1))),
        ("likelihoods", (base, further, bytes([1, 0]), some(2), some(2))),
        ("likelihoods", (base, further, bytes([1, 0, 0]), some(1), some(1))),
        ("likelihoods", (base, further, bytes([1, 0]), some(1), some(2))),
        ("likelihoods", (base, further, bytes([63, *[0] * 63]), some(1), some(1))),
        ("likelihoods", ((some(2), 0.0, some(2), some(2)), further, b"", some(0), some(0))),
        ("likelihoods", ((some(2), 0.0, some(3), some(1)), further, b"", some(0), some(0))),
        ("likelihoods", (base, (some(1), some(1), some(1)), b"", some(0), some(0))),
        ("likelihoods", (base, (some(2), some(2), some(1)), b"", some(0), some(0))),
    ]
    for name, arguments in calls:
        with pytest.raises(ValueError, match="do not fit together"):
            getattr(compiled, name)(*arguments)
