import math

import pytest
from needs import DEG

from h2nav.maths import frames, quaternion

V = (1.0, 2.0, 3.0)


def test_yaw_90_deg_sends_body_x_to_east() -> None:
    q_nb = quaternion.from_euler(0.0, 0.0, 90.0 * DEG)
    nose_n = quaternion.rotate(q_nb, (1.0, 0.0, 0.0))
    assert nose_n == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    assert frames.enu_from_ned(nose_n) == pytest.approx((1.0, 0.0, 0.0), abs=1e-15)


def test_pitch_90_deg_sends_body_x_up() -> None:
    q_nb = quaternion.from_euler(0.0, 90.0 * DEG, 0.0)
    assert quaternion.rotate(q_nb, (1.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0, -1.0), abs=1e-15)


def test_roll_90_deg_sends_body_y_down() -> None:
    q_nb = quaternion.from_euler(90.0 * DEG, 0.0, 0.0)
    assert quaternion.rotate(q_nb, (0.0, 1.0, 0.0)) == pytest.approx((0.0, 0.0, 1.0), abs=1e-15)


def test_each_axis_goes_where_its_letter_says() -> None:
    assert frames.enu_from_ned(V) == (2.0, 1.0, -3.0)
    assert frames.ned_from_enu(V) == (2.0, 1.0, -3.0)
    assert frames.flu_from_frd(V) == (1.0, -2.0, -3.0)
    assert frames.frd_from_flu(V) == (1.0, -2.0, -3.0)


def test_level_and_north_in_ned_is_yaw_90_deg_in_enu() -> None:
    q_ef = frames.attitude_enu_flu_from_ned_frd(quaternion.IDENTITY)
    half = math.sqrt(0.5)
    assert q_ef == pytest.approx((half, 0.0, 0.0, half), abs=1e-15)


@pytest.mark.parametrize(
    "euler_deg", [(10.0, 20.0, 30.0), (-170.0, 80.0, -100.0), (0.0, -90.0, 45.0)]
)
def test_attitudes_and_vectors_change_frames_together(euler_deg: tuple[float, ...]) -> None:
    roll, pitch, yaw = (angle * DEG for angle in euler_deg)
    q_nb = quaternion.from_euler(roll, pitch, yaw)
    v_n = quaternion.rotate(q_nb, V)
    q_ef = frames.attitude_enu_flu_from_ned_frd(q_nb)
    assert quaternion.rotate(q_ef, frames.flu_from_frd(V)) == pytest.approx(
        frames.enu_from_ned(v_n), abs=1e-14
    )
    q_es = frames.attitude_enu_from_ned(q_nb)
    assert quaternion.rotate(q_es, V) == pytest.approx(frames.enu_from_ned(v_n), abs=1e-14)
    assert quaternion.angle(frames.attitude_ned_frd_from_enu_flu(q_ef), q_nb) < 1e-14
    assert quaternion.angle(frames.attitude_ned_from_enu(q_es), q_nb) < 1e-14
