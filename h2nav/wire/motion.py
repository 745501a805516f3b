"""Measured poses and wheel distances, converted to h2nav's frames."""

from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths import frames, quaternion
from h2nav.maths.quaternion import Quat, Vec3
from h2nav.motion.pose_gate import PoseVerdict
from h2nav.motion.samples import PoseFrame
from h2nav.wire.refused import Refused, need_finite, need_time

FAILED_QUALITY = -1
# MAV_FRAME_BODY_FLU of older dialects.
BODY_FLU = 13
BODY_FRD = (mavlink.MAV_FRAME_BODY_FRD, mavlink.MAV_FRAME_BODY_NED)

# Why a pose is rejected before its sender is considered.
POSE_NOT_FINITE = PoseVerdict.NOT_FINITE.value
POSE_WRONG_FRAME = PoseVerdict.WRONG_FRAME.value
POSE_STRAY_TIME = "pose_stray_time"
WHEELS_STRAY_TIME = "wheels_stray_time"
POSE_FAILED = "pose_failed"  # the source reports that it has lost track
POSE_OF_AUTOPILOT = "pose_of_autopilot"  # the autopilot's own estimate is not a measurement


class PoseReading(NamedTuple):
    """A pose in h2nav's frames."""

    usec: int  # its time stamp, on whichever clock; 0 = none
    q_ob: Quat  # attitude, body FRD to the fixed frame
    p_o: Vec3  # position, m
    frame: PoseFrame  # the fixed frame, z down
    source_resets: int  # the source's own count of jumps


class WheelDistances(NamedTuple):
    """WHEEL_DISTANCE."""

    usec: int  # its time stamp, on whichever clock; 0 = none
    distances_m: tuple[float, ...]  # of each wheel since the start, forward positive


def odometry(m: Any) -> PoseReading:
    """ODOMETRY of a camera; rejects the autopilot's own and unsupported frames."""
    if m.estimator_type == mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT:
        raise Refused(POSE_OF_AUTOPILOT)
    if m.quality == FAILED_QUALITY:
        raise Refused(POSE_FAILED)
    q, p = tuple(m.q), (m.x, m.y, m.z)
    need_finite(POSE_NOT_FINITE, *q, *p)
    placed = _in_our_frames(m.frame_id, m.child_frame_id, q, p)
    return PoseReading(need_time(POSE_STRAY_TIME, m.time_usec), *placed, m.reset_counter)


def vision_position_estimate(m: Any) -> PoseReading:
    """Its heading is the source's own, not necessarily from north: the frame is LOCAL_FRD."""
    angles, p = (m.roll, m.pitch, m.yaw), (m.x, m.y, m.z)
    need_finite(POSE_NOT_FINITE, *angles, *p)
    q = quaternion.from_euler(*angles)
    return PoseReading(
        need_time(POSE_STRAY_TIME, m.usec), q, p, PoseFrame.LOCAL_FRD, m.reset_counter
    )


def att_pos_mocap(m: Any) -> PoseReading:
    """ATT_POS_MOCAP."""
    q, p = tuple(m.q), (m.x, m.y, m.z)
    need_finite(POSE_NOT_FINITE, *q, *p)
    return PoseReading(need_time(POSE_STRAY_TIME, m.time_usec), q, p, PoseFrame.LOCAL_FRD, 0)


def wheel_distance(m: Any) -> WheelDistances:
    """WHEEL_DISTANCE; distances that are not finite are checked where the wheels are known."""
    return WheelDistances(need_time(WHEELS_STRAY_TIME, m.time_usec), tuple(m.distance[: m.count]))


def _in_our_frames(world: int, body: int, q: Quat, p: Vec3) -> tuple[Quat, Vec3, PoseFrame]:
    """Attitude, position and frame with z down and body FRD; rejects unsupported frames."""
    if body in BODY_FRD:
        if world == mavlink.MAV_FRAME_LOCAL_FRD:
            return q, p, PoseFrame.LOCAL_FRD
        if world == mavlink.MAV_FRAME_LOCAL_NED:
            return q, p, PoseFrame.LOCAL_NED
        if world == mavlink.MAV_FRAME_LOCAL_ENU:
            turned = frames.attitude_ned_from_enu(q)
            return turned, frames.ned_from_enu(p), PoseFrame.LOCAL_NED
    elif body == BODY_FLU:
        if world == mavlink.MAV_FRAME_LOCAL_ENU:
            turned = frames.attitude_ned_frd_from_enu_flu(q)
            return turned, frames.ned_from_enu(p), PoseFrame.LOCAL_NED
        if world == mavlink.MAV_FRAME_LOCAL_FLU:
            w, x, y, z = q
            turned = (w, *frames.frd_from_flu((x, y, z)))
            return turned, frames.frd_from_flu(p), PoseFrame.LOCAL_FRD
    raise Refused(POSE_WRONG_FRAME)
