"""Whatever messages say: motion estimation never raises and never publishes a non-number."""

import math
from types import SimpleNamespace

from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, ImuSample, Trust
from h2nav.service.autopilot import Autopilot, Heard
from h2nav.service.effects import Record, Send
from h2nav.service.motion import motion_for
from h2nav.service.outputs import Outputs
from h2nav.service.settings import (
    AutopilotSettings,
    MotionSettings,
    OutputSettings,
    ServiceSettings,
)
from h2nav.wire.codec import Encoder
from h2nav.wire.readers import READERS, Envelope
from h2nav.wire.refused import Refused
from h2nav.wire.vehicle import Heartbeat

ANY_FLOAT = st.one_of(
    st.floats(width=32), st.sampled_from([0.0, 1.0, -1.0, math.nan, math.inf, -math.inf])
)
TIMES = st.one_of(st.integers(0, 4_000_000), st.integers(0, (1 << 64) - 1))
LEVEL = (1.0, 0.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


def bound(estimator):
    """Motion estimation of a vehicle 1/1, with what it told."""
    autopilot = Autopilot(AutopilotSettings())
    assert autopilot.take_heartbeat(0, (1, 1), Heartbeat(3, 2, is_armed=False)) is Heard.BOUND
    chosen = ServiceSettings(motion=MotionSettings(estimator, odometry_rate_hz=1000.0))
    outputs = Outputs(OutputSettings(), 1000.0)
    return motion_for(chosen, autopilot, outputs, lambda *_: [], 0)


def deliver(motion, t_ns, sender, message_id, fields):
    """The message across the wire boundary."""
    envelope = Envelope(t_ns, t_ns, sender, message_id)
    try:
        measured = READERS[message_id](fields)
    except Refused as refusal:
        return motion.on_refusal(envelope, refusal.reason)
    return motion.on_message(envelope, measured)


@st.composite
def poses(draw):
    q = draw(st.one_of(st.just(LEVEL), st.tuples(*[ANY_FLOAT] * 4)))
    x, y, z, roll, pitch, yaw = draw(st.tuples(*[ANY_FLOAT] * 6))
    time = draw(TIMES)
    world = draw(st.sampled_from([1, 4, 20, 21, 0]))
    child = draw(st.sampled_from([8, 12, 13, 0]))
    fields = SimpleNamespace(
        time_usec=time, usec=time, q=q, x=x, y=y, z=z, roll=roll, pitch=pitch, yaw=yaw,
        frame_id=world, child_frame_id=child, quality=0, estimator_type=3,
        reset_counter=draw(st.integers(0, 255)),
    )  # fmt: skip
    message_id = draw(
        st.sampled_from(
            [
                mavlink.MAVLINK_MSG_ID_ODOMETRY,
                mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE,
                mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP,
            ]
        )
    )
    return message_id, draw(st.integers(190, 200)), fields


@st.composite
def samples(draw):
    w_b = draw(st.one_of(st.just(ZERO), st.tuples(*[ANY_FLOAT] * 3)))
    return w_b, draw(st.one_of(st.just((0.0, 0.0, -9.8)), st.tuples(*[ANY_FLOAT] * 3)))


def assert_finite(effects):
    for effect in effects:
        if isinstance(effect, Send):
            message = effect.message
            Encoder(1, 191).encode(message)  # a number that does not fit raises here
            values = (*message.q, message.x, message.y, message.z, message.vx, message.vy)
            values += (message.vz, message.rollspeed, message.pitchspeed, message.yawspeed)
            values += (*message.pose_covariance, *message.velocity_covariance)
            assert all(map(math.isfinite, values))
        elif isinstance(effect, Record) and effect.topic != "/pose_measured":
            numbers = [value for value in effect.record if isinstance(value, float)]
            assert all(map(math.isfinite, numbers))


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.lists(st.one_of(poses(), samples(), st.just("restart")), max_size=60))
def test_the_twist_observer_takes_anything(events):
    motion = bound("twist")
    for i, event in enumerate(events):
        t_us = 1_000_000 + i * 10_000
        t_ns = 9_000_000_000 + i * 10_000_000
        if event == "restart":
            motion.restart()
        elif len(event) == 3:
            message_id, component_id, fields = event
            assert_finite(deliver(motion, t_ns, (1, component_id), message_id, fields))
        w_b, f_b = event if len(event) == 2 else (ZERO, (0.0, 0.0, -9.8))
        estimate = AttitudeEstimate(t_us, LEVEL, ZERO, ZERO, ZERO, 0.01, Trust.ALIGNED)
        assert_finite(motion.on_sample(t_ns, ImuSample(t_us, w_b, f_b), estimate))
    assert all(count > 0 for count in motion.rejected.values())


@settings(derandomize=True, deadline=None, max_examples=150)
@given(
    st.lists(
        st.tuples(
            TIMES, st.integers(0, 255), st.lists(st.floats(), min_size=16, max_size=16)
        ),
        max_size=60,
    )
)  # fmt: skip
def test_the_wheel_odometry_takes_anything(readings):
    motion = bound("wheels")
    for i, (time_usec, count, distance) in enumerate(readings):
        t_us, t_ns = 1_000_000 + i * 10_000, 9_000_000_000 + i * 10_000_000
        fields = SimpleNamespace(time_usec=time_usec, count=count, distance=tuple(distance))
        motion.on_sample(t_ns, ImuSample(t_us, ZERO, (0.0, 0.0, -9.8)), None)
        effects = deliver(motion, t_ns, (1, 1), mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE, fields)
        assert_finite(effects)
