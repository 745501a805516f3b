"""What a lane does with readings and with what others say of its sensors, at both sides."""

import math
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.filter import FilterState
from h2nav.attitude.samples import (
    AttitudeEstimate,
    EarthField,
    SensorCorrection,
    SensorDoubt,
    SensorErrors,
    Trust,
    VehicleState,
    VelocityFix,
)
from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.monitor import Speeds
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.sensor_checks import Use
from h2nav.integrity.sensor_pairs import InertialSensor
from h2nav.integrity.voting import Verdict
from h2nav.maths.units import SECOND_NS
from h2nav.service import lane as lane_module
from h2nav.service.autopilot import Identity
from h2nav.service.imu_choice import ImuChoice, LaneMessages
from h2nav.service.intake import Incoming, Need
from h2nav.service.lane import NO_STEP, NOT_ITS_OWN, Lane
from h2nav.service.sample_clock import TimeVerdict
from h2nav.service.settings import AutopilotSettings
from h2nav.service.trust import REFUSALS
from h2nav.wire.imu import IDS_BY_NAME, IMU_MESSAGES, ImuReading

SCALED2 = IDS_BY_NAME["SCALED_IMU2"]
RATE, DOWN, FIELD = (0.1, 0.2, 0.3), (0.0, 0.0, -9.81), (21.0, 1.0, 40.0)
ZERO = (0.0, 0.0, 0.0)
LEVEL = (1.0, 0.0, 0.0, 0.0)
TICK_NS, START_MS = 10_000_000, 20_000
GYRO, ACCELEROMETER = InertialSensor
IMU_2, COMPASS = Sensor(SensorKind.IMU, 2), Sensor(SensorKind.COMPASS, 1)


class FakeFilter:
    """Answers every sample with one attitude; notes what it was given."""

    name = "fake"

    def __init__(self):
        self.calls, self.answer, self.trust = [], True, Trust.ALIGNED
        self.error = None
        self.sensor_errors = SensorErrors(ZERO)
        self.q_nb, self.sigma_rad = LEVEL, 0.01

    def update(self, sample):
        self.calls.append(("update", sample))
        if self.error is not None:
            raise self.error
        if not self.answer:
            return None
        return AttitudeEstimate(
            sample.t_us, self.q_nb, sample.w_b, ZERO, ZERO, self.sigma_rad, self.trust, 0.02
        )

    def state(self):
        return FilterState("fake", (len(self.calls),))

    def __getattr__(self, name):
        return lambda *args: self.calls.append((name, *args))

    def named(self, name):
        return [call[1] if len(call) > 1 else None for call in self.calls if call[0] == name]


class FakeMonitor:
    """Says of samples and sensors what a test wants."""

    def __init__(self, *_):
        self.calls = []
        self.ratios, self.vibration_m_s2 = InnovationRatios(), 0.0
        self.field_is_frozen = self.sensor_is_bad = self.force_is_withheld = False
        self.attitude_is_lost = self.velocity_is_false = False
        self.force_error, self.use, self.doubt, self.found = None, Use.ALL, None, ()
        self.rate_factor, self.misturned_rad = 1.0, 0.0

    def anew(self):
        self.calls.append(("anew",))
        return self

    def check(self, sample):
        return self.use

    def add(self, sample, estimate):
        self.calls.append(("add", sample))
        return estimate

    def alarms(self, t_us):
        return self.found

    def corrected(self, fix):
        return fix._replace(removed_s=0.1)

    def fix(self, fix, errors):
        self.calls.append(("fix", fix, errors))
        return self.doubt

    def __getattr__(self, name):
        return lambda *args, **kwargs: self.calls.append((name, *args, *kwargs.items()))

    def named(self, name):
        return [call[1:] for call in self.calls if call[0] == name]


class Bench:
    """A lane of the second IMU with a filter and a monitor that a test commands."""

    def __init__(self, monkeypatch, **settings):
        monkeypatch.setattr(lane_module, "Monitor", FakeMonitor)
        self.filter, self.counted, self.tick = FakeFilter(), [], 0
        self.lane = Lane(
            LaneMessages(1, (SCALED2,)),
            self.filter,
            Identity(1, 1, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR),
            AutopilotSettings(gyro_delay_s=0.0, field_delay_s=0.0, **settings),
            self.counted.append,
        )
        self.monitor = self.lane.monitor

    @property
    def t_ns(self):
        return self.tick * TICK_NS

    def take(self, rate=RATE, force=DOWN, field=FIELD, *, clipped=False, time_ms=None, ticks=1):
        self.tick += ticks
        time_ms = START_MS + 10 * self.tick if time_ms is None else time_ms
        reading = ImuReading(time_ms, rate, force, field, clipped)
        need = self.lane.need(self.t_ns, SCALED2)
        return self.lane.take(Incoming(self.t_ns, SCALED2, reading), need)

    def run(self, samples=20):
        for _ in range(samples):
            step = self.take()
        return step

    def judged(self, t_ns=None):
        self.lane.judge(self.t_ns if t_ns is None else t_ns)
        return self.lane


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


# --- samples ----------------------------------------------------------------------------------


def test_a_sample_goes_through_filter_and_monitor(bench):
    assert not bench.lane.has_estimate
    assert bench.lane.is_silent(0)
    step = bench.run(1)
    assert (step.sample.w_b, step.sample.f_b, step.sample.m_b_ut) == (RATE, DOWN, FIELD)
    assert step.filtered.t_us == step.sample.t_us
    assert (step.event, step.is_accused) == (None, False)
    assert bench.filter.named("update") == [step.sample]
    assert bench.monitor.named("add") == [(step.sample,)]
    assert bench.lane.has_estimate
    assert (bench.lane.newest, bench.lane.last_used_ns) == (step.sample, bench.t_ns)


@pytest.mark.parametrize(
    ("use", "force", "is_clipped"),
    [(Use.ALL, DOWN, False), (Use.RATES, ZERO, False), (Use.DOUBTED, DOWN, True)],
)
def test_the_filter_takes_what_the_checks_leave(bench, use, force, is_clipped):
    bench.run()
    bench.monitor.use = use
    step = bench.take()
    assert (step.sample.f_b, step.sample.clipped) == (force, is_clipped)
    assert step.sample.m_b_ut == FIELD
    assert step.is_accused is (use is not Use.ALL)
    assert not bench.take().is_accused  # once


def test_of_a_frozen_gyro_nothing_is_used_and_the_filter_restarts_after_it(bench):
    bench.run()
    bench.monitor.use = Use.NONE
    step = bench.take()
    assert (step.sample, step.filtered, step.is_accused) == (None, None, True)
    assert bench.take() == lane_module.NO_STEP
    assert bench.counted == ["frozen"] * 2
    assert bench.lane.trust.why_no_samples(bench.t_ns).cause == "frozen"
    assert not bench.filter.named("restart")
    bench.monitor.use = Use.ALL
    assert bench.take().sample is not None
    assert len(bench.filter.named("restart")) == 1
    assert len(bench.monitor.named("restart")) == 1


@pytest.mark.parametrize(
    ("frozen", "wrong", "has_field"),
    [(False, False, True), (True, False, False), (False, True, False)],
)
def test_a_field_that_shows_nothing_is_not_used(bench, frozen, wrong, has_field):
    bench.run()
    bench.monitor.field_is_frozen = frozen
    bench.lane.use_verdict(wrong, 0.1)
    assert bench.take().sample.m_b_ut == (FIELD if has_field else None)
    assert bench.lane.newest.m_b_ut == FIELD  # it is shown as it came
    assert bench.lane.may_lend(bench.t_ns) is has_field


def test_a_force_that_is_withheld_reaches_no_filter(bench):
    bench.monitor.force_is_withheld = True
    step = bench.run(1)
    assert step.sample.f_b == DOWN
    assert bench.filter.named("update")[0].f_b == ZERO


def test_a_filter_that_raises_begins_anew(bench):
    bench.run()
    bench.filter.error = ZeroDivisionError()
    step = bench.take()
    assert (step.sample is not None, step.filtered) == (True, None)
    assert bench.counted == ["filter_error"]
    assert not bench.lane.has_estimate
    assert len(bench.filter.named("restart")) == 1
    bench.filter.error = None
    bench.take()
    assert bench.lane.has_estimate


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", range(4))
def test_nothing_that_is_not_finite_passes(bench, bad, place):
    bench.run()
    bench.filter.q_nb = tuple(bad if i == place else part for i, part in enumerate(LEVEL))
    assert bench.take().filtered is None
    assert bench.counted == ["non_finite_estimate"]
    assert not bench.lane.has_estimate


def test_a_filter_without_an_attitude_has_none(bench):
    bench.filter.answer = False
    assert bench.run(1).filtered is None
    assert not bench.lane.has_estimate
    assert bench.lane.estimate is None
    assert bench.monitor.named("add") == []


def test_a_reboot_begins_an_epoch_and_is_told_once(bench):
    bench.run(300)
    step = None
    for number in range(100):
        found = bench.take(time_ms=1000 + 10 * number)
        step = found if found.event is not None else step
    assert step is not None
    assert step.event is TimeVerdict.REBOOT
    assert len(bench.filter.named("restart")) == 1
    assert len(bench.monitor.named("anew")) == 1
    assert bench.lane.pop_event() is TimeVerdict.REBOOT
    assert bench.lane.pop_event() is None


def test_a_time_that_stands_is_refused(bench):
    bench.run()
    assert bench.take(time_ms=START_MS + 10 * bench.tick).sample is None
    assert bench.counted == [TimeVerdict.DUPLICATE.value]


# --- the deviations that others open ----------------------------------------------------------


@pytest.mark.parametrize(
    ("open_rad", "doubt_rad", "tilt_rad", "heading_rad"),
    [
        (0.0, 0.0, 0.01, 0.02),
        (0.3, 0.0, math.hypot(0.01, 0.3), math.hypot(0.02, 0.3)),
        (0.0, 0.4, 0.01, math.hypot(0.02, 0.4)),
        (0.3, 0.4, math.hypot(0.01, 0.3), math.hypot(0.02, 0.3, 0.4)),
    ],
)
def test_what_nobody_can_decide_opens_the_deviations(
    bench, open_rad, doubt_rad, tilt_rad, heading_rad
):
    bench.run()
    bench.lane.use_votes(Verdict(open_rad=open_rad))
    bench.lane.use_verdict(False, doubt_rad)
    filtered = bench.take().filtered
    assert filtered.sigma_tilt_rad == pytest.approx(tilt_rad)
    assert filtered.sigma_heading_rad == pytest.approx(heading_rad)


def test_a_heading_of_a_wrong_field_stays_doubted_until_it_is_dropped(bench):
    bench.run()
    lane = bench.lane
    lane.use_verdict(True, 0.4)
    assert lane.heading_is_wrong
    assert bench.take().filtered.sigma_heading_rad > 0.4
    lane.drop_heading()
    assert lane.trust.needs_restart
    assert not lane.heading_is_wrong
    lane.use_verdict(True, 0.4)  # that is known: no heading of it any more
    assert not lane.heading_is_wrong
    assert bench.take().filtered.sigma_heading_rad == pytest.approx(0.02)


def test_a_sound_heading_is_not_dropped(bench):
    bench.lane.drop_heading()
    assert not bench.lane.trust.needs_restart


@pytest.mark.parametrize("agreed", [(), (GYRO,), (ACCELEROMETER,), (GYRO, ACCELEROMETER)])
def test_votes_reach_the_monitor_once(bench, agreed):
    apart = frozenset({GYRO, ACCELEROMETER}) - frozenset(agreed)
    verdict = Verdict(agreed=frozenset(agreed), apart=apart)
    for _ in range(2):
        bench.lane.use_votes(verdict)
    told = (("gyro", GYRO in agreed), ("accelerometer", ACCELEROMETER in agreed))
    assert bench.monitor.named("use_agreed") == [told]
    assert bench.monitor.named("use_differing_force") == [(ACCELEROMETER not in agreed,)]


# --- alarms -----------------------------------------------------------------------------------


def alarm(kind, sensor=IMU_2, *, degrades=True):
    return Alarm(kind, sensor, Severity.ERROR, 1.0, "", "text", "evidence", degrades)


ALARMS = (
    alarm(Kind.GYRO_BIAS_STEP),
    alarm(Kind.ACCELEROMETER_BIAS_STEP),
    alarm(Kind.GYRO_FROZEN),
    alarm(Kind.COMPASS_FROZEN, COMPASS),
    alarm(Kind.CLIPPING, degrades=False),
)


@pytest.mark.parametrize(
    ("wrong", "lent", "is_sent", "kept"),
    [
        (False, False, True, (0, 1, 2, 3, 4)),
        (True, False, True, (2, 3, 4)),  # the comparison knows it better
        (False, True, True, (0, 1, 2, 4)),  # that is said of the IMU whose compass it is
        (False, False, False, (0, 1, 2, 4)),  # of its own sensors only
    ],
)
def test_which_alarms_are_told(bench, wrong, lent, is_sent, kept):
    bench.monitor.found = ALARMS
    bench.lane.use_votes(Verdict(wrong=frozenset({GYRO} if wrong else ())))
    if lent:
        bench.lane.lent.lend(0, FIELD, 0)
    found = bench.lane.alarms(is_sent)
    assert [one.kind for one in found] == [ALARMS[place].kind for place in kept]
    assert any(one.degrades for one in found) is is_sent


@pytest.mark.parametrize(
    ("kinds", "is_bad", "parts"),
    [
        ((Kind.GYRO_FROZEN,), True, (GYRO,)),
        ((Kind.ACCELEROMETER_FROZEN,), True, (ACCELEROMETER,)),
        ((Kind.IMU_FROZEN,), True, (GYRO, ACCELEROMETER)),
        ((Kind.GYRO_FROZEN, Kind.ACCELEROMETER_FROZEN), True, (GYRO, ACCELEROMETER)),
        ((Kind.GYRO_FROZEN,), False, ()),
        ((), True, ()),
    ],
)
def test_sensors_that_are_faulty_by_their_own_values(bench, kinds, is_bad, parts):
    bench.monitor.sensor_is_bad = is_bad
    bench.monitor.found = (
        *map(alarm, kinds),
        alarm(Kind.COMPASS_FROZEN, COMPASS),
        alarm(Kind.CLIPPING, degrades=False),
    )
    assert bench.lane.frozen_parts() == parts


# --- whether it can be followed ---------------------------------------------------------------


@pytest.mark.parametrize(("later_ns", "is_silent"), [(0, False), (1, True)])
def test_a_lane_without_samples_is_silent(bench, later_ns, is_silent):
    bench.run()
    assert bench.lane.is_silent(bench.t_ns + ImuChoice.SILENT_NS + later_ns) is is_silent
    # after a time without any readings it has to have had the chance
    bench.lane.resume(bench.t_ns + SECOND_NS)
    after_ns = bench.t_ns + SECOND_NS + ImuChoice.SILENT_NS + later_ns
    assert bench.lane.is_silent(after_ns) is is_silent


@pytest.mark.parametrize(("later_ns", "is_missing"), [(0, False), (1, True)])
def test_an_imu_is_missing_after_two_seconds_if_it_was_there(bench, later_ns, is_missing):
    t_ns = 2 * SECOND_NS + later_ns
    assert not bench.lane.is_missing(t_ns)
    bench.run()
    assert bench.lane.is_missing(bench.t_ns + t_ns) is is_missing
    bench.lane.rest(bench.t_ns)
    assert not bench.lane.is_missing(bench.t_ns + t_ns)


@pytest.mark.parametrize(
    ("own_hz", "sent_hz", "wanted_hz", "may_follow"),
    [
        (49.0, 100.0, 100.0, False),
        (51.0, 100.0, 100.0, True),
        (26.0, 50.0, 100.0, True),  # half of what the lane that is sent has
        (24.0, 50.0, 100.0, False),
        (26.0, 100.0, 50.0, True),  # or of what is wanted
        (24.0, 100.0, 50.0, False),
    ],
)
@pytest.mark.parametrize("sent_is_silent", [False, True])
def test_a_lane_needs_samples_enough_to_be_followed(
    monkeypatch, own_hz, sent_hz, wanted_hz, may_follow, sent_is_silent
):
    bench = Bench(monkeypatch, imu_rate_hz=wanted_hz)
    bench.run()
    bench.lane.rate_hz = own_hz
    sent = SimpleNamespace(rate_hz=sent_hz, is_silent=lambda _: sent_is_silent, is_left=False)
    found = bench.lane.condition(bench.t_ns, sent, is_reported=False)
    assert found.may_follow is (may_follow or sent_is_silent)


def condition(bench, *, is_reported=False):
    sent = SimpleNamespace(rate_hz=0.0, is_silent=lambda _: False, is_left=False)
    return bench.lane.condition(bench.t_ns, sent, is_reported=is_reported)


def test_a_lane_without_an_attitude_or_before_a_restart_is_not_followed(bench):
    assert not condition(bench).may_follow
    assert condition(bench).sigma_rad == 0.0
    bench.run()
    assert condition(bench).may_follow
    assert condition(bench).sigma_rad == pytest.approx(math.hypot(0.01, 0.02))
    bench.monitor.attitude_is_lost = True
    assert bench.judged().is_lost
    assert not condition(bench).may_follow


@pytest.mark.parametrize(
    ("vibration_m_s2", "is_reported", "is_shaken"),
    [(29.9, False, False), (30.1, False, True), (0.0, True, True)],
)
def test_a_lane_is_shaken_by_its_samples_or_as_reported(
    bench, vibration_m_s2, is_reported, is_shaken
):
    bench.monitor.vibration_m_s2 = vibration_m_s2
    found = condition(bench, is_reported=is_reported)
    assert (found.is_shaken, found.noise_m_s2) == (is_shaken, vibration_m_s2)


def test_ratios_are_the_worst_and_those_of_a_faulty_sensor_infinite(bench):
    bench.monitor.ratios = InnovationRatios(
        velocity_1s=0.2, velocity_10s=0.6, field_1s=0.9, field_10s=0.8, turn_1s=0.7
    )
    assert bench.lane.ratio == 0.7
    assert condition(bench).field_ratio == 0.9
    found = bench.lane.suspicion
    assert (found.ratios.of_velocity, found.ratios.of_turn) == (0.6, 0.7)
    assert not found.force_is_wrong
    bench.monitor.force_error = object()
    assert bench.lane.suspicion.force_is_wrong
    bench.monitor.sensor_is_bad = True
    assert bench.judged().ratio == math.inf


@pytest.mark.parametrize("by_votes", [False, True])
@pytest.mark.parametrize(("bad_s", "restarts"), [(1.0, False), (1.01, True)])
def test_a_filter_fed_with_bad_samples_for_a_second_restarts_once_they_are_good(
    bench, by_votes, bad_s, restarts
):
    bench.run()
    start_ns = bench.t_ns
    if by_votes:
        bench.lane.use_votes(Verdict(wrong=frozenset({GYRO})))
    else:
        bench.monitor.sensor_is_bad = True
    bench.judged(start_ns)
    assert bench.lane.trust.sensor_is_bad
    bench.judged(start_ns + round(bad_s * 1e9))
    assert bench.lane.trust.needs_restart is restarts
    bench.monitor.sensor_is_bad = False
    bench.lane.use_votes(Verdict())
    bench.judged(start_ns + 2 * SECOND_NS)
    bench.run(350)
    assert bench.lane.may_begin_anew(start_ns + 3 * SECOND_NS - 1) is False
    assert bench.lane.may_begin_anew(start_ns + 3 * SECOND_NS) is restarts
    assert not bench.lane.may_begin_anew(bench.t_ns + SECOND_NS)  # silent


def test_the_rate_is_counted_every_second(bench):
    bench.judged(0)
    bench.run(50)
    bench.judged(SECOND_NS - 1)
    assert bench.lane.rate_hz == 0.0
    bench.judged(SECOND_NS)
    assert bench.lane.rate_hz == 50.0
    bench.judged(3 * SECOND_NS)
    assert bench.lane.rate_hz == 0.0


def test_a_stream_of_which_nothing_is_usable_is_lost_if_it_was_usable(bench):
    bench.run()
    bench.monitor.use = Use.NONE
    for _ in range(REFUSALS):
        assert not bench.lane.trust.is_refused
        bench.take()
    assert bench.lane.trust.is_refused
    assert bench.lane.lost
    bench.monitor.use = Use.ALL
    bench.take()
    assert bench.lane.lost == ""


def test_a_stream_that_never_was_usable_is_not_lost(bench):
    bench.monitor.use = Use.NONE
    bench.run(REFUSALS + 5)
    assert bench.lane.trust.is_refused
    assert bench.lane.lost == ""


# --- rest of a stream -------------------------------------------------------------------------


def test_a_stream_rests_for_a_minute(bench):
    bench.run()
    bench.lane.rest(bench.t_ns)
    end_ns = bench.t_ns + 60 * SECOND_NS
    assert bench.lane.is_resting
    assert (bench.lane.newest, bench.lane.estimate) == (None, None)
    assert bench.lane.need(end_ns - 1, SCALED2) is Need.NONE
    assert bench.lane.needs_until_ns(SCALED2, Need.NONE) == end_ns
    assert bench.lane.idle_until_ns(SCALED2) == end_ns
    bench.lane.trust.wake(end_ns - 1)
    assert bench.lane.is_resting
    bench.lane.trust.wake(end_ns)
    assert not bench.lane.is_resting
    assert bench.lane.trust.needs_restart
    assert bench.lane.need(end_ns, SCALED2) is Need.SAMPLE


# --- what else it is told ---------------------------------------------------------------------


def fix(**how):
    return VelocityFix(1_000, (1.0, 2.0, 3.0), 0.2, **how)


def test_a_velocity_reaches_monitor_and_filter_after_the_first_sample(bench):
    bench.lane.use(fix(independent=False))
    assert bench.filter.named("use_velocity") == []
    assert bench.lane.dependent_source == ""
    bench.run()
    bench.lane.use(fix())
    assert bench.filter.named("use_velocity") == [fix(removed_s=0.1)]
    assert bench.lane.dependent_source == ""
    bench.lane.use(fix(independent=False))
    assert bench.lane.dependent_source == "its velocity"
    bench.lane.use(fix())
    assert bench.lane.dependent_source == "its velocity"  # it is in the state


def test_a_velocity_that_is_false_reaches_no_filter(bench):
    bench.run()
    bench.monitor.velocity_is_false = True
    bench.lane.use(fix())
    assert len(bench.monitor.named("fix")) == 1
    assert bench.filter.named("use_velocity") == []


def test_a_velocity_that_its_places_deny_is_judged_and_reaches_no_filter(bench):
    bench.run()
    bench.lane.use(fix(is_denied=True))
    assert len(bench.monitor.named("fix")) == 1
    assert bench.filter.named("use_velocity") == []


@pytest.mark.parametrize("is_corrected", [False, True])
def test_a_doubt_reaches_the_filter_and_what_is_found_corrects_later_samples(bench, is_corrected):
    bench.run()
    found = SensorCorrection((0.01, 0.0, 0.0), (0.0, 0.5, 0.0), ZERO, ZERO, (0.0, 0.0), 0.1, 0.1)
    bench.monitor.doubt = SensorDoubt(correction=found if is_corrected else None)
    bench.lane.use(fix())
    assert bench.filter.named("doubt") == [bench.monitor.doubt]
    step = bench.take()
    given = bench.filter.named("update")[-1]
    if not is_corrected:
        assert given == step.sample
        return
    assert given.w_b == pytest.approx((RATE[0] - 0.01, *RATE[1:]))
    assert given.f_b == pytest.approx((0.0, -0.5, DOWN[2]))
    assert step.filtered.bias_b == pytest.approx((0.01, 0.0, 0.0))
    assert step.sample.w_b == RATE


@pytest.mark.parametrize(
    ("on_ground", "trust", "clipped", "learns"),
    [
        (True, Trust.ALIGNED | Trust.REST, False, True),
        (False, Trust.ALIGNED | Trust.REST, False, False),
        (None, Trust.ALIGNED | Trust.REST, False, False),
        (True, Trust.ALIGNED, False, False),
        (True, Trust.ALIGNED | Trust.REST, True, False),
    ],
)
def test_the_size_of_the_force_at_rest_shows_its_bias(bench, on_ground, trust, clipped, learns):
    bench.lane.use(VehicleState(on_ground=on_ground))
    bench.lane.use_gravity(9.80)
    bench.filter.trust = trust
    for _ in range(3000):
        bench.take(force=(0.0, 0.0, -10.1), clipped=clipped)
    given = bench.filter.named("update")[-1]
    assert given.f_b[2] == pytest.approx(-9.80 if learns else -10.1, abs=0.02)


def test_a_rest_does_not_go_on_after_a_flight(bench):
    bench.filter.trust = Trust.ALIGNED | Trust.REST
    for on_ground in (True, False, True):
        bench.lane.use(VehicleState(on_ground=on_ground))
        for _ in range(2):
            bench.take(force=(0.0, 0.0, -10.1), ticks=600)
    assert bench.filter.named("update")[-1].f_b[2] == -10.1


def test_a_lane_begins_as_another_one_with_its_own_bias(monkeypatch):
    own, other = Bench(monkeypatch), Bench(monkeypatch)
    for one in (own, other):
        one.run()
    own.judged()
    own.filter.calls.clear()
    own.lane.begin_as(other.lane)
    (state,) = own.filter.named("restore")
    assert state == other.filter.state()
    assert own.filter.named("restart") == []
    assert len(own.filter.named("use_delays")) == 1
    assert not own.lane.trust.needs_restart
    assert len(own.monitor.named("renew")) == 1


@pytest.mark.parametrize("has_other", [False, True])
def test_a_lane_that_has_no_other_aligns(monkeypatch, has_other):
    own = Bench(monkeypatch)
    own.run()
    own.filter.calls.clear()
    own.lane.begin_as(Bench(monkeypatch).lane if has_other else None)
    assert len(own.filter.named("restart")) == 1
    assert own.filter.named("restore") == []


def test_field_and_vehicle_reach_filter_and_monitor(bench):
    field, vehicle = EarthField(50.0, 1.1, 0.05), VehicleState(on_ground=False)
    bench.lane.use(field)
    bench.lane.use(vehicle)
    for told in (bench.filter, bench.monitor):
        assert ("use_field", field) in told.calls
        assert ("use_vehicle", vehicle) in told.calls


@pytest.mark.parametrize(("ticks", "is_uneven"), [(1, False), (2, True)])
def test_the_filter_takes_a_sample_of_an_uneven_step_as_even_and_the_rate_is_its_own(
    bench, ticks, is_uneven
):
    bench.run(300)
    step = bench.take(rate=(1.1, 0.2, 0.3), ticks=ticks)
    given = bench.filter.named("update")[-1]
    assert (given.w_b[0] < 1.0) is is_uneven
    assert step.sample.w_b[0] == step.filtered.w_b[0] == 1.1


# --- what a lane is -----------------------------------------------------------------------------


def test_a_zero_that_has_moved_is_kept_when_it_begins_as_another(monkeypatch):
    own, other = Bench(monkeypatch), Bench(monkeypatch)
    for one in (own, other):
        one.run()
    own.judged()
    own.lane.use_moved_zero((0.25, 0.0, 0.0))
    own.lane.begin_as(other.lane)
    step = own.take()
    assert own.filter.named("update")[-1].w_b == pytest.approx((RATE[0] - 0.25, *RATE[1:]))
    assert step.filtered.bias_b == pytest.approx((0.25, 0.0, 0.0))


def test_a_reading_of_another_imu_is_not_its_own(monkeypatch):
    monkeypatch.setattr(lane_module, "Monitor", FakeMonitor)
    highres = IDS_BY_NAME["HIGHRES_IMU"]
    identity = Identity(1, 1, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
    lane = Lane(
        LaneMessages(1, (SCALED2, highres)), FakeFilter(), identity, AutopilotSettings(), print
    )
    reading = ImuReading(20_000_000, RATE, DOWN, FIELD, False, imu=2)
    assert lane.take(Incoming(0, highres, reading), Need.SAMPLE) is NOT_ITS_OWN
    assert lane.take(Incoming(0, highres, reading), Need.FIELD) is NO_STEP
    assert lane.take(Incoming(0, highres, reading._replace(imu=1)), Need.SAMPLE).sample is not None


@pytest.mark.parametrize(("wrong_rad", "tilt_rad"), [(0.1, 0.1), (1.5, math.radians(15.0))])
def test_rates_of_another_scale_are_multiplied_and_their_turns_doubted(bench, wrong_rad, tilt_rad):
    bench.run(300)
    bench.monitor.rate_factor, bench.monitor.misturned_rad = 0.8, wrong_rad
    bench.run(2)
    *_, before, one, other = bench.filter.named("update")
    assert before.w_b == RATE
    assert one.w_b == other.w_b == pytest.approx([0.8 * x for x in RATE])
    (doubt,) = bench.filter.named("doubt")
    assert doubt == SensorDoubt(tilt_rad=pytest.approx(tilt_rad), heading_rad=wrong_rad)
    step = bench.take(ticks=2)  # an uneven one has the rate at its end
    assert step.filtered.w_b == pytest.approx([0.8 * x for x in RATE])
    bench.monitor.rate_factor = 1.0
    bench.run(1)
    assert bench.filter.named("update")[-1].w_b == RATE


def test_the_monitor_is_told_of_another_message_but_not_of_the_first(monkeypatch):
    monkeypatch.setattr(lane_module, "Monitor", FakeMonitor)
    highres, raw = IDS_BY_NAME["HIGHRES_IMU"], IDS_BY_NAME["RAW_IMU"]
    identity = Identity(1, 1, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
    lane = Lane(LaneMessages(0, (highres, raw)), FakeFilter(), identity, AutopilotSettings(), print)
    told = []
    for tick, message_id in enumerate((highres, highres, raw, raw, highres)):
        time_us = 20_000_000 + TICK_NS // 1000 * tick
        reading = ImuReading(time_us, RATE, DOWN, FIELD, False)
        taken = lane.take(Incoming(TICK_NS * tick, message_id, reading), Need.SAMPLE)
        assert taken.sample is not None
        told.append(len(lane.monitor.named("change_message")))
    assert told == [0, 0, 1, 1, 2]


def test_an_imu_that_the_autopilot_has_left_is_judged_by_all_that_is_known_of_it(monkeypatch):
    monkeypatch.setattr(lane_module, "Monitor", FakeMonitor)
    highres, raw = IDS_BY_NAME["HIGHRES_IMU"], IDS_BY_NAME["RAW_IMU"]
    identity = Identity(1, 1, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, mavlink.MAV_TYPE_QUADROTOR)
    lane = Lane(LaneMessages(0, (highres, raw)), FakeFilter(), identity, AutopilotSettings(), print)
    for tick in range(60):
        other = RATE if tick < 30 else ZERO
        for message_id, rate in ((highres, other), (raw, RATE)):
            t_ns = TICK_NS * 10 * tick
            need = lane.need(t_ns, message_id)
            if need is not Need.NONE:
                unit_us = 1000 if message_id == raw and IMU_MESSAGES[raw].time_unit_us > 1 else 1
                reading = ImuReading(
                    (20_000_000 + t_ns // 1000) // unit_us, rate, DOWN, FIELD, False
                )
                lane.take(Incoming(t_ns, message_id, reading), need)
    assert lane.intake.is_left
    assert not lane.monitor.named("change_message")


@pytest.mark.parametrize(
    ("vehicle", "usual_m_s"),
    [
        (mavlink.MAV_TYPE_FIXED_WING, 30.0),
        (mavlink.MAV_TYPE_QUADROTOR, 15.0),
        (mavlink.MAV_TYPE_GROUND_ROVER, 15.0),
    ],
)
def test_how_fast_a_vehicle_usually_is(monkeypatch, vehicle, usual_m_s):
    made = []
    monkeypatch.setattr(lane_module, "Monitor", lambda *parts: made.append(parts) or FakeMonitor())
    identity = Identity(1, 1, mavlink.MAV_AUTOPILOT_PX4, vehicle)
    Lane(LaneMessages(1, (SCALED2,)), FakeFilter(), identity, AutopilotSettings(), print)
    assert made == [(IMU_2, Speeds(usual_m_s))]


def test_the_message_asked_for_stands_for_one_that_has_not_come(bench):
    assert bench.lane.stream_id == SCALED2
    assert (bench.lane.imu, bench.lane.sensor) == (1, IMU_2)
    assert math.isnan(bench.lane.sigma_tilt_rad)
    assert bench.lane.estimate is None
    bench.run()
    assert bench.lane.stream_id == SCALED2
    assert bench.lane.sigma_tilt_rad == 0.01
    assert bench.lane.estimate.t_us == bench.lane.newest.t_us


@pytest.mark.parametrize(
    ("later_ns", "is_silent", "is_missing"),
    [
        (200_000_000, False, False),
        (200_000_001, True, False),
        (2_000_000_000, True, False),
        (2_000_000_001, True, True),
    ],
)
def test_it_is_silent_after_a_fifth_of_a_second_and_missing_after_two(
    bench, later_ns, is_silent, is_missing
):
    assert not bench.lane.is_missing(0)
    bench.run()
    t_ns = bench.t_ns + later_ns
    assert bench.lane.is_silent(t_ns) is is_silent
    assert bench.lane.is_missing(t_ns) is is_missing
    bench.lane.resume(t_ns)
    assert not bench.lane.is_silent(t_ns)


@pytest.mark.parametrize(
    ("rate_hz", "sent_hz", "may_follow"),
    [(50.0, 100.0, True), (49.9, 100.0, False), (25.0, 50.0, True), (50.0, 400.0, True)],
)
def test_half_of_the_samples_are_enough(bench, rate_hz, sent_hz, may_follow):
    bench.run()
    bench.lane.rate_hz = rate_hz
    sent = SimpleNamespace(rate_hz=sent_hz, is_silent=lambda _: False, is_left=False)
    found = bench.lane.condition(bench.t_ns, sent, is_reported=False)
    assert found.may_follow is may_follow
    assert found.sigma_rad == pytest.approx(math.hypot(0.01, 0.02))
    sent.is_silent = lambda _: True
    assert bench.lane.condition(bench.t_ns, sent, is_reported=False).may_follow


def test_its_rate_is_that_of_the_last_second(bench):
    bench.run(100)
    bench.judged(SECOND_NS)
    assert bench.lane.rate_hz == 100.0
    bench.run(30)
    bench.judged(2 * SECOND_NS - 1)
    assert bench.lane.rate_hz == 100.0
    bench.judged(2 * SECOND_NS)
    assert bench.lane.rate_hz == 30.0


@pytest.mark.parametrize(
    ("frozen", "wrong", "may"), [(False, False, True), (True, False, False), (False, True, False)]
)
def test_a_sound_compass_may_be_lent(bench, frozen, wrong, may):
    assert not bench.lane.may_lend(bench.t_ns)
    bench.run()
    bench.monitor.field_is_frozen, bench.lane.compass_is_wrong = frozen, wrong
    assert bench.lane.may_lend(bench.t_ns) is may


@pytest.mark.parametrize(("ratio", "learns"), [(0.49, True), (0.5, False), (math.inf, False)])
def test_a_bias_is_learnt_while_the_tests_are_calm(monkeypatch, ratio, learns):
    own, other = Bench(monkeypatch), Bench(monkeypatch)
    for one in (own, other):
        one.run()
    own.monitor.ratios = InnovationRatios(velocity_1s=ratio)
    own.judged()
    own.lane.use_moved_zero((0.25, 0.0, 0.0))  # of what was learnt, if anything was
    own.lane.begin_as(other.lane)
    assert (own.take().filtered.bias_b[0] == 0.25) is learns


def test_an_attitude_that_is_lost_restarts_the_lane(bench):
    bench.run()
    assert not bench.judged().is_lost
    bench.monitor.attitude_is_lost = True
    assert bench.judged().is_lost
    assert bench.lane.trust.needs_restart
    assert not bench.lane.may_be_right(bench.t_ns)


def test_a_lane_may_be_right_unless_something_is_known_against_it(bench):
    assert not bench.lane.may_be_right(0)
    bench.run()
    assert bench.lane.may_be_right(bench.t_ns)
    assert not bench.lane.may_be_right(bench.t_ns + 200_000_001)
    bench.lane.use_votes(Verdict(wrong=frozenset({GYRO})))
    assert not bench.lane.may_be_right(bench.t_ns)
    bench.lane.use_votes(Verdict())
    bench.monitor.sensor_is_bad = True
    assert not bench.judged().may_be_right(bench.t_ns)


def test_what_was_found_of_the_force_is_forgotten_when_it_begins_anew(bench):
    bench.run()
    found = SensorCorrection(ZERO, (0.0, 0.5, 0.0), ZERO, ZERO, (0.0, 0.0), 0.1, 0.1)
    bench.monitor.doubt = SensorDoubt(correction=found)
    bench.lane.use(fix())
    bench.take()
    assert bench.filter.named("update")[-1].f_b == pytest.approx((0.0, -0.5, DOWN[2]))
    bench.lane.trust.require_restart()
    bench.lane.begin_as(None)
    bench.take()
    assert bench.filter.named("update")[-1].f_b == DOWN
    assert not bench.lane.trust.needs_restart
