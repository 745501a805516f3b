import numpy as np
import pytest

from h2nav.errors import BadInput
from h2nav.maths.least_squares import SOLVERS, minimum_norm, ridge_solution, solve


def tall(seed=0, m=30, n=4):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(m, n)), rng.normal(size=m)


@pytest.mark.parametrize("solver", SOLVERS)
def test_every_solver_finds_the_exact_answer_of_consistent_data(solver):
    A, _ = tall()
    x = np.array([1.0, -2.0, 0.5, 3.0])
    solution = solve(A, A @ x, solver, ridge=1e-14)
    np.testing.assert_allclose(solution.x, x, atol=1e-10)
    assert solution.rank == 4
    np.testing.assert_allclose(solution.residuals, 0.0, atol=1e-10)


def test_square_data_have_a_solution_and_no_covariance():
    A, b = tall(m=4)
    solution = solve(A, b)
    np.testing.assert_allclose(A @ solution.x, b, atol=1e-12)
    assert np.isnan(solution.covariance).all()


@pytest.mark.parametrize("solver", ["qr", "svd", "min-norm", "normal"])
def test_under_determined_data_give_the_minimum_norm_and_say_so(solver):
    A, b = tall(1, m=2, n=4)
    solution = solve(A, b, solver)
    np.testing.assert_allclose(A @ solution.x, b, atol=1e-12)
    null = np.linalg.svd(A)[2][2:]
    np.testing.assert_allclose(null @ solution.x, 0.0, atol=1e-12)  # nothing in the null space
    assert "under-determined: 2 equations for 4 unknowns" in solution.notes[0]


def test_the_sources_general_formula_fails_where_minimum_norm_does_not():
    A, b = tall(2, m=2, n=4)
    assert np.linalg.matrix_rank(A.T @ A) == 2  # (A^T A)^-1 does not exist
    np.testing.assert_allclose(A @ minimum_norm(A, b), b, atol=1e-13)


@pytest.mark.parametrize("solver", SOLVERS)
def test_rank_deficient_data_are_said_to_be_so(solver):
    A, b = tall(3)
    A[:, 3] = A[:, 0] + A[:, 1]
    solution = solve(A, b, solver)
    assert solution.rank == 3
    assert solution.condition > 1e10
    assert any("rank-deficient: rank 3 of 4" in note for note in solution.notes)
    assert np.isfinite(solution.x).all()


def test_zero_data_have_rank_zero():
    solution = solve(np.zeros((5, 2)), np.ones(5))
    assert solution.rank == 0
    np.testing.assert_array_equal(solution.x, 0.0)


def test_ridge_does_not_depend_on_the_unit_of_the_columns():
    A, b = tall(4)
    metres = ridge_solution(A, b, 0.1)
    millimetres = ridge_solution(1e3 * A, b, 0.1)
    np.testing.assert_allclose(metres, 1e3 * millimetres, rtol=1e-12)


def test_ridge_shrinks():
    A, b = tall(5)
    assert np.linalg.norm(solve(A, b, "ridge", ridge=1.0).x) < np.linalg.norm(solve(A, b).x)


def test_covariance_is_that_of_repeated_experiments():
    A, _ = tall(6, m=40, n=2)
    rng = np.random.default_rng(7)
    runs = [solve(A, A @ [1.0, 2.0] + 0.1 * rng.normal(size=40)) for _ in range(2000)]
    spread = np.cov(np.array([run.x for run in runs]).T)
    predicted = np.mean([run.covariance for run in runs], axis=0)
    np.testing.assert_allclose(predicted, spread, atol=0.1 * np.max(spread))


@pytest.mark.parametrize(
    ("A", "b", "solver", "words"),
    [
        ([[1.0, 2.0]], [1.0], "lu", "unknown"),
        ([[1.0, 2.0]], [1.0, 2.0], "qr", "expected (m, n), (m,)"),
        ([[1.0, np.nan]], [1.0], "qr", "finite"),
        (np.zeros((0, 2)), [], "qr", "expected (m, n), (m,)"),
    ],
)
def test_bad_data_are_refused(A, b, solver, words):
    with pytest.raises(BadInput, match=words.replace("(", r"\(").replace(")", r"\)")):
        solve(A, b, solver)


def test_ridge_without_a_share_is_refused():
    with pytest.raises(BadInput, match="above 0"):
        ridge_solution(np.eye(2), np.ones(2), 0.0)
