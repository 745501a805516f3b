"""Linear least squares by five methods, each with the quality of its solution.

Thin layers over numpy. Every solution has rank, condition number, residuals and the covariance of
the parameters, and `notes` says when it is not the plain unique solution.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from h2nav.errors import BadInput

Array = NDArray[np.float64]

SOLVERS = ("qr", "svd", "ridge", "min-norm", "normal")


@dataclass(frozen=True, slots=True)
class Solution:
    """A solution of A x = b with its quality."""

    x: Array  # (n,) the parameters
    solver: str  # one of `SOLVERS`
    rank: int  # numerical rank of A (singular values above `rcond` of the largest)
    condition: float  # largest over smallest singular value; inf for a rank-deficient A
    residuals: Array  # (m,) b - A x
    # (n, n) of x from the residuals; NaN where m <= rank leaves no residual. In directions
    # that the data do not observe it is infinite and not part of this matrix: `notes` says
    # so.
    covariance: Array
    notes: tuple[str, ...]  # sentences for the user; empty for a unique, well-conditioned answer


def solve(
    A: Any, b: Any, solver: str = "qr", *, rcond: float = 1e-10, ridge: float = 1e-6
) -> Solution:
    """Solves A x = b in the least-squares sense.

    Args:
        A: (m, n) finite.
        b: (m,) finite.
        solver: `qr` (default), `svd` (pseudo-inverse), `ridge`, `min-norm`, `normal` (normal
            equations: for comparison, they square the condition number).
        rcond: singular values below this share of the largest count as zero.
        ridge: lambda of `ridge` as a share of the mean squared column norm, hence free of units
            that all columns share.

    Returns:
        The solution; for rank-deficient or under-determined data that of minimum norm, as stated
        in `notes`.

    Raises:
        BadInput: shapes that do not fit, values that are not finite, an unknown solver.

    Source: docs/motion.md Eq. (31)-(35).
    """
    A, b = _checked(A, b, solver)
    U, sigma, Vt = np.linalg.svd(A, full_matrices=False)
    rank = int(np.count_nonzero(sigma > rcond * sigma[0])) if sigma[0] > 0.0 else 0
    notes = _rank_notes(A.shape, rank)
    deficient = rank < A.shape[1]
    if solver == "ridge":
        x = ridge_solution(A, b, ridge)
        notes += (f"ridge: the answer is drawn towards zero by lambda = {ridge:g} of the scale",)
    elif deficient:
        x = _deficient(A, b, (U, sigma, Vt), rank, solver)
        if solver in ("qr", "normal"):
            notes += (f"{solver} needs full column rank: solved by the pseudo-inverse instead",)
    elif solver == "svd":
        x = Vt.T @ ((U.T @ b) / sigma)
    elif solver == "normal":
        x = normal_equations(A, b)
    else:  # for full column rank the minimum-norm solution is that of QR
        x = qr_solution(A, b)
    residuals = b - A @ x
    condition = float(sigma[0] / sigma[-1]) if rank == min(A.shape) else np.inf
    covariance = _covariance(residuals, sigma, Vt, rank)
    return Solution(x, solver, rank, condition, residuals, covariance, notes)


def qr_solution(A: Array, b: Array) -> Array:
    """R x = Q^T b for A of full column rank."""
    Q, R = np.linalg.qr(A)
    return np.asarray(np.linalg.solve(R, Q.T @ b))


def minimum_norm(A: Array, b: Array) -> Array:
    """A^T (A A^T)^-1 b for A of full row rank, through A^T = Q R: x = Q R^-T b."""
    Q, R = np.linalg.qr(A.T)
    return np.asarray(Q @ np.linalg.solve(R.T, b))


def normal_equations(A: Array, b: Array) -> Array:
    """(A^T A)^-1 A^T b, as the source writes it: loses twice the digits that `qr_solution` does."""
    try:
        return np.asarray(np.linalg.solve(A.T @ A, A.T @ b))
    except np.linalg.LinAlgError:
        raise BadInput(
            "normal equations: A^T A is singular to rounding; use the solver qr"
        ) from None


def ridge_solution(A: Array, b: Array, share: float) -> Array:
    """The least |A x - b|^2 + lambda |x|^2 by QR of [A; sqrt(lambda) I].

    lambda is `share` times the mean squared column norm of A.
    """
    n = A.shape[1]
    if not share > 0.0:
        raise BadInput(f"ridge: the share is {share:g}, expected a number above 0")
    root = np.sqrt(share * np.sum(A * A) / n)
    if root == 0.0:
        return np.zeros(n)
    return qr_solution(np.vstack([A, root * np.eye(n)]), np.concatenate([b, np.zeros(n)]))


def _deficient(
    A: Array, b: Array, svd: tuple[Array, Array, Array], rank: int, solver: str
) -> Array:
    if rank == 0:
        return np.zeros(A.shape[1])
    if solver == "min-norm" and rank == A.shape[0]:
        return minimum_norm(A, b)
    U, sigma, Vt = svd
    return np.asarray(Vt[:rank].T @ ((U[:, :rank].T @ b) / sigma[:rank]))


def _covariance(residuals: Array, sigma: Array, Vt: Array, rank: int) -> Array:
    """s^2 (A^T A)^+ with s^2 = |residuals|^2 / (m - rank)."""
    freedom = residuals.size - rank
    n = Vt.shape[1]
    if freedom <= 0:
        return np.full((n, n), np.nan)
    root = Vt[:rank].T / sigma[:rank]
    return np.asarray(root @ root.T * (residuals @ residuals) / freedom)


def _rank_notes(shape: tuple[int, ...], rank: int) -> tuple[str, ...]:
    m, n = shape
    if rank == n:
        return ()
    if m < n and rank == m:
        return (f"under-determined: {m} equations for {n} unknowns; the answer of minimum norm",)
    return (
        f"rank-deficient: rank {rank} of {n}; {n - rank} combination(s) of the unknowns are not "
        "seen by the data; the answer of minimum norm",
    )


def _checked(A: Any, b: Any, solver: str) -> tuple[Array, Array]:
    A = np.asarray(A, dtype=np.float64)
    b = np.asarray(b, dtype=np.float64)
    if solver not in SOLVERS:
        raise BadInput(f"solver {solver!r} is unknown; expected one of {', '.join(SOLVERS)}")
    if A.ndim != 2 or b.shape != A.shape[:1] or A.size == 0:
        raise BadInput(f"least squares: A has shape {A.shape}, b {b.shape}; expected (m, n), (m,)")
    if not (np.isfinite(A).all() and np.isfinite(b).all()):
        raise BadInput("least squares: A and b must be finite; remove NaN and infinity")
    return A, b
