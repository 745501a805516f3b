"""The columns of a window of velocity rows: compiled and in Python they have the same bits."""

import random
from array import array

import pytest

from h2nav.attitude.native import native_kernels
from h2nav.integrity import composition
from h2nav.integrity.composition import COLUMNS, MEASURED, TURNS, VECTORS
from tests.needs import absent


@pytest.mark.parametrize("rows", [1, 2, 7, 29])
def test_compiled_and_python_give_the_same_bits(rows: int) -> None:
    native = native_kernels()
    if native is None:
        absent("the extension is not built, or older")
    rng = random.Random(rows)
    sizes = (9, 5, 3 * VECTORS * rows, MEASURED * rows)
    given = [array("d", (rng.gauss(0.0, 1.0) for _ in range(size))) for size in sizes]
    results = []
    for compose in (native.compose, composition.compose):
        lengths = (2 * rows * COLUMNS, 3 * rows, 9 * rows, 3 * TURNS)
        found = tuple(array("d", [7.0] * length) for length in lengths)
        compose(*given, found)
        results.append(found)
    assert results[0] == results[1]
    assert all(7.0 not in part for part in results[0]), "all is written"
    with pytest.raises(ValueError, match="do not fit"):
        native.compose(given[0][1:], *given[1:], results[0])
