"""Normal equations with values at knots: the same as with a full matrix."""

import numpy as np
import pytest

from h2nav.calibration.knots import Knots, normal, prior

ROWS, VALUES, KINDS = 90, 4, 3
RNG = np.random.default_rng(5)
FLIGHT = np.repeat((3, 8), (50, 40))
T_S = np.concatenate((np.cumsum(RNG.uniform(0.2, 3.0, 50)), np.cumsum(RNG.uniform(0.2, 3.0, 40))))
KNOTS = Knots.of(FLIGHT, T_S, 10.0)
OWN, TURNED = RNG.normal(size=(ROWS, 2, VALUES)), RNG.normal(size=(ROWS, 2, KINDS))
WEIGHT, LEFT = RNG.uniform(0.1, 2.0, ROWS), RNG.normal(size=(ROWS, 2))
SIGMA = np.array((0.5, 1.0, 2.0, 3.0))


def beside(knots: Knots) -> np.ndarray:
    """Information with the next knot; nothing joins two flights."""
    return np.where(np.roll(knots.begins, -1), 0.0, -0.7)


BLOCKS = [(np.full(KNOTS.number, 2.0 + kind), beside(KNOTS)) for kind in range(KINDS)]
SHOWN, KNOWN = normal(OWN, TURNED, KNOTS, WEIGHT, LEFT), prior(SIGMA, BLOCKS)


def hats() -> np.ndarray:
    """(N, K) share of each knot in each row, by hand."""
    found = np.zeros((ROWS, KNOTS.number))
    found[np.arange(ROWS), KNOTS.place] = 1.0 - KNOTS.share
    found[np.arange(ROWS), KNOTS.place + 1] = KNOTS.share
    return found


def full() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Information of the rows and of the prior, and the gradient, of all values in one matrix."""
    swings = (TURNED[:, :, None, :] * hats()[:, None, :, None]).reshape(ROWS, 2, -1)
    J = np.concatenate((OWN, swings), axis=2)
    known = np.zeros((J.shape[2], J.shape[2]))
    known[:VALUES, :VALUES] = np.diag(SIGMA**-2)
    for kind, (diagonal, later) in enumerate(BLOCKS):
        at = VALUES + KINDS * np.arange(KNOTS.number) + kind
        known[at, at] = diagonal
        known[at[:-1], at[1:]] = known[at[1:], at[:-1]] = later[:-1]
    A = np.einsum("n,nca,ncb->ab", WEIGHT, J, J)
    return A, known, np.einsum("n,nca,nc->a", WEIGHT, J, LEFT)


def test_the_values_are_those_of_the_full_matrix():
    A, known, gradient = full()
    expected = np.linalg.solve(A + known, gradient)
    own, knots = SHOWN.plus(KNOWN).reduced().solved()
    np.testing.assert_allclose(
        np.concatenate((own, knots.ravel())), expected, rtol=1e-9, atol=1e-12
    )


def test_some_values_can_be_held_at_zero():
    A, known, gradient = full()
    free = np.array((True, False, True, False))
    places = np.flatnonzero(np.concatenate((free, np.ones(len(A) - VALUES, bool))))
    expected = np.zeros(len(A))
    expected[places] = np.linalg.solve((A + known)[np.ix_(places, places)], gradient[places])
    own, knots = SHOWN.plus(KNOWN).reduced().solved(free)
    np.testing.assert_allclose(
        np.concatenate((own, knots.ravel())), expected, rtol=1e-9, atol=1e-12
    )


def test_the_deviations_are_those_of_the_full_matrix():
    A, known, _ = full()
    expected = np.linalg.inv(0.25 * A + known)
    left = SHOWN.times(0.25).plus(KNOWN)
    np.testing.assert_allclose(
        np.linalg.inv(left.reduced().own), expected[:VALUES, :VALUES], rtol=1e-9
    )
    at_knots = expected[VALUES:, VALUES:]
    np.testing.assert_allclose(
        left.covariance().reshape(at_knots.shape), at_knots, rtol=1e-7, atol=1e-12
    )
    by_kind = [at_knots[kind::KINDS, kind::KINDS] for kind in range(KINDS)]
    variance = np.stack([np.einsum("nk,kl,nl->n", hats(), C, hats()) for C in by_kind], axis=1)
    np.testing.assert_allclose(KNOTS.variance(left.covariance()), variance, rtol=1e-7)


def test_a_part_of_the_rows_can_be_taken_away():
    gone, kept = np.arange(20), np.arange(20, ROWS)
    one, other = (
        normal(OWN[rows], TURNED[rows], KNOTS.part(rows), WEIGHT[rows], LEFT[rows])
        for rows in (gone, kept)
    )
    for found, expected in zip(SHOWN.plus(one, -1.0), other, strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_part_without_rows_takes_nothing_away():
    none = np.arange(0)
    empty = normal(OWN[none], TURNED[none], KNOTS.part(none), WEIGHT[none], LEFT[none])
    assert not any(np.any(each) for each in empty)


def test_values_pull_back_to_what_is_known():
    _, known, _ = full()
    own, knots = RNG.normal(size=VALUES), RNG.normal(size=(KNOTS.number, KINDS))
    expected = known @ np.concatenate((own, knots.ravel()))
    pulled, swung = KNOWN.product(own, knots)
    np.testing.assert_allclose(np.concatenate((pulled, swung.ravel())), expected, atol=1e-12)
    against = SHOWN.against(KNOWN, own, knots)
    np.testing.assert_allclose(against.own_gradient, SHOWN.own_gradient - pulled)
    np.testing.assert_allclose(against.gradient, SHOWN.gradient - swung)


def test_without_own_values_the_knots_are_solved_alone():
    A, known, gradient = full()
    shown = normal(OWN[:, :, :0], TURNED, KNOTS, WEIGHT, LEFT)
    own, knots = shown.plus(prior(SIGMA[:0], BLOCKS)).reduced().solved()
    expected = np.linalg.solve((A + known)[VALUES:, VALUES:], gradient[VALUES:])
    assert not len(own)
    np.testing.assert_allclose(knots.ravel(), expected, rtol=1e-9, atol=1e-12)


def test_knots_are_even_within_each_flight_and_join_none():
    assert np.flatnonzero(KNOTS.begins).tolist() == [0, KNOTS.place[50]]
    assert KNOTS.step_s.max() <= 10.0
    np.testing.assert_allclose(KNOTS.at_rows(np.ones(KNOTS.number)), 1.0)
    for flight in (3, 8):
        rows = flight == FLIGHT
        at_s = KNOTS.at_rows(np.concatenate([_even(KNOTS, one) for one in (3, 8)]))[rows]
        np.testing.assert_allclose(at_s, T_S[rows], atol=1e-9)


def _even(knots: Knots, flight: int) -> np.ndarray:
    """Times of the knots of a flight."""
    own_s = T_S[flight == FLIGHT]
    first = int(knots.place[np.flatnonzero(flight == FLIGHT)[0]])
    last = int(knots.place[np.flatnonzero(flight == FLIGHT)[-1]]) + 1
    return np.linspace(own_s[0], own_s[-1], last - first + 1)


@pytest.mark.parametrize("rows", [1, 2])
def test_a_single_moment_has_two_knots(rows: int):
    knots = Knots.of(np.zeros(rows, np.int64), np.full(rows, 5.0), 10.0)
    assert knots.number == 2
    np.testing.assert_allclose(knots.at_rows(np.array((3.0, 9.0))), 3.0)


@pytest.mark.parametrize("count", range(2, 10))
def test_any_number_of_knots_is_solved(count: int):
    knots = Knots.of(np.zeros(ROWS, np.int64), np.linspace(0.0, 10.0 * (count - 1), ROWS), 10.0)
    assert knots.number == count
    known = prior(SIGMA, [(np.full(count, 2.0), beside(knots))] * KINDS)
    whole = normal(OWN, TURNED, knots, WEIGHT, LEFT).plus(known)
    own, swing = whole.reduced().solved()
    for found, expected in zip(
        whole.product(own, swing), (whole.own_gradient, whole.gradient), strict=True
    ):
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_knots_lie_evenly_over_each_flight_with_the_row_behind_each():
    """Ten seconds apart at most, two at least, also of a flight of one row."""
    flights = np.array([0] * 6 + [1])
    t_s = np.array([0.0, 1.0, 9.0, 12.0, 20.0, 24.0, 5.0])
    knots = Knots.of(flights, t_s, 10.0)
    assert knots.begins.tolist() == [True, False, False, False, True, False]
    assert knots.step_s == pytest.approx([8.0] * 4 + [1e-3] * 2)
    assert knots.row.tolist() == [0, 2, 4, 5, 6, 6]
    assert knots.place.tolist() == [0, 0, 1, 1, 2, 2, 4]
    assert knots.share == pytest.approx([0.0, 0.125, 0.125, 0.5, 0.5, 1.0, 0.0])
    assert knots.number == 6
