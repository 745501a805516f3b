"""The rover's drives end where geometry says, and its wheels go the way that the body goes."""

import math

import pytest
from needs import DEG

from h2nav.maths import quaternion
from h2nav.motion.wheels import DifferentialDrive
from h2nav.sim.drives import FIGURE_EIGHT, HALF_CIRCLE, SQUARE, START_S, TRACK_M
from h2nav.sim.scenarios import SCENARIOS


def yaw(drive, t_s):
    return quaternion.to_euler(drive.motion(t_s).q_nb)[2]


@pytest.mark.parametrize(
    ("drive", "end", "yaw_deg"),
    [
        (HALF_CIRCLE, (0.0, 4.0, 0.0), 180.0),
        (FIGURE_EIGHT, (0.0, 0.0, 0.0), 0.0),
        (SQUARE, (0.0, 0.0, 0.0), 0.0),
    ],
)
def test_drives_end_where_they_should_and_stay_there(drive, end, yaw_deg):
    for t_s in (drive.duration_s, drive.duration_s + 5.0):
        assert drive.motion(t_s).p_n == pytest.approx(end, abs=1e-9)
        assert math.remainder(yaw(drive, t_s) - yaw_deg * DEG, math.tau) == pytest.approx(
            0, abs=1e-9
        )
        assert drive.motion(t_s).v_n == pytest.approx((0, 0, 0), abs=1e-12)
    assert drive.motion(START_S / 2).p_n == (0.0, 0.0, 0.0)


def test_half_circle_keeps_its_radius():
    for i in range(100):
        north, east, _ = HALF_CIRCLE.motion(0.08 * i).p_n
        assert math.hypot(north, east - 2.0) == pytest.approx(2.0)


@pytest.mark.parametrize("drive", [HALF_CIRCLE, FIGURE_EIGHT, SQUARE])
def test_wheels_agree_with_the_kinematics_of_the_motion_room(drive):
    """Forward kinematics of small wheel increments give the true body motion."""
    chassis = DifferentialDrive(TRACK_M)
    h = 1e-4
    for i in range(1, 150):
        t_s = 0.137 * i
        before, after = drive.wheels(t_s - h), drive.wheels(t_s + h)
        speeds = [(b - a) / (2 * h) for a, b in zip(before, after, strict=True)]
        ahead, aside, turn = chassis.motion(speeds)
        motion = drive.motion(t_s)
        v_b = quaternion.rotate(quaternion.conjugate(motion.q_nb), motion.v_n)
        assert ahead == pytest.approx(v_b[0], abs=1e-6)
        assert aside == 0.0
        assert v_b[1] == pytest.approx(0.0, abs=1e-9)
        # Planar turns count to the left, NED's to the right.
        assert turn == pytest.approx(-motion.w_b[2], abs=1e-6)


def test_only_rovers_have_wheels():
    with_wheels = {name for name, item in SCENARIOS.items() if item.wheels_at is not None}
    assert with_wheels == {"half-circle", "figure-eight", "square"}
