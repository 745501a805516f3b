"""Lanes: several IMUs, one filter each, one of them sent."""

import itertools
import math
import random

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    SensorDelays,
    SensorErrors,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.findings import Kind
from h2nav.integrity.sensor_pairs import InertialSensor
from h2nav.integrity.velocity_witness import NO_DOUBT
from h2nav.recordings.listener import Listener
from h2nav.service import estimation
from h2nav.service.autopilot import Identity
from h2nav.service.before_arming import BeforeArming
from h2nav.service.estimation import Estimation
from h2nav.service.notices import Notices
from h2nav.service.sample_clock import TimeVerdict
from h2nav.service.settings import AutopilotSettings
from h2nav.service.trust import REFUSALS
from h2nav.wire.imu import IDS_BY_NAME, ImuReading

ARDUPILOT = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
HIGHRES, RAW = IDS_BY_NAME["HIGHRES_IMU"], IDS_BY_NAME["RAW_IMU"]
SECOND, THIRD = IDS_BY_NAME["SCALED_IMU2"], IDS_BY_NAME["SCALED_IMU3"]
UNIT_US = {HIGHRES: 1, RAW: 1, SECOND: 1000, THIRD: 1000}
START_US = 20_000_000
GYRO = (0.001, -0.002, 0.001)
CONFIGURATION = Configuration()
FILTERS = FilterFactory.shipped(CONFIGURATION.filter, 100.0)


class Flight:
    """A vehicle that hovers, with noise of each sensor's own, and what is sent of it.

    Args:
        lanes: how many are wanted.
        sends: the messages that come, in their order within a tick.
    """

    def __init__(self, lanes="auto", sends=(HIGHRES, RAW, SECOND)):
        self.estimation = Estimation(
            FILTERS.filter_for,
            AutopilotSettings(lanes=lanes),
            BeforeArming(Notices(as_status_text=False).report),
        )
        self.estimation.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
        self.estimation.use(VehicleState(on_ground=False))
        self.sends = sends
        self.tick, self.uptime_us = 0, START_US
        self.highres_holds = 0
        self.frozen = set()
        self.without_force = set()
        self.biases = {}
        self.field, self.fields = (22.0, 0.0, -42.0), {}
        self.outcomes, self.all_outcomes = [], []
        self.texts = []
        self._random = random.Random(1)
        self._values = {}

    def run(self, seconds):
        """Goes on for so long; what was sent."""
        first = len(self.outcomes)
        for _ in range(round(100 * seconds)):
            self.tick += 1
            for message_id in self.sends:
                self._arrives(message_id)
        return self.outcomes[first:]

    def _arrives(self, message_id):
        t_ns = self.tick * 10_000_000 + self.sends.index(message_id) * 10_000
        noise = [self._random.gauss(0.0, 0.01) for _ in range(6)]
        bias = self.biases.get(message_id, (0.0, 0.0, 0.0))
        values = (
            tuple(w + n + b for w, n, b in zip(GYRO, noise, bias, strict=False)),
            (5.0 * noise[3], 5.0 * noise[4], -9.8 + 5.0 * noise[5]),
        )
        if message_id in self.frozen:
            values = self._values[message_id]
        if message_id in self.without_force:
            values = (values[0], self._values[message_id][1])
        self._values[message_id] = values
        if not self.estimation.on_arrival(t_ns, message_id):
            return
        t_us = self.uptime_us + self.tick * 10_000 + 400
        imu = self.highres_holds if message_id == HIGHRES else None
        field = self.fields.get(message_id, self.field)
        reading = ImuReading(t_us // UNIT_US[message_id], *values, field, clipped=False, imu=imu)
        outcome = self.estimation.take(t_ns, message_id, reading)
        self.all_outcomes.append(outcome)
        if outcome.switched:
            self.texts.append(outcome.switched)
        if outcome.sample is not None:
            self.outcomes.append(outcome)

    @property
    def message(self):
        return self.estimation.imu_message.message_id

    @property
    def records(self):
        return {record.imu: record for record in self.estimation.lane_records()}


def test_a_second_lane_changes_nothing_of_the_first():
    """Bit for bit the estimates of a service that follows one IMU."""

    def estimates(sends, lanes):
        flight = Flight(lanes, sends)
        flight.biases = {SECOND: (0.0, 0.0, 0.0)}
        values = random.Random(5)
        flight._random = values
        state = {}
        original = flight._arrives

        def arrives(message_id):
            # Each message draws its own numbers, whatever else is sent.
            flight._random = state.setdefault(message_id, random.Random(message_id))
            original(message_id)

        flight._arrives = arrives
        return [outcome.estimate for outcome in flight.run(10.0)]

    alone = estimates((HIGHRES,), 1)
    beside = estimates((SECOND, HIGHRES, THIRD), "auto")
    assert len(alone) == 1000
    assert beside == alone


def test_both_lanes_are_followed_and_the_first_one_is_sent():
    flight = Flight()
    flight.run(10.0)
    assert flight.message == HIGHRES
    assert {imu: record.sent for imu, record in flight.records.items()} == {1: True, 2: False}
    assert flight.records[2].message == "SCALED_IMU2"
    assert flight.records[2].rate_hz == pytest.approx(100.0, rel=0.05)
    assert flight.records[2].tilt_apart_deg < 1.0


def test_a_frozen_sensor_is_left_and_told_once_and_times_only_grow():
    flight = Flight()
    flight.run(10.0)
    flight.frozen = {HIGHRES, RAW}
    flight.run(5.0)
    assert flight.message == SECOND
    assert len(flight.texts) == 1
    assert flight.texts[0].startswith("IMU 2 instead of 1: ")
    assert sum(outcome.is_accused for outcome in flight.all_outcomes) == 1
    flight.frozen = set()
    flight.run(60.0)
    assert flight.message == SECOND  # there is no way back without a cause
    assert len(flight.texts) == 1
    times = [outcome.sample.t_us for outcome in flight.outcomes]
    assert all(later > earlier for earlier, later in itertools.pairwise(times))


class Compass:
    """Fields with noise, in the messages of one IMU alone."""

    def __init__(self, message_id):
        self._message_id, self._random = message_id, random.Random(3)

    def get(self, message_id, _):
        if message_id != self._message_id:
            return None
        return tuple(part + self._random.gauss(0.0, 0.3) for part in (22.0, 0.0, -42.0))


def test_an_imu_without_a_compass_is_lent_the_field_of_another():
    """As on most vehicles: three IMUs, and one compass, whose field comes with the first."""
    flight = Flight(sends=(RAW, SECOND, THIRD))
    flight.fields = Compass(RAW)
    before = heading_deg(flight.run(10.0)[-1])
    flight.without_force = {RAW}
    after = flight.run(3.0)[-1]
    assert flight.message in (SECOND, THIRD)
    assert Trust.YAW_REFERENCED in after.estimate.trust
    assert heading_deg(after) == pytest.approx(before, abs=1.0)


def test_nothing_is_lent_any_more_when_the_only_compass_is_gone():
    flight = Flight(sends=(RAW, SECOND))
    flight.fields = {RAW: None, SECOND: (22.0, 0.0, -42.0)}
    flight.run(5.0)
    assert all(outcome.sample.m_b_ut is not None for outcome in flight.run(1.0))
    flight.fields[SECOND] = None  # the only compass is gone
    flight.run(2.0)
    assert all(outcome.sample.m_b_ut is None for outcome in flight.run(1.0))


def test_an_own_field_comes_before_a_lent_one():
    flight = Flight(sends=(RAW, SECOND))
    flight.fields = {RAW: None, SECOND: (22.0, 0.0, -42.0)}
    flight.run(5.0)
    flight.fields[RAW] = (21.0, 1.0, -42.0)
    assert {outcome.sample.m_b_ut for outcome in flight.run(2.0)} == {(21.0, 1.0, -42.0)}


def heading_deg(outcome):
    w, x, y, z = outcome.estimate.q_nb
    return math.degrees(math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)))


def test_a_silent_lane_is_left():
    flight = Flight()
    flight.run(10.0)
    flight.sends = (SECOND,)
    sent = flight.run(1.0)
    assert flight.texts == ["IMU 2 instead of 1: no samples"]
    assert len(sent) >= 65


def test_a_gap_of_the_whole_link_is_no_cause():
    flight = Flight(sends=(SECOND, HIGHRES))
    flight.run(10.0)
    flight.tick += 200
    flight.sends = (SECOND,)  # the first to be heard again
    flight.run(0.1)
    flight.sends = (SECOND, HIGHRES)
    flight.run(5.0)
    assert flight.message == HIGHRES
    assert flight.texts == []


def test_highres_of_another_imu_does_not_enter_the_filter():
    flight = Flight()
    flight.run(10.0)
    flight.highres_holds = 1
    flight.biases = {HIGHRES: (1.0, 0.0, 0.0)}
    sent = flight.run(5.0)
    assert all(abs(outcome.sample.w_b[0]) < 0.2 for outcome in sent)
    assert flight.message == RAW
    assert flight.records[2].message == "SCALED_IMU2"
    assert flight.texts == []


def test_highres_of_another_imu_feeds_its_lane_where_nothing_else_does():
    flight = Flight(sends=(HIGHRES,))
    flight.run(10.0)
    flight.highres_holds = 1
    flight.run(5.0)
    assert flight.texts == ["IMU 2 instead of 1: no samples"]
    assert flight.estimation.has_estimate


def test_with_one_lane_the_autopilot_decides_what_highres_holds():
    flight = Flight(lanes=1)
    flight.run(5.0)
    flight.highres_holds = 1
    assert len(flight.run(5.0)) == 500
    assert flight.message == HIGHRES
    assert flight.records == {}


def test_a_slow_stream_is_no_lane():
    flight = Flight()
    flight.run(5.0)
    for _ in range(50):
        flight.sends = (HIGHRES, RAW)
        flight.run(0.03)
        flight.sends = (HIGHRES, RAW, SECOND)
        flight.run(0.01)
    flight.without_force = {HIGHRES, RAW}
    for _ in range(50):
        flight.sends = (HIGHRES, RAW)
        flight.run(0.03)
        flight.sends = (HIGHRES, RAW, SECOND)
        flight.run(0.01)
        if flight.texts:
            break
    assert flight.records[2].rate_hz < 50.0
    assert not any("frozen" in text for text in flight.texts)


def test_a_stream_of_zeros_is_given_up_and_does_not_count():
    flight = Flight()
    flight.run(1.0)
    for number in range(150):
        t_ns = 2_000_000_000 + number * 10_000_000
        if flight.estimation.on_arrival(t_ns, THIRD):
            flight.estimation.refuse(t_ns, THIRD, "zero_force")
    assert not flight.estimation.on_arrival(t_ns, THIRD)
    assert list(flight.estimation.useless_streams()) == [THIRD]
    assert flight.estimation.rejected == {}


def test_a_stream_that_was_given_up_has_another_chance_after_a_minute():
    """Whoever asks for its messages learns it from the first one that comes then."""
    estimation = Flight().estimation
    for number in range(100):
        last_ns = number * 10_000_000
        assert estimation.on_arrival(last_ns, THIRD)
        estimation.refuse(last_ns, THIRD, "zero_force")
    assert not estimation.on_arrival(last_ns + 60_000_000_000 - 1, THIRD)
    assert list(estimation.useless_streams()) == [THIRD]
    assert estimation.on_arrival(last_ns + 60_000_000_000, THIRD)
    assert list(estimation.useless_streams()) == []


def test_a_message_that_repeats_the_first_imu_is_no_lane():
    flight = Flight()
    original = flight._arrives

    def arrives(message_id):
        if message_id == SECOND:
            flight._values[SECOND] = flight._values[HIGHRES]
        original(message_id)

    flight._arrives = arrives
    flight.frozen = {SECOND}
    flight.run(5.0)
    assert list(flight.estimation.useless_streams()) == [SECOND]
    assert flight.records == {}


def test_a_lane_that_recovers_takes_the_attitude_and_keeps_its_own_bias():
    flight = Flight()
    flight.biases = {HIGHRES: (0.02, 0.0, 0.0), RAW: (0.02, 0.0, 0.0)}
    flight.estimation.use(VehicleState(on_ground=True))
    flight.run(30.0)
    flight.estimation.use(VehicleState(on_ground=False))
    flight.run(10.0)
    flight.frozen = {HIGHRES, RAW}
    flight.run(20.0)
    flight.frozen = set()
    flight.run(3.0)
    first = flight.records[1]
    assert first.tilt_apart_deg < 1.0
    assert abs(first.heading_apart_deg) < 1.0
    lane = flight.estimation._lanes[0]
    assert lane.estimate.bias_b[0] == pytest.approx(0.021, abs=0.004)


def test_what_was_known_before_reaches_the_filters_of_a_vehicle_that_comes_later():
    listener = Listener()
    estimation = Estimation(
        listener.filter_for, AutopilotSettings(), BeforeArming(Notices(as_status_text=False).report)
    )
    field, vehicle = EarthField(50.0, 1.0, 0.1), VehicleState(on_ground=True)
    estimation.use(field)
    estimation.use(vehicle)
    estimation.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
    filters = [listener, *listener.others]
    assert len(filters) == 3
    for each in filters:
        told = [one.what for one in each.stretches[-1].inputs]
        assert field in told
        assert vehicle in told


def test_a_filter_is_told_how_late_its_samples_are_once_their_period_is_known():
    listener = Listener(FILTERS.filter_for)
    flight = Flight(1, (HIGHRES,))
    flight.estimation = Estimation(
        listener.filter_for,
        AutopilotSettings(lanes=1),
        BeforeArming(Notices(as_status_text=False).report),
    )
    flight.estimation.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
    flight.run(1.0)
    told = [one for one in listener.stretches[-1].inputs if isinstance(one.what, SensorDelays)]
    assert [one.row for one in told] == [1], "with the second sample, and never again"
    gyro_s, field_s = told[0].what
    assert gyro_s == pytest.approx(0.01125 - 0.005, abs=1e-4)
    assert field_s == pytest.approx(0.05)
    filtered, estimate = flight.outcomes[-1].filtered, flight.outcomes[-1].estimate
    assert estimate.q_nb != filtered.q_nb, "the attitude is extrapolated to the time of its sample"


def compasses_differ(flight):
    return [alarm for alarm in flight.estimation.alarms() if alarm.kind is Kind.COMPASSES_DIFFER]


def test_fields_of_different_times_are_not_compared():
    """After a silence of the whole link a lane is not silent, but its newest field is old."""
    flight = Flight()
    flight.run(10.0)
    flight.sends, flight.field = (HIGHRES,), (-22.0, 0.0, -42.0)
    for _ in range(20):
        flight.run(0.2)
        flight.tick += 50
    assert not compasses_differ(flight)
    flight.sends = (HIGHRES, SECOND)
    flight.run(5.0)
    assert not compasses_differ(flight)
    flight.fields = {SECOND: (22.0, 0.0, -42.0)}
    flight.run(5.0)
    assert compasses_differ(flight)


def test_a_stream_that_rests_has_no_zero_that_moves(monkeypatch):
    """It was outvoted, then refused; the other one is clipped meanwhile, so nothing differs."""
    flight = Flight()
    flight.run(0.5)
    voting = flight.estimation._voting
    voting._wrong[InertialSensor.GYRO, 1] = 0
    monkeypatch.setattr(voting, "look", lambda *_: {1: (0.1, 0.0, 0.0)})
    for _ in range(REFUSALS):
        flight.estimation.refuse(10**7 * flight.tick, SECOND, "not_finite")
    assert flight.run(0.3)[-1].estimate is not None


def test_while_its_only_force_is_frozen_velocities_do_not_speak_for_it():
    flight = Flight(sends=(RAW,))
    flight.run(5.0)
    assert not flight.estimation.doubt.may_be_bent
    flight.without_force = {RAW}
    flight.run(5.0)
    assert flight.estimation.doubt.may_be_bent


def test_the_newest_time_is_that_of_the_newest_sample():
    flight = Flight(sends=(RAW,))
    assert flight.estimation.newest_t_us is None
    sample = flight.run(0.1)[-1].sample
    assert flight.estimation.newest_t_us == sample.t_us


def rebooted(flight):
    """The flight after half a second of another uptime."""
    flight.uptime_us = 1_000_000 - 10_000 * flight.tick
    flight.run(0.5)
    return flight


def test_the_newest_time_is_of_the_present_clock_though_an_imu_has_not_come_back():
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.run(0.5)
    flight.sends = (HIGHRES,)
    rebooted(flight)
    assert [outcome.event for outcome in flight.outcomes if outcome.event] == [TimeVerdict.REBOOT]
    assert flight.estimation.heard_t_us == flight.outcomes[-1].sample.t_us < START_US


def test_a_reboot_is_not_told_again_when_another_imu_is_sent():
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.run(0.5)
    rebooted(flight)
    for _ in range(3):
        flight.tick += 500  # as long as a link that is interrupted, and no new epoch
        flight.run(0.5)
    flight.sends = (SECOND,)
    flight.run(1.0)
    assert [text[:14] for text in flight.texts] == ["IMU 2 instead "]
    assert [outcome.event for outcome in flight.outcomes if outcome.event] == [TimeVerdict.REBOOT]


def test_a_reboot_that_the_imu_in_use_did_not_survive_is_told_of_the_next():
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.run(0.5)
    flight.sends = (SECOND,)
    rebooted(flight)
    flight.run(0.5)
    assert [outcome.event for outcome in flight.outcomes if outcome.event] == [TimeVerdict.REBOOT]


def test_a_lane_that_is_left_is_blamed_for_what_is_off():
    gyro = Flight(sends=(HIGHRES, SECOND))
    gyro.run(5.0)
    gyro.biases[HIGHRES] = (0.0, 0.1, 0.0)
    gyro.run(8.0)
    (text,) = gyro.texts
    # How it is wrong is said when its attitude has been contradicted for long enough.
    assert text == "IMU 2 instead of 1: its gyro is off"
    compass = Flight(sends=(HIGHRES, SECOND))
    compass.run(5.0)
    compass.fields[HIGHRES] = (-22.0, 0.0, -42.0)
    compass.run(15.0)
    assert compass.texts == ["IMU 2 instead of 1: its compass is off"]


@pytest.mark.parametrize(
    ("has_field", "reason"), [(True, "it contradicts the field"), (False, "its attitude is off")]
)
def test_a_lane_that_a_short_fault_has_tilted_blames_no_sensor_that_is_sound_again(
    has_field, reason
):
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.field = flight.field if has_field else None

    def hover(seconds):
        for _ in range(round(5 * seconds)):
            flight.run(0.2)
            t_us = START_US + flight.tick * 10_000
            flight.estimation.use(VelocityFix(t_us, (0.0, 0.0, 0.0), 0.1))

    hover(20.0)
    flight.biases[HIGHRES] = (0.0, 0.5, 0.0)
    hover(0.2)
    flight.biases.clear()
    hover(12.0)
    assert flight.texts == [f"IMU 2 instead of 1: {reason}"]


def test_a_turn_of_one_field_may_be_that_of_gyro_or_compass_where_the_attitudes_agree():
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.estimation.use(EarthField(math.hypot(22.0, 42.0), math.atan2(-42.0, 22.0), 0.0))
    flight.run(5.0)
    angle = math.radians(150.0)
    flight.fields[HIGHRES] = (22.0 * math.cos(angle), 22.0 * math.sin(angle), -42.0)
    flight.run(15.0)
    assert flight.texts == ["IMU 2 instead of 1: it contradicts the field"]


@pytest.mark.parametrize(
    ("turned", "texts"),
    [
        ((HIGHRES,), ["IMU 2 instead of 1: the others agree"]),
        ((HIGHRES, SECOND), []),
        ((SECOND, THIRD), ["IMU 2 instead of 1: the others agree"]),
        ((SECOND,), []),
    ],
)
def test_of_three_headings_the_middle_one_is_sent(turned, texts):
    """By compasses that are too near to each other to accuse one."""
    flight, angle = Flight(sends=(HIGHRES, SECOND, THIRD)), math.radians(12.0)
    for message in turned:
        flight.fields[message] = (22.0 * math.cos(angle), 22.0 * math.sin(angle), -42.0)
    flight.run(10.0)
    assert flight.texts == texts
    assert flight.estimation.alarms() == []


def test_compasses_that_differ_are_reported_when_it_lasts():
    flight = Flight(sends=(HIGHRES, SECOND))
    flight.run(5.0)
    flight.fields[SECOND] = (-22.0, 0.0, -42.0)
    flight.run(1.0)
    assert not compasses_differ(flight)
    flight.run(4.0)
    (alarm,) = compasses_differ(flight)
    assert alarm.size == pytest.approx(180.0, abs=5.0)
    assert alarm.since_s == pytest.approx(5.0, abs=0.5)


def test_who_takes_a_message_is_remembered_only_while_it_holds():
    """What is remembered is what the lanes answer, through silence, rest, recovery and identity."""
    flight = Flight(sends=(HIGHRES, RAW, SECOND, THIRD))
    estimation, remembered = flight.estimation, flight.estimation._takers

    def compared(t_ns, message_id):
        found = remembered(t_ns, message_id)
        needs = [(lane, lane.need(t_ns, message_id)) for lane in estimation._lanes]
        assert found == tuple(taker for taker in needs if taker[1])
        return found

    estimation._takers = compared
    original = flight._arrives

    def arrives(message_id):
        t_ns = flight.tick * 10_000_000 + flight.sends.index(message_id) * 10_000
        taken = estimation.on_arrival(t_ns, message_id)
        assert taken == bool(compared(t_ns, message_id))
        if message_id == THIRD and taken and flight.tick < 700:
            estimation.refuse(t_ns, message_id, "zero_force")
            return
        original(message_id)

    flight._arrives = arrives
    flight.run(2.0)
    flight.sends = (RAW, SECOND)
    flight.run(1.0)
    flight.sends = (SECOND,)
    flight.run(1.0)
    flight.sends = (HIGHRES, RAW, SECOND, THIRD)
    flight.run(2.0)
    flight.highres_holds = 1
    flight.run(2.0)
    flight.highres_holds = 0
    flight.run(64.0)  # a rest ends after a minute
    assert flight.outcomes


def test_tilts_that_differ_by_more_than_they_allow_open_their_deviations(monkeypatch):
    flight = Flight(sends=(RAW, SECOND))
    flight.run(20.0)
    usual_rad = flight.outcomes[-1].estimate.sigma_tilt_rad
    apart = {"rad": 1.9 * math.hypot(usual_rad, usual_rad)}
    monkeypatch.setattr(estimation, "_apart", lambda *_: (apart["rad"], 0.0))
    flight.run(2.0)
    assert flight.outcomes[-1].estimate.sigma_tilt_rad == pytest.approx(usual_rad, rel=0.05)
    apart["rad"] = 0.5
    flight.run(2.0)
    # by half of the difference each, and a bit more
    assert 0.3 < flight.outcomes[-1].estimate.sigma_tilt_rad < 0.4
    assert flight.estimation.doubt.tilts_apart_rad == 0.5
    flight.estimation.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
    assert flight.estimation.doubt.tilts_apart_rad == 0.0
    flight.run(20.0)
    assert flight.estimation.doubt.tilts_apart_rad == 0.5
    # a lane that is known to be wrong says nothing of the others
    flight.frozen.add(SECOND)
    flight.run(40.0)
    assert flight.outcomes[-1].estimate.sigma_tilt_rad < 2.0 * usual_rad
    assert flight.estimation.doubt.tilts_apart_rad == 0.0


class Level:
    """A filter that finds a level attitude at rest in every sample; it keeps the forces."""

    name = "level"
    sensor_errors = SensorErrors((0.0, 0.0, 0.0))

    def __init__(self):
        self.forces = []

    def update(self, sample):
        self.forces.append(sample.f_b)
        zero, trust = (0.0, 0.0, 0.0), Trust.ALIGNED | Trust.REST
        q_nb = (1.0, 0.0, 0.0, 0.0)
        return AttitudeEstimate(sample.t_us, q_nb, zero, zero, zero, 0.01, trust, 0.02)

    def __getattr__(self, _name):
        return lambda *_: None


def unbound():
    """An estimation before an autopilot is known, and the filter that it will have."""
    chosen = Level()
    report = Notices(as_status_text=False).report
    return Estimation(lambda _: chosen, AutopilotSettings(lanes=1), BeforeArming(report)), chosen


def test_before_an_autopilot_is_known_nothing_is():
    found, _ = unbound()
    assert (found.imu_message, found.newest_t_us, found.heard_t_us) == (None, None, None)
    assert (found.has_estimate, found.is_independent, found.velocity_is_false) == (
        False,
        True,
        False,
    )
    assert found.doubt == NO_DOUBT
    fix = VelocityFix(0, (1.0, 2.0, 0.0), 0.3)
    assert found.corrected(fix) is fix
    assert found.error_by_compass_rad is None
    assert math.isnan(found.ratios.velocity_1s)
    assert (found.alarms(), found.lane_records(), found.objections(0)) == ([], [], ())
    assert found.why_no_samples(0) is None
    assert list(found.lost_imus(lambda _: True)) == list(found.useless_streams()) == []
    assert (found.rejected, found.used) == ({}, 0)


@pytest.mark.parametrize("knows_first", [True, False])
def test_the_local_gravity_reaches_every_lane(knows_first):
    found, chosen = unbound()
    copter = Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR)
    if knows_first:
        found.use_gravity(9.78)
    found.begin(copter)
    if not knows_first:
        found.use_gravity(9.78)
    found.use(VehicleState(on_ground=True))
    for number in range(25):
        t_ns, noise = number * 500_000_000, 1e-3 * (number % 7)
        assert found.on_arrival(t_ns, RAW)
        reading = ImuReading(
            START_US + t_ns // 1000, (noise, 0.0, 0.0), (noise, 0.0, -10.0), None, False
        )
        found.take(t_ns, RAW, reading)
    # Most of the excess is a bias, and taken off.
    assert chosen.forces[0][2] == -10.0
    assert chosen.forces[-1][2] == pytest.approx(-10.0 + 0.93 * 0.22, abs=0.01)
    assert found.used == 25


@pytest.mark.parametrize("is_later", [True, False])
def test_times_that_are_sent_only_increase(is_later):
    found, _ = unbound()
    found.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
    reading = ImuReading(START_US, (1e-3, 0.0, 0.0), (0.0, 0.0, -9.8), None, False)
    found.on_arrival(0, RAW)
    assert found.take(0, RAW, reading).sample.t_us == START_US
    found.on_arrival(10_000_000, RAW)
    second = reading._replace(time=START_US + 10_000 * is_later, w_b=(2e-3, 0.0, 0.0))
    assert (found.take(10_000_000, RAW, second).sample is not None) is is_later
    assert found.used == 1 + is_later
    assert found.rejected == ({} if is_later else {"duplicate": 1})


@pytest.mark.parametrize(("count", "is_read"), [(99, True), (100, False)])
def test_of_an_imu_whose_messages_are_refused_a_hundred_times_nothing_is_read(count, is_read):
    report = Notices(as_status_text=False).report
    found = Estimation(lambda _: Level(), AutopilotSettings(lanes=2), BeforeArming(report))
    found.begin(Identity(1, 1, ARDUPILOT, mavlink.MAV_TYPE_QUADROTOR))
    for number in range(count):
        assert found.on_arrival(number, SECOND)
        found.refuse(number, SECOND, "zero_force")
    assert found.on_arrival(count, SECOND) is is_read
    assert list(found.useless_streams()) == ([] if is_read else [SECOND])
    assert found.rejected == {}  # of an optional one
    # It gets another chance after a minute.
    assert found.on_arrival(99 + 60_000_000_000, SECOND)
