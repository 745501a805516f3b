"""Poses of cameras and ways of wheels, in our frames by scipy's rotations."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.spatial.transform import Rotation

from h2nav.motion.samples import PoseFrame
from h2nav.wire import motion
from h2nav.wire.refused import LATEST_USEC, Refused

NED_FROM_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLIP = np.diag([1.0, -1.0, -1.0])  # FLU and FRD
SAME = np.eye(3)
FRD, NED, FLU = mavlink.MAV_FRAME_BODY_FRD, mavlink.MAV_FRAME_BODY_NED, motion.BODY_FLU
Q = (0.5, -0.1, 0.7, 0.5)  # of length one
P = (1.0, 2.0, 3.0)


def sent(**changes):
    usual = {
        "time_usec": 9,
        "usec": 9,
        "frame_id": mavlink.MAV_FRAME_LOCAL_FRD,
        "child_frame_id": FRD,
        "q": list(Q),
        "roll": 0.1,
        "pitch": -0.2,
        "yaw": 2.0,
        "x": P[0],
        "y": P[1],
        "z": P[2],
        "estimator_type": mavlink.MAV_ESTIMATOR_TYPE_VISION,
        "quality": 0,
        "reset_counter": 4,
        "count": 2,
        "distance": [0.5, -0.5, 7.0],
    }
    return SimpleNamespace(**{**usual, **changes})


def refusal(reader, **changes):
    with pytest.raises(Refused) as refused:
        reader(sent(**changes))
    return refused.value.reason


def matrix(q):
    return Rotation.from_quat([*q[1:], q[0]]).as_matrix()


@pytest.mark.parametrize(
    ("world", "body", "of_world", "of_body", "frame"),
    [
        (mavlink.MAV_FRAME_LOCAL_FRD, FRD, SAME, SAME, PoseFrame.LOCAL_FRD),
        (mavlink.MAV_FRAME_LOCAL_FRD, NED, SAME, SAME, PoseFrame.LOCAL_FRD),
        (mavlink.MAV_FRAME_LOCAL_NED, FRD, SAME, SAME, PoseFrame.LOCAL_NED),
        (mavlink.MAV_FRAME_LOCAL_ENU, FRD, NED_FROM_ENU, SAME, PoseFrame.LOCAL_NED),
        (mavlink.MAV_FRAME_LOCAL_ENU, FLU, NED_FROM_ENU, FLIP, PoseFrame.LOCAL_NED),
        (mavlink.MAV_FRAME_LOCAL_FLU, FLU, FLIP, FLIP, PoseFrame.LOCAL_FRD),
    ],
)
def test_a_pose_has_z_down_and_its_body_forward_right_down(world, body, of_world, of_body, frame):
    read = motion.odometry(sent(frame_id=world, child_frame_id=body))
    assert matrix(read.q_ob) == pytest.approx(of_world @ matrix(Q) @ of_body, abs=1e-12)
    assert read.p_o == pytest.approx(of_world @ P)
    assert (read.usec, read.frame, read.source_resets) == (9, frame, 4)


@pytest.mark.parametrize(
    ("world", "body"),
    [
        (mavlink.MAV_FRAME_LOCAL_FLU, FRD),
        (mavlink.MAV_FRAME_LOCAL_FRD, FLU),
        (mavlink.MAV_FRAME_LOCAL_NED, FLU),
        (mavlink.MAV_FRAME_GLOBAL, FRD),
        (mavlink.MAV_FRAME_LOCAL_NED, mavlink.MAV_FRAME_LOCAL_NED),
    ],
)
def test_other_pairs_of_frames_are_refused(world, body):
    reason = refusal(motion.odometry, frame_id=world, child_frame_id=body)
    assert reason == motion.POSE_WRONG_FRAME


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"estimator_type": mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT}, motion.POSE_OF_AUTOPILOT),
        ({"quality": -1}, motion.POSE_FAILED),
        ({"q": [math.nan, 0.0, 0.0, 0.0]}, motion.POSE_NOT_FINITE),
        ({"z": math.inf}, motion.POSE_NOT_FINITE),
        ({"time_usec": LATEST_USEC + 1}, motion.POSE_STRAY_TIME),
    ],
)
def test_what_is_no_measured_pose_is_refused(changes, reason):
    assert refusal(motion.odometry, **changes) == reason


def test_angles_of_a_camera_are_an_attitude_in_its_own_frame():
    read = motion.vision_position_estimate(sent())
    expected = Rotation.from_euler("ZYX", [2.0, -0.2, 0.1]).as_matrix()
    assert matrix(read.q_ob) == pytest.approx(expected, abs=1e-12)
    assert read[2:] == (P, PoseFrame.LOCAL_FRD, 4)
    assert refusal(motion.vision_position_estimate, yaw=math.nan) == motion.POSE_NOT_FINITE
    assert refusal(motion.vision_position_estimate, usec=2**63) == motion.POSE_STRAY_TIME


def test_motion_capture_counts_no_resets():
    assert motion.att_pos_mocap(sent()) == (9, Q, P, PoseFrame.LOCAL_FRD, 0)
    assert refusal(motion.att_pos_mocap, x=math.nan) == motion.POSE_NOT_FINITE


def test_of_wheels_only_those_counted_are_there():
    assert motion.wheel_distance(sent()) == (9, (0.5, -0.5))
    assert motion.wheel_distance(sent(count=255)).distances_m == (0.5, -0.5, 7.0)
    assert refusal(motion.wheel_distance, time_usec=2**63) == motion.WHEELS_STRAY_TIME
