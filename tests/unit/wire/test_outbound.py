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
