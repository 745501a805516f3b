"""The extended Kalman filter on Euler angles that the source paper compares with; the baseline.

State (roll, pitch, yaw, gyro bias), full 6x6 covariance, linearised at every estimate. With unit
matrices it is the paper's slow-witted opponent; with the sensors' own covariances it is a good
filter away from pitch +-90 deg. Many runs at once, one row per run.
"""

import numpy as np

from h2nav.evaluation.paper.filter import (
    directions,
    directions_by_angles,
    kinematics,
    kinematics_matrix,
)
from h2nav.synthesis.plant import Matrix


class EulerEkf:
    """Many runs of the Euler-angle EKF side by side.

    Args:
        vectors: (2, 3) gravity and magnetic field in NED, in the measurements' units.
        process: (6,) process noise per second of each state: variances of white rate noise
            (mapped by T) and of the bias walk.
        measurement: (6,) variances of one measurement.
        initial: (6,) variances of the initial state.
    """

    def __init__(
        self, vectors: Matrix, process: Matrix, measurement: Matrix, initial: Matrix, runs: int
    ) -> None:
        self._vectors = vectors
        self._process = process
        self._R = np.diag(measurement)
        self.angles = np.zeros((runs, 3))
        self.bias = np.zeros((runs, 3))
        self._P = np.repeat(np.diag(initial)[None], runs, axis=0)

    def predict(self, rate: Matrix, dt_s: float) -> None:
        """Moves all estimates by one step, by the midpoint rule.

        Euler's rule would lag by half a step in T as a held gyro sample does in w.

        Args:
            rate: (runs, 3) gyro, rad/s.
            dt_s: length of the step.

        Source: docs/derivation.md Eq. (5.7).
        """
        unbiased = rate - self.bias
        halfway = self.angles + dt_s / 2 * kinematics(self.angles, unbiased)
        T = kinematics_matrix(halfway)
        F = np.tile(np.eye(6), (len(T), 1, 1))
        # d(T w)/dPhi by central differences: exact to 1e-10, and free of slips.
        nudges = 1e-5 * np.eye(3)[:, None]
        change = kinematics(halfway + nudges, unbiased) - kinematics(halfway - nudges, unbiased)
        F[:, :3, :3] += (dt_s * change / 2e-5).transpose(1, 2, 0)
        F[:, :3, 3:] = -dt_s * T
        Q = np.zeros_like(F)
        Q[:, :3, :3] = (T * self._process[:3]) @ T.transpose(0, 2, 1) * dt_s
        Q[:, 3:, 3:] = np.diag(self._process[3:]) * dt_s
        self._P = F @ self._P @ F.transpose(0, 2, 1) + Q
        self.angles = self.angles + dt_s * kinematics(halfway, unbiased)

    def correct(self, measured: Matrix) -> None:
        """Uses one measurement of both vectors, (runs, 6).

        Source: docs/derivation.md Eq. (5.8).
        """
        C = np.zeros((len(self.angles), 6, 6))
        C[:, :, :3] = directions_by_angles(self.angles, self._vectors)
        PC = self._P @ C.transpose(0, 2, 1)
        K = np.linalg.solve(C @ PC + self._R, PC.transpose(0, 2, 1)).transpose(0, 2, 1)
        change = (K @ (measured - directions(self.angles, self._vectors))[:, :, None])[:, :, 0]
        self.angles = self.angles + change[:, :3]
        self.bias = self.bias + change[:, 3:]
        P = self._P - K @ PC.transpose(0, 2, 1)
        self._P = (P + P.transpose(0, 2, 1)) / 2
