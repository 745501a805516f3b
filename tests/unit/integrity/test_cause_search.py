"""What follows from the explanation of a contradiction, with explanations that are given."""

import math
from types import SimpleNamespace

import pytest

from h2nav.attitude.samples import SensorCorrection, SensorErrors
from h2nav.integrity import cause_search, slow_drift
from h2nav.integrity.cause_search import CauseSearch, Situation
from h2nav.integrity.causes import DECIDED, NOTHING, SUSPECTED, Cause, Explained
from h2nav.integrity.findings import Kind, Sensor, SensorKind
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.velocity_windows import Window

S = 1_000_000
G = 9.80665
DEG = math.pi / 180.0
IMU = Sensor(SensorKind.IMU, 1)
ERRORS = SensorErrors((0.0, 0.0, 0.0))
DECIDING, SUSPECTING = math.log(DECIDED) + 1.0, math.log(SUSPECTED) + 1.0
QUIET = InnovationRatios(velocity_1s=0.19, turn_1s=0.1)
LOUD = InnovationRatios(velocity_1s=0.21, turn_1s=0.1)


def decides(cause, share=0.9999, **more):
    rest = Cause.GYRO if cause is not Cause.GYRO else Cause.VELOCITY
    shares = ((cause, share), (rest, 1.0 - share))
    return Explained(DECIDING, shares, **{"step": 2.0, **more})


def correction(tilt_deg=1.0, turn_deg=(3.0, 4.0, 5.0)):
    nothing = (0.0, 0.0, 0.0)
    turn_n = tuple(part * DEG for part in turn_deg)
    return SensorCorrection(nothing, nothing, turn_n, nothing, (0.0, 0.0), tilt_deg * DEG, 0.2)


class Rows:
    """Stands for `VelocityRows`: every velocity ends a row."""

    jitter_m_s = force_density = usual_m_s2 = felt_m_s2 = 0.0
    shifts = ()

    def __init__(self, *_):
        self.moment = SimpleNamespace(t_us=90 * S, sigma_heading_rad=0.1, bias_b=(0.0, 0.0, 0.0))
        self.restarts = 0
        row = SimpleNamespace(begun=SimpleNamespace(moment=self.moment), errors=ERRORS)
        self.rows = [row]

    @property
    def begun_us(self):
        return self.moment.t_us

    def restart(self):
        self.restarts += 1

    def take(self, _mark, _errors):
        return True


class Bench:
    """A search of which each velocity is explained as a test says, five times a second."""

    def __init__(self, monkeypatch):
        self.found = NOTHING
        monkeypatch.setattr(cause_search, "VelocityRows", Rows)
        monkeypatch.setattr(cause_search, "explain", lambda *_, **__: self.found)
        monkeypatch.setattr(slow_drift, "VelocityRows", Rows)
        monkeypatch.setattr(slow_drift, "explain", lambda *_: NOTHING)
        monkeypatch.setattr(cause_search, "advanced", lambda found, _then, _now: found)
        self.strapdown = SimpleNamespace(newest=SimpleNamespace(sigma_heading_rad=0.3))
        self.windows_restarted, self.opened = 0, []
        opened = SimpleNamespace(
            correct=lambda *errors: self.opened.append(errors),
            suspect_drift=lambda t_us, drift, is_suspicious: self.opened.append(
                (t_us, drift, is_suspicious)
            ),
        )
        velocity = SimpleNamespace(restart=self.restart)
        self.search = CauseSearch(self.strapdown, velocity, opened)
        self.learns = []
        self.search.receiver = SimpleNamespace(
            learn=lambda *_: self.learns.append(self.t_us) or False, errors=None
        )
        self.learns_force = []
        self.search._scatter = SimpleNamespace(
            learn=lambda *_: self.learns_force.append(self.t_us), share=0.25
        )
        self.t_us = 100 * S
        self.seen = Situation(0, ERRORS, LOUD, None, 0, 0.0, 5_000.0, True, False, (0, 0), False)

    def restart(self):
        self.windows_restarted += 1

    def take(self, found=None, seconds=0.2, **seen):
        """Explains velocities for some time so; the last doubt, and whether it is a correction."""
        if found is not None:
            self.found = found
        answer = None
        for _ in range(round(5 * seconds)):
            self.t_us += S // 5
            now = {"t_us": self.t_us, "sample_us": self.t_us, **seen}
            answer = self.search.take(SimpleNamespace(moment=None), self.seen._replace(**now))
        return answer

    def alarms(self, reported=()):
        return self.search.alarms(IMU, self.t_us, reported)


@pytest.fixture
def bench(monkeypatch):
    return Bench(monkeypatch)


def test_a_cause_that_lasts_for_a_second_is_told(bench):
    bench.take(decides(Cause.GYRO))
    for _ in range(4):
        assert bench.alarms() == []
        bench.take()
    assert bench.alarms() == []
    bench.take()
    (alarm,) = bench.alarms()
    assert (alarm.kind, alarm.is_decided) == (Kind.GYRO_BIAS_STEP, True)
    assert alarm.since_s == pytest.approx(1.0)
    assert bench.alarms([Kind.GYRO_BIAS_STEP]) == []
    bench.search.use_cleared(frozenset({Cause.GYRO}))
    (alarm,) = bench.alarms()
    assert (alarm.kind, alarm.is_decided) == (Kind.ATTITUDE_VELOCITY, False)


@pytest.mark.parametrize(
    ("how", "is_over"),
    [
        ({"ratios": QUIET}, True),
        ({"ratios": LOUD}, False),
        ({"ratios": InnovationRatios()}, True),
        ({"found": SUSPECTING}, False),
        ({"found": math.log(SUSPECTED)}, True),
        # a window that began before the tilt had settled, or without a heading
        ({"unsettled_us": (80 * S, 90 * S)}, True),
        ({"unsettled_us": (90 * S, 95 * S)}, True),
        ({"unsettled_us": (80 * S, 90 * S - 1)}, False),
        ({"unsettled_us": (90 * S + 1, 95 * S)}, False),
        ({"heading_rad": 0.99}, False),
        ({"heading_rad": 1.0}, True),
    ],
)
def test_what_ends_a_contradiction(bench, how, is_over):
    bench.take(decides(Cause.GYRO), seconds=2.0)
    assert bench.search.contradiction.begun_us is not None
    how = dict(how)
    if "heading_rad" in how:
        bench.search._rows.moment.sigma_heading_rad = how.pop("heading_rad")
    found = how.pop("found", None)
    bench.take(None if found is None else bench.found._replace(odds=found), **how)
    assert (bench.search.contradiction.begun_us is None) == is_over
    assert (bench.alarms() == []) == is_over


def test_an_undecided_cause_is_doubted_after_a_while(bench):
    undecided = decides(Cause.GYRO, 0.6, rate_b=(0.01, 0.0, 0.0))
    assert bench.take(undecided, seconds=0.8) == (None, False)
    doubt, is_correction = bench.take()
    assert doubt.correction is None
    assert doubt[0][0] > 0.0
    assert not is_correction


@pytest.mark.parametrize(
    ("share", "vibration_m_s2", "told_s"),
    [(0.6, 4.9, 1.0), (0.6, 5.1, 5.0), (0.9999, 5.1, 1.0)],
)
def test_what_a_force_that_shakes_leaves_undecided_is_told_after_five_seconds(
    bench, share, vibration_m_s2, told_s
):
    bench.take(decides(Cause.GYRO, share), vibration_m_s2=vibration_m_s2)
    for _ in range(round(5 * told_s)):
        assert bench.alarms() == []
        bench.take(vibration_m_s2=vibration_m_s2)
    (alarm,) = bench.alarms()
    assert alarm.is_decided == (share > 0.9)


def test_a_decided_cause_is_doubted_at_once(bench):
    doubt, _ = bench.take(decides(Cause.GYRO, rate_b=(0.01, 0.0, 0.0)))
    assert doubt is not None


# --- a false velocity -----------------------------------------------------------------------------

FALSE = decides(Cause.VELOCITY)


@pytest.mark.parametrize(
    ("found", "seen", "after_s"),
    [
        (FALSE, {}, 2.6),
        # a velocity that has jumped begins like nothing else
        (FALSE._replace(has_jumped=True), {}, 0.0),
        (decides(Cause.VELOCITY, 0.95, has_jumped=True), {}, 2.6),
        # probable is enough, if it is seen
        (decides(Cause.VELOCITY, 0.91), {}, 2.6),
        (decides(Cause.VELOCITY, 0.89), {}, None),
        (decides(Cause.VELOCITY, 0.91, is_seen=False), {}, None),
        (decides(Cause.GYRO), {}, None),
        # only a field can confirm the gyro
        (FALSE, {"field_holds": False}, None),
        (FALSE, {"ratios": LOUD._replace(turn_1s=0.49)}, 2.6),
        (FALSE, {"ratios": LOUD._replace(turn_1s=0.5)}, None),
        # vibration is rectified into a drift, but for a larger one
        (FALSE, {"vibration_m_s2": 4.9}, 2.6),
        (FALSE, {"vibration_m_s2": 5.1}, None),
        (FALSE._replace(drift_m_s2=0.25), {"vibration_m_s2": 5.1}, None),
        (FALSE._replace(drift_m_s2=0.52), {"vibration_m_s2": 5.1}, 2.6),
    ],
)
def test_when_a_velocity_is_refused(bench, found, seen, after_s):
    refused_s = None
    for i in range(25):
        bench.take(found, **seen)
        if bench.search.velocity_is_false and refused_s is None:
            refused_s = 0.2 * i
    assert refused_s == (None if after_s is None else pytest.approx(after_s))
    is_decided = found.decided is Cause.VELOCITY
    assert bench.search.velocity_is_known_false == (after_s is not None and is_decided)
    assert bench.search.may_be_bent(bench.t_us) == (
        bench.search.velocity_is_known_false or found.decided is Cause.GYRO
    )


@pytest.mark.parametrize(
    ("share", "drift_m_s2", "is_refused"),
    [(0.9999, 0.52, True), (0.91, 0.52, False), (0.91, 0.75, False), (0.91, 0.78, True)],
)
def test_beside_vibration_what_is_only_probable_has_to_be_larger_by_half(
    bench, share, drift_m_s2, is_refused
):
    found = decides(Cause.VELOCITY, share, drift_m_s2=drift_m_s2)
    bench.take(found, seconds=5.0, vibration_m_s2=5.1)
    assert bench.search.velocity_is_false is is_refused


def test_a_refused_velocity_is_told_and_heard(bench):
    bench.take(FALSE, seconds=4.0)
    (alarm,) = bench.alarms([Kind.GPS_VELOCITY])
    assert alarm.kind is Kind.GPS_VELOCITY
    assert alarm.since_s == pytest.approx(1.2)
    agreeing = Window(10.0, 0.0, 1.0, 1.0, True)
    bench.take(FALSE._replace(odds=0.0), seconds=11.0, long=agreeing)
    assert not bench.search.velocity_is_false
    assert bench.search.contradiction.decided is None


def test_a_velocity_that_is_refused_as_probably_false_is_told_after_three_seconds(bench):
    bench.take(decides(Cause.VELOCITY, 0.91), seconds=2.8)
    assert bench.search.velocity_is_false
    bench.take(decides(Cause.GYRO, 0.6), seconds=2.8)
    (alarm,) = bench.alarms()
    assert alarm.kind is Kind.ATTITUDE_VELOCITY
    assert not bench.search.accuses_velocity(bench.t_us)
    bench.take()
    (alarm,) = bench.alarms()
    assert (alarm.kind, alarm.is_decided) == (Kind.GPS_VELOCITY, False)
    # by what was found when it began
    assert "velocity 91%" in alarm.evidence
    assert alarm.since_s == pytest.approx(3.0)
    assert bench.search.accuses_velocity(bench.t_us)


@pytest.mark.parametrize(
    ("cleared", "is_named"), [(Cause.GYRO, True), (Cause.ACCELEROMETER, False), (None, False)]
)
def test_without_a_field_another_imu_confirms_the_gyro_that_a_velocity_contradicts(
    bench, cleared, is_named
):
    bench.search.use_cleared(frozenset({cleared}) if cleared else frozenset())
    bench.take(FALSE, seconds=0.8, field_holds=False)
    assert not bench.search.accuses_velocity(bench.t_us)
    bench.take(seconds=0.4, field_holds=False)
    assert not bench.search.velocity_is_false
    (alarm,) = bench.alarms()
    assert (alarm.kind is Kind.GPS_VELOCITY) is is_named
    assert bench.search.accuses_velocity(bench.t_us) is is_named
    # force and velocity are withheld for half a minute: then it is used again
    bench.take(seconds=29.8, field_holds=False)
    assert not bench.search.accuses_velocity(bench.t_us)


def test_a_velocity_that_its_places_deny_is_refused_at_once_without_a_field(bench):
    bench.take(FALSE, seconds=1.0, field_holds=False)
    assert not bench.search.velocity_is_false
    bench.take(FALSE, field_holds=False, is_denied=True)
    assert bench.search.velocity_is_false
    assert bench.search.velocity_is_known_false


def test_while_a_window_holds_a_velocity_that_was_denied_it_stays_refused(bench):
    bench.take(FALSE, seconds=2.0, is_denied=True)
    agreeing = Window(10.0, 0.0, 1.0, 1.0, True)
    bench.take(FALSE._replace(odds=0.0), seconds=15.0, long=agreeing, is_denied=True)
    assert bench.search.velocity_is_false
    assert bench.search.velocity_is_denied
    bench.take(seconds=9.0, long=agreeing)
    assert bench.search.velocity_is_false
    bench.take(seconds=1.4, long=agreeing)
    assert not bench.search.velocity_is_false


def test_a_window_that_begins_behind_what_was_denied_is_explained_as_ever(bench):
    bench.take(FALSE, is_denied=True)
    assert bench.search.velocity_is_denied
    bench.search._rows.moment.t_us = bench.t_us
    assert not bench.search.velocity_is_denied


def test_a_velocity_that_another_cause_outweighs_is_not_refused(bench):
    bench.take(decides(Cause.GYRO), seconds=1.0)
    bench.take(FALSE, seconds=0.6)
    bench.take(decides(Cause.GYRO), seconds=4.0)
    assert not bench.search.velocity_is_false


def test_what_shook_lately_shows_no_velocity_to_be_false(bench):
    bench.take(decides(Cause.VIBRATION), seconds=0.2)
    bench.take(FALSE, seconds=6.0)
    assert not bench.search.velocity_is_false


# --- force or velocity ----------------------------------------------------------------------------

EITHER = Explained(
    DECIDING, ((Cause.ACCELEROMETER, 0.5), (Cause.VELOCITY, 0.4999), (Cause.GYRO, 0.0001))
)


def test_force_and_velocity_are_withheld_for_half_a_minute(bench):
    seen = {"field_holds": False}
    bench.take(EITHER, **seen)
    began_us = bench.search.withheld_us
    assert began_us == bench.t_us
    assert bench.take(EITHER, seconds=2.0, **seen) == (None, False)
    assert bench.search.is_withheld(began_us + 30 * S - 1)
    assert not bench.search.is_withheld(began_us + 30 * S)
    for other in (EITHER._replace(odds=SUSPECTING), decides(Cause.GYRO)):
        bench.take(other, **seen)
        assert bench.search.withheld_us is None
        assert not bench.search.is_withheld(bench.t_us)
        bench.take(EITHER, **seen)
        assert bench.search.withheld_us == bench.t_us


CARRIED = EITHER._replace(carried=correction())


def test_the_attitude_goes_back_to_that_by_the_gyro(bench):
    for _ in range(5):
        answer = bench.take(CARRIED, field_holds=False)
        assert answer == (None, False)
    doubt, is_corrected = bench.take(field_holds=False)
    assert not is_corrected
    assert doubt.correction.turn_n == pytest.approx((3.0 * DEG, 4.0 * DEG, 0.0))
    assert doubt.correction.heading_sigma_rad == 0.3
    assert bench.opened[-1] == pytest.approx((1.0 * DEG,))
    assert bench.take(field_holds=False) == (None, False)  # once


@pytest.mark.parametrize(
    ("tilt_deg", "turn_deg", "is_carried"),
    [
        (4.9, (3.0, 4.0, 9.0), True),
        (5.1, (3.0, 4.0, 9.0), False),
        (1.4, (0.0, 0.0, 9.0), True),
        (1.6, (0.0, 0.0, 9.0), False),
        (9.9, (20.0, 0.0, 0.0), True),
        (10.1, (20.0, 0.0, 0.0), False),
    ],
)
def test_it_goes_back_only_to_what_is_known_better(bench, tilt_deg, turn_deg, is_carried):
    found = EITHER._replace(carried=correction(tilt_deg, turn_deg))
    bench.take(found, seconds=1.0, field_holds=False)
    doubt, _ = bench.take(found, field_holds=False)
    assert (doubt is not None) == is_carried


def test_while_dead_reckoning_is_gone_nothing_is_corrected(bench):
    bench.strapdown.newest = None
    wrong = decides(Cause.GYRO, correction=correction())
    assert bench.take(CARRIED, seconds=2.0, field_holds=False) == (None, False)
    bench.take(wrong, seconds=2.0)
    assert bench.search.contradiction.begun_us is not None


# --- a wrong sensor -------------------------------------------------------------------------------


def corrected_after(bench, found, seconds=6.0, **seen):
    """Time until a correction, s; None without one."""
    for i in range(round(5 * seconds)):
        doubt, is_corrected = bench.take(found, **seen)
        if is_corrected:
            assert doubt.correction is found.correction
            return pytest.approx(0.2 * i, abs=1e-9)
    return None


@pytest.mark.parametrize(
    ("found", "seen", "after_s"),
    [
        (decides(Cause.GYRO, correction=correction()), {}, 1.0),
        (decides(Cause.ACCELEROMETER, correction=correction()), {}, 1.0),
        (decides(Cause.GYRO), {}, None),
        (decides(Cause.GYRO, correction=correction(9.9)), {}, 1.0),
        (decides(Cause.GYRO, correction=correction(10.1)), {}, None),
        # an accelerometer that probably is, once it remains undecided
        (EITHER._replace(
            shares=((Cause.ACCELEROMETER, 0.95), (Cause.VELOCITY, 0.0499)),
            correction=correction(),
        ), {"field_holds": False}, 2.6),
        # vibration between slow samples
        (decides(Cause.GYRO, correction=correction()),
         {"period_us": 15_000.0, "vibration_m_s2": 1.1}, None),
        (decides(Cause.GYRO, correction=correction()),
         {"period_us": 15_000.0, "vibration_m_s2": 0.9}, 1.0),
        (decides(Cause.GYRO, correction=correction()),
         {"period_us": 14_999.0, "vibration_m_s2": 1.1}, 1.0),
        (decides(Cause.ACCELEROMETER, correction=correction()),
         {"period_us": 15_000.0, "vibration_m_s2": 0.68}, None),
        (decides(Cause.ACCELEROMETER, correction=correction()),
         {"period_us": 15_000.0, "vibration_m_s2": 0.65}, 1.0),
    ],
)  # fmt: skip
def test_when_a_sensor_is_corrected(bench, found, seen, after_s):
    assert corrected_after(bench, found, **seen) == after_s


def test_behind_a_correction_everything_is_measured_anew(bench):
    found = decides(Cause.GYRO, correction=correction(), step=0.1)
    restarts = bench.search._rows.restarts
    assert corrected_after(bench, found) == 1.0
    assert bench.search._rows.restarts == restarts + 1
    assert bench.opened[-1] == pytest.approx((1.0 * DEG, 0.2))
    assert bench.search.contradiction.begun_us is None
    assert bench.search.bent.is_bent(bench.t_us)
    (alarm,) = bench.alarms()  # it is told until the filter has learnt it
    assert alarm.kind is Kind.GYRO_BIAS_STEP
    bench.search.renew()
    assert bench.alarms() == []


def test_a_sensor_that_others_confirm_is_not_corrected(bench):
    bench.search.use_cleared(frozenset({Cause.GYRO}))
    assert corrected_after(bench, decides(Cause.GYRO, correction=correction())) is None


def test_a_sensor_is_not_accused_of_what_another_has_bent(bench):
    bench.take(decides(Cause.ACCELEROMETER))
    bench.search._rows.moment.t_us = bench.t_us + S // 10
    bench.take(decides(Cause.GYRO), seconds=3.0)
    assert bench.search.contradiction.decided is Cause.ACCELEROMETER


# --- the rest -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("drift_share", "lasts_s", "is_bent"),
    [(1.01, 1.2, True), (0.99, 1.2, False), (1.01, 0.8, False)],
)
def test_a_drift_that_lasts_may_have_bent_the_attitude(bench, drift_share, lasts_s, is_bent):
    drift = drift_share * G * 1.5 * DEG
    bench.take(decides(Cause.VELOCITY, 0.6, drift_m_s2=drift), seconds=lasts_s)
    assert bench.opened[-1] == (bench.t_us, drift, True)
    assert bench.search.may_be_bent(bench.t_us + 120 * S - 1) == is_bent
    assert not bench.search.may_be_bent(bench.t_us + 120 * S)
    assert not bench.search.may_be_bent(None)


def test_an_attitude_that_velocities_contradicted_may_be_bent(bench):
    bench.search.bent.contradict(bench.t_us)
    assert bench.search.may_be_bent(bench.t_us)


@pytest.mark.parametrize(("odds", "may_learn"), [(math.log(99.0), True), (math.log(101.0), False)])
def test_nothing_is_learnt_of_receiver_and_force_while_a_fault_is_likely(bench, odds, may_learn):
    bench.take(Explained(odds))
    assert bool(bench.learns) == bool(bench.learns_force) == may_learn


def test_of_an_old_contradiction_a_receiver_is_learnt(bench):
    bench.take(decides(Cause.VELOCITY, 0.6), seconds=4.0)
    assert bench.learns == []
    bench.take(seconds=0.4)
    assert bench.learns[-1] == bench.t_us
    assert bench.learns_force == []
    bench.search.receiver.learn = lambda *_: True
    restarts = bench.search._rows.restarts
    assert bench.take() == (None, False)
    assert bench.windows_restarted == 1
    assert bench.search._rows.restarts == restarts + 1
    assert bench.search.contradiction.begun_us is None


def test_a_slow_drift_is_searched_with_a_settled_tilt_in_the_air(bench, monkeypatch):
    searched = []
    slow = bench.search._slow
    monkeypatch.setattr(slow, "search", lambda *_: searched.append(bench.t_us))
    bench.take(unsettled_us=(0, bench.t_us + S // 5 - 30 * S))
    assert searched == []
    bench.take(unsettled_us=(0, bench.t_us + S // 5 - 30 * S - 1))
    assert len(searched) == 1
    restarts = slow.rows.restarts
    bench.take(on_ground=True)
    assert len(searched) == 1
    assert slow.rows.restarts == restarts + 1


def test_what_only_a_slow_window_shows_is_taken(bench, monkeypatch):
    slow = bench.search._slow
    drift = decides(Cause.VELOCITY)
    monkeypatch.setattr(slow, "search", lambda *_: setattr(slow, "found", drift))
    bench.take(NOTHING, ratios=QUIET)
    assert bench.search.contradiction.explained is drift
    bench.take(decides(Cause.GYRO), ratios=QUIET)
    assert bench.search.contradiction.explained.decided is Cause.GYRO
