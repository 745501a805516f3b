"""Linear plants for the synthesis, and their discretisation.

A plant is ``x' = A x + B_w w``, ``y = C_y x + D_w w``, ``z = C_z x`` with unit white noise ``w``
(continuous: density 1/Hz; discrete: variance 1). An observer with gain ``L`` makes the error

    e' = (A - L C_y) e + (B_w - L D_w) w,        z~ = C_z e.

The source slides write the gain with the other sign: ``L_slides = -L``.
Offline code: uses numpy; no filter imports it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plant:
    """A linear time-invariant plant with noise inputs."""

    A: Matrix  # (n, n) state matrix; per second (continuous) or per step (discrete)
    B_w: Matrix  # (n, m) noise into the states
    C_y: Matrix  # (p, n) measurement
    D_w: Matrix  # (p, m) noise into the measurements; D_w D_w^T must be invertible
    C_z: Matrix  # (k, n) the outputs whose error is minimised
    dt_s: float = 0.0  # step of a discrete plant, 0.0 for a continuous one


class VectorSensor(NamedTuple):
    """A sensor of a direction known in the inertial frame."""

    v_n: tuple[float, float, float]  # the vector in NED, in the sensor's unit, as `y = R^T v`
    density: float  # noise density per axis, sensor's unit per sqrt(Hz)


def cross_matrix(v: Sequence[float]) -> Matrix:
    """The (3, 3) matrix [v]x with [v]x u = v x u."""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def attitude_plant(gyro_density: float, sensors: Sequence[VectorSensor]) -> Plant:
    """The bias-free attitude error, states eps (rad, NED).

    Args:
        gyro_density: rad/s/sqrt(Hz).

    Source: docs/derivation.md Eq. (4.2) without its bias states.
    """
    p = 3 * len(sensors)
    noise = np.repeat([sensor.density for sensor in sensors], 3)
    return Plant(
        A=np.zeros((3, 3)),
        B_w=np.hstack([-gyro_density * np.eye(3), np.zeros((3, p))]),
        C_y=np.vstack([cross_matrix(sensor.v_n) for sensor in sensors]),
        D_w=np.hstack([np.zeros((p, 3)), np.diag(noise)]),
        C_z=np.eye(3),
    )


def attitude_bias_plant(
    gyro_density: float, bias_walk_density: float, sensors: Sequence[VectorSensor]
) -> Plant:
    """Attitude and gyro-bias error at rest, states (eps, delta).

    Args:
        gyro_density: rad/s/sqrt(Hz).
        bias_walk_density: rad/s/sqrt(s).

    Source: docs/derivation.md Eq. (4.2).
    """
    still = attitude_plant(gyro_density, sensors)
    p = still.C_y.shape[0]
    O3 = np.zeros((3, 3))
    I3 = np.eye(3)
    return Plant(
        A=np.block([[O3, -I3], [O3, O3]]),
        B_w=np.block(
            [
                [-gyro_density * I3, O3, np.zeros((3, p))],
                [O3, bias_walk_density * I3, np.zeros((3, p))],
            ]
        ),
        C_y=np.hstack([still.C_y, np.zeros((p, 3))]),
        D_w=np.hstack([np.zeros((p, 3)), still.D_w]),
        C_z=np.hstack([I3, O3]),
    )


def discretise(plant: Plant, dt_s: float) -> Plant:
    """The plant seen once per step, its noise spectra integrated exactly.

    Process and measurement noise become independent inputs. Requires a nilpotent `A` of degree at
    most 2 (A A = 0), which every plant of h2nav has, and B_w D_w^T = 0.

    Args:
        dt_s: the step, > 0.

    Raises:
        ValueError: when `A A` or `B_w D_w^T` is not zero.

    Source: docs/derivation.md Eq. (4.10), (4.11).
    """
    A = plant.A
    cross = plant.B_w @ plant.D_w.T
    if np.any(A @ A) or np.any(cross):
        raise ValueError("discretise needs A A = 0 and B_w D_w^T = 0")
    n, p = A.shape[0], plant.C_y.shape[0]
    Q = plant.B_w @ plant.B_w.T
    AQ = A @ Q
    Q_d = Q * dt_s + (AQ + AQ.T) * dt_s**2 / 2 + AQ @ A.T * dt_s**3 / 3
    R_d = plant.D_w @ plant.D_w.T / dt_s
    return Plant(
        A=np.eye(n) + A * dt_s,
        B_w=np.hstack([_square_root(Q_d), np.zeros((n, p))]),
        C_y=plant.C_y,
        D_w=np.hstack([np.zeros((p, n)), _square_root(R_d)]),
        C_z=plant.C_z,
        dt_s=dt_s,
    )


def _square_root(S: Matrix) -> Matrix:
    """A factor F with F F^T = S for positive semidefinite S (which may be singular)."""
    scale = np.sqrt(np.diag(S))
    safe = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(S / np.outer(safe, safe))
    F: Matrix = safe[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    return F
