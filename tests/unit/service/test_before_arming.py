"""The opinion before arming, as it is given and told: what makes it, and from when on."""

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.integrity.findings import Alarm, Kind, Sensor, SensorKind, Severity
from h2nav.integrity.preflight import GroundFault, GroundVerdict, Item
from h2nav.service import before_arming
from h2nav.service.before_arming import BeforeArming, parameters, reasons_in
from h2nav.service.health import ServiceState, StateVerdict
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.vehicle import ParameterValue

SECOND = 1_000_000_000
ACTIVE = StateVerdict(ServiceState.ACTIVE)
GYRO = GroundFault(Item.GYRO, "IMU 1", 4.0, "deg/s", 2.0)
COMPASS = GroundFault(Item.COMPASS, "compass 2", 0.5, "not read", 1.0)


def alarm(kind, sensor, number=None, severity=Severity.WARNING, degrades=False, text="wrong"):
    return Alarm(kind, Sensor(sensor, number), severity, 1.0, "", text, "", degrades)


class FakePreflight:
    """Has the verdict that it is given."""

    def __init__(self):
        self.verdict, self.calls = GroundVerdict(), []

    def restart(self):
        self.calls.append("restart")

    def on_sample(self, imu, sample, *, field_is_raw):
        self.calls.append((imu, sample, field_is_raw))

    def on_unused_compasses(self, unused):
        self.calls.append(unused)

    def on_attitude(self, q_nb):
        self.calls.append(q_nb)


class Bench:
    """A vehicle on the ground that is looked at four times a second."""

    def __init__(self, monkeypatch, others=()):
        self.preflight, self.told = FakePreflight(), []
        monkeypatch.setattr(before_arming, "Preflight", lambda: self.preflight)
        self.named = []
        self.opinion_of = BeforeArming(self.report, self.others)
        self.other_reasons = others
        self.t_ns = 0

    def report(self, t_ns, severity, text, cause):
        self.told.append((t_ns / SECOND, severity, text, cause))
        return [text]

    def others(self, named):
        self.named.append(named)
        return self.other_reasons

    def look(self, faults=(), judged=(), seconds=0.25):
        """Looks for some time; returns what was reported."""
        self.preflight.verdict = GroundVerdict(tuple(faults), frozenset(judged))
        effects = []
        for _ in range(round(4 * seconds)):
            self.t_ns += SECOND // 4
            effects += self.opinion_of.look(self.t_ns)
        return effects

    def sent(self):
        """The opinion, and the text before it."""
        messages = self.opinion_of.messages
        text = bytes(messages[0].payload[: messages[0].payload_length]) if messages[1:] else b""
        assert messages[-1].name == "h2_arm"
        return messages[-1].value, text.decode()

    def authorized(self):
        message = self.opinion_of.authorization((1, 1))
        return message.result, message.result_param2


ACCEPTED = (mavlink.MAV_RESULT_ACCEPTED, 10)
LATER = (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, 0)
DENIED = (mavlink.MAV_RESULT_DENIED, 0)


def test_what_is_not_judged_is_unknown_and_then_good(monkeypatch):
    bench = Bench(monkeypatch)
    assert bench.sent() == (0, "not judged yet: keep it still")
    assert bench.authorized() == LATER
    bench.look(judged={Item.GYRO})
    assert bench.opinion_of.opinion == 0
    bench.look(judged={Item.ACCELEROMETER})
    assert bench.sent() == (1, "")
    assert bench.authorized() == ACCEPTED
    bench.look()  # it is carried
    assert bench.opinion_of.opinion == 1
    bench.opinion_of.armed(True)
    assert bench.sent() == (0, "")
    bench.opinion_of.armed(False)
    assert bench.opinion_of.opinion == 0


def test_what_never_rests_is_good_after_ten_seconds_without_a_reason(monkeypatch):
    bench = Bench(monkeypatch)
    bench.look(seconds=10.0)
    assert bench.opinion_of.opinion == 0
    bench.look()
    assert bench.opinion_of.opinion == 1
    again = Bench(monkeypatch)
    again.look(seconds=9.0)
    again.look([GYRO])
    again.look(seconds=10.0)
    assert again.opinion_of.opinion == 0
    again.look()
    assert again.opinion_of.opinion == 1


def test_each_reason_counts_and_the_first_is_told_in_what_fits(monkeypatch):
    bench = Bench(monkeypatch, others=("the heading is wrong by 40 deg, as it seems",))
    assert bench.sent() == (-1, "the heading is wrong by 40 deg, as")
    bench.look([GYRO, COMPASS])
    assert bench.named[-1] == {"gyro 1", "compass 2"}
    assert bench.sent() == (-3, "gyro 1 turns 4.0 deg/s at rest +2")
    assert bench.authorized() == DENIED
    long = GYRO._replace(item=Item.GYROS_APART, sensor="IMU 1 and 2", size=1234.0)
    assert long.text == "gyros 1 and 2 differ by 1234 deg/s"
    bench.look([long])
    assert bench.sent() == (-2, "gyros 1 and 2 differ by 1234 de +1")
    bench.opinion_of.armed(True)
    assert bench.opinion_of.reasons == ()


def test_a_fault_is_reported_once_it_has_lasted_for_three_seconds(monkeypatch):
    bench = Bench(monkeypatch)
    assert bench.look([GYRO], seconds=3.0) == []
    assert bench.look([GYRO, COMPASS]) == ["before arming: gyro 1 turns 4.0 deg/s at rest"]
    text, cause = f"before arming: {GYRO.text}", "preflight gyro IMU 1"
    assert bench.told == [(3.25, Severity.WARNING, text, cause)]
    bench.look([COMPASS])
    assert bench.look([GYRO, COMPASS], seconds=2.5) == []
    assert bench.look([COMPASS]) == ["before arming: compass 2 is no longer read"]


def test_it_looks_four_times_a_second_and_not_while_armed(monkeypatch):
    bench = Bench(monkeypatch)
    looks = []
    for t_ns in (0, SECOND // 4 - 1, SECOND // 4, SECOND // 2 - 1, SECOND // 2):
        before = bench.opinion_of.due_ns
        bench.opinion_of.look(t_ns)
        looks.append(bench.opinion_of.due_ns != before)
    assert looks == [False, False, True, False, True]
    bench.look([GYRO])
    bench.opinion_of.armed(True)
    assert bench.opinion_of.faults == ()
    bench.look([GYRO])
    assert bench.opinion_of.faults == ()


def test_what_reaches_the_checks(monkeypatch):
    bench = Bench(monkeypatch)
    opinion, calls = bench.opinion_of, bench.preflight.calls
    opinion.on_sample(2, "sample", field_is_raw=True)
    q_nb = (1.0, 0.0, 0.0, 0.0)
    opinion.on_message(ReportedAttitude(True, 1, q_nb))
    opinion.on_message(ReportedAttitude(False, 1, q_nb))
    assert calls == [(2, "sample", True), q_nb]
    calls.clear()
    for name, value in (("COMPASS_USE2", 0.0), ("COMPASS_USE", 1.0), ("OTHER", 0.0),
                        ("COMPASS_USE3", 0.0), ("COMPASS_USE2", 1.0)):  # fmt: skip
        opinion.on_message(ParameterValue(name, value))
    assert calls == [{1}, {1}, {1, 2}, {2}]
    calls.clear()
    opinion.armed(False)
    assert calls == []
    opinion.armed(True)
    opinion.on_sample(2, "sample", field_is_raw=True)
    assert calls == ["restart"]
    opinion.restart()
    assert calls == ["restart", set(), "restart"]
    opinion.on_message(ParameterValue("COMPASS_USE", 0.0))
    assert calls[-1] == {0}  # nothing is known of the others any more


def test_only_ardupilot_is_asked_which_compasses_it_uses():
    names = ("COMPASS_USE", "COMPASS_USE2", "COMPASS_USE3")
    assert parameters(mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA) == names
    assert parameters(mavlink.MAV_AUTOPILOT_PX4) == ()


LATE = StateVerdict(ServiceState.DEGRADED, "late", "late by 3 s")
OF_FIELD = alarm(Kind.COMPASS_FIELD, SensorKind.COMPASS, degrades=True)
OF_GYRO = alarm(Kind.GYRO_BIAS_STEP, SensorKind.IMU, 1)


@pytest.mark.parametrize(
    ("state", "alarms", "named", "reasons"),
    [
        (ACTIVE, (), (), ()),
        (LATE, (), (), ("late by 3 s",)),
        # the worst first, and no notices
        (ACTIVE, (OF_GYRO, OF_FIELD._replace(severity=Severity.ERROR, text="field")), (),
         ("field", "IMU 1: wrong")),
        (ACTIVE, (OF_GYRO._replace(severity=Severity.NOTICE),), (), ()),
        # a state that an alarm has degraded is not told beside it
        (LATE, (OF_FIELD,), (), ("wrong",)),
        (LATE, (OF_GYRO,), (), ("IMU 1: wrong", "late by 3 s")),
        (StateVerdict(ServiceState.NO_LINK, "down", "down"), (OF_FIELD,), (), ("wrong", "down")),
        (LATE, (OF_FIELD._replace(severity=Severity.NOTICE),), (), ("late by 3 s",)),
        # sensors that are named already, and what follows from them
        (ACTIVE, (OF_GYRO,), ("gyro 1",), ()),
        (ACTIVE, (OF_GYRO,), ("gyro 2",), ("IMU 1: wrong",)),
        (ACTIVE, (OF_GYRO,), ("accelerometer 1",), ("IMU 1: wrong",)),
        (ACTIVE, (OF_FIELD,), ("gyro 2",), ()),
        (ACTIVE, (OF_FIELD,), ("compass 1",), ()),
        (ACTIVE, (OF_FIELD,), ("gps",), ("wrong",)),
        (ACTIVE, (alarm(Kind.ATTITUDE_VELOCITY, SensorKind.GPS),), ("gps",), ()),
        (ACTIVE, (alarm(Kind.COMPASS_FROZEN, SensorKind.COMPASS, 2),), ("compass 2",), ()),
        (ACTIVE, (alarm(Kind.COMPASS_FROZEN, SensorKind.COMPASS, 2),), ("compass 1",), ("wrong",)),
        (ACTIVE, (alarm(Kind.GPS_JUMP, SensorKind.GPS),), ("gps",), ()),
    ],
)  # fmt: skip
def test_reasons_besides_what_is_wrong_on_the_ground(state, alarms, named, reasons):
    assert reasons_in(state, alarms, frozenset(named)) == reasons
