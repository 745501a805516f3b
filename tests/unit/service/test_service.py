"""One autopilot after another: what was learnt of the first does not hold for the second."""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Kind
from h2nav.maths.units import GRAVITY_M_S2
from h2nav.service.effects import Notice, Record, Send
from h2nav.service.service import Service, Surroundings
from h2nav.wire.imu import ImuReading
from h2nav.wire.position import Place
from h2nav.wire.questions import Command
from h2nav.wire.readers import Envelope, Message
from h2nav.wire.vehicle import CommandAck, Heartbeat, LandedState

HEARTBEAT_ID = mavlink.MAVLINK_MSG_ID_HEARTBEAT
RAW_IMU_ID = mavlink.MAVLINK_MSG_ID_RAW_IMU
US_PER_SECOND = 1_000_000


class Bench:
    """A service, a clock, and the notices so far."""

    def __init__(self) -> None:
        chosen = Configuration()
        filters = FilterFactory.shipped(chosen.filter, chosen.autopilot.imu_rate_hz)
        surroundings = Surroundings(filters.filter_for, earth_field_at, 1_795_000_000.0)
        self.service = Service(chosen.service, surroundings)
        self.notices: list[str] = []
        self.t_us = 1_000 * US_PER_SECOND
        self.ahead_us = 0  # the autopilot's clock
        self.is_armed = False

    def rests(self, sender: tuple[int, int], seconds: float, force_m_s2: float) -> None:
        """An autopilot at rest on the ground says so at 100 Hz, with a heartbeat a second."""
        for count in range(round(100 * seconds)):
            self.t_us += 10_000
            if count % 100 == 0:
                beat = Heartbeat(
                    mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR, self.is_armed
                )
                self._hears(sender, HEARTBEAT_ID, beat)
            noise = 1e-4 * (count % 7)  # a sensor that gives one value for ever is frozen
            force = (noise, 0.0, -force_m_s2)
            rates, field = (noise, 0.0, 0.0), (20.0, 0.0, 45.0)
            reading = ImuReading(self.t_us + self.ahead_us, rates, force, field, False)
            self._hears(sender, RAW_IMU_ID, reading)

    def _hears(self, sender: tuple[int, int], message_id: int, message: Message) -> None:
        t_ns = 1000 * self.t_us
        envelope = Envelope(t_ns, t_ns, sender, message_id)
        if self.service.on_arrival(t_ns, sender, message_id):
            effects = self.service.on_message(envelope, message)
            self.notices += [effect.text for effect in effects if isinstance(effect, Notice)]


def test_a_place_is_read_once_a_second_after_the_field_is_known() -> None:
    bench = Bench()
    bench.rests((1, 1), 1, GRAVITY_M_S2)
    place_id = mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT

    def places(of: Place) -> int:
        """How many of 50 in the next second are read."""
        start_ns = 1000 * bench.t_us
        bench.t_us += US_PER_SECOND
        times_ns = range(start_ns, 1000 * bench.t_us, 20_000_000)
        needed = [t_ns for t_ns in times_ns if bench.service.on_arrival(t_ns, (1, 1), place_id)]
        for t_ns in needed:
            bench.service.on_message(Envelope(t_ns, t_ns, (1, 1), place_id), of)
        return len(needed)

    assert places(Place(0.0, 0.0, 0.0)) == 50
    places(Place(47.4, 8.5, 500.0))
    assert places(Place(47.4, 8.5, 500.0)) == 1


def test_the_units_of_another_autopilot_are_looked_at_anew() -> None:
    bench = Bench()
    bench.rests((1, 1), 5, GRAVITY_M_S2)
    assert not [text for text in bench.notices if text.startswith("|acc|")]
    bench.t_us += 20 * US_PER_SECOND
    bench.rests((2, 1), 8, 1.0)
    assert [text for text in bench.notices if text.startswith("|acc|")] == [
        "|acc| at rest 1 m/s2, not 9.8: sent in g as if in m/s2"
    ]


def test_faults_of_another_autopilot_end_when_this_one_is_bound() -> None:
    bench = Bench()
    bench.rests((1, 1), 0.5, GRAVITY_M_S2)
    for _ in range(100):
        bench.rests((1, 1), 0.01, GRAVITY_M_S2)  # the first sample, again and again
    assert [found.kind for found in bench.service.open_findings] == [Kind.IMU_FROZEN]
    beat = Heartbeat(mavlink.MAV_AUTOPILOT_PX4, mavlink.MAV_TYPE_QUADROTOR, False)
    for _ in range(12):
        bench.t_us += US_PER_SECOND
        bench._hears((2, 1), HEARTBEAT_ID, beat)
    assert bench.service.bound_to.endswith("2/1")
    assert not bench.service.open_findings
    assert bench.service.findings


def test_an_attitude_from_before_a_reboot_is_not_handed_out() -> None:
    bench = Bench()
    attitude_id = mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION
    question = Command(mavlink.MAV_CMD_REQUEST_MESSAGE, attitude_id, 0.0, (1, 0))

    def answers() -> list[str]:
        t_ns = 1000 * bench.t_us
        envelope = Envelope(t_ns, t_ns, (255, 190), mavlink.MAVLINK_MSG_ID_COMMAND_LONG)
        effects = bench.service.on_message(envelope, question)
        return [effect.message.get_type() for effect in effects if isinstance(effect, Send)]

    bench.rests((1, 1), 5, GRAVITY_M_S2)
    assert "ATTITUDE_QUATERNION" in answers()
    bench.ahead_us = -990 * US_PER_SECOND
    while "autopilot rebooted" not in bench.notices:
        bench.rests((1, 1), 0.01, GRAVITY_M_S2)
    assert "ATTITUDE_QUATERNION" not in answers()


def test_a_landed_state_that_lasts_is_passed_to_the_filter_once() -> None:
    bench = Bench()
    bench.is_armed = True
    bench.rests((1, 1), 3, GRAVITY_M_S2)
    passed = []
    for _ in range(100):
        bench.rests((1, 1), 0.1, GRAVITY_M_S2)
        bench.t_us += US_PER_SECOND
        t_ns = 1000 * bench.t_us
        envelope = Envelope(t_ns, t_ns, (1, 1), mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
        effects = bench.service.on_message(envelope, LandedState(on_ground=True))
        passed += [e.record.on_ground for e in effects if isinstance(e, Record)]
    assert passed == [True]


def test_a_stream_that_is_refused_is_reported() -> None:
    bench = Bench()
    bench.rests((1, 1), 1, GRAVITY_M_S2)
    denied = CommandAck(
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_RESULT_DENIED, target=(0, 0)
    )
    said: list[str] = []
    bench.service.on_link(1000 * bench.t_us, True)
    for _ in range(50):
        bench.rests((1, 1), 0.1, GRAVITY_M_S2)
        t_ns = 1000 * bench.t_us
        effects = bench.service.on_timer(t_ns)
        said += [effect.text for effect in effects if isinstance(effect, Notice)]
        if any(isinstance(e, Send) and e.message.get_type() == "COMMAND_LONG" for e in effects):
            envelope = Envelope(t_ns, t_ns, (1, 1), mavlink.MAVLINK_MSG_ID_COMMAND_ACK)
            bench.service.on_message(envelope, denied)
    assert [text for text in said if text.endswith("refused")]


def test_a_ground_station_that_comes_late_is_told_what_is_wrong_once() -> None:
    bench = Bench()
    bench.rests((1, 1), 4, 1.0)  # a force of 1 m/s^2 at rest is a wrong unit
    said: list[str] = []

    def beats(station: tuple[int, int], seconds: int) -> None:
        """A ground station, and the vehicle; every text is sent."""
        heartbeat = Heartbeat(mavlink.MAV_AUTOPILOT_INVALID, mavlink.MAV_TYPE_GCS, False)
        for _ in range(seconds):
            bench._hears(station, HEARTBEAT_ID, heartbeat)
            bench.rests((1, 1), 1, 1.0)
            effects = bench.service.on_timer(1000 * bench.t_us)
            sent = [effect.message for effect in effects if isinstance(effect, Send)]
            said.extend(m.text for m in sent if m.get_type() == "STATUSTEXT")

    bench.service.on_link(1000 * bench.t_us, True)
    beats((255, 190), 20)
    degraded = [text for text in said if "degraded: |acc| at rest" in text]
    said.clear()
    beats((255, 190), 10)
    assert not [text for text in said if "degraded" in text]
    beats((254, 190), 10)
    assert len(degraded) >= 1
    assert len([text for text in said if "degraded: |acc| at rest" in text]) == 1
