"""Which lane a parameter of a test is in."""

import itertools
from collections.abc import Iterable
from typing import Any

import pytest


def few(count: int, values: Iterable[Any]) -> list[Any]:
    """The values of one argument, of which all but the first ones are thorough.

    For what one value shows already and the others show again, of other sizes or other seeds.
    """
    return few_rows(count, ((value,) for value in values))


def few_rows(count: int, rows: Iterable[tuple[Any, ...]]) -> list[Any]:
    """The same for several arguments."""
    marks = (() if place < count else pytest.mark.thorough for place in itertools.count())
    return [pytest.param(*row, marks=mark) for row, mark in zip(rows, marks, strict=False)]
