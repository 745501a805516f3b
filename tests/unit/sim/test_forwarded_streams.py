"""Wheel distances and vision poses: what they say, when, from whom, and how noisy."""

import math

import numpy as np
import pytest
from needs import DEG
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.errors import BadInput
from h2nav.maths import quaternion
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.faults import parse_fault
from h2nav.sim.scenarios import scenario
from h2nav.sim.vision_streams import VISION_MESSAGES, VisionOptions, vision_stream

SECOND = 1_000_000_000


def flown(name, seconds, vision=None, ask=(), seed=1):
    streams = () if vision is None else (vision_stream(vision, seed),)
    autopilot = FakeAutopilot(AutopilotOptions(scenario(name), seed=seed, extra_streams=streams))
    autopilot.advance(0)
    for message_id in ask:
        request = mavlink.MAVLink_command_long_message(1, 1, 511, 0, message_id, 5e4, 0, 0, 0, 0, 0)
        autopilot.on_message(0, 1, 191, request.id, request)
    return autopilot.advance(round(seconds * SECOND))


def of(outgoing, name):
    return [item for item in outgoing if item.message.get_type() == name]


def test_wheel_distance_on_request_only():
    assert of(flown("square", 5.0), "WHEEL_DISTANCE") == []
    assert len(of(flown("square", 5.0, ask=[9000]), "WHEEL_DISTANCE")) == 100


def test_wheel_distance_follows_the_wheels_with_slip_and_whole_steps():
    ends = []
    for seed in range(60):
        last = of(flown("half-circle", 9.0, ask=[9000], seed=seed), "WHEEL_DISTANCE")[-1].message
        assert last.count == 2
        assert last.distance[2:] == [0.0] * 14
        for distance in last.distance[:2]:
            assert distance * 1e3 == pytest.approx(round(distance * 1e3), abs=1e-6)
        ends.append(last.distance[:2])
    truth = scenario("half-circle").wheels_at(9.0)
    assert truth == pytest.approx((2.2 * math.pi, 1.8 * math.pi))
    np.testing.assert_allclose(np.mean(ends, axis=0), truth, atol=0.003)
    np.testing.assert_allclose(np.std(ends, axis=0), 0.002 * np.sqrt(truth), rtol=0.3)


def test_rover_says_it_is_one_and_never_flies():
    outgoing = flown("square", 8.0, ask=[245])
    beats = [item.message for item in of(outgoing, "HEARTBEAT")]
    assert {beat.type for beat in beats} == {mavlink.MAV_TYPE_GROUND_ROVER}
    states = {item.message.landed_state for item in of(outgoing, "EXTENDED_SYS_STATE")}
    assert states == {mavlink.MAV_LANDED_STATE_UNDEFINED}


def pose_of(message):
    """Time, attitude and position of any of the three messages."""
    if message.get_type() == "VISION_POSITION_ESTIMATE":
        q_nb = quaternion.from_euler(message.roll, message.pitch, message.yaw)
        return message.usec, q_nb, (message.x, message.y, message.z)
    return message.time_usec, tuple(message.q), (message.x, message.y, message.z)


@pytest.mark.parametrize("name", VISION_MESSAGES)
def test_poses_are_the_truth_of_their_time_with_the_stated_noise(name):
    outgoing = flown("aggressive", 20.0, VisionOptions(name, delay_s=0.05))
    items = of(outgoing, name.upper())
    assert {(item.sysid, item.compid) for item in items} == {(1, 197)}
    turns, shifts = [], []
    for item in items:
        t_usec, q_nb, p_n = pose_of(item.message)
        assert item.t_ns / 1000 - t_usec == pytest.approx(50_000, abs=1)
        truth = scenario("aggressive").motion(t_usec * 1e-6)
        turns.append(quaternion.log(quaternion.multiply(quaternion.conjugate(truth.q_nb), q_nb)))
        shifts.append([a - b for a, b in zip(p_n, truth.p_n, strict=True)])
    assert len(items) == pytest.approx(599, abs=2)
    np.testing.assert_allclose(np.std(turns, axis=0), 2e-3, rtol=0.15)
    np.testing.assert_allclose(np.std(shifts, axis=0), 5e-3, rtol=0.15)
    np.testing.assert_allclose(np.mean(turns, axis=0), 0, atol=0.02 * DEG)
    covariance = (
        items[0].message.pose_covariance if name == "odometry" else items[0].message.covariance
    )
    assert [covariance[i] for i in (0, 6, 11, 15, 18, 20)] == pytest.approx(
        [25e-6] * 3 + [4e-6] * 3
    )


def test_odometry_has_the_frames_that_ardupilot_takes_and_body_velocities():
    outgoing = flown("half-circle", 6.0, VisionOptions("odometry"))
    message = of(outgoing, "ODOMETRY")[90].message
    assert (message.frame_id, message.child_frame_id) == (20, 12)
    truth = scenario("half-circle").motion(message.time_usec * 1e-6)
    assert message.vx == pytest.approx(math.hypot(*truth.v_n), abs=0.1)
    assert message.vy == pytest.approx(0.0, abs=0.1)
    assert message.yawspeed == pytest.approx(truth.w_b[2])


def test_drop_outs():
    items = of(flown("hover", 40.0, VisionOptions(rate_hz=50.0, drop_out=0.1)), "ODOMETRY")
    assert len(items) == pytest.approx(1800, abs=60)


@pytest.mark.parametrize(
    "options",
    [
        VisionOptions("telepathy"),
        VisionOptions(rate_hz=0.0),
        VisionOptions(rate_hz=math.nan),
        VisionOptions(delay_s=-1.0),
        VisionOptions(drop_out=1.5),
    ],
)
def test_bad_options_are_refused(options):
    with pytest.raises(BadInput, match="vision"):
        vision_stream(options, 0)


@pytest.mark.parametrize("delay_s", [0.5, 1.5])
def test_after_a_reboot_no_pose_is_older_than_the_clock(delay_s):
    stream = vision_stream(VisionOptions(rate_hz=50.0, delay_s=delay_s), 1)
    faults = (parse_fault("reboot@2"),)
    autopilot = FakeAutopilot(
        AutopilotOptions(scenario("rest"), extra_streams=(stream,), faults=faults)
    )
    autopilot.advance(0)
    autopilot.advance(2 * SECOND)
    poses = of(autopilot.advance(5 * SECOND), "ODOMETRY")
    assert poses[0].t_ns == pytest.approx((2.0 + max(delay_s, 1.0)) * SECOND, abs=2.1e7)
    assert 0 <= poses[0].message.time_usec < 2e4 + max(1.0 - delay_s, 0.0) * 1e6 + 1
