"""The H2-optimal gain by convex optimisation, as in the source slides.

One semidefinite programme serves continuous and discrete time: the discrete inequality is in delta
form, which tends to the slides' continuous inequality as the step goes to zero.
"""

import time
import warnings
from collections.abc import Mapping
from typing import Any

import cvxpy
import numpy as np
from scipy import linalg

from h2nav.synthesis.method import Candidate, SynthesisError
from h2nav.synthesis.plant import Matrix, Plant
from h2nav.synthesis.riccati import error_covariance
from h2nav.synthesis.scaling import DeltaPlant, delta_form, scale, unscale_gain

# cvxpy's re-exports are invisible to the type checker.
cp: Any = cvxpy

SOLVER_OPTIONS: dict[str, dict[str, float | int]] = {
    "CLARABEL": {"tol_gap_abs": 1e-14, "tol_gap_rel": 1e-14, "tol_feas": 1e-13},
    "SCS": {"eps_abs": 1e-11, "eps_rel": 1e-11, "max_iters": 100_000},
}


def solve_lmi(plant: Plant, solver: str = "CLARABEL") -> Candidate:
    """Minimises trace Q subject to the H2 inequalities; `L = X^-1 W`.

    The problem is scaled first. Minimised is the error of *all* (scaled) states: the optimal gain
    does not depend on C_z, and with a C_z that ignores states their part of X is badly determined.

    Args:
        plant: continuous or discrete.
        solver: a key of `SOLVER_OPTIONS`.

    Raises:
        SynthesisError: the solver returns nothing. A result is only a claim: see
            `certificate.accept`.

    Source: docs/derivation.md Eq. (4.8) (continuous), (4.16) (discrete).
    """
    scaled, scaling = scale(plant, error_covariance(plant))
    started = time.perf_counter()
    everything = np.eye(plant.A.shape[0])
    L, X, status = _solve(scaled, everything, solver, SOLVER_OPTIONS[solver])
    wall_time_s = time.perf_counter() - started
    norm = scaling.z * _claimed_norm(scaled.C_z, X)
    return Candidate(
        f"lmi_{solver.lower()}", unscale_gain(plant, scaling, L), norm, status, wall_time_s
    )


def solve_raw_lmi(plant: Plant, solver: str = "CLARABEL") -> Candidate:
    """The slides' programme in physical units with the solver's own tolerances.

    For demonstration only: the result is far from optimal, whatever status the solver reports.
    """
    delta = delta_form(plant)
    started = time.perf_counter()
    L, X, status = _solve(delta, plant.C_z, solver, {})
    wall_time_s = time.perf_counter() - started
    gain = L * plant.dt_s if plant.dt_s else L
    return Candidate(
        f"raw_lmi_{solver.lower()}", gain, _claimed_norm(plant.C_z, X), status, wall_time_s
    )


def _solve(
    plant: DeltaPlant, C_z: Matrix, solver: str, options: Mapping[str, float | int]
) -> tuple[Matrix, Matrix, str]:
    """Gain, X and the solver's status for one programme."""
    n, p = plant.F.shape[0], plant.C.shape[0]
    X = cp.Variable((n, n), symmetric=True)
    Q = cp.Variable((C_z.shape[0], C_z.shape[0]), symmetric=True)
    W = cp.Variable((n, p))
    problem = cp.Problem(
        cp.Minimize(cp.trace(Q)),
        [_dynamics_inequality(plant, X, W) >> 0, cp.bmat([[Q, C_z], [C_z.T, X]]) >> 0],
    )
    with warnings.catch_warnings():
        # "may be inaccurate" is what the certificate decides, not the solver.
        warnings.simplefilter("ignore")
        try:
            problem.solve(solver=solver, **options)
        except cp.SolverError as error:
            raise SynthesisError(f"{solver} gave up: {error}") from None
    if X.value is None or W.value is None or not np.all(np.isfinite(X.value)):
        raise SynthesisError(f"{solver} found no solution: {problem.status}")
    L: Matrix = linalg.solve(X.value, W.value)
    return L, X.value, str(problem.status)


def _dynamics_inequality(plant: DeltaPlant, X: Any, W: Any) -> Any:
    """The matrix that must be positive; the step h = 0 gives the slides' inequality."""
    XF = X @ plant.F - W @ plant.C
    XG = X @ plant.G - W @ plant.D
    m = plant.G.shape[1]
    rows = [[-(XF + XF.T), -XG], [-XG.T, np.eye(m)]]
    if plant.h > 0.0:
        root = float(np.sqrt(plant.h))
        rows = [
            [X, root * XF, root * XG],
            [root * XF.T, *rows[0]],
            [root * XG.T, *rows[1]],
        ]
    block = cp.bmat(rows)
    return (block + block.T) / 2


def _claimed_norm(C_z: Matrix, X: Matrix) -> float:
    """The norm claimed by X: X^-1 bounds the error covariance."""
    return float(np.sqrt(np.trace(C_z @ linalg.solve(X, C_z.T))))
