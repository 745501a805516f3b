"""The optimal gains of the attitude plants without any solver.

In the eigenbasis of the information matrix M the problem falls into three scalar-measurement
problems, each with a solution in square roots.
"""

from collections.abc import Sequence

import numpy as np

from h2nav.synthesis.method import Candidate
from h2nav.synthesis.plant import Matrix, VectorSensor, attitude_bias_plant, attitude_plant


def attitude_bias_gain(
    gyro_density: float,
    bias_walk_density: float,
    sensors: Sequence[VectorSensor],
    dt_s: float = 0.0,
) -> Candidate:
    """The optimal gain of `attitude_bias_plant`, discretised by `dt_s` unless that is 0.

    Args:
        gyro_density: rad/s/sqrt(Hz).
        bias_walk_density: rad/s/sqrt(s), > 0.
        sensors: two or more vectors that are not all parallel.
        dt_s: step, or 0 for continuous time.

    Source: docs/derivation.md Eq. (4.4) (continuous), (4.20) - (4.22) (discrete).
    """
    plant = attitude_bias_plant(gyro_density, bias_walk_density, sensors)
    mu, V, to_axes = _axes(plant.C_y[:, :3], plant.D_w)
    if dt_s:
        k_p, k_i, p11 = _discrete(gyro_density, bias_walk_density, mu, dt_s)
    else:
        k_p, k_i, p11 = _continuous(gyro_density, bias_walk_density, mu)
    L = np.vstack([V * k_p @ to_axes, V * k_i @ to_axes])
    return Candidate("closed_form", L, float(np.sqrt(np.sum(p11))))


def attitude_gain(gyro_density: float, sensors: Sequence[VectorSensor], dt_s: float) -> Candidate:
    """The optimal gain of `attitude_plant`, discretised by `dt_s` unless that is 0.

    Source: docs/derivation.md Eq. (4.4) with n_b = 0 (continuous), (4.23) (discrete).
    """
    plant = attitude_plant(gyro_density, sensors)
    mu, V, to_axes = _axes(plant.C_y, plant.D_w)
    q = gyro_density**2
    if dt_s:
        p11 = q * dt_s / 2 + np.sqrt((q * dt_s / 2) ** 2 + q / mu)
        k_p = p11 * dt_s * mu / (1.0 + p11 * dt_s * mu)
    else:
        p11 = np.sqrt(q / mu)
        k_p = p11 * mu
    return Candidate("closed_form", V * k_p @ to_axes, float(np.sqrt(np.sum(p11))))


def _axes(C: Matrix, D_w: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """The information rates mu, their axes V and the matrix from measurements to V^T eps.

    Singular values of the whitened measurement keep the digits of a small mu beside a large one,
    which the eigenvalues of M lose.

    Source: docs/derivation.md Eq. (4.3).
    """
    noise = np.sqrt(np.diag(D_w @ D_w.T))
    U, root_mu, V_T = np.linalg.svd(C / noise[:, None], full_matrices=False)
    return root_mu**2, V_T.T, U.T / root_mu[:, None] / noise


def _continuous(n_w: float, n_b: float, mu: Matrix) -> tuple[Matrix, Matrix, Matrix]:
    """Gains on the attitude pseudo-measurement (1/s, 1/s^2) and the variance, per axis."""
    p11 = np.sqrt((n_w**2 + 2 * n_b / np.sqrt(mu)) / mu)
    p12 = -n_b / np.sqrt(mu)
    return p11 * mu, p12 * mu, p11


def _discrete(n_w: float, n_b: float, mu: Matrix, dt_s: float) -> tuple[Matrix, Matrix, Matrix]:
    """The same per step, by spectral factorisation."""
    r = 1.0 / (mu * dt_s)
    first = n_w**2 * dt_s - n_b**2 * dt_s**3 / 6
    second = n_b**2 * dt_s**3
    root = np.sqrt(first**2 - 4 * r * second + 0j)
    root = np.where(first < 0.0, -root, root)
    u_1 = -(first + root) / (2 * r)
    u_2 = second / (r * u_1)
    s_1, s_2 = _stable_root(u_1), _stable_root(u_2)
    l_1 = -(s_1 + s_2).real
    b = (s_1 * s_2).real
    S = r / (1.0 - l_1 + b)
    return l_1, -b / dt_s, (l_1 - b) * S


def _stable_root(u: Matrix) -> Matrix:
    """The solution of s^2 + u s + u = 0 with |1 + s| < 1."""
    half = np.sqrt(u * u - 4 * u) / 2
    plus, minus = -u / 2 + half, -u / 2 - half
    s: Matrix = np.where(np.abs(1.0 + plus) < np.abs(1.0 + minus), plus, minus)
    return s
