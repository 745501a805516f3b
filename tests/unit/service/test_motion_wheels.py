"""What the wheel odometry reports of wheel distances that it refuses."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import ImuSample
from h2nav.motion.settings import OdometrySettings
from h2nav.service.autopilot import Autopilot
from h2nav.service.motion import motion_for
from h2nav.service.motion_output import REFUSED_IN_A_ROW
from h2nav.service.outputs import Outputs
from h2nav.service.settings import (
    AutopilotSettings,
    MotionSettings,
    OutputSettings,
    ServiceSettings,
)
from h2nav.wire.motion import WheelDistances
from h2nav.wire.readers import Envelope
from h2nav.wire.vehicle import Heartbeat

WHEELS = mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE
STEP_NS = 50_000_000


class Rover:
    """A rover 1/1 that stands, or rolls by 0.1 m per message."""

    def __init__(self):
        self.told = []
        autopilot = Autopilot(AutopilotSettings())
        autopilot.take_heartbeat(0, (1, 1), Heartbeat(3, 10, is_armed=False))
        chosen = ServiceSettings(
            motion=MotionSettings("wheels", odometry_rate_hz=1000.0),
            odometry=OdometrySettings(track_m=0.5),
        )
        outputs = Outputs(OutputSettings(), 1000.0)
        self.motion = motion_for(chosen, autopilot, outputs, self._tell, 0)
        self.number = 0

    def _tell(self, _t_ns, severity, text, _cause=""):
        self.told.append((severity, text))
        return []

    def _envelope(self, sender=(1, 1)):
        self.number += 1
        t_ns = 9_000_000_000 + self.number * STEP_NS
        self.motion.on_sample(t_ns, ImuSample(t_ns // 1000, (0, 0, 0), (0, 0, -9.8)), None)
        return Envelope(t_ns, t_ns, sender, WHEELS)

    def refused(self, count, sender=(1, 1)):
        for _ in range(count):
            self.motion.on_refusal(self._envelope(sender), "wheels_not_finite")

    def rolls(self, usec=None, sender=(1, 1)):
        envelope = self._envelope(sender)
        way_m = 0.1 * self.number
        usec = envelope.t_ns // 1000 if usec is None else usec
        return self.motion.on_message(envelope, WheelDistances(usec, (way_m, way_m)))


def test_many_refusals_in_a_row_are_reported_once():
    rover = Rover()
    rover.refused(REFUSED_IN_A_ROW - 1)
    assert rover.told == []
    rover.refused(3 * REFUSED_IN_A_ROW)
    assert [text for _, text in rover.told] == ["wheel distances refused: wheels_not_finite"]
    assert rover.motion.rejected == {"wheels_not_finite": 4 * REFUSED_IN_A_ROW - 1}


def test_a_good_message_between_them_begins_a_new_row():
    rover = Rover()
    for _ in range(5):
        rover.refused(REFUSED_IN_A_ROW - 1)
        rover.rolls()
    assert [text for _, text in rover.told] == ["odometry from wheel distances"]
    assert rover.motion.latest is not None


def test_what_another_vehicle_sends_is_not_even_counted():
    rover = Rover()
    rover.refused(REFUSED_IN_A_ROW, sender=(2, 1))
    assert rover.told == []
    assert rover.motion.rejected == {}


def test_a_time_far_off_is_refused_and_counted():
    rover = Rover()
    rover.rolls()
    rover.rolls(usec=77_000_000_000)
    assert rover.motion.rejected == {"wheels_stray_time": 1}


def test_another_component_is_the_source_when_the_first_one_has_long_been_silent():
    rover = Rover()
    rover.rolls()
    rover.rolls(sender=(1, 20))
    assert rover.motion.rejected == {"wheels_other_source": 1}
    rover.number += 100
    rover.rolls(sender=(1, 20))
    assert rover.motion.rejected == {"wheels_other_source": 1}


def test_wheels_that_fall_silent_give_no_estimate_any_more():
    rover = Rover()
    rover.rolls()
    rover.rolls()
    assert rover.motion.latest.t_us == pytest.approx(9_000_000 + 2 * 50_000, abs=1_000)
    rover.number += 100
    rover.refused(1)
    assert rover.motion.latest is None
