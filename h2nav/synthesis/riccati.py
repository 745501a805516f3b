"""The H2-optimal gain from the filter Riccati equation, continuous and discrete."""

import numpy as np
from scipy import linalg

from h2nav.synthesis.method import Candidate, SynthesisError
from h2nav.synthesis.plant import Matrix, Plant
from h2nav.synthesis.scaling import delta_form


def solve_riccati(plant: Plant) -> Candidate:
    """The optimal gain.

    Raises:
        SynthesisError: when the equation has no stabilising solution (a state that is not
            observable, or noise that does not excite a marginal state).

    Source: docs/derivation.md Eq. (4.5) (continuous), (4.14) (discrete).
    """
    P = error_covariance(plant)
    L = optimal_gain(plant, P)
    norm = float(np.sqrt(np.trace(plant.C_z @ P @ plant.C_z.T)))
    return Candidate("riccati", L, norm)


def error_covariance(plant: Plant) -> Matrix:
    """P, the stabilising Riccati solution: before the measurement in the discrete case.

    Solved in units in which noise and states are of order one, then refined by Newton steps
    (Kleinman), because scipy's own balancing leaves 1e-8 for plants with slow bias states.

    Raises:
        SynthesisError: as `solve_riccati`.
    """
    size = _state_size(plant)
    A = plant.A * size / size[:, None]
    B = plant.B_w / size[:, None]
    whiten = linalg.inv(linalg.cholesky(plant.D_w @ plant.D_w.T, lower=True))
    C = whiten @ plant.C_y * size
    D = whiten @ plant.D_w
    solve = linalg.solve_discrete_are if plant.dt_s else linalg.solve_continuous_are
    try:
        P: Matrix = np.asarray(solve(A.T, C.T, B @ B.T, D @ D.T, s=B @ D.T), dtype=np.float64)
    except (linalg.LinAlgError, ValueError) as error:
        raise SynthesisError(f"the Riccati equation has no stabilising solution: {error}") from None
    unit = Plant(A, B, C, D, plant.C_z * size, plant.dt_s)
    for _ in range(2):
        P = closed_loop_covariance(unit, optimal_gain(unit, P))
    result: Matrix = P * np.outer(size, size)
    return result


def optimal_gain(plant: Plant, P: Matrix) -> Matrix:
    """The gain that is optimal if `P` is the error covariance of its own closed loop.

    Source: docs/derivation.md Eq. (4.5) (continuous), (4.14) (discrete).
    """
    R = plant.D_w @ plant.D_w.T
    cross = plant.B_w @ plant.D_w.T
    L: Matrix
    if plant.dt_s:
        S = plant.C_y @ P @ plant.C_y.T + R
        L = linalg.solve(S, (plant.A @ P @ plant.C_y.T + cross).T, assume_a="pos").T
    else:
        L = linalg.solve(R, (P @ plant.C_y.T + cross).T, assume_a="pos").T
    return L


def closed_loop_covariance(plant: Plant, L: Matrix) -> Matrix:
    """Error covariance with a gain; meaningless unless the loop is stable.

    Uses the delta form, in which a fast rate loses no digits.

    Source: docs/derivation.md Eq. (4.6) (continuous), (4.15) (discrete).
    """
    delta = delta_form(plant)
    gain = L / plant.dt_s if plant.dt_s else L
    F = delta.F - gain @ delta.C
    G = delta.G - gain @ delta.D
    n = F.shape[0]
    I_n = np.eye(n)
    operator = np.kron(F, I_n) + np.kron(I_n, F) + delta.h * np.kron(F, F)
    try:
        P = linalg.solve(operator, -(G @ G.T).reshape(-1)).reshape(n, n)
    except linalg.LinAlgError as error:
        raise SynthesisError(f"the closed loop has no finite covariance: {error}") from None
    result: Matrix = (P + P.T) / 2
    return result


def _state_size(plant: Plant) -> Matrix:
    """Sizes of the states that scale noise and dynamics to the same order."""
    delta = delta_form(plant)
    size = np.sqrt(np.diag(delta.G @ delta.G.T))
    largest = float(np.max(size))
    if largest == 0.0:
        raise SynthesisError("no noise drives the states, so there is nothing to estimate")
    return np.where(size > 0.0, size, largest)
