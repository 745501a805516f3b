"""Immutable inputs and outputs of the motion estimators.

Frames: ``b`` body (forward, right, down); ``o`` the fixed frame of the pose source, z down
(LOCAL_FRD or LOCAL_NED). ``q_ob`` is Hamilton, scalar first, and takes body coordinates to ``o``.
A twist is (angular; linear); the linear part of the spatial twist is the velocity of the point of
the body that passes the origin of ``o``.
"""

from enum import StrEnum
from typing import NamedTuple

from h2nav.maths.quaternion import Quat, Vec3


class PoseFrame(StrEnum):
    """The fixed frames that a pose source may use; both have z down."""

    LOCAL_FRD = "local_frd"  # x ahead at start-up, heading free
    LOCAL_NED = "local_ned"  # x north


class PoseSample(NamedTuple):
    """One measured pose of the body, from visual odometry or motion capture.

    Attributes:
        t_us: time of validity on the clock of the IMU samples, not of arrival.
        q_ob: attitude, body to the source's fixed frame; unit to 1 %.
        p_o: position of the body, m.
        frame: what ``o`` is.
        source_resets: the source's own count of jumps; a change restarts from this pose.
    """

    t_us: int
    q_ob: Quat
    p_o: Vec3
    frame: PoseFrame = PoseFrame.LOCAL_FRD
    source_resets: int = 0


class TwistSample(NamedTuple):
    """Measured body twist, valid over the interval that ends at `t_us`.

    Attributes:
        t_us: end of the interval.
        w_b: angular rate, rad/s, bias still in it.
        v_b: velocity, m/s, bias still in it.
    """

    t_us: int
    w_b: Vec3
    v_b: Vec3


class InertialSample(NamedTuple):
    """One inertial sample with the direction of gravity, valid over the interval up to `t_us`.

    Attributes:
        t_us: end of the interval.
        w_b: angular rate, rad/s, bias still in it.
        f_b: specific force, m/s^2; (0, 0, -9.8) at rest and level.
        down_b: unit vector of gravity in the body, from the attitude filter.
    """

    t_us: int
    w_b: Vec3
    f_b: Vec3
    down_b: Vec3


class TwistEstimate(NamedTuple):
    """The twist observer's estimate at the time of an IMU sample.

    Attributes:
        t_us: time of the sample.
        q_ob: attitude, body to the pose source's frame.
        p_o: position, m.
        w_b: angular rate corrected for bias, rad/s.
        v_b: velocity in the body, m/s.
        w_o: angular part of the spatial twist, rad/s.
        v_o: linear part of the spatial twist, m/s.
        bias_w: gyro bias, rad/s (measured = true + bias).
        bias_v: bias of the measured velocity, m/s; zero where velocity is integrated.
        sigma_r_rad: one-sigma error per axis of the attitude.
        sigma_p_m: of the position.
        sigma_w_rad_s: of `w_b` and `bias_w`.
        sigma_v_m_s: of `v_b` and `bias_v`.
        pose_age_s: time since the last pose that was used.
        frame: what ``o`` is.
        reset_counter: number of breaks in pose continuity; not wrapped.
    """

    t_us: int
    q_ob: Quat
    p_o: Vec3
    w_b: Vec3
    v_b: Vec3
    w_o: Vec3
    v_o: Vec3
    bias_w: Vec3
    bias_v: Vec3
    sigma_r_rad: float
    sigma_p_m: float
    sigma_w_rad_s: float
    sigma_v_m_s: float
    pose_age_s: float
    frame: PoseFrame
    reset_counter: int


class WheelSample(NamedTuple):
    """Distances that the wheels have rolled since their counters' zero.

    Attributes:
        t_us: time of the reading.
        ways: one per wheel, in the order of the layout (differential: left, right); unit as the
            settings' radii expect it (WHEEL_DISTANCE: m).
    """

    t_us: int
    ways: tuple[float, ...]


class OdometryRecord(NamedTuple):
    """An estimate in the form of the ODOMETRY message, child frame BODY_FRD.

    Attributes:
        t_us: time of validity.
        frame: the fixed frame.
        q: attitude, body to the fixed frame, scalar first.
        p_m: position in the fixed frame.
        v_b_m_s: velocity in the body.
        w_b_rad_s: angular rate in the body.
        pose_covariance: upper triangle, row by row, of (x, y, z, roll, pitch, yaw).
        velocity_covariance: of (vx, vy, vz, roll rate, pitch rate, yaw rate).
        reset_counter: not wrapped; the message carries it modulo 256.
    """

    t_us: int
    frame: PoseFrame
    q: Quat
    p_m: Vec3
    v_b_m_s: Vec3
    w_b_rad_s: Vec3
    pose_covariance: tuple[float, ...]
    velocity_covariance: tuple[float, ...]
    reset_counter: int
