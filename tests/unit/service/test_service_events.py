"""What the service answers to each kind of event, by a filter that finds an attitude at once."""

import itertools

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav import __version__
from h2nav.attitude.samples import AttitudeEstimate, EarthField, SensorErrors, Trust
from h2nav.integrity.findings import Severity
from h2nav.maths.units import GRAVITY_M_S2, SECOND_NS
from h2nav.service.effects import Notice, Record, Send, Used
from h2nav.service.health import ServiceState
from h2nav.service.service import Service, Surroundings
from h2nav.service.settings import (
    AidingSettings,
    AutopilotSettings,
    MotionSettings,
    OutputSettings,
    ServiceSettings,
)
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.imu import ImuReading
from h2nav.wire.motion import PoseReading
from h2nav.wire.position import EstimatedVelocity, GpsFix, Place
from h2nav.wire.questions import Command, ParameterList
from h2nav.wire.readers import MOTION_READERS, READERS, Envelope
from h2nav.wire.vehicle import (
    Heartbeat,
    LandedState,
    ParameterValue,
    SystemTime,
    TimeSyncMessage,
)

HEARTBEAT, RAW_IMU = mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_RAW_IMU
VEHICLE, STATION, OURS = (3, 1), (255, 190), (3, 191)
ARDUPILOT, PX4 = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_AUTOPILOT_PX4
QUADROTOR = Heartbeat(ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR, False)
ZERO = (0.0, 0.0, 0.0)
FIELD = EarthField(50.0, 1.0, 0.1)
START_NS = 1_000 * SECOND_NS
BOUND = "bound to ArduPilot quadrotor 3/1"


class LevelFilter:
    """Finds a level attitude in every sample."""

    name = "level"
    sensor_errors = SensorErrors(ZERO)

    def update(self, sample):
        trust = Trust.ALIGNED | Trust.CONVERGED
        q_nb = (1.0, 0.0, 0.0, 0.0)
        return AttitudeEstimate(sample.t_us, q_nb, sample.w_b, ZERO, ZERO, 0.01, trust, 0.02)

    def __getattr__(self, _name):
        return lambda *_: None


class Bench:
    """A service and what it has been told."""

    def __init__(self, *, link=True, autopilot=None, output=None, **sections):
        settings = ServiceSettings(
            AutopilotSettings(**(autopilot or {})), OutputSettings(**(output or {})), **sections
        )
        self.asked_fields = []
        surroundings = Surroundings(lambda _: LevelFilter(), self._field_at, 1_795_000_000.0)
        self.service = Service(settings, surroundings)
        self.t_ns, self.told = START_NS, []
        if link:
            self.service.on_link(self.t_ns, True)

    def _field_at(self, *place):
        self.asked_fields.append(place)
        return FIELD

    def hears(self, message, message_id=0, sender=VEHICLE):
        """The effects of a message, if it is read."""
        envelope = Envelope(self.t_ns, self.t_ns, sender, message_id)
        if not self.service.on_arrival(self.t_ns, sender, message_id):
            return []
        return self.service.on_message(envelope, message)

    def said(self, message, sender=VEHICLE):
        """The effects of a message that is read anyway."""
        return self.service.on_message(Envelope(self.t_ns, self.t_ns, sender, 0), message)

    def beats(self, beat=QUADROTOR, sender=VEHICLE):
        return self.hears(beat, HEARTBEAT, sender)

    def samples(self, count=1, force_m_s2=GRAVITY_M_S2, field=(20.0, 0.0, 45.0)):
        """Some samples at 100 Hz; the effects of the last one."""
        effects = []
        for _ in range(count):
            self.t_ns += 10_000_000
            noise = 1e-4 * (self.t_ns // 10_000_000 % 7)
            t_us = self.t_ns // 1000
            reading = ImuReading(t_us, (noise, 0.0, 0.0), (noise, 0.0, -force_m_s2), field, False)
            effects = self.hears(reading, RAW_IMU)
        return effects

    def flies(self):
        """Bound, with samples."""
        self.beats()
        self.samples(10)
        return self

    def timer(self, later_s=0.0):
        self.t_ns += round(later_s * SECOND_NS)
        return self.service.on_timer(self.t_ns)


def names(effects):
    return [effect.message.get_type() for effect in effects if isinstance(effect, Send)]


def texts(effects):
    return [(effect.severity, effect.text) for effect in effects if isinstance(effect, Notice)]


def topics(effects):
    return [effect.topic for effect in effects if isinstance(effect, Record)]


# --- what it is ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sections", "more", "less"),
    [
        ({}, set(), {"LOCAL_POSITION_NED"}),
        ({"aiding": AidingSettings(autopilot_velocity=True)}, set(), set()),
        ({"autopilot": {"simulation_truth": True}}, {"SIMSTATE"}, {"LOCAL_POSITION_NED"}),
        (
            {"motion": MotionSettings("twist", pose_message="ODOMETRY")},
            {"ODOMETRY"},
            {"LOCAL_POSITION_NED"},
        ),
    ],
)
def test_which_messages_it_reads(sections, more, less):
    service = Bench(**sections).service
    usual = READERS.keys() - MOTION_READERS.keys()
    expected = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}") for name in more}
    left_out = {getattr(mavlink, f"MAVLINK_MSG_ID_{name}") for name in less}
    assert service.message_ids == (usual | expected) - left_out


@pytest.mark.parametrize(("chosen", "system_id"), [(0, 1), (9, 9)])
def test_its_system_is_the_chosen_one_and_then_the_vehicles(chosen, system_id):
    bench = Bench(autopilot={"system_id": chosen})
    assert bench.service.system_id == system_id
    bench.beats(sender=(chosen or 3, 1))
    assert bench.service.system_id == (chosen or 3)


def test_what_it_is_bound_to():
    bench = Bench()
    assert (bench.service.bound_to, bench.service.identity) == ("", None)
    effects = bench.beats(QUADROTOR._replace(is_armed=True))
    assert texts(effects) == [(Severity.INFO, BOUND)]
    assert bench.service.bound_to == "ArduPilot quadrotor 3/1"
    assert bench.service.identity.address == VEHICLE
    assert bench.service.is_armed


def test_its_health_as_it_is_logged():
    bench = Bench(link=False)
    assert bench.service.health[:10] == (
        "no_link", "link is down", "", "", 0.0, 0, 0, 0, False, True,
    )  # fmt: skip
    bench.service.on_link(bench.t_ns, True)
    bench.flies()
    found = bench.service.health
    assert (found.state, found.reason, found.cause) == ("active", "", "")
    assert (found.autopilot, found.imu_message, found.samples_used) == ("3/1", "RAW_IMU", 10)
    assert found.estimates_sent == 5 + 2  # of 90 ms, at 50 and at 10 Hz
    assert (found.late_ms, found.autopilot_tilt_deg) == (0.0, None)
    assert found.summary == "active, RAW_IMU 0 Hz"


def test_how_long_each_state_has_lasted():
    bench = Bench()
    bench.timer(1.0)
    bench.timer(2.5)
    assert bench.service.state_s == {"no_link": 0.0, "no_autopilot": 3.5}


# --- the link -----------------------------------------------------------------------------------


def test_a_link_that_comes_and_goes_changes_the_state():
    bench = Bench(link=False)
    assert bench.service.on_link(bench.t_ns, False, "no such device") == [
        Notice(Severity.WARNING, "no_link: no such device"),
        Record("/health", bench.service.health),
    ]
    assert bench.service.on_link(bench.t_ns, False, "no such device") == []
    assert bench.service.state is ServiceState.NO_LINK
    assert topics(bench.service.on_link(bench.t_ns, True, "no such device")) == ["/health"]
    assert bench.service.state is ServiceState.NO_AUTOPILOT
    # Trouble of a link that stays up is told, once.
    told = bench.service.on_link(bench.t_ns, True, "no route")
    assert texts(told) == [(Severity.WARNING, "no route")]
    assert bench.service.on_link(bench.t_ns, True, "no route") == []


def test_without_a_link_nothing_is_sent():
    bench = Bench().flies()
    assert "HEARTBEAT" in names(bench.timer(1.0))
    bench.service.on_link(bench.t_ns, False, "gone")
    bench.beats()
    assert [name for later_s in (1.0, 2.0, 5.0) for name in names(bench.timer(later_s))] == []


def test_bytes_without_messages_are_junk():
    bench = Bench()
    (notice, _) = bench.service.on_bytes(bench.t_ns, True)
    text = "no_autopilot: bytes, no MAVLink: wrong baud rate?"
    assert (notice.severity, notice.text) == (Severity.WARNING, text)
    assert topics(bench.service.on_bytes(bench.t_ns, False)) == ["/health"]
    assert bench.service.health.cause == "heartbeat"


def test_a_stall_is_lateness_until_a_sample():
    bench = Bench().flies()
    effects = bench.service.on_stall(bench.t_ns, 2_500_000_000)
    assert texts(effects) == [(Severity.WARNING, "degraded: late by 2.5 s")]
    effects = bench.samples()
    assert texts(effects) == [(Severity.INFO, "active")]


def test_who_hangs():
    bench = Bench().flies()
    bench.t_ns += 4 * SECOND_NS
    bench.beats()
    assert bench.service.is_progressing(bench.t_ns)
    assert not bench.service.is_progressing(bench.t_ns + SECOND_NS)
    bench.service.on_link(bench.t_ns, False, "gone")
    assert bench.service.is_progressing(bench.t_ns + SECOND_NS)


# --- the clock ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("beats", "samples", "status"),
    [
        (0, 0, mavlink.MAV_STATE_BOOT),
        (1, 0, mavlink.MAV_STATE_STANDBY),
        (1, 10, mavlink.MAV_STATE_ACTIVE),
    ],
)
def test_its_heartbeat_says_how_it_is(beats, samples, status):
    bench = Bench()
    for _ in range(beats):
        bench.beats()
    bench.samples(samples)
    first = next(effect for effect in bench.timer() if isinstance(effect, Send))
    assert first.message.get_type() == "HEARTBEAT"
    assert (first.message.system_status, first.system_id) == (status, 3 if beats else 1)


def test_each_job_has_its_own_pause():
    bench = Bench().flies()
    counted = dict.fromkeys(("HEARTBEAT", "TIMESYNC"), 0)
    healths = 0
    assert bench.service.next_timer_ns(bench.t_ns) == 0  # nothing has been done yet
    for tick in range(40):
        if tick % 10 == 0:
            bench.beats()
        effects = bench.timer()
        healths += topics(effects).count("/ratios")
        for name in counted:
            counted[name] += names(effects).count(name)
        assert bench.service.next_timer_ns(bench.t_ns) == bench.t_ns + SECOND_NS // 10
        bench.samples(10)
    # of 4 s: a heartbeat and a report a second, five questions for the time
    assert (counted, healths) == ({"HEARTBEAT": 4, "TIMESYNC": 20}, 4)


def test_no_question_for_a_silent_autopilot():
    bench = Bench().flies()
    assert "TIMESYNC" in names(bench.timer(1.0))
    assert "TIMESYNC" in names(bench.timer(4.0 - 0.1))
    assert "TIMESYNC" not in names(bench.timer(0.2))


def test_parameters_are_asked_of_who_is_confirmed():
    bench = Bench().flies()
    asked = []
    for second in range(1, 6):
        bench.t_ns += SECOND_NS - 10_000_000
        bench.samples()
        bench.beats()
        effects = bench.timer()
        asked += [(second, name) for name in names(effects) if name == "PARAM_REQUEST_READ"]
    assert asked[0][0] == 2  # with the third heartbeat
    silent = Bench(autopilot={"request_streams": False}).flies()
    for _ in range(5):
        silent.t_ns += SECOND_NS - 10_000_000
        silent.samples()
        silent.beats()
        assert {"PARAM_REQUEST_READ", "COMMAND_LONG"}.isdisjoint(names(silent.timer()))


def test_a_report_tells_what_was_refused():
    bench = Bench().flies()
    bench.service.on_fault(bench.t_ns, "RAW_IMU", "boom")
    bench.service.on_refusal(Envelope(0, 0, VEHICLE, RAW_IMU), "non_finite")
    bench.service.on_refusal(Envelope(0, 0, VEHICLE, 24), "gps_position_out_of_range")
    bench.service.on_refusal(Envelope(0, 0, (9, 9), 24), "gps_position_out_of_range")
    counts = {
        "handler_error:RAW_IMU": 1,
        "non_finite": 1,
        "gps_position_out_of_range": 1,
    }
    assert bench.service.rejected == counts
    records = [effect for effect in bench.timer(1.0) if isinstance(effect, Record)]
    assert {r.record for r in records if r.topic == "/rejected"} == set(counts.items())
    assert [r.topic for r in records if r.topic == "/ratios"] == ["/ratios"]


def test_a_fault_of_our_own_is_told_once():
    bench = Bench()
    said = texts(bench.service.on_fault(bench.t_ns, "timer", "ValueError: x"))
    assert said == [(Severity.ERROR, "fault in h2nav at timer: ValueError: x; please report it")]
    assert bench.service.on_fault(bench.t_ns, "timer", "ValueError: y") == []
    assert bench.service.rejected == {"handler_error:timer": 2}


def test_a_note_from_outside_is_told_by_its_cause():
    bench = Bench()
    note = Notice(Severity.WARNING, "log: disk full", "log")
    assert texts(bench.service.on_note(bench.t_ns, note)) == [note[:2]]
    assert bench.service.on_note(bench.t_ns, note._replace(text="log: disk fuller")) == []


# --- who speaks ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sender", "message", "later_s", "speaks"),
    [
        (VEHICLE, None, 0.0, True),
        (STATION, None, 0.0, False),
        ((4, 1), QUADROTOR, 10.0, False),
        ((4, 1), QUADROTOR, 10.1, True),
        ((4, 1), None, 10.1, False),
        ((4, 1), SystemTime(None), 10.1, False),
        ((4, 191), QUADROTOR, 10.1, False),
        ((4, 1), QUADROTOR._replace(vehicle_type=mavlink.MAV_TYPE_GCS), 10.1, False),
    ],
)
def test_who_speaks_for_the_vehicle(sender, message, later_s, speaks):
    bench = Bench()
    bench.beats()
    t_ns = bench.t_ns + round(later_s * SECOND_NS)
    assert bench.service.speaks_for_vehicle(Envelope(t_ns, t_ns, sender, 0), message) is speaks


def test_another_autopilot_on_the_link_is_told():
    bench, said = Bench().flies(), []
    for _ in range(4):
        bench.t_ns += SECOND_NS
        bench.beats()
        said += texts(bench.beats(sender=(4, 1)))
    assert said == [(Severity.WARNING, "another autopilot 4/1 on this link")]


def test_what_others_report_is_of_no_use():
    bench = Bench().flies()
    for message in (LandedState(True), Place(47.0, 8.0, 500.0), SystemTime(1_800_000_000.0)):
        assert bench.said(message, sender=(3, 2)) == []
    assert bench.asked_fields == []


def test_a_date_is_that_of_the_autopilot():
    bench = Bench().flies()
    assert bench.said(SystemTime(1_800_000_000.0)) == []
    assert topics(bench.said(Place(47.0, 8.0, 500.0))) == ["/aiding"]
    assert bench.asked_fields == [(47.0, 8.0, 500.0, 1_800_000_000.0)]


def test_the_autopilots_own_velocity_makes_us_dependent_and_that_is_told():
    bench = Bench(aiding=AidingSettings(autopilot_velocity=True)).flies()
    assert bench.service.health.independent
    fix = EstimatedVelocity(bench.t_ns // 1000, ZERO)
    assert topics(bench.said(fix)) == ["/aiding"]
    assert not bench.service.health.independent
    text = "not independent: its velocity holds the autopilot's own estimate"
    assert (Severity.NOTICE, text) in texts(bench.timer(1.0))
    assert (Severity.NOTICE, text) not in texts(bench.timer(70.0))


def test_a_parameter_that_changes_the_delays_is_told_and_logged():
    bench = Bench()
    effects = bench.beats()
    (delays, vehicle) = (effect.record for effect in effects if isinstance(effect, Record))
    assert (delays.kind, delays.field_delay_s, vehicle.kind) == ("delays", 0.05, "vehicle")
    assert delays.gyro_delay_s == pytest.approx(0.01125, abs=1e-5)
    notice, record = bench.said(ParameterValue("INS_GYRO_FILTER", 40.0))
    assert (notice.severity, notice.text) == (
        Severity.INFO,
        "INS_GYRO_FILTER 40 Hz: rates 5.6 ms late",
    )
    assert record.record.gyro_delay_s == pytest.approx(0.005627, abs=1e-6)
    assert bench.said(ParameterValue("INS_GYRO_FILTER", 40.0)) == []
    assert bench.said(ParameterValue("OTHER", 40.0)) == []


@pytest.mark.parametrize(
    ("target", "sender", "tc1_ns", "found"),
    [
        (OURS, VEHICLE, 5, ["/time_sync"]),
        ((0, 0), VEHICLE, 5, ["/time_sync"]),
        ((3, 1), VEHICLE, 5, []),
        (OURS, (3, 2), 5, []),
        (OURS, VEHICLE, 0, []),  # a question, before the relation is known
    ],
)
def test_whose_time_is_taken(target, sender, tc1_ns, found):
    bench = Bench().flies()
    (question,) = [
        effect.message
        for effect in bench.timer()
        if isinstance(effect, Send) and effect.message.get_type() == "TIMESYNC"
    ]
    answer = TimeSyncMessage(tc1_ns, question.ts1, target)
    assert topics(bench.said(answer, sender)) == found


def test_poses_go_to_the_estimator_of_motion():
    bench = Bench(motion=MotionSettings("twist")).flies()
    message_id = mavlink.MAVLINK_MSG_ID_ODOMETRY
    envelope = Envelope(bench.t_ns, bench.t_ns, (3, 197), message_id)
    bench.service.on_refusal(envelope, "pose_failed")
    assert bench.service.rejected == {"pose_failed": 1}
    pose = PoseReading(bench.t_ns // 1000, (1.0, 0.0, 0.0, 0.0), ZERO, "local_frd", 0)
    assert topics(bench.service.on_message(envelope, pose)) == ["/pose_measured"]


# --- samples ------------------------------------------------------------------------------------


def test_the_attitude_leaves_before_anything_is_logged():
    bench = Bench(output={"attitude_rate_hz": 1000.0})
    bench.beats()
    effects = bench.samples()
    kinds = [type(effect) for effect in effects]
    assert names(effects)[0] == "ATTITUDE"
    assert kinds.index(Used) > max(i for i, kind in enumerate(kinds) if kind is Send)
    (used,) = (effect for effect in effects if isinstance(effect, Used))
    assert used.sample.t_us == used.estimate.t_us == bench.t_ns // 1000
    assert used.late_ns == 0


def test_late_samples_are_used_and_not_sent():
    bench = Bench(output={"attitude_rate_hz": 1000.0}).flies()
    bench.t_ns += 10_000_000
    t_us = bench.t_ns // 1000
    reading = ImuReading(t_us, (3e-4, 0.0, 0.0), (3e-4, 0.0, -9.8), None, False)
    envelope = Envelope(bench.t_ns, bench.t_ns + 160_000_000, VEHICLE, RAW_IMU)
    assert bench.service.on_arrival(bench.t_ns, VEHICLE, RAW_IMU)
    effects = bench.service.on_message(envelope, reading)
    assert names(effects) == []
    assert [effect.late_ns for effect in effects if isinstance(effect, Used)] == [160_000_000]
    assert "ATTITUDE" in names(bench.samples())


def test_wrong_units_are_told_on_the_ground():
    bench = Bench()
    said = list(
        itertools.chain.from_iterable(
            texts(bench.beats() if tick % 100 == 0 else bench.samples(force_m_s2=1.0))
            for tick in range(60)
        )
    )
    text = "|acc| at rest 1 m/s2, not 9.8: sent in g as if in m/s2"
    assert (Severity.ERROR, text) in said
    bench.timer()
    assert bench.service.health.cause == "units acc"
    in_flight = Bench()
    in_flight.beats(QUADROTOR._replace(is_armed=True))
    in_flight.samples(60, force_m_s2=1.0)
    in_flight.timer()
    assert in_flight.service.health.cause == ""


def test_attitudes_of_the_autopilot_are_shown_beside_ours():
    bench = Bench().flies()
    assert bench.service.status(bench.t_ns).autopilot_q_w is None
    bench.said(ReportedAttitude(False, bench.t_ns // 1_000_000, (1.0, 0.0, 0.0, 0.0)))
    status = bench.service.status(bench.t_ns + 250_000_000)
    assert (status.autopilot_q_w, status.autopilot_age_ms) == (1.0, 250.0)
    assert (status.state, status.vehicle) == ("active", "ArduPilot quadrotor 3/1")
    assert (status.age_ms, status.open_findings) == (250.0, "")


# --- the opinion before arming ------------------------------------------------------------------


@pytest.mark.parametrize(
    ("is_on", "sender", "target", "answered"),
    [
        (True, VEHICLE, OURS, True),
        (True, VEHICLE, (3, 0), True),
        (True, VEHICLE, (0, 191), True),
        (True, VEHICLE, (3, 1), False),
        (True, VEHICLE, (4, 191), False),
        (True, STATION, OURS, False),
        (False, VEHICLE, OURS, False),
    ],
)
def test_whom_an_authorization_is_given(is_on, sender, target, answered):
    bench = Bench(output={"arming_opinion": is_on}).flies()
    question = Command(mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST, 0.0, 0.0, target)
    sent = [effect.message for effect in bench.said(question, sender)]
    unsupported = mavlink.MAV_RESULT_UNSUPPORTED
    assert [message.result != unsupported for message in sent] in (
        [[True]] if answered else [[], [False]]
    )


@pytest.mark.parametrize(("is_on", "count"), [(True, 3), (False, 0)])
def test_an_opinion_is_told_every_second_where_it_is_wanted(is_on, count):
    bench = Bench(output={"arming_opinion": is_on}).flies()
    told = [name for _ in range(3) for name in names(bench.timer(1.0))]
    assert told.count("NAMED_VALUE_INT") == count


def test_an_opinion_that_changes_is_told_at_once():
    bench = Bench(output={"arming_opinion": True})
    bench.beats()
    told = [names(bench.samples()).count("NAMED_VALUE_INT") for _ in range(30)]
    assert 0 < sum(told) < 4


def test_questions_are_answered_as_the_vehicles_system():
    bench = Bench().flies()
    effects = bench.said(ParameterList((3, 0)), STATION)
    assert {effect.system_id for effect in effects} == {3}
    assert set(names(effects)) == {"PARAM_VALUE"}
    request = mavlink.MAV_CMD_REQUEST_MESSAGE
    version_id = mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION
    _, version = bench.said(Command(request, version_id, 0.0, OURS), STATION)
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    packed = version.message.flight_sw_version
    assert (packed >> 24, packed >> 16 & 255, packed >> 8 & 255) == (major, minor, patch)


def test_a_clock_that_changes_is_told_and_everything_begins_anew():
    bench = Bench().flies()
    bench.said(GpsFix(0, Place(47.0, 8.0, 500.0), None, 0.5))
    bench.t_ns += SECOND_NS
    said = []
    for number in range(4):
        bench.t_ns += 10_000_000
        reading = ImuReading(
            5_000_000 + 10_000 * number, (1e-4 * number, 0.0, 0.0), (0.0, 0.0, -9.8), None, False
        )
        said += texts(bench.hears(reading, RAW_IMU))
    assert (Severity.WARNING, "autopilot rebooted") in said
