"""The source paper's extended H2 filter, exactly as published. A reference, never a flight mode.

Kim, Tadiparthi, Bhattacharya, "Nonlinear Attitude Estimation for Small UAVs with Low Power
Microprocessors", ACC 2020: the state is (roll, pitch, yaw, gyro bias), one constant gain L0 is
synthesised for the plant linearised at zero attitude, and the estimate moves by the nonlinear model

    x' = f(x, w_m) + L0 (h(x) - y).

L0 fits attitudes near zero only: with yaw beyond 90 deg, or tilt beyond about 70 deg, the filter is
unstable (docs/paper.md). It is here so that the paper's tables can be reproduced and every claim
about it checked. All functions work on many runs at once, one row per run.
"""

from typing import NamedTuple

import numpy as np

from h2nav.synthesis.plant import Matrix, Plant
from h2nav.synthesis.riccati import solve_riccati


class Weights(NamedTuple):
    """Noise densities of the paper's linear model; the slides' own figures need all ones."""

    gyro: float = 1.0
    bias_walk: float = 1.0
    accelerometer: float = 1.0
    magnetometer: float = 1.0


def kinematics(angles: Matrix, rate: Matrix) -> Matrix:
    """Euler-angle rates T(Phi) w.

    Args:
        angles: (..., 3) roll, pitch, yaw, rad.
        rate: (..., 3) body rate, rad/s; either is repeated along the axes it lacks.

    Source: docs/derivation.md Eq. (5.1).
    """
    roll, pitch = angles[..., 0], angles[..., 1]
    x, y, z = rate[..., 0], rate[..., 1], rate[..., 2]
    sin_roll, cos_roll = np.sin(roll), np.cos(roll)
    across = sin_roll * y + cos_roll * z
    # `np.stack` would cost more than all of the rest
    rates = np.empty((*across.shape, 3))
    rates[..., 0] = x + np.tan(pitch) * across
    rates[..., 1] = cos_roll * y - sin_roll * z
    rates[..., 2] = across / np.cos(pitch)
    return rates


def kinematics_matrix(angles: Matrix) -> Matrix:
    """(N, 3, 3) the matrices T(Phi). Source: docs/derivation.md Eq. (5.1)."""
    return kinematics(angles, np.eye(3)[:, None]).transpose(1, 2, 0)


def directions(angles: Matrix, vectors: Matrix) -> Matrix:
    """The measurement h(x): (N, 3 k) the inertial vectors seen in the body.

    Args:
        angles: (N, 3) roll, pitch, yaw, rad.
        vectors: (k, 3) in NED; the slides measure R g and R h, gravity pointing down.

    Source: docs/derivation.md Eq. (5.2).
    """
    seen = vectors @ _to_ned(angles)
    return seen.reshape(len(angles), -1)


def directions_by_angles(angles: Matrix, vectors: Matrix) -> Matrix:
    """(N, 3 k, 3) Jacobian of `directions` by the angles. Source: docs/derivation.md Eq. (5.4)."""
    # d(R^T v) = (R^T v) x dtheta_b, and dtheta_b = T^-1 dPhi.
    seen = directions(angles, vectors).reshape(len(angles), -1, 3)
    x, y, z = seen[..., 0], seen[..., 1], seen[..., 2]
    o = np.zeros_like(x)
    cross = _matrices(((o, -z, y), (z, o, -x), (-y, x, o)))
    turned = cross @ _body_by_angles(angles)[:, None]
    return turned.reshape(len(angles), -1, 3)


def linearised_plant(vectors: Matrix, weights: Weights, angles: Matrix | None = None) -> Plant:
    """The paper's plant linearised at an attitude, zero by default.

    The noise vector is w = (n_w, n_b, n_a, n_m), 12 components; the slides' six with D_w = I would
    make measurement and process noise one and the same.

    Args:
        vectors: (2, 3) gravity and magnetic field, NED, in the measurements' units.
        weights: noise densities in the same units.
        angles: (3,) roll, pitch, yaw, rad.

    Source: docs/derivation.md Eq. (5.3), (5.4).
    """
    at = np.zeros((1, 3)) if angles is None else np.asarray(angles, dtype=np.float64)[None, :]
    T = kinematics_matrix(at)[0]
    C = directions_by_angles(at, vectors)[0]
    O3, I3 = np.zeros((3, 3)), np.eye(3)
    A = np.block([[O3, -T], [O3, O3]])
    B_w = np.zeros((6, 12))
    B_w[:3, :3], B_w[3:, 3:6] = -weights.gyro * T, weights.bias_walk * I3
    D_w = np.zeros((6, 12))
    D_w[:3, 6:9], D_w[3:, 9:] = weights.accelerometer * I3, weights.magnetometer * I3
    return Plant(A, B_w, np.hstack([C, np.zeros((6, 3))]), D_w, np.hstack([I3, O3]))


def literal_slides_plant(vectors: Matrix) -> Plant:
    """The plant with the slides' six noises and D_w = I taken literally, for docs/paper.md."""
    plant = linearised_plant(vectors, Weights())
    return Plant(plant.A, plant.B_w[:, :6], plant.C_y, np.eye(6), plant.C_z)


def paper_gain(vectors: Matrix) -> Matrix:
    """L0 of the slides: unit weights, linearised at zero; sign of `synthesis.plant`."""
    return solve_riccati(linearised_plant(vectors, Weights())).L


def spectral_abscissa(L: Matrix, vectors: Matrix, angles: Matrix) -> Matrix:
    """(N,) largest real part of the error dynamics at each resting attitude; < 0 is stable.

    Args:
        L: (6, 6) gain with the sign of `plant` (the slides' is -L).
        vectors: (2, 3) as for `linearised_plant`.
        angles: (N, 3) attitudes, rad.

    Source: docs/derivation.md Eq. (5.6).
    """
    n = len(angles)
    A = np.zeros((n, 6, 6))
    A[:, :3, 3:] = -kinematics_matrix(angles)
    A[:, :, :3] -= L @ directions_by_angles(angles, vectors)
    largest: Matrix = np.max(np.linalg.eigvals(A).real, axis=1)
    return largest


def stable_share(vectors: Matrix, tilt_deg: float, samples: int = 20_000) -> float:
    """Share of attitudes with |roll|, |pitch| <= `tilt_deg` and any heading where L0 is stable."""
    random = np.random.default_rng(0)
    most = np.radians([tilt_deg, tilt_deg, 180.0])
    angles = random.uniform(-1.0, 1.0, (samples, 3)) * most
    return float(np.mean(spectral_abscissa(paper_gain(vectors), vectors, angles) < 0.0))


class PaperFilter:
    """Many runs of the extended H2 filter side by side.

    Args:
        L: (6, 6) constant gain with the sign of `plant`.
        vectors: (2, 3) gravity and magnetic field in NED, in the measurements' units.
    """

    def __init__(self, L: Matrix, vectors: Matrix, runs: int) -> None:
        self._L_transposed = L.T
        self._vectors = vectors
        self.angles = np.zeros((runs, 3))
        self.bias = np.zeros((runs, 3))

    def step(self, rate: Matrix, measured: Matrix, dt_s: float) -> None:
        """Moves all estimates by one step.

        Args:
            rate: (runs, 3) gyro, rad/s.
            measured: (runs, 6) both vectors at the step's beginning.
            dt_s: length of the step.

        Source: docs/derivation.md Eq. (5.5).
        """
        correction = (measured - directions(self.angles, self._vectors)) @ self._L_transposed
        turned = kinematics(self.angles, rate - self.bias)
        self.angles = self.angles + dt_s * (turned + correction[:, :3])
        self.bias = self.bias + dt_s * correction[:, 3:]


def _to_ned(angles: Matrix) -> Matrix:
    """(N, 3, 3) R_nb of roll, pitch, yaw."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(angles).T, np.cos(angles).T
    rows = (
        (cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy),
        (cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy),
        (-sp, sr * cp, cr * cp),
    )
    return _matrices(rows)


def _body_by_angles(angles: Matrix) -> Matrix:
    """(N, 3, 3) T^-1: body rotation per change of the angles; regular at every attitude."""
    roll, pitch = angles[:, 0], angles[:, 1]
    sr, cr, sp, cp = np.sin(roll), np.cos(roll), np.sin(pitch), np.cos(pitch)
    o, i = np.zeros_like(roll), np.ones_like(roll)
    rows = ((i, o, -sp), (o, cr, sr * cp), (o, -sr, cr * cp))
    return _matrices(rows)


def _matrices(rows: tuple[tuple[Matrix, ...], ...]) -> Matrix:
    """(..., 3, 3) one matrix for each number of the entries."""
    entries = np.array(rows)
    return np.ascontiguousarray(entries.transpose(*range(2, entries.ndim), 0, 1))
