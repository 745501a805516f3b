"""The gate of measured poses: sound, in the right frame, and no jump."""

import math
from enum import StrEnum
from typing import NamedTuple

from h2nav.maths import quaternion
from h2nav.maths.quaternion import Vec3
from h2nav.motion.samples import PoseFrame, PoseSample

# Farther from the origin no pose source works and float64 loses sub-micrometre steps.
MAX_POSITION_M = 1e7
UNIT_TOLERANCE = 0.01


class PoseVerdict(StrEnum):
    """The result for a pose."""

    USED = "pose_used"
    STARTED = "pose_started"  # the first pose, or the first after a restart
    WAITING = "pose_waiting"  # newer than the newest IMU sample: used when that has come
    RESTARTED = "pose_restarted"  # pose continuity broken: reset_counter + 1
    NOT_FINITE = "pose_not_finite"  # or no rotation, or out of range
    WRONG_FRAME = "pose_wrong_frame"
    NOT_LATER = "pose_not_later"
    TOO_OLD = "pose_too_old"
    TOO_FAR_AHEAD = "pose_too_far_ahead"
    JUMP = "pose_jump"


class PoseError(NamedTuple):
    """Estimate minus measured pose, in the measured body frame."""

    e_r: Vec3  # rotation vector, rad
    e_p: Vec3  # position, m


class JumpStreak(NamedTuple):
    """Consecutive poses beyond the gate that agree with each other."""

    poses: int = 0  # their number
    last: PoseError = PoseError((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))  # the error of the latest

    def and_then(self, error: PoseError, gate_rad: float, gate_m: float) -> "JumpStreak":
        """The streak with another pose; one that disagrees with the last begins a new streak."""
        agrees = (
            math.dist(error.e_r, self.last.e_r) <= gate_rad
            and math.dist(error.e_p, self.last.e_p) <= gate_m
        )
        return JumpStreak(self.poses + 1 if agrees else 1, error)


def unsound(pose: PoseSample, frame: PoseFrame | None) -> PoseVerdict | None:
    """Why a pose cannot be used at all; None if it can."""
    if not all(map(math.isfinite, (*pose.q_ob, *pose.p_o))):
        return PoseVerdict.NOT_FINITE
    if abs(quaternion.norm(pose.q_ob) - 1.0) > UNIT_TOLERANCE:
        return PoseVerdict.NOT_FINITE
    if max(map(abs, pose.p_o)) > MAX_POSITION_M:
        return PoseVerdict.NOT_FINITE
    if frame is not None and pose.frame != frame:
        return PoseVerdict.WRONG_FRAME
    return None
