"""The twist observer in the whole pipeline: biased IMU, a camera with its faults, ODOMETRY out."""

import math

import pytest
from lanes import few_rows
from motion_flights import (
    CAMERA,
    altered,
    is_finite,
    odometry,
    position_error_m,
    rate_error_rad_s,
    twist_flight,
    velocity_error_m_s,
)
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths import frames, quaternion
from h2nav.service.settings import MotionSettings
from h2nav.sim.vision_streams import vision_stream

UNIX_US = 1_795_000_000_000_000


def assert_right(flight, start_s, end_s=math.inf, velocity_m_s=0.25):
    """ODOMETRY at its rate, with twist, position and (by the rates) bias right."""
    sent = odometry(flight, start_s, end_s)
    assert len(sent) > 15 * (min(end_s, flight.t_s) - start_s)
    for _, message in sent:
        assert message.frame_id == mavlink.MAV_FRAME_LOCAL_FRD
        assert message.child_frame_id == mavlink.MAV_FRAME_BODY_FRD
        assert velocity_error_m_s(flight, message) < velocity_m_s
        assert position_error_m(flight, message) < 0.1
        assert rate_error_rad_s(flight, message) < 0.03


@pytest.mark.parametrize("name", ["odometry", "vision_position_estimate", "att_pos_mocap"])
def test_twist_and_bias_come_right_within_5_s(name):
    """30 Hz, 50 ms late, a tenth lost, 2 deg/s of bias: after 5 s 0.25 m/s, 0.03 rad/s, 0.1 m.

    The bias itself is right within 0.006 rad/s. (The rate's bound holds the gyro's noise; the
    rates are 11 ms old.)
    """
    flight = twist_flight(camera=CAMERA._replace(message=name, drop_out=0.1)).run(9.0)
    first_s = odometry(flight)[0][0]
    assert first_s < 1.0
    assert_right(flight, first_s + 5.0)
    bias = flight.pipeline.service.motion.latest.bias_w
    assert math.dist(bias, flight.autopilot.vehicle.gyro_bias(0)) < 0.006
    assert flight.seen.states[-1][1] == "active"
    assert odometry(flight)[-1][1].reset_counter == 0
    # Poses of before the first sample.
    assert set(flight.rejected) <= {"pose_before_attitude", "pose_too_old"}


def test_odometry_answers_to_requests_like_the_other_outputs():
    """MAV_CMD_REQUEST_MESSAGE and GET_MESSAGE_INTERVAL know ODOMETRY while motion is estimated."""
    flight = twist_flight(motion=MotionSettings("twist", odometry_rate_hz=5.0)).run(6.0)
    assert 25 < len(odometry(flight)) < 32
    outputs = flight.pipeline.service._outputs
    assert outputs.latest(mavlink.MAVLINK_MSG_ID_ODOMETRY)[0].time_usec > 5_900_000
    assert outputs.rate_hz(mavlink.MAVLINK_MSG_ID_ODOMETRY) == 5.0


def test_a_silent_camera_stops_odometry_and_its_return_is_a_reset():
    """Silent from 5 s to 9 s: nothing after 7.1 s, a warning, then reset_counter + 1 and right."""

    def change(t_s, message):
        return None if 5.0 < t_s < 9.0 else message

    flight = twist_flight(change=change).run(12.0)
    assert len(odometry(flight, 5.0, 7.0)) > 30
    assert odometry(flight, 7.1, 9.0) == []
    assert 7.0 < flight.first("no ODOMETRY: no poses") < 7.6
    assert_right(flight, 10.5)
    assert {message.reset_counter for _, message in odometry(flight, 0.0, 7.1)} == {0}
    assert odometry(flight)[-1][1].reset_counter == 1
    assert flight.pipeline.service._outputs.latest(mavlink.MAVLINK_MSG_ID_ODOMETRY)


def test_while_the_camera_is_silent_no_old_odometry_is_handed_out():
    """A stale estimate is not given on request either."""
    flight = twist_flight(change=lambda t_s, m: m if t_s < 4.0 else None).run(7.0)
    assert odometry(flight) != []
    assert not flight.pipeline.service._outputs.latest(mavlink.MAVLINK_MSG_ID_ODOMETRY)


@pytest.mark.parametrize("told", [False, True])
def test_a_jump_of_the_poses_is_a_reset(told):
    """A map shifted by 5 m at 6 s, said by the source's own counter or not: reset_counter + 1."""

    def change(t_s, message):
        if t_s > 6.0:
            message.x += 5.0
            message.reset_counter = int(told)
        return message

    flight = twist_flight(change=change).run(8.0)
    before, after = odometry(flight, 0.0, 6.0)[-1][1], odometry(flight)[-1][1]
    assert (before.reset_counter, after.reset_counter) == (0, 1)
    assert after.x - before.x == pytest.approx(5.0, abs=0.6)
    assert velocity_error_m_s(flight, after) < 0.25
    assert flight.first("odometry reset") < 6.5
    assert flight.rejected.get("pose_jump", 0) == (0 if told else 4)


def damage(field, value):
    def change(t_s, message):
        # Every third message is damaged, once the first ones were sound.
        if t_s > 2.0 and round(t_s * 30.0) % 3 == 0:
            setattr(message, field, value(message))
        return message

    return change


@pytest.mark.parametrize(
    ("field", "value", "reason"),
    few_rows(
        4,
        [
            ("x", lambda _m: math.nan, "pose_not_finite"),
            ("q", lambda _m: (math.nan,) * 4, "pose_not_finite"),
            ("q", lambda _m: (0.0,) * 4, "pose_not_finite"),
            ("z", lambda _m: 1e30, "pose_not_finite"),
            ("frame_id", lambda _m: mavlink.MAV_FRAME_GLOBAL, "pose_wrong_frame"),
            ("frame_id", lambda _m: mavlink.MAV_FRAME_LOCAL_NED, "pose_wrong_frame"),
            ("quality", lambda _m: -1, "pose_failed"),
            ("time_usec", lambda m: m.time_usec - 300_000, "pose_not_later"),
            ("time_usec", lambda m: m.time_usec - 1_500_000, "pose_not_later"),
            ("time_usec", lambda _m: 1, "pose_stray_time"),
            ("time_usec", lambda m: m.time_usec + 1_500_000, "pose_too_far_ahead"),
            ("time_usec", lambda _m: (1 << 64) - 1, "pose_stray_time"),
            (
                "estimator_type",
                lambda _m: mavlink.MAV_ESTIMATOR_TYPE_AUTOPILOT,
                "pose_of_autopilot",
            ),
        ],
    ),
)
def test_bad_poses_between_good_ones_are_counted_and_do_no_harm(field, value, reason):
    """Every third pose is damaged: it is counted by its reason, and the twist comes right."""
    flight = twist_flight(change=damage(field, value)).run(6.5)
    assert flight.rejected[reason] > 40
    assert all(is_finite(message) for _, message in odometry(flight))
    assert_right(flight, 5.5)
    assert odometry(flight)[-1][1].reset_counter == 0


def test_nothing_but_bad_poses_is_told_once():
    """Every pose in a global frame: no ODOMETRY, one warning that names the reason."""

    def change(_t_s, message):
        message.frame_id = mavlink.MAV_FRAME_GLOBAL
        return message

    flight = twist_flight(change=change).run(4.0)
    assert odometry(flight) == []
    told = [text for _, _, text in flight.seen.notices if "refused" in text]
    assert told == ["poses refused: pose_wrong_frame"]
    assert flight.seen.states[-1][1] == "active"


@pytest.mark.parametrize(
    ("name", "shift_us", "delay_s"),
    # The test's monotonic clock begins at 1,000 s and counts as UNIX time.
    [("unix of the host", 1_000_000_000, 0.05), ("own", UNIX_US, 0.0), ("none", None, 0.0)],
)
def test_time_stamps_on_other_clocks(name, shift_us, delay_s):
    """The host's UNIX time, a clock of the camera's own, and none at all: the twist comes right.

    A delay shows only in the first; for the others it would be `twist.pose_delay_ms`.
    """

    def change(_t_s, message):
        message.time_usec = 0 if shift_us is None else message.time_usec + shift_us
        return message

    camera = CAMERA._replace(delay_s=delay_s)
    flight = twist_flight(camera=camera, change=change).run(8.0)
    assert_right(flight, 7.0)
    assert odometry(flight)[-1][1].reset_counter == 0


def test_east_north_up_with_forward_left_up_is_the_same_pose():
    """A source that speaks as ROS does gives the same motion, in LOCAL_NED."""

    def change(_t_s, message):
        message.frame_id, message.child_frame_id = mavlink.MAV_FRAME_LOCAL_ENU, 13
        message.q = frames.attitude_enu_flu_from_ned_frd(tuple(message.q))
        message.x, message.y, message.z = frames.enu_from_ned((message.x, message.y, message.z))
        return message

    flight = twist_flight(change=change).run(8.0)
    _, message = odometry(flight)[-1]
    assert message.frame_id == mavlink.MAV_FRAME_LOCAL_NED
    assert position_error_m(flight, message) < 0.1
    assert velocity_error_m_s(flight, message) < 0.25
    q_nb = flight.autopilot.vehicle.scenario.motion(message.time_usec * 1e-6).q_nb
    assert quaternion.angle(tuple(message.q), q_nb) < 0.5 * DEG


def second_camera(compid, message):
    def elsewhere(_t_s, pose):
        pose.x += 100.0
        return pose

    stream = vision_stream(CAMERA._replace(message=message, rate_hz=10.0), 4)
    return altered(stream, elsewhere)._replace(compid=compid)


def test_the_first_source_stays_and_the_other_is_counted():
    """Two cameras in different maps: one is followed, no reset, the other counted."""
    flight = twist_flight(others=(second_camera(198, "vision_position_estimate"),)).run(5.0)
    assert flight.rejected["pose_other_source"] > 30
    assert odometry(flight)[-1][1].reset_counter == 0
    assert abs(odometry(flight)[-1][1].x) < 50.0


def test_the_configured_source_is_the_one():
    """`pose_component_id` and `pose_message` choose."""
    chosen = MotionSettings("twist", "VISION_POSITION_ESTIMATE", 198)
    others = (second_camera(198, "vision_position_estimate"),)
    flight = twist_flight(motion=chosen, others=others).run(3.0)
    assert odometry(flight)[-1][1].x == pytest.approx(100.0, abs=1.0)


def test_another_source_takes_over_when_the_first_has_died():
    """5 s of silence give the second camera its turn: reset_counter + 1, its map."""

    def dies(t_s, message):
        return message if t_s < 4.0 else None

    others = (second_camera(198, "vision_position_estimate"),)
    flight = twist_flight(change=dies, others=others).run(11.0)
    assert odometry(flight, 6.2, 8.9) == []
    _, last = odometry(flight)[-1]
    assert last.reset_counter == 1
    assert last.x == pytest.approx(100.0, abs=1.0)


def test_a_reboot_of_the_autopilot_is_a_reset_that_keeps_the_bias():
    """After the reboot the observer starts from the next poses with what it has learnt."""
    flight = twist_flight(faults=("reboot@5",)).run(9.0)
    back_s, first = odometry(flight, 6.0)[0]
    assert back_s < 8.0
    assert first.reset_counter == 1
    bias = flight.pipeline.service.motion.latest.bias_w
    assert math.dist(bias, flight.autopilot.vehicle.gyro_bias(0)) < 0.006


def test_a_line_that_loses_delays_and_doubles_frames():
    """A tenth of all frames lost, doubled and reordered, up to 50 ms held back: still right."""
    faults = ("drop=0.1@0", "duplicate=0.1@0", "reorder=0.1@0", "delay=50@0")
    flight = twist_flight(faults=faults).run(10.0)
    assert_right(flight, 7.0, velocity_m_s=0.4)
    assert odometry(flight)[-1][1].reset_counter == 0


def test_without_the_setting_nothing_of_it_happens():
    """`motion.estimator: none` ignores poses and sends no ODOMETRY."""
    flight = twist_flight(motion=MotionSettings()).run(3.0)
    assert odometry(flight) == []
    assert mavlink.MAVLINK_MSG_ID_ODOMETRY not in flight.pipeline.service.message_ids
    assert flight.rejected == {}
