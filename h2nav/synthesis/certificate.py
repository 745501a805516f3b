"""Proof that a gain is stabilising, has the stated H2 norm and is optimal; needs no solver.

`prove` creates a certificate for a plant and a gain, `verify` checks one by matrix products,
eigenvalues and one linear system, `accept` decides whether the result of a method is optimal.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy import linalg

from h2nav.synthesis.method import Candidate, SynthesisError, relative_distance
from h2nav.synthesis.plant import Matrix, Plant
from h2nav.synthesis.riccati import closed_loop_covariance, optimal_gain, solve_riccati
from h2nav.synthesis.scaling import DeltaPlant, delta_form, delta_gain

# Slack by which X and Q exceed the true covariance, so that the inequalities hold strictly.
SLACK = 1e-6
# The stored figures must agree with the recomputed ones to this relative accuracy.
REPEATABLE = 1e-6
# A method's claimed norm may differ from the true one by this much.
HONEST = 1e-4
# A method's gain may miss its own optimality condition by this much.
OPTIMAL = 1e-4


class CertificateError(Exception):
    """A gain without a certificate; the message names the reason."""


@dataclass(frozen=True, slots=True)
class LoopCertificate:
    """The proof for one closed loop."""

    # largest real part of the error dynamics' eigenvalues; for a discrete loop log(spectral
    # radius)/step. Negative: the error decays.
    spectral_abscissa_per_s: float
    spectral_radius: float | None  # of a discrete loop; None for a continuous one
    h2_norm: float  # by the Lyapunov equation; the rms of C_z e in its own unit
    h2_bound: float  # sqrt(trace Q), the bound that X and Q prove
    lmi_margin: float  # smallest eigenvalue of both normalised matrix inequalities, > 0
    # relative distance of the gain from the optimal gain for its own error covariance; 0
    # exactly at the optimum
    optimality_residual: float
    X: Matrix  # (n, n) the matrix of the inequalities, an inverse covariance
    Q: Matrix  # (k, k) bound on the covariance of C_z e


def prove(plant: Plant, L: Matrix) -> LoopCertificate:
    """The certificate of a gain.

    Args:
        plant: continuous or discrete.
        L: (n, p) gain, per second or per step.

    Raises:
        CertificateError: the gain is not finite, the closed loop is not stable, or the
            inequalities cannot be satisfied numerically.

    Source: docs/derivation.md Eq. (4.17) - (4.19).
    """
    if L.shape != plant.C_y.T.shape or not np.all(np.isfinite(L)):
        raise CertificateError(f"the gain is not a finite {plant.C_y.T.shape} matrix")
    abscissa, radius = spectrum(plant, L)
    if not abscissa < 0.0:
        raise CertificateError(f"the closed loop is unstable: spectral abscissa {abscissa:.3g} 1/s")
    P = closed_loop_covariance(plant, L)
    if not np.all(np.diag(P) > 0.0):
        raise CertificateError("the closed loop's covariance is not positive")
    P_slack = closed_loop_covariance(_noisier(plant, L, P), L)
    X = linalg.inv(P_slack)
    X = (X + X.T) / 2
    Z = plant.C_z @ P_slack @ plant.C_z.T
    Q = (Z + Z.T) / 2 + SLACK * np.trace(Z) / Z.shape[0] * np.eye(Z.shape[0])
    margin = lmi_margin(plant, L, X, Q)
    if not margin > 0.0:
        raise CertificateError(f"the matrix inequalities do not hold: margin {margin:.3g}")
    return LoopCertificate(
        spectral_abscissa_per_s=abscissa,
        spectral_radius=radius,
        h2_norm=float(np.sqrt(np.trace(plant.C_z @ P @ plant.C_z.T))),
        h2_bound=float(np.sqrt(np.trace(Q))),
        lmi_margin=margin,
        optimality_residual=optimality_residual(plant, L, P),
        X=X,
        Q=Q,
    )


def verify(
    plant: Plant, L: Matrix, stored: LoopCertificate, optimality_limit: float = OPTIMAL
) -> list[str]:
    """Everything that is wrong with a stored certificate; empty if it holds.

    Args:
        plant: rebuilt from the gain file's model, never read from the certificate.
        L: the gain as deployed.
        stored: the certificate of the file.
        optimality_limit: largest optimality residual allowed; `inf` for a gain that should be
            stable with a known norm, not optimal.
    """
    try:
        fresh = prove(plant, L)
    except CertificateError as error:
        return [str(error)]
    problems = [
        f"stored {name} {was!r} is not the recomputed {now!r}"
        for name, was, now in (
            ("spectral abscissa", stored.spectral_abscissa_per_s, fresh.spectral_abscissa_per_s),
            ("H2 norm", stored.h2_norm, fresh.h2_norm),
            ("H2 bound", stored.h2_bound, float(np.sqrt(abs(np.trace(stored.Q))))),
        )
        if not abs(was - now) <= REPEATABLE * abs(now)
    ]
    if fresh.spectral_radius is not None and not (
        stored.spectral_radius is not None
        and abs(stored.spectral_radius - fresh.spectral_radius) <= 1e-12
    ):
        problems.append(f"stored spectral radius is not {fresh.spectral_radius!r}")
    margin = lmi_margin(plant, L, stored.X, stored.Q)
    if not margin > 0.0:
        problems.append(f"stored X and Q violate the matrix inequalities (margin {margin:.3g})")
    if not fresh.h2_norm <= stored.h2_bound <= fresh.h2_norm * (1 + 100 * SLACK):
        problems.append(f"stored X and Q prove {stored.h2_bound:.9g}, not {fresh.h2_norm:.9g}")
    if not fresh.optimality_residual <= optimality_limit:
        problems.append(
            f"the gain is not optimal for the model: residual {fresh.optimality_residual:.3g}, "
            f"allowed {optimality_limit:.3g}"
        )
    return problems


def accept(plant: Plant, candidate: Candidate) -> LoopCertificate:
    """The certificate of a method's result, whatever status the method reports.

    Raises:
        CertificateError: the gain is unstable or not optimal, or its norm differs from the claim.
    """
    certificate = prove(plant, candidate.L)
    if not abs(candidate.claimed_h2_norm - certificate.h2_norm) <= HONEST * certificate.h2_norm:
        raise CertificateError(
            f"{candidate.method} says {candidate.status!r} with H2 norm "
            f"{candidate.claimed_h2_norm:.6g}, but it is {certificate.h2_norm:.6g}"
        )
    if not certificate.optimality_residual <= OPTIMAL:
        raise CertificateError(
            f"{candidate.method} says {candidate.status!r}, but its gain misses the optimality "
            f"condition by {certificate.optimality_residual:.3g} (allowed {OPTIMAL:g})"
        )
    return certificate


def optimality_residual(plant: Plant, L: Matrix, P: Matrix) -> float:
    """Relative distance of `L` from the gain that is optimal for its own covariance `P`.

    The worst row counts: a state with a small gain must not hide behind the others.

    Source: docs/derivation.md Eq. (4.19).
    """
    noise = linalg.cholesky(plant.D_w @ plant.D_w.T, lower=True)
    best = optimal_gain(plant, P) @ noise
    distance = np.linalg.norm(L @ noise - best, axis=1)
    return float(np.max(distance / np.maximum(np.linalg.norm(best, axis=1), 1e-300)))


def lmi_margin(plant: Plant, L: Matrix, X: Matrix, Q: Matrix) -> float:
    """Smallest eigenvalue of both matrix inequalities, in units that do not depend on the plant.

    Source: docs/derivation.md Eq. (4.17), (4.18).
    """
    if not (_is_symmetric(X, plant.A.shape[0]) and _is_symmetric(Q, plant.C_z.shape[0])):
        return -np.inf
    if not np.all(np.diag(X) > 0.0):
        return -np.inf
    delta = delta_form(plant)
    gain = delta_gain(plant, L)
    F, G = delta.F - gain @ delta.C, delta.G - gain @ delta.D
    size = 1.0 / np.sqrt(np.diag(X))
    rate = max(float(np.max(np.abs(linalg.eigvals(F)))), 1e-300)
    unit = DeltaPlant(
        F=F * size / size[:, None] / rate,
        G=G / size[:, None] / np.sqrt(rate),
        C=delta.C,
        D=delta.D,
        C_z=delta.C_z * size,
        h=delta.h * rate,
    )
    dynamics = _dynamics_block(unit, X * np.outer(size, size))
    z = np.sqrt(np.trace(Q)) if np.trace(Q) > 0.0 else 1.0
    output = np.block([[Q / z**2, unit.C_z / z], [unit.C_z.T / z, X * np.outer(size, size)]])
    return float(min(linalg.eigvalsh(dynamics)[0], linalg.eigvalsh(output)[0]))


def _is_symmetric(S: Matrix, size: int) -> bool:
    """Whether S is finite and equal to its transpose; eigenvalue routines look at one half only."""
    if S.shape != (size, size) or not np.all(np.isfinite(S)):
        return False
    return bool(np.array_equal(S, S.T))


def _dynamics_block(closed: DeltaPlant, X: Matrix) -> Matrix:
    """The matrix whose positivity proves the covariance bound X^-1."""
    XF, XG = X @ closed.F, X @ closed.G
    rows = [[-(XF + XF.T), -XG], [-XG.T, np.eye(closed.G.shape[1])]]
    if closed.h > 0.0:
        root = np.sqrt(closed.h)
        rows = [
            [X, root * XF, root * XG],
            [root * XF.T, *rows[0]],
            [root * XG.T, *rows[1]],
        ]
    block: Matrix = np.block(rows)
    return block


def spectrum(plant: Plant, L: Matrix) -> tuple[float, float | None]:
    """Spectral abscissa (1/s) and, of a discrete loop, spectral radius of the error dynamics.

    Args:
        plant: continuous or discrete.
        L: (n, p) gain, per second or per step.
    """
    delta = delta_form(plant)
    values = np.asarray(
        linalg.eigvals(delta.F - delta_gain(plant, L) @ delta.C), dtype=np.complex128
    )
    if not plant.dt_s:
        return float(np.max(values.real)), None
    # |1 + h s|^2 - 1 without losing the digits of a slow loop.
    h = plant.dt_s
    growth = float(np.max(2 * h * values.real + h * h * np.abs(values) ** 2))
    return float(np.log1p(max(growth, -1.0 + 1e-15)) / (2 * h)), float(
        np.sqrt(max(1.0 + growth, 0.0))
    )


def _noisier(plant: Plant, L: Matrix, P: Matrix) -> Plant:
    """The plant with a little more process noise, sized by the loop itself."""
    delta = delta_form(plant)
    F = delta.F - delta_gain(plant, L) @ delta.C
    rate = float(np.max(np.abs(linalg.eigvals(F))))
    extra = np.diag(np.sqrt(SLACK * np.diag(P) * rate * (plant.dt_s or 1.0)))
    blank = np.zeros((plant.D_w.shape[0], extra.shape[1]))
    return Plant(
        A=plant.A,
        B_w=np.hstack([plant.B_w, extra]),
        C_y=plant.C_y,
        D_w=np.hstack([plant.D_w, blank]),
        C_z=plant.C_z,
        dt_s=plant.dt_s,
    )


class Compared(NamedTuple):
    """A method's result beside the reference's."""

    candidate: Candidate
    proof: LoopCertificate
    distance: float  # of its gain from the reference's


def compared(
    plant: Plant, reference: Candidate, lmi_solvers: Sequence[str]
) -> Iterator[tuple[str, Compared | str]]:
    """Yields the name and the result of every other method; why, if its gain is not trustworthy."""
    methods: dict[str, Callable[[Plant], Candidate]] = {"riccati": solve_riccati}
    if lmi_solvers:
        # Imported here: cvxpy takes a second, and checking a certificate needs no solver.
        from h2nav.synthesis.lmi import solve_lmi

        for solver in lmi_solvers:
            methods[f"lmi_{solver.lower()}"] = partial(solve_lmi, solver=solver)
    methods.pop(reference.method, None)
    for name, solve in methods.items():
        try:
            candidate = solve(plant)
            proof = accept(plant, candidate)
        except (SynthesisError, CertificateError) as error:
            yield name, str(error)
        else:
            yield name, Compared(candidate, proof, relative_distance(candidate.L, reference.L))
