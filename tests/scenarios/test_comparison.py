"""The autopilot's attitude is compared with ours, and nobody else's."""

import math

import pytest
from lanes import few, few_rows
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from simulated_flight import SimulatedFlight

from h2nav.apps.configuration import Configuration
from h2nav.service.settings import AutopilotSettings, OutputSettings
from h2nav.sim.personalities import ARDUPILOT, PX4

AUTOPILOT, US = (1, 1), (1, 191)
QUIET = AutopilotSettings(compare_rate_hz=0.0)
SEEN_S = 16.0  # a difference is shown before


class Answering(SimulatedFlight):
    """A vehicle at rest whose attitude some sender reports at 10 Hz, turned by some angle."""

    def reports(self, until_s, *, turned_deg=0.0, sender=AUTOPILOT, second=False):
        while self.t_s < until_s:
            self.run(self.t_s + 0.1)
            if not self.seen.estimates:
                continue
            _, ours = self.seen.estimates[-1]
            angles = [math.radians(a) for a in (ours.roll_deg, ours.pitch_deg, ours.yaw_deg)]
            angles[2] = math.remainder(angles[2] + math.radians(turned_deg), 2.0 * math.pi)
            if second:
                message = mavlink.MAVLink_ahrs2_message(*angles, 0.0, 0, 0)
            else:
                message = mavlink.MAVLink_attitude_message(ours.t_us // 1000, *angles, 0, 0, 0)
            self.inject(message, sender)
        return self


def test_the_difference_is_shown_and_sent():
    output = OutputSettings(difference_rate_hz=5.0)
    flight = Answering("rest", configuration=Configuration(autopilot=QUIET, output=output))
    flight.reports(SEEN_S, turned_deg=20.0)
    assert flight.health.autopilot_heading_deg == pytest.approx(20.0, abs=0.3)
    assert flight.health.autopilot_tilt_deg == pytest.approx(0.0, abs=0.3)
    values = {
        m.name: m.value for _, m in flight.seen.sent if type(m).__name__ == "NAMED_VALUE_FLOAT"
    }
    assert values["h2_yaw_dif"] == pytest.approx(20.0, abs=0.3)
    assert values["h2_tiltdif"] == pytest.approx(0.0, abs=0.3)
    flight.run(SEEN_S + 4.0)
    assert flight.health.autopilot_heading_deg is None


def test_a_heading_that_jumps_at_rest_is_told_as_theirs_by_the_compass():
    flight = Answering("rest", configuration=Configuration(autopilot=QUIET))
    agreed_s = SEEN_S + 10.0
    flight.reports(agreed_s).reports(agreed_s + 5.0, turned_deg=60.0)
    (finding,) = flight.pipeline.service.findings
    assert finding.text == "autopilot heading off 60 deg, compass backs us"
    assert finding.backs_us
    flight.reports(agreed_s + 8.0)
    assert not flight.pipeline.service.open_findings


@pytest.mark.parametrize("sender", few(2, [US, (1, 2), (2, 1), (255, 190)]))
def test_nobody_elses_attitude_is_taken_for_the_autopilots(sender):
    flight = Answering("rest", configuration=Configuration(autopilot=QUIET))
    flight.reports(SEEN_S, turned_deg=20.0, sender=sender)
    assert flight.health.autopilot_heading_deg is None


def test_ahrs2_alone_is_no_difference_of_the_autopilot():
    flight = Answering("rest", configuration=Configuration(autopilot=QUIET))
    flight.reports(SEEN_S, turned_deg=20.0, second=True)
    assert flight.health.autopilot_heading_deg is None


@pytest.mark.parametrize(
    ("personality", "wanted"),
    few_rows(1, [(ARDUPILOT, {30: 10.0, 178: 5.0}), (PX4, {})]),
)
def test_what_is_missing_is_asked_for_last_and_nobody_hears_of_it(personality, wanted):
    """PX4 sends ATTITUDE by itself, and knows no AHRS2."""
    flight = SimulatedFlight("rest", personality=personality).run(20.0)
    asked = [
        (round(m.param1), 1e6 / m.param2)
        for _, m in flight.seen.sent
        if type(m).__name__ == "COMMAND_LONG"
        and m.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        and m.param2 > 0.0  # else it is given up
    ]
    assert {
        message_id: rate_hz for message_id, rate_hz in asked if message_id in (30, 178)
    } == wanted
    assert not any("ATTITUDE" in text or "AHRS2" in text for _, _, text in flight.seen.notices)
    first = [message_id for message_id, _ in dict.fromkeys(asked)]
    assert not wanted or first[-3:] == [30, 178, mavlink.MAVLINK_MSG_ID_VIBRATION]
