"""Rotations in columns have the bits of single ones."""

import math
import random

import numpy as np
import pytest

from h2nav.maths import columns, quaternion, rows

TURNS = [
    *((0.0, 0.0, 0.0), (1e-9, 0.0, 0.0), (1.9e-4, 0.0, 0.0), (2.1e-4, 0.0, 0.0)),
    *((math.pi, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, -7.0)),
    *[tuple(random.Random(seed).gauss(0.0, 1.0) for _ in range(3)) for seed in range(500)],
]


def test_turns_and_their_logarithms() -> None:
    found = np.stack(columns.exp(tuple(np.array(TURNS).T)), axis=1)
    assert [tuple(q) for q in found.tolist()] == [quaternion.exp(turn) for turn in TURNS]
    quats = [*found.tolist(), [0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-0.5, 0.1, 0.2, 0.3]]
    back = np.stack(columns.log(tuple(np.array(quats).T)), axis=1)
    assert [tuple(v) for v in back.tolist()] == [quaternion.log(tuple(q)) for q in quats]


def test_products_and_length() -> None:
    q = columns.exp(tuple(np.array(TURNS).T))
    p = tuple(2.0 * part[::-1] for part in q)
    found = np.stack(columns.normalize(quaternion.multiply(p, q)), axis=1)
    ps, qs = (np.stack(each, axis=1).tolist() for each in (p, q))
    expected = [
        quaternion.normalize(quaternion.multiply(tuple(one), tuple(other)))
        for one, other in zip(ps, qs, strict=True)
    ]
    assert [tuple(each) for each in found.tolist()] == expected
    with pytest.raises(ValueError, match="no direction"):
        columns.normalize(tuple(np.zeros((4, 1))))


def test_euler_angles() -> None:
    angles = [*TURNS, (0.3, 0.5 * math.pi, 1.0), (-1.0, -0.5 * math.pi, 0.2)]
    found = np.stack(columns.from_euler(*np.array(angles).T), axis=1)
    quats = [quaternion.from_euler(*each) for each in angles]
    assert [tuple(q) for q in found.tolist()] == quats
    back = np.stack(columns.to_euler(tuple(found.T)), axis=1)
    assert [tuple(each) for each in back.tolist()] == [quaternion.to_euler(q) for q in quats]


def test_the_larger_is_chosen_as_in_python() -> None:
    nan = math.nan
    found = columns.larger(np.array([1.0, nan, 1.0, 0.0]), np.array([2.0, 1.0, nan, -0.0]))
    assert repr(found.tolist()) == repr([max(1.0, 2.0), max(nan, 1.0), max(1.0, nan), 0.0])


def test_cross_products_of_rows_are_numpys() -> None:
    a, b = np.random.default_rng(8).normal(size=(2, 200, 3))
    assert np.array_equal(rows.cross(a, b), np.cross(a, b))
    assert np.array_equal(rows.cross(a[0], b), np.cross(a[0], b))
