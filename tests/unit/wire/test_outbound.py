"""What we send always fits its fields."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.maths.quaternion import exp, from_euler, multiply, to_euler
from h2nav.motion.samples import OdometryRecord, PoseFrame
from h2nav.wire import outbound
from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer

YAW_EAST = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
ZERO = (0.0, 0.0, 0.0)


def estimate(t_us, q_nb=YAW_EAST):
    return AttitudeEstimate(t_us, q_nb, (0.1, 0.2, 0.3), ZERO, ZERO, 0.01, Trust.ALIGNED)


def on_the_wire(message):
    """What a receiver reads."""
    (frame,) = Deframer().feed(Encoder(1, 191).encode(message))
    return decode(frame)


def test_attitude_has_the_samples_time_and_bias_corrected_rates():
    message = outbound.attitude(estimate((1 << 32) * 1000 + 5_000))
    assert message.time_boot_ms == 5
    assert message.yaw == pytest.approx(math.pi / 2)
    assert (message.rollspeed, message.pitchspeed, message.yawspeed) == (0.1, 0.2, 0.3)


def test_attitude_quaternion_is_scalar_first():
    assert outbound.attitude_quaternion(estimate(0)).q1 == pytest.approx(math.sqrt(0.5))


SIGMAS = st.floats(0.0) | st.just(math.nan)


def covariance_of(q_nb, sigma_tilt_rad=0.02, sigma_heading_rad=0.05):
    sent = estimate(7_000_000, q_nb)._replace(
        sigma_tilt_rad=sigma_tilt_rad, sigma_heading_rad=sigma_heading_rad
    )
    return on_the_wire(outbound.attitude_quaternion_cov(sent)).covariance


def test_a_level_attitude_has_the_variances_of_its_deviations():
    """That of the tilt is shared by roll and pitch."""
    expected = [2e-4, 0, 0, 0, 2e-4, 0, 0, 0, 25e-4]
    assert covariance_of(YAW_EAST) == pytest.approx(expected, abs=1e-8)


def test_the_covariance_is_that_of_the_euler_angles():
    """Against many attitudes that are off by as much."""
    q_nb = from_euler(0.3, 0.9, -2.0)
    rng = np.random.default_rng(1)
    errors = rng.normal(size=(20_000, 3)) * (0.02 / math.sqrt(2), 0.02 / math.sqrt(2), 0.05)
    angles = [to_euler(multiply(exp(tuple(error)), q_nb)) for error in errors.tolist()]
    expected = np.cov(np.array(angles).T).ravel()
    assert covariance_of(q_nb) == pytest.approx(expected, rel=0.05, abs=3e-5)


def test_an_unknown_deviation_is_that_of_any_angle():
    assert covariance_of(YAW_EAST, math.nan, math.nan)[8] == pytest.approx(math.pi**2 / 3)
    assert covariance_of(YAW_EAST, math.inf, math.inf)[8] == pytest.approx(math.pi**2)


@given(st.floats(-math.pi, math.pi), st.floats(-math.pi / 2, math.pi / 2), SIGMAS, SIGMAS)
@settings(derandomize=True, deadline=None)
def test_every_covariance_is_finite(roll, pitch, sigma_tilt_rad, sigma_heading_rad):
    covariance = covariance_of(from_euler(roll, pitch, 1.0), sigma_tilt_rad, sigma_heading_rad)
    assert all(map(math.isfinite, covariance))


@given(st.floats(), st.floats())
@settings(derandomize=True, deadline=None)
def test_what_is_unknown_of_the_estimator_is_zero(vel_ratio, mag_ratio):
    read = on_the_wire(outbound.estimator_status(5, 3, vel_ratio, mag_ratio))
    assert (read.time_usec, read.flags, read.pos_horiz_ratio) == (5, 3, 0.0)
    assert math.isfinite(read.vel_ratio)
    assert math.isfinite(read.mag_ratio)
    if math.isnan(vel_ratio):
        assert read.vel_ratio == 0.0


@pytest.mark.parametrize("name", ["h2_tiltdif", "h2_yaw_dif"])
def test_a_named_value_keeps_its_name(name):
    read = on_the_wire(outbound.named_value_float((1 << 32) * 1000 + 5_000, name, 1.5))
    assert (read.time_boot_ms, read.name, read.value) == (5, name, 1.5)


def test_timesync_carries_its_target():
    read = on_the_wire(outbound.time_sync(123, 456, (7, 8)))
    assert (read.tc1, read.ts1, read.target_system, read.target_component) == (123, 456, 7, 8)


@given(st.integers(), st.integers(), st.tuples(st.integers(0, 255), st.integers(0, 255)))
@settings(derandomize=True, deadline=None)
def test_any_clock_fits_a_timesync(tc1_ns, ts1_ns, target):
    assert on_the_wire(outbound.time_sync(tc1_ns, ts1_ns, target))


@given(st.floats(0.0, allow_nan=False))
@settings(derandomize=True, deadline=None)
def test_any_rate_fits_a_message_interval(rate_hz):
    read = on_the_wire(outbound.message_interval(mavlink.MAVLINK_MSG_ID_ATTITUDE, rate_hz))
    assert read.interval_us == -1 or 0 <= read.interval_us <= (1 << 31) - 1


@given(st.floats(allow_nan=False))
@settings(derandomize=True, deadline=None)
def test_any_number_fits(number):
    assert on_the_wire(outbound.param_value("H2_ATT_HZ", number, 0, 1))


def put_together(text):
    """The chunks of a text, read as QGroundControl and others do: one that is not full is last."""
    chunks = [on_the_wire(message) for message in outbound.status_text(4, text, 9)]
    octets = [chunk.text.encode() for chunk in chunks]
    assert all(len(part) == outbound.STATUS_TEXT_SIZE for part in octets[:-1])
    assert len(chunks) == 1 or len(octets[-1]) < outbound.STATUS_TEXT_SIZE
    ids = [(chunk.id, chunk.chunk_seq) for chunk in chunks]
    assert ids == ([(0, 0)] if len(chunks) == 1 else [(9, i) for i in range(len(chunks))])
    return "".join(chunk.text for chunk in chunks)


@pytest.mark.parametrize("length", [0, 1, 49, 50, 51, 99, 100, 101, 199])
def test_a_text_arrives_whole(length):
    text = ("h2nav: IMU 2 instead of 1: vibration, 12 clips; " * 5)[:length]
    assert put_together(text) == text


def test_a_character_is_never_cut_in_two():
    for before in range(47, 52):
        text = "x" * before + "\u00e4\u20ac\U0001f681" + "y" * 60
        read = put_together(text)
        assert "\ufffd" not in read
        assert read.replace(" ", "") == text


def test_what_is_too_long_ends_with_an_ellipsis():
    for letter in ("x", "\u00e4", "\u20ac"):
        read = put_together(letter * 1000)
        assert read.endswith(letter + outbound.ELLIPSIS)
        assert 180 < len(read.encode()) <= 199


@given(st.text(st.characters(), max_size=300))
@settings(derandomize=True, deadline=None)
def test_any_text_fits_that_of_a_file_name_without_utf8_as_well(text):
    assert "\0" not in put_together(text + "\udcff.tlog")


def test_a_covariance_beyond_single_precision_stands_at_its_end():
    record = OdometryRecord(
        1, PoseFrame.LOCAL_FRD, (1.0, 0.0, 0.0, 0.0), (1e300, 0.0, 0.0), ZERO, ZERO,
        (1e300,) * 21, (1e300,) * 21, 300,
    )  # fmt: skip
    read = on_the_wire(outbound.odometry(record, 3, 100))
    assert read.x == pytest.approx(3.4e38, rel=0.01)
    assert all(map(math.isfinite, read.pose_covariance))
    assert read.reset_counter == 300 % 256
    first = outbound.odometry(record._replace(reset_counter=256), 3, 100)
    assert on_the_wire(first).reset_counter == 0


THEM = (7, 8)


@pytest.mark.parametrize(
    ("message", "name", "fields"),
    [
        (
            outbound.heartbeat(4),
            "HEARTBEAT",
            {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4},
        ),
        (
            outbound.attitude_quaternion(estimate((1 << 32) * 1000 + 5_999)),
            "ATTITUDE_QUATERNION",
            {"time_boot_ms": 5, "q2": 0.0, "q3": 0.0, "rollspeed": 0.1, "yawspeed": 0.3},
        ),
        (
            outbound.attitude_quaternion_cov(estimate(7)),
            "ATTITUDE_QUATERNION_COV",
            {"time_usec": 7, "q": YAW_EAST, "rollspeed": 0.1, "pitchspeed": 0.2, "yawspeed": 0.3},
        ),
        (
            outbound.estimator_status(9, 3, 0.25, 0.5),
            "ESTIMATOR_STATUS",
            {"time_usec": 9, "flags": 3, "vel_ratio": 0.25, "mag_ratio": 0.5, "hagl_ratio": 0.0},
        ),
        (
            outbound.command_ack(511, 4, THEM),
            "COMMAND_ACK",
            {"command": 511, "result": 4, "progress": 0, "result_param2": 0,
             "target_system": 7, "target_component": 8},
        ),
        (
            outbound.arm_authorization(2, 10, THEM),
            "COMMAND_ACK",
            {"command": 3001, "result": 2, "progress": 0, "result_param2": 10,
             "target_system": 7, "target_component": 8},
        ),
        (
            outbound.arming_opinion(-3),
            "NAMED_VALUE_INT",
            {"time_boot_ms": 0, "name": "h2_arm", "value": -3},
        ),
        (
            outbound.arming_reason("gyro 1"),
            "TUNNEL",
            {"target_system": 0, "target_component": 0, "payload_type": 0xE832,
             "payload_length": 6, "payload": (*b"gyro 1", *[0] * 122)},
        ),
        (outbound.arming_reason("x" * 35), "TUNNEL", {"payload_length": 34}),
        (outbound.message_interval(30, 50.0), "MESSAGE_INTERVAL",
         {"message_id": 30, "interval_us": 20_000}),
        (outbound.message_interval(30, 0.0), "MESSAGE_INTERVAL", {"interval_us": -1}),
        (outbound.message_interval(30, 1e-9), "MESSAGE_INTERVAL", {"interval_us": (1 << 31) - 1}),
        (
            outbound.param_value("H2_ATT_HZ", 5.0, 2, 6),
            "PARAM_VALUE",
            {"param_id": "H2_ATT_HZ", "param_value": 5.0, "param_type": 9, "param_index": 2,
             "param_count": 6},
        ),
        (
            outbound.param_request_read(THEM, "COMPASS_USE"),
            "PARAM_REQUEST_READ",
            {"target_system": 7, "target_component": 8, "param_id": "COMPASS_USE",
             "param_index": -1},
        ),
        (
            outbound.autopilot_version(1, 2, 3),
            "AUTOPILOT_VERSION",
            # MAVLink 2, and parameters that are floats
            {"flight_sw_version": 0x01020300, "capabilities": 0x2002, "uid": 0},
        ),
        (
            outbound.set_message_interval(THEM, 27, 200.0),
            "COMMAND_LONG",
            {"target_system": 7, "target_component": 8, "command": 511, "confirmation": 0,
             "param1": 27.0, "param2": 5_000.0, "param3": 0.0, "param7": 0.0},
        ),
        (outbound.set_message_interval(THEM, 27, 0.0), "COMMAND_LONG", {"param2": 0.0}),
        (
            outbound.request_message(THEM, 148),
            "COMMAND_LONG",
            {"target_system": 7, "target_component": 8, "command": 512, "confirmation": 0,
             "param1": 148.0, "param2": 0.0, "param7": 0.0},
        ),
        (
            outbound.request_data_stream(THEM, 6, 9.6),
            "REQUEST_DATA_STREAM",
            {"target_system": 7, "target_component": 8, "req_stream_id": 6,
             "req_message_rate": 10, "start_stop": 1},
        ),
        (outbound.request_data_stream(THEM, 6, 0.2), "REQUEST_DATA_STREAM",
         {"req_message_rate": 1}),
    ],
)  # fmt: skip
def test_what_is_sent_says_what_it_means(message, name, fields):
    read = on_the_wire(message)
    assert type(read).__name__ == name
    assert {key: getattr(read, key) for key in fields} == {
        key: pytest.approx(value) if isinstance(value, float | tuple) else value
        for key, value in fields.items()
    }


@pytest.mark.parametrize(("frame", "number"), [(PoseFrame.LOCAL_FRD, 20), (PoseFrame.LOCAL_NED, 1)])
def test_each_number_of_an_odometry_has_its_field(frame, number):
    pose, twist = tuple(map(float, range(21))), tuple(map(float, range(100, 121)))
    record = OdometryRecord(
        6, frame, YAW_EAST, (1.0, 2.0, 3.0), (4.0, 5.0, 6.0), (7.0, 8.0, 9.0), pose, twist, 3
    )
    read = on_the_wire(outbound.odometry(record, 3, 55))
    assert (read.time_usec, read.frame_id, read.child_frame_id) == (6, number, 12)
    assert read.q == pytest.approx(YAW_EAST)
    assert (read.x, read.y, read.z) == record.p_m
    assert (read.vx, read.vy, read.vz) == record.v_b_m_s
    assert (read.rollspeed, read.pitchspeed, read.yawspeed) == record.w_b_rad_s
    assert (read.pose_covariance, read.velocity_covariance) == (pose, twist)
    assert (read.reset_counter, read.estimator_type, read.quality) == (3, 3, 55)
