"""Rotations as rows and vectors as tuples: what single ones and numpy say of them."""

import math
from typing import NamedTuple

import numpy as np
import pytest

from h2nav.maths import frames, quaternion, rows, vectors

RNG = np.random.default_rng(8)
Q = RNG.normal(size=(20, 4))
Q /= np.linalg.norm(Q, axis=1)[:, None]
P = Q[::-1].copy()
U, V = RNG.normal(size=(2, 20, 3))


def single(function, *arrays):
    return np.array([function(*map(tuple, each)) for each in zip(*arrays, strict=True)])


def test_products_and_cross_products_are_those_of_single_ones() -> None:
    assert np.array_equal(rows.product(P, Q), single(quaternion.multiply, P, Q))
    assert np.array_equal(
        rows.product(P[:1], Q), single(quaternion.multiply, P[:1].repeat(20, 0), Q)
    )
    assert np.array_equal(rows.cross(U, V), single(vectors.cross, U, V))
    assert np.array_equal(rows.cross(U, V), np.cross(U, V))


def test_euler_angles_there_and_back() -> None:
    angles = rows.to_euler(Q)
    assert np.array_equal(angles, single(quaternion.to_euler, Q))
    same = np.abs(np.sum(rows.from_euler(angles) * Q, axis=1))
    assert same == pytest.approx(np.ones(20))


def test_frames_of_the_world_are_those_of_single_attitudes() -> None:
    assert np.array_equal(rows.enu_from_ned(Q), single(frames.attitude_enu_from_ned, Q))
    assert rows.enu_from_ned(Q[:0]).shape == (0, 4)
    # half a turn about north: east becomes west, down becomes up
    for q, turned, v in zip(Q, rows.ned_from_nwu(Q), V, strict=True):
        north, west, up = quaternion.rotate(tuple(q), tuple(v))
        assert quaternion.rotate(tuple(turned), tuple(v)) == pytest.approx((north, -west, -up))
    assert np.allclose(rows.ned_from_nwu(rows.ned_from_nwu(Q)), -Q)


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (0.0, 0.0),
        (3.14, 3.14),
        (math.pi, -math.pi),
        (3.15, 3.15 - math.tau),
        (-math.pi, -math.pi),
        (-3.15, math.tau - 3.15),
        (7.0 * math.tau + 1.0, 1.0),
    ],
)
def test_angles_are_within_half_a_turn(angle: float, expected: float) -> None:
    assert rows.wrapped(np.array([angle])) == pytest.approx([expected], abs=1e-12)


class Track(NamedTuple):
    t_s: np.ndarray
    v_n: np.ndarray
    name: str


@pytest.mark.parametrize(
    "wanted", [np.array([True, False, True]), np.array([0, 2]), slice(0, 3, 2)]
)
def test_rows_are_chosen_of_every_array(wanted: np.ndarray | slice) -> None:
    whole = Track(np.array([1.0, 2.0, 3.0]), np.arange(9.0).reshape(3, 3), "a track")
    found = rows.select_rows(whole, wanted)
    assert isinstance(found, Track)
    assert (found.t_s.tolist(), found.v_n.tolist(), found.name) == (
        [1.0, 3.0],
        [[0.0, 1.0, 2.0], [6.0, 7.0, 8.0]],
        "a track",
    )


def test_vectors_are_those_of_numpy() -> None:
    for u, v in zip(U, V, strict=True):
        a, b = tuple(u.tolist()), tuple(v.tolist())
        assert vectors.plus(a, b) == tuple(u + v)
        assert vectors.minus(a, b) == tuple(u - v)
        assert vectors.scaled(-3.0, a) == tuple(-3.0 * u)
        assert vectors.middle(a, b) == pytest.approx(tuple((u + v) / 2.0))
        assert vectors.dot(a, b) == pytest.approx(u @ v)
        assert vectors.square(a) == pytest.approx(u @ u)
    assert vectors.mean([tuple(u) for u in U]) == pytest.approx(tuple(U.mean(axis=0)))
