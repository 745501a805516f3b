"""A full-covariance multiplicative Kalman filter: the optimum that constant gains are held to.

Reference for tests only: six states (attitude error in NED, gyro bias), numpy, textbook form.
"""

import numpy as np

from h2nav.attitude.gains.densities import SensorDensities
from h2nav.attitude.samples import ImuSample, Quat
from h2nav.maths import quaternion, so3


class ReferenceMekf:
    """Right-invariant error: R = Exp(eps) R^, b = b^ + delta."""

    def __init__(
        self, densities: SensorDensities, rate_hz: float, q: Quat, sigma: float, sigma_bias: float
    ) -> None:
        self.R = np.array(quaternion.to_matrix(q))
        self.b = np.zeros(3)
        self.P = np.diag([sigma**2] * 3 + [sigma_bias**2] * 3)
        self.dt = 1.0 / rate_hz
        self.n = densities
        field = densities.field
        self.v_force = np.array([0.0, 0.0, densities.gravity_m_s2])
        self.v_field = field.norm_ut * np.array([np.cos(field.dip_rad), 0.0, np.sin(field.dip_rad)])

    def update(self, sample: ImuSample) -> None:
        dt, n = self.dt, self.n
        w = np.array(sample.w_b) - self.b
        mean_R = self.R @ so3.left_jacobian(dt * w)
        self.R = self.R @ so3.exp(dt * w)
        F = np.eye(6)
        F[:3, 3:] = -dt * mean_R
        Q = np.zeros((6, 6))
        Q[:3, :3] = n.gyro**2 * dt * np.eye(3)
        Q[3:, 3:] = n.bias_walk**2 * dt * np.eye(3)
        self.P = F @ self.P @ F.T + Q
        rows = [(-np.array(sample.f_b), self.v_force, n.accelerometer)]
        if sample.m_b_ut is not None:
            rows.append((np.array(sample.m_b_ut), self.v_field, n.magnetometer))
        C = np.zeros((3 * len(rows), 6))
        C[:, :3] = np.vstack([so3.hat(v) for _, v, _ in rows])
        r = np.concatenate([self.R @ y - v for y, v, _ in rows])
        variance = np.repeat([density**2 / dt for _, _, density in rows], 3)
        S = C @ self.P @ C.T + np.diag(variance)
        K = np.linalg.solve(S, C @ self.P).T
        d = K @ r
        self.P = self.P - K @ C @ self.P
        self.P = 0.5 * (self.P + self.P.T)
        self.R = so3.exp(d[:3]) @ self.R
        self.b = self.b + d[3:]

    def error_rad(self, q_true: Quat) -> float:
        return float(np.linalg.norm(so3.log(np.array(quaternion.to_matrix(q_true)) @ self.R.T)))
