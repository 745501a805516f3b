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
    """One measured pose of the body, from visual odometry or motion capture."""

    t_us: int  # time of validity on the clock of the IMU samples, not of arrival
    q_ob: Quat  # attitude, body to the source's fixed frame; unit to 1 %
    p_o: Vec3  # position of the body, m
    frame: PoseFrame = PoseFrame.LOCAL_FRD  # what ``o`` is
    source_resets: int = 0  # the source's own count of jumps; a change restarts from this pose


class TwistSample(NamedTuple):
    """Measured body twist, valid over the interval that ends at `t_us`."""

    t_us: int  # end of the interval
    w_b: Vec3  # angular rate, rad/s, bias still in it
    v_b: Vec3  # velocity, m/s, bias still in it


class InertialSample(NamedTuple):
    """One inertial sample with the direction of gravity, valid over the interval up to `t_us`."""

    t_us: int  # end of the interval
    w_b: Vec3  # angular rate, rad/s, bias still in it
    f_b: Vec3  # specific force, m/s^2; (0, 0, -9.8) at rest and level
    down_b: Vec3  # unit vector of gravity in the body, from the attitude filter


class TwistEstimate(NamedTuple):
    """The twist observer's estimate at the time of an IMU sample."""

    t_us: int  # time of the sample
    q_ob: Quat  # attitude, body to the pose source's frame
    p_o: Vec3  # position, m
    w_b: Vec3  # angular rate corrected for bias, rad/s
    v_b: Vec3  # velocity in the body, m/s
    w_o: Vec3  # angular part of the spatial twist, rad/s
    v_o: Vec3  # linear part of the spatial twist, m/s
    bias_w: Vec3  # gyro bias, rad/s (measured = true + bias)
    bias_v: Vec3  # bias of the measured velocity, m/s; zero where velocity is integrated
    sigma_r_rad: float  # one-sigma error per axis of the attitude
    sigma_p_m: float  # of the position
    sigma_w_rad_s: float  # of `w_b` and `bias_w`
    sigma_v_m_s: float  # of `v_b` and `bias_v`
    pose_age_s: float  # time since the last pose that was used
    frame: PoseFrame  # what ``o`` is
    reset_counter: int  # number of breaks in pose continuity; not wrapped


class WheelSample(NamedTuple):
    """Distances that the wheels have rolled since their counters' zero."""

    t_us: int  # time of the reading
    # one per wheel, in the order of the layout (differential: left, right); unit as the
    # settings' radii expect it (WHEEL_DISTANCE: m)
    ways: tuple[float, ...]


class OdometryRecord(NamedTuple):
    """An estimate in the form of the ODOMETRY message, child frame BODY_FRD."""

    t_us: int  # time of validity
    frame: PoseFrame  # the fixed frame
    q: Quat  # attitude, body to the fixed frame, scalar first
    p_m: Vec3  # position in the fixed frame
    v_b_m_s: Vec3  # velocity in the body
    w_b_rad_s: Vec3  # angular rate in the body
    pose_covariance: tuple[float, ...]  # upper triangle, row by row, of (x, y, z, roll, pitch, yaw)
    velocity_covariance: tuple[float, ...]  # of (vx, vy, vz, roll rate, pitch rate, yaw rate)
    reset_counter: int  # not wrapped; the message carries it modulo 256
