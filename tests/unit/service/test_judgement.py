"""What is wrong, told a few times a second."""

import pytest

from h2nav.integrity.findings import Alarm, Kind, Phase, Sensor, SensorKind, Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Effect, Notice
from h2nav.service.health import Objection
from h2nav.service.judgement import Judgement
from h2nav.service.notices import Notices

WRONG = Alarm(
    Kind.ATTITUDE_GRAVITY,
    Sensor(SensorKind.IMU),
    Severity.ERROR,
    1.0,
    "deg",
    "wrong",
    "shown",
    True,
    4.0,
)


class Always:
    """Somebody who does not notice that no more samples come."""

    def __init__(self) -> None:
        self.asked = 0

    def alarms(self) -> tuple[Alarm, ...]:
        self.asked += 1
        return (WRONG,)


def test_however_many_messages_come_it_looks_a_few_times_a_second() -> None:
    always = Always()
    judgement = Judgement(lambda *_: [], always)
    for t_ms in range(1_000, 11_000, 5):
        judgement.look(t_ms * SECOND_NS // 1_000)
    assert 20 <= always.asked <= 100


def test_a_sensor_that_is_found_to_be_faulty_does_not_wait() -> None:
    always = Always()
    judgement = Judgement(lambda *_: [], always)
    judgement.look(SECOND_NS)
    judgement.look(SECOND_NS + 10_000_000)
    assert always.asked == 1
    judgement.look(SECOND_NS + 20_000_000, at_once=True)
    assert always.asked == 2


def test_what_was_wrong_before_a_pause_is_not_told_again_at_its_end() -> None:
    judgement = Judgement(lambda *_: [], Always())
    times = [t / 10.0 for t in range(10, 100)] + [60.0, 60.3, 60.6, 60.9]
    for t_s in times:
        judgement.look(round(t_s * SECOND_NS))
    (finding,) = judgement.findings
    assert finding.to_s < 10.0
    assert not judgement.objections
    judgement.look(round(61.2 * SECOND_NS))
    assert len(judgement.findings) == 2


class Switching:
    """Alarms that a test sets."""

    def __init__(self) -> None:
        self.now: tuple[Alarm, ...] = ()

    def alarms(self) -> tuple[Alarm, ...]:
        return self.now


def vibration(imu: int, severity: Severity = Severity.NOTICE) -> Alarm:
    sensor = Sensor(SensorKind.IMU, imu)
    return Alarm(Kind.VIBRATION, sensor, severity, 31.0, "m/s2", "vibration", "seen")


def test_one_kind_is_told_once_a_minute_and_what_waits_is_told_if_it_lasts() -> None:
    switching, notices = Switching(), Notices(as_status_text=True)
    judgement = Judgement(notices.report, switching)

    def told(from_s: int, to_s: int) -> list[str]:
        effects = []
        for tick in range(5 * from_s, 5 * to_s):
            effects += judgement.look(SECOND_NS + tick * SECOND_NS // 5)
        return [effect.text for effect in effects if isinstance(effect, Notice)]

    switching.now = (vibration(1),)
    assert told(0, 10) == ["IMU 1: vibration"]
    switching.now = (vibration(1), vibration(2))
    assert told(10, 58) == []
    assert told(58, 70) == ["IMU 2: vibration"]
    switching.now = (vibration(1, Severity.WARNING), vibration(2))
    assert told(70, 75) == ["IMU 1: vibration"], "worse than before"


def test_each_sensor_that_fails_is_told_at_once() -> None:
    switching, notices = Switching(), Notices(as_status_text=True)
    judgement = Judgement(notices.report, switching)
    frozen = [
        Alarm(Kind.GYRO_FROZEN, Sensor(SensorKind.IMU, n), Severity.ERROR, 1.0, "s", "frozen", "")
        for n in (1, 2)
    ]
    switching.now = (frozen[0],)
    judgement.look(SECOND_NS)
    switching.now = tuple(frozen)
    effects = judgement.look(2 * SECOND_NS)
    assert [effect.text for effect in effects if isinstance(effect, Notice)] == ["IMU 2: frozen"]


MS = SECOND_NS // 1000


def test_it_looks_after_a_fifth_of_a_second_and_says_when() -> None:
    always = Always()
    judgement = Judgement(lambda *_: [], always)
    judgement.look(SECOND_NS)
    assert judgement.due_ns == 1200 * MS
    assert judgement.look(1200 * MS - 1) == []
    assert (always.asked, judgement.due_ns) == (1, 1200 * MS)
    judgement.look(1200 * MS)
    assert (always.asked, judgement.due_ns) == (2, 1400 * MS)
    judgement.look(1300 * MS, at_once=True)
    assert (always.asked, judgement.due_ns) == (3, 1500 * MS)


@pytest.mark.parametrize(
    ("pause_ns", "later_ns", "count"),
    [
        (2 * SECOND_NS, 0, 1),  # no pause yet
        (2 * SECOND_NS + 1, 0, 0),
        (2 * SECOND_NS + 1, SECOND_NS - 1, 0),
        (2 * SECOND_NS + 1, SECOND_NS, 1),
    ],
)
def test_after_two_seconds_of_silence_alarms_count_again_a_second_later(
    pause_ns: int, later_ns: int, count: int
) -> None:
    judgement = Judgement(lambda *_: [], Always())
    judgement.look(SECOND_NS)
    assert len(judgement.alarms) == 1
    judgement.look(SECOND_NS + pause_ns)
    judgement.look(SECOND_NS + pause_ns + later_ns, at_once=True)
    assert len(judgement.alarms) == count
    assert len(judgement.open) == count


def test_what_degrades_is_an_objection_and_told_by_the_state() -> None:
    switching, told = Switching(), []

    def report(t_ns: int, severity: Severity, text: str, cause: str = "") -> list[Effect]:
        told.append((t_ns, severity, text, cause))
        return []

    judgement = Judgement(report, switching)
    notice = vibration(2)
    switching.now = (WRONG, notice)
    effects = judgement.look(SECOND_NS)
    assert [(effect.phase, effect.finding.kind) for effect in effects] == [
        (Phase.BEGIN, WRONG.kind),
        (Phase.BEGIN, notice.kind),
    ]
    assert judgement.objections == (Objection(WRONG.cause, WRONG.notice),)
    assert told == [(SECOND_NS, Severity.NOTICE, "IMU 2: vibration", str(Kind.VIBRATION))]
    judgement.look(2 * SECOND_NS)  # it was not told, and lasts
    assert len(told) == 2
    switching.now = (WRONG._replace(degrades=False),)
    judgement.look(3 * SECOND_NS)
    assert judgement.objections == ()
    assert len(told) == 2


def test_an_error_is_told_by_its_own_cause() -> None:
    switching, causes = Switching(), []

    def report(_t_ns: int, _severity: Severity, _text: str, cause: str = "") -> list[Effect]:
        causes.append(cause)
        return [Notice(Severity.ERROR, "told")]

    judgement = Judgement(report, switching)
    switching.now = tuple(vibration(1 + n, level) for n, level in enumerate(Severity))
    judgement.look(SECOND_NS)
    expected = [
        alarm.cause if alarm.severity <= Severity.ERROR else str(Kind.VIBRATION)
        for alarm in switching.now
    ]
    assert sorted(causes) == sorted(expected)
    judgement.look(2 * SECOND_NS)
    assert len(causes) == len(expected)  # once
