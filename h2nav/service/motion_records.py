"""Log records of motion estimation: flat scalars with units in their names."""

import math
from typing import NamedTuple

from h2nav.maths import quaternion
from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.samples import OdometryRecord, PoseSample, TwistEstimate
from h2nav.motion.wheel_odometry import WheelEstimate
from h2nav.service.motion_source import MotionRefusal


class TwistRecord(NamedTuple):
    """One estimate of the twist observer; body FRD, fixed frame of the pose source.

    Attributes:
        t_us: autopilot time of its IMU sample.
        frame: the fixed frame of the pose source, local_frd or local_ned.
        q_w: attitude, body to the fixed frame, scalar first.
        x_m: position in the fixed frame.
        vx_m_s: velocity in the body.
        rate_x_rad_s: angular rate corrected for bias, body.
        spatial_rate_x_rad_s: angular part of the spatial twist.
        spatial_vx_m_s: linear part: the velocity of the point that passes the origin.
        bias_x_rad_s: gyro bias.
        sigma_attitude_rad: one sigma per axis, as of the other sigmas.
        pose_age_s: since the time of the last pose that was used.
        reset_counter: number of breaks in pose continuity.
    """

    t_us: int
    frame: str
    q_w: float
    q_x: float
    q_y: float
    q_z: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    x_m: float
    y_m: float
    z_m: float
    vx_m_s: float
    vy_m_s: float
    vz_m_s: float
    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float
    spatial_rate_x_rad_s: float
    spatial_rate_y_rad_s: float
    spatial_rate_z_rad_s: float
    spatial_vx_m_s: float
    spatial_vy_m_s: float
    spatial_vz_m_s: float
    bias_x_rad_s: float
    bias_y_rad_s: float
    bias_z_rad_s: float
    sigma_attitude_rad: float
    sigma_position_m: float
    sigma_rate_rad_s: float
    sigma_velocity_m_s: float
    pose_age_s: float
    reset_counter: int


def twist_record(estimate: TwistEstimate) -> TwistRecord:
    """Flattens an estimate."""
    return TwistRecord(
        estimate.t_us,
        estimate.frame.value,
        *estimate.q_ob,
        *_euler_deg(estimate.q_ob),
        *estimate.p_o,
        *estimate.v_b,
        *estimate.w_b,
        *estimate.w_o,
        *estimate.v_o,
        *estimate.bias_w,
        estimate.sigma_r_rad,
        estimate.sigma_p_m,
        estimate.sigma_w_rad_s,
        estimate.sigma_v_m_s,
        estimate.pose_age_s,
        estimate.reset_counter,
    )


class PoseRecord(NamedTuple):
    """One measured pose as given to the observer.

    Attributes:
        t_us: time of validity on the IMU's clock.
        verdict: of the observer.
        age_ms: on arrival, by the IMU's clock.
        q_w: attitude, body to the fixed frame, scalar first.
        x_m: position in the fixed frame.
        source_resets: the source's own count of jumps.
    """

    t_us: int
    verdict: str
    age_ms: float
    q_w: float
    q_x: float
    q_y: float
    q_z: float
    x_m: float
    y_m: float
    z_m: float
    source_resets: int


def pose_record(
    pose: PoseSample, verdict: PoseVerdict | MotionRefusal, newest_us: int
) -> PoseRecord:
    """Flattens a pose."""
    age_ms = (newest_us - pose.t_us) * 1e-3
    return PoseRecord(pose.t_us, verdict.value, age_ms, *pose.q_ob, *pose.p_o, pose.source_resets)


class WheelsRecord(NamedTuple):
    """One estimate of the wheel odometry: plane with x ahead at the start, y left.

    Attributes:
        t_us: time of the reading.
        x_m: ahead of the start.
        y_m: left of the start.
        heading_deg: counter-clockwise from above.
        ahead_m_s: mean velocity since the previous reading.
        turn_rad_s: counter-clockwise.
        cov_xx_m2: covariance of position and heading (t).
        reset_counter: number of losses of motion.
    """

    t_us: int
    x_m: float
    y_m: float
    heading_deg: float
    ahead_m_s: float
    left_m_s: float
    turn_rad_s: float
    cov_xx_m2: float
    cov_xy_m2: float
    cov_xt_m_rad: float
    cov_yy_m2: float
    cov_yt_m_rad: float
    cov_tt_rad2: float
    reset_counter: int


def wheels_record(estimate: WheelEstimate) -> WheelsRecord:
    """Flattens an estimate."""
    x, y, heading = estimate.pose
    (xx, xy, xt), (_, yy, yt), (_, _, tt) = estimate.covariance
    return WheelsRecord(
        estimate.t_us,
        x,
        y,
        math.degrees(heading),
        *estimate.twist,
        xx,
        xy,
        xt,
        yy,
        yt,
        tt,
        estimate.reset_counter,
    )


class OdometryLine(NamedTuple):
    """One ODOMETRY as it was sent; child frame BODY_FRD.

    Attributes:
        t_us: time of validity.
        frame: local_frd or local_ned.
        x_m: position in the fixed frame.
        roll_deg: attitude, z-y-x sequence.
        vx_m_s: velocity in the body.
        rate_x_rad_s: angular rate in the body.
        sigma_x_m: one sigma, root of the covariance's diagonal, as of the others.
        reset_counter: not wrapped; the message carries it modulo 256.
        quality: 1 to 100 %; 0 = unknown.
    """

    t_us: int
    frame: str
    x_m: float
    y_m: float
    z_m: float
    roll_deg: float
    pitch_deg: float
    yaw_deg: float
    vx_m_s: float
    vy_m_s: float
    vz_m_s: float
    rate_x_rad_s: float
    rate_y_rad_s: float
    rate_z_rad_s: float
    sigma_x_m: float
    sigma_y_m: float
    sigma_z_m: float
    sigma_roll_rad: float
    sigma_pitch_rad: float
    sigma_yaw_rad: float
    reset_counter: int
    quality: int


# Places of the diagonal of a 6 x 6 matrix in its upper triangle.
_DIAGONAL = (0, 6, 11, 15, 18, 20)


def odometry_line(record: OdometryRecord, quality: int) -> OdometryLine:
    """Flattens an ODOMETRY that is sent."""
    x, y, z, roll, pitch, yaw = (math.sqrt(record.pose_covariance[i]) for i in _DIAGONAL)
    return OdometryLine(
        record.t_us,
        record.frame.value,
        *record.p_m,
        *_euler_deg(record.q),
        *record.v_b_m_s,
        *record.w_b_rad_s,
        x,
        y,
        z,
        roll,
        pitch,
        yaw,
        record.reset_counter,
        quality,
    )


def _euler_deg(q: quaternion.Quat) -> tuple[float, float, float]:
    roll, pitch, yaw = quaternion.to_euler(q)
    return math.degrees(roll), math.degrees(pitch), math.degrees(yaw)
