"""Every least-squares solver against an independent one, and its loss of digits by condition."""

import numpy as np
import pytest
import scipy.linalg
import scipy.optimize

from h2nav.errors import BadInput
from h2nav.maths.least_squares import SOLVERS, normal_equations, qr_solution, solve


def problem(seed, m=60, n=5, condition=50.0):
    rng = np.random.default_rng(seed)
    U = np.linalg.qr(rng.normal(size=(m, n)))[0]
    V = np.linalg.qr(rng.normal(size=(n, n)))[0]
    return U @ np.diag(np.geomspace(1.0, 1.0 / condition, n)) @ V.T, rng.normal(size=m)


def independent(A, b, solver):
    if solver == "ridge":
        n = A.shape[1]
        root = np.sqrt(1e-6 * np.sum(A * A) / n)
        stacked = np.vstack([A, root * np.eye(n)])
        return scipy.optimize.lsq_linear(stacked, np.concatenate([b, np.zeros(n)]), tol=1e-14).x
    return scipy.linalg.lstsq(A, b, lapack_driver="gelsy")[0]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("seed", range(5))
def test_full_rank(solver, seed):
    A, b = problem(seed)
    np.testing.assert_allclose(
        solve(A, b, solver).x, independent(A, b, solver), rtol=1e-7, atol=1e-9
    )


@pytest.mark.parametrize("solver", ["qr", "svd", "min-norm", "normal"])
@pytest.mark.parametrize("shape", [(3, 6), (20, 6)])
def test_minimum_norm_of_deficient_data(solver, shape):
    rng = np.random.default_rng(9)
    A = rng.normal(size=(shape[0], 3)) @ rng.normal(size=(3, shape[1]))
    b = rng.normal(size=shape[0])
    expected = scipy.linalg.lstsq(A, b, cond=1e-10, lapack_driver="gelsd")[0]
    np.testing.assert_allclose(solve(A, b, solver).x, expected, atol=1e-10)


def error_of_normal_equations(A, b, x):
    try:
        return np.linalg.norm(normal_equations(A, b) - x) / np.linalg.norm(x)
    except BadInput:  # at 1e10 some are singular to rounding, and said to be so
        return np.inf


@pytest.mark.parametrize(
    ("condition", "qr_limit", "normal_floor"),
    [(1e2, 1e-13, 0.0), (1e5, 1e-10, 1e-9), (1e8, 1e-7, 1e-4), (1e10, 1e-5, 1e-2)],
)
def test_normal_equations_lose_twice_the_digits(condition, qr_limit, normal_floor):
    qr_errors, normal_errors = [], []
    for seed in range(5):
        A, _ = problem(seed, condition=condition)
        x = np.random.default_rng(seed + 100).normal(size=5)
        b = A @ x
        qr_errors.append(np.linalg.norm(qr_solution(A, b) - x) / np.linalg.norm(x))
        normal_errors.append(error_of_normal_equations(A, b, x))
    assert max(qr_errors) < qr_limit
    assert np.median(normal_errors) > normal_floor
    assert np.median(normal_errors) > np.median(qr_errors)
