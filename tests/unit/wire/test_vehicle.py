"""What an autopilot reports of its vehicle."""

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.codec import Encoder, decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.readers import READERS
from h2nav.wire.vehicle import Vibration


def read(message):
    """The record of a message as it comes over a link."""
    (frame,) = Deframer().feed(Encoder(1, 1).encode(message))
    return READERS[frame.msg_id](decode(frame))


def test_vibration_has_levels_and_the_clips_of_each_accelerometer():
    message = mavlink.MAVLink_vibration_message(5, 1.5, 62.0, 30.25, 7, 0, 4_000_000_000)
    assert read(message) == Vibration((1.5, 62.0, 30.25), (7, 0, 4_000_000_000))


def test_a_level_that_is_no_number_says_nothing():
    message = mavlink.MAVLink_vibration_message(5, math.nan, math.inf, 3.0, 0, 0, 0)
    assert read(message) == Vibration((0.0, 0.0, 3.0), (0, 0, 0))
