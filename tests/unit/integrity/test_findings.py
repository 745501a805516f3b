"""Alarms become findings with a beginning and an end."""

from h2nav.integrity.findings import (
    MOST_FINDINGS,
    PAUSE_S,
    Alarm,
    Findings,
    Severity,
    as_mapping,
)


def alarm(kind="gyro_frozen", source="IMU 1", size=1.0, since_s=0.0, severity=Severity.ERROR):
    return Alarm(kind, source, severity, size, "s", f"size {size}", "seen", True, since_s)


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


def test_news_are_beginnings_and_ends():
    findings = Findings()
    one, other = alarm(), alarm(source="IMU 2")
    assert [found.source for found in findings.update(0.0, [one]).news] == ["IMU 1"]
    assert findings.update(1.0, [one]).news == []
    news = findings.update(2.0, [other]).news
    assert [(found.source, found.to_s) for found in news] == [("IMU 1", 1.0), ("IMU 2", 2.0)]


def test_they_do_not_grow_without_bound():
    findings = Findings()
    for number in range(MOST_FINDINGS + 7):
        findings.update(float(number), [alarm(source=f"sensor {number}")])
    assert len(findings.all) == MOST_FINDINGS
    assert findings.omitted == 7


def test_the_imu_is_named_where_one_is_concerned():
    assert alarm().told == "IMU 1: size 1.0"
    assert alarm(source="GPS").told == "size 1.0"


def test_json_has_plain_values():
    findings = Findings()
    findings.update(1.23456, [alarm()])
    mapping = as_mapping(findings.all[0])
    assert mapping["from_s"] == 1.235
    assert mapping["severity"] == "error"
    assert list(mapping)[:6] == ["kind", "source", "severity", "from_s", "to_s", "size"]
