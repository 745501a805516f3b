"""Alarms become findings with a beginning and an end."""

import itertools

import pytest

from h2nav.integrity.findings import (
    MAX_FINDINGS,
    MAX_LESSER_FINDINGS,
    PAUSE_S,
    REPEAT_S,
    UPDATE_S,
    Alarm,
    Findings,
    Kind,
    Phase,
    Sensor,
    SensorKind,
    Severity,
    as_mapping,
)
from h2nav.integrity.kinds import MEANINGS

IMU_1, IMU_2 = Sensor(SensorKind.IMU, 1), Sensor(SensorKind.IMU, 2)


def alarm(sensor=IMU_1, size=1.0, since_s=0.0, severity=Severity.ERROR, is_decided=False):
    text = f"size {size}"
    return Alarm(
        Kind.GYRO_FROZEN, sensor, severity, size, "s", text, "seen", True, since_s, is_decided
    )


def test_a_finding_begins_before_it_was_noticed_and_keeps_its_worst():
    findings = Findings()
    assert findings.update(20.0, [alarm(since_s=2.0, severity=Severity.WARNING)]).begun
    assert not findings.update(21.0, [alarm(size=3.0)]).begun
    findings.update(22.0, [alarm(size=2.0)])
    (found,) = findings.all
    assert (found.from_s, found.to_s, found.size) == (18.0, 22.0, 3.0)
    assert found.text == "size 3.0"
    assert found.severity is Severity.ERROR


def test_what_comes_back_soon_goes_on_and_what_comes_later_is_another():
    findings = Findings()
    findings.update(0.0, [alarm()])
    findings.update(1.0, [])
    assert not findings.update(PAUSE_S, [alarm()]).begun
    findings.update(PAUSE_S + 1.0, [])
    assert findings.update(2.0 * PAUSE_S + 1.0, [alarm()]).begun
    assert [(found.from_s, found.to_s) for found in findings.all] == [(0.0, 10.0), (21.0, 21.0)]


def phases(change):
    return [(phase, found.id, found.is_open) for phase, found in change.news]


def test_news_are_beginnings_and_ends():
    findings = Findings()
    one, other = alarm(), alarm(IMU_2)
    assert phases(findings.update(0.0, [one])) == [(Phase.BEGIN, "gyro_frozen.imu1.1", True)]
    assert findings.update(1.0, [one]).news == []
    assert phases(findings.update(2.0, [other])) == [
        (Phase.END, "gyro_frozen.imu1.1", False),
        (Phase.BEGIN, "gyro_frozen.imu2.1", True),
    ]
    assert [found.id for found in findings.open] == ["gyro_frozen.imu2.1"]
    assert phases(findings.update(3.0, [one, other])) == [(Phase.BEGIN, "gyro_frozen.imu1.1", True)]


def test_what_grows_is_reported_again_but_not_often():
    findings = Findings()
    sizes = {t_s: 1.0 + 0.1 * t_s for t_s in range(60)}
    news = {
        t_s: findings.update(float(t_s), [alarm(size=size)]).news for t_s, size in sizes.items()
    }
    told_s = [t_s for t_s, found in news.items() if found]
    assert told_s[0] == 0
    assert len(told_s) > 5
    assert all(later - earlier >= UPDATE_S for earlier, later in itertools.pairwise(told_s))
    assert {phase for found in news.values() for phase, _ in found} == {Phase.BEGIN, Phase.UPDATE}


def test_what_only_goes_on_is_repeated_for_who_comes_late():
    findings = Findings()
    told_s = [t for t in range(200) if findings.update(float(t), [alarm()]).news]
    assert told_s == [0, int(REPEAT_S), int(2 * REPEAT_S), int(3 * REPEAT_S)]


def test_a_decided_verdict_stays_however_the_size_goes_on():
    findings = Findings()
    findings.update(0.0, [alarm(size=9.0)])
    ((phase, found),) = findings.update(UPDATE_S, [alarm(size=4.0, is_decided=True)]).news
    assert (phase, found.text, found.size) == (Phase.UPDATE, "size 4.0", 9.0)
    findings.update(6.0, [alarm(size=20.0)])
    findings.update(7.0, [alarm(size=5.0, is_decided=True)])
    (found,) = findings.all
    assert (found.text, found.size) == ("size 5.0", 20.0)


def test_a_comparison_of_all_causes_clears_the_velocity_whatever_angle_was_told_before():
    findings = Findings()
    contradicts = alarm(size=9.0)._replace(kind=Kind.ATTITUDE_VELOCITY)
    findings.update(0.0, [contradicts])
    assert not findings.all[0].clears_velocity
    compared = contradicts._replace(size=0.0, is_decided=True, clears_velocity=True)
    findings.update(1.0, [compared])
    (found,) = findings.all
    assert (found.size, found.clears_velocity) == (9.0, True)


def test_they_do_not_grow_without_bound():
    findings = Findings()
    for number in range(MAX_FINDINGS + 7):
        findings.update(float(number), [alarm(Sensor(SensorKind.IMU, number))])
    assert len(findings.all) == MAX_FINDINGS


def test_what_comes_and_goes_for_days_hides_no_error():
    findings = Findings()
    for number in range(MAX_FINDINGS):
        lesser = alarm(Sensor(SensorKind.IMU, number), severity=Severity.WARNING)
        findings.update(float(number), [lesser])
    assert len(findings.all) == MAX_LESSER_FINDINGS
    assert findings.update(float(MAX_FINDINGS), [alarm()]).begun
    assert findings.all[-1].severity is Severity.ERROR


def test_the_imu_is_named_where_one_is_concerned():
    assert alarm().notice == "IMU 1: size 1.0"
    assert alarm(Sensor(SensorKind.GPS)).notice == "size 1.0"


def test_json_has_plain_values():
    findings = Findings()
    findings.update(1.23456, [alarm()])
    mapping = as_mapping(findings.all[0])
    assert mapping["from_s"] == 1.235
    assert mapping["severity"] == "error"
    assert mapping["sensor"] == {"kind": "imu", "number": 1, "others": []}
    assert (mapping["id"], mapping["is_open"], mapping["cause"]) == (
        "gyro_frozen.imu1.1",
        True,
        None,
    )


@pytest.mark.parametrize(
    ("sensor", "name"),
    [
        (Sensor(SensorKind.GPS), "GPS"),
        (Sensor(SensorKind.COMPASS, 2), "compass 2"),
        (Sensor(SensorKind.IMU, 1, (3,)), "IMU 1, IMU 3"),
        (Sensor(SensorKind.IMU, None, (1, 3)), "IMU 1 or IMU 3"),
    ],
)
def test_a_sensor_has_a_name(sensor, name):
    assert sensor.name == name


def test_every_kind_of_a_check_in_flight_has_a_meaning():
    assert set(MEANINGS) <= set(Kind)
    silent = [kind for kind, one in MEANINGS.items() if not one.means]
    assert silent == []


def test_a_level_at_its_limit_is_one_condition_with_its_share_of_the_time():
    findings, reported = Findings(), []
    shaking = Alarm(Kind.VIBRATION, IMU_1, Severity.NOTICE, 31.0, "m/s2", "vibration", "rms of 1 s")
    for tick in range(23 * 60 * 5):
        t_s = tick / 5.0
        change = findings.update(t_s, [shaking] if t_s % 12.0 < 3.0 else [])
        reported += [phase for phase, _ in change.news if phase is not Phase.UPDATE]
    (found,) = findings.all
    assert reported == [Phase.BEGIN]
    assert found.evidence.startswith("rms of 1 s; 2")
    assert found.evidence.endswith("% of this time")


def test_what_grows_worse_is_news_again():
    findings = Findings()
    severities = (Severity.NOTICE, Severity.NOTICE, Severity.WARNING, Severity.WARNING)
    changes = [
        findings.update(float(t_s), [alarm(severity=severity)])
        for t_s, severity in enumerate(severities)
    ]
    assert [len(change.begun) for change in changes] == [1, 0, 0, 0]
    assert [len(change.worse) for change in changes] == [0, 0, 1, 0]


def differs(backs_us):
    text = {True: "autopilot off", False: "ours off", None: "differs"}[backs_us]
    autopilot = Sensor(SensorKind.AUTOPILOT)
    return Alarm(
        Kind.AUTOPILOT_HEADING, autopilot, Severity.WARNING, 20.0, "deg", text, "seen",
        is_decided=backs_us is not None, backs_us=backs_us,
    )  # fmt: skip


def test_that_the_autopilot_is_wrong_does_not_continue_that_we_were():
    findings = Findings()
    findings.update(0.0, [differs(None)])
    assert not findings.update(1.0, [differs(False)]).begun
    assert [alarm.text for alarm in findings.update(2.0, [differs(True)]).begun] == [
        "autopilot off"
    ]
    # each is still known, and undecided goes on with the newer one
    assert not findings.update(3.0, [differs(False)]).begun
    assert not findings.update(4.0, [differs(True)]).begun
    assert not findings.update(5.0, [differs(None)]).begun
    found = [(one.text, one.backs_us, one.from_s, one.to_s, one.is_open) for one in findings.all]
    assert found == [("ours off", False, 0.0, 3.0, False), ("autopilot off", True, 2.0, 5.0, True)]


def test_of_two_opposite_findings_the_older_one_is_forgotten_after_its_pause():
    findings = Findings()
    findings.update(0.0, [differs(False)])
    for t_s in range(1, round(PAUSE_S) + 2):
        findings.update(float(t_s), [differs(True)])
    assert findings.update(PAUSE_S + 2.0, [differs(False)]).begun
    assert len(findings.all) == 3
