"""Motion estimates in the form of ODOMETRY: body FRD, covariances as 21 numbers."""

import math

from h2nav.maths import frames, quaternion
from h2nav.maths.se2 import Matrix3
from h2nav.motion.samples import OdometryRecord, PoseFrame, TwistEstimate
from h2nav.motion.wheel_odometry import WheelEstimate

# Wheels cannot observe height, roll and pitch: they are zero with this one-sigma error.
UNSEEN_SIGMA = 1.0


def of_twist(estimate: TwistEstimate) -> OdometryRecord:
    """The record of a twist observer's estimate."""
    pose = (estimate.sigma_p_m**2,) * 3 + (estimate.sigma_r_rad**2,) * 3
    velocity = (estimate.sigma_v_m_s**2,) * 3 + (estimate.sigma_w_rad_s**2,) * 3
    return OdometryRecord(
        estimate.t_us,
        estimate.frame,
        estimate.q_ob,
        estimate.p_o,
        estimate.v_b,
        estimate.w_b,
        _upper_triangle(pose, {}),
        _upper_triangle(velocity, {}),
        estimate.reset_counter,
    )


def of_wheels(estimate: WheelEstimate) -> OdometryRecord:
    """The record of a wheel estimate: from the plane (ahead, left, counter-clockwise) to FRD."""
    x, y, heading = estimate.pose
    ahead, left, turn = estimate.twist
    _, _, yaw = frames.frd_from_flu((0.0, 0.0, heading))
    return OdometryRecord(
        estimate.t_us,
        PoseFrame.LOCAL_FRD,
        quaternion.exp((0.0, 0.0, yaw)),
        frames.frd_from_flu((x, y, 0.0)),
        frames.frd_from_flu((ahead, left, 0.0)),
        frames.frd_from_flu((0.0, 0.0, turn)),
        _planar_triangle(estimate.covariance),
        _planar_triangle(estimate.twist_covariance),
        estimate.reset_counter,
    )


def _planar_triangle(P: Matrix3) -> tuple[float, ...]:
    """Expands three axes to six: y and turn both change sign, so only their products with x do."""
    unseen = UNSEEN_SIGMA**2
    diagonal = (P[0][0], P[1][1], unseen, unseen, unseen, P[2][2])
    return _upper_triangle(diagonal, {(0, 1): -P[0][1], (0, 5): -P[0][2], (1, 5): P[1][2]})


def _upper_triangle(
    diagonal: tuple[float, ...], beside: dict[tuple[int, int], float]
) -> tuple[float, ...]:
    """The 21 numbers of a symmetric 6 x 6 matrix, row by row."""
    assert all(map(math.isfinite, diagonal))
    return tuple(
        diagonal[i] if i == j else beside.get((i, j), 0.0) for i in range(6) for j in range(i, 6)
    )
