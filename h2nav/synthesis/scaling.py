"""The numerically sound form of a synthesis problem: delta operator, unit noise, unit states.

Solvers see a plant whose outputs are whitened, whose states have unit optimal variance and whose
time runs in units of the closed loop. The raw problem mixes 1e-9 with 1e9 and solvers then report
"optimal" far from the optimum (docs/paper.md).
"""

from dataclasses import dataclass

import numpy as np
from scipy import linalg

from h2nav.synthesis.plant import Matrix, Plant


@dataclass(frozen=True, slots=True)
class DeltaPlant:
    """A plant in delta form; a continuous plant has step 0.

    (x+ - x)/h = F x + G w,  y = C x + D w,  w of density 1/Hz.

    Source: docs/derivation.md Eq. (4.12).
    """

    F: Matrix
    G: Matrix
    C: Matrix
    D: Matrix
    C_z: Matrix
    h: float


@dataclass(frozen=True, slots=True)
class Scaling:
    """How to undo the scaling: ``L = state * L' @ output / sqrt(time)``, per second."""

    state: Matrix  # (n,) sizes of the states
    output: Matrix  # (p, p) whitening matrix of the measurements
    time_s: float  # unit of time
    z: float  # size of the minimised output


def delta_form(plant: Plant) -> DeltaPlant:
    """The plant in delta form, unscaled. Source: docs/derivation.md Eq. (4.12)."""
    if plant.dt_s == 0.0:
        return DeltaPlant(plant.A, plant.B_w, plant.C_y, plant.D_w, plant.C_z, 0.0)
    h = plant.dt_s
    root = float(np.sqrt(h))
    F = (plant.A - np.eye(plant.A.shape[0])) / h
    return DeltaPlant(F, plant.B_w / root, plant.C_y, plant.D_w * root, plant.C_z, h)


def delta_gain(plant: Plant, L: Matrix) -> Matrix:
    """Converts a gain per step to a gain per second (a continuous gain already is)."""
    return L / plant.dt_s if plant.dt_s else L


def scale(plant: Plant, P: Matrix) -> tuple[DeltaPlant, Scaling]:
    """The plant in delta form and in natural units, and how to undo them.

    Args:
        P: (n, n) rough error covariance; its diagonal sets the units of the states. It affects only
            the conditioning, never the result.

    Source: docs/derivation.md Eq. (4.13).
    """
    delta = delta_form(plant)
    state = np.sqrt(np.diag(P))
    R = delta.D @ delta.D.T
    output = linalg.inv(linalg.cholesky(R, lower=True))
    rate = _closed_loop_rate(delta, P, R)
    time_s = 1.0 / rate
    root = float(np.sqrt(time_s))
    z = float(np.sqrt(np.trace(delta.C_z @ P @ delta.C_z.T)))
    scaled = DeltaPlant(
        F=time_s * delta.F * state / state[:, None],
        G=root * delta.G / state[:, None],
        C=root * output @ delta.C * state,
        D=output @ delta.D,
        C_z=delta.C_z * state / z,
        h=delta.h / time_s,
    )
    return scaled, Scaling(state, output, time_s, z)


def unscale_gain(plant: Plant, scaling: Scaling, L: Matrix) -> Matrix:
    """The gain of the plant (per second or per step) from the scaled problem's gain."""
    per_second = scaling.state[:, None] * L @ scaling.output / np.sqrt(scaling.time_s)
    gain: Matrix = per_second * (plant.dt_s or 1.0)
    return gain


def _closed_loop_rate(delta: DeltaPlant, P: Matrix, R: Matrix) -> float:
    """Geometric mean of the closed loop's rates, 1/s."""
    L = linalg.solve(R, delta.C @ P).T
    rates = np.abs(linalg.eigvals(delta.F - L @ delta.C))
    rates = rates[rates > 0.0]
    return float(np.exp(np.mean(np.log(rates)))) if rates.size else 1.0
