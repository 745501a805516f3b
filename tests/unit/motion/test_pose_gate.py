import math

import pytest

from h2nav.motion.pose_gate import JumpStreak, PoseError, PoseVerdict, unsound
from h2nav.motion.samples import PoseFrame, PoseSample

POSE = PoseSample(1, (1.0, 0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


def test_a_sound_pose_passes():
    assert unsound(POSE, None) is None
    assert unsound(POSE, PoseFrame.LOCAL_FRD) is None


def test_single_precision_quaternions_pass():
    assert unsound(POSE._replace(q_ob=(0.9999997, 0.0, 0.0, 4e-4)), None) is None


@pytest.mark.parametrize("q", [(math.nan, 0, 0, 1.0), (0.0, 0, 0, 0), (0.5, 0, 0, 0)])
def test_what_is_no_rotation_is_refused(q):
    assert unsound(POSE._replace(q_ob=q), None) is PoseVerdict.NOT_FINITE


def test_another_frame_is_refused():
    assert unsound(POSE, PoseFrame.LOCAL_NED) is PoseVerdict.WRONG_FRAME


def test_a_streak_grows_by_agreement_only():
    def error(x):
        return PoseError((0.0, 0.0, 0.0), (x, 0.0, 0.0))

    streak = JumpStreak().and_then(error(10.0), 0.5, 1.0)
    assert streak.poses == 1
    streak = streak.and_then(error(10.5), 0.5, 1.0)
    assert streak.poses == 2
    assert streak.and_then(error(12.0), 0.5, 1.0).poses == 1
