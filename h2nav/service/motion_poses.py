"""Measured poses out of MAVLink: what the messages mean in our frames, and whose are taken."""

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths import frames, quaternion
from h2nav.maths.quaternion import Quat, Vec3
from h2nav.motion.samples import PoseFrame
from h2nav.service.autopilot import Autopilot

Sender = tuple[int, int]

# A source that is silent for so long gives way to another one.
SILENT_NS = 5_000_000_000
FAILED_QUALITY = -1
# MAV_FRAME_BODY_FLU of older dialects.
BODY_FLU = 13
BODY_FRD = (mavlink.MAV_FRAME_BODY_FRD, mavlink.MAV_FRAME_BODY_NED)


class Refusal(StrEnum):
    """Why a pose message does not reach the observer, besides the observer's own verdicts."""

    NOT_FINITE = "pose_not_finite"
    WRONG_FRAME = "pose_wrong_frame"
    FAILED = "pose_failed"  # the source says that it has lost track
    OWN_ESTIMATE = "pose_of_autopilot"  # the autopilot's own estimate is no measurement
    OTHER_SOURCE = "pose_other_source"
    BEFORE_ATTITUDE = "pose_before_attitude"
    STRAY_TIME = "pose_stray_time"


class PoseReading(NamedTuple):
    """A pose message in our frames.

    Attributes:
        usec: its time stamp, on whichever clock; 0 = none.
        q_ob: attitude, body FRD to the fixed frame.
        p_o: position, m.
        frame: the fixed frame, z down.
        source_resets: the source's own count of jumps.
    """

    usec: int
    q_ob: Quat
    p_o: Vec3
    frame: PoseFrame
    source_resets: int


def _odometry(fields: Any) -> PoseReading | Refusal:
    if fields.estimator_type == mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT:
        return Refusal.OWN_ESTIMATE
    if fields.quality == FAILED_QUALITY:
        return Refusal.FAILED
    q, p = tuple(fields.q), (fields.x, fields.y, fields.z)
    if not all(map(math.isfinite, (*q, *p))):
        return Refusal.NOT_FINITE
    placed = _in_our_frames(fields.frame_id, fields.child_frame_id, q, p)
    if placed is None:
        return Refusal.WRONG_FRAME
    return PoseReading(fields.time_usec, *placed, fields.reset_counter)


def _in_our_frames(world: int, body: int, q: Quat, p: Vec3) -> tuple[Quat, Vec3, PoseFrame] | None:
    """Attitude, position and frame with z down and body FRD; None for frames that do not fit."""
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
    return None


def _vision_position_estimate(fields: Any) -> PoseReading | Refusal:
    """Its heading is that of the source: north is not promised, so the frame is LOCAL_FRD."""
    angles, p = (fields.roll, fields.pitch, fields.yaw), (fields.x, fields.y, fields.z)
    if not all(map(math.isfinite, (*angles, *p))):
        return Refusal.NOT_FINITE
    q = quaternion.from_euler(*angles)
    return PoseReading(fields.usec, q, p, PoseFrame.LOCAL_FRD, fields.reset_counter)


def _att_pos_mocap(fields: Any) -> PoseReading | Refusal:
    q, p = tuple(fields.q), (fields.x, fields.y, fields.z)
    if not all(map(math.isfinite, (*q, *p))):
        return Refusal.NOT_FINITE
    return PoseReading(fields.time_usec, q, p, PoseFrame.LOCAL_FRD, 0)


POSE_MESSAGES: dict[int, tuple[str, Callable[[Any], PoseReading | Refusal]]] = {
    mavlink.MAVLINK_MSG_ID_ODOMETRY: ("ODOMETRY", _odometry),
    mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: (
        "VISION_POSITION_ESTIMATE",
        _vision_position_estimate,
    ),
    mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP: ("ATT_POS_MOCAP", _att_pos_mocap),
}


class Source:
    """The one sender and message that is listened to: the first, until it has long been silent.

    Args:
        autopilot: the vehicle; senders with its system id are its components.
        own_component_id: ours, whose messages come back on some links.
        component_id: the only component to listen to; 0 = any.
    """

    def __init__(self, autopilot: Autopilot, own_component_id: int, component_id: int = 0) -> None:
        self._autopilot = autopilot
        self._own_component_id = own_component_id
        self._component_id = component_id
        self._latched: tuple[Sender, int] | None = None
        self._heard_ns = 0

    def is_of_vehicle(self, sender: Sender) -> bool:
        """Whether the sender is a component of the bound vehicle, and not ourselves."""
        identity = self._autopilot.identity
        return (
            identity is not None
            and sender[0] == identity.system_id
            and sender[1] != self._own_component_id
        )

    def may_be(self, t_ns: int, sender: Sender, message_id: int) -> bool:
        """Whether this sender's message is, or may become, the source."""
        if self._component_id not in (0, sender[1]):
            return False
        return self._latched in (None, (sender, message_id)) or t_ns - self._heard_ns > SILENT_NS

    def heard(self, t_ns: int, sender: Sender, message_id: int) -> bool:
        """Takes note of a sound message; True when its sender takes the place of another one."""
        before, self._latched = self._latched, (sender, message_id)
        self._heard_ns = t_ns
        return before not in (None, self._latched)
