"""Which findings are one, which take others away, and how they are told apart."""

from types import SimpleNamespace

import pytest

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.gathering import all_findings, identified, merged


def finding(kind=Kind.COMPASS_STEP, number=1, from_s=10.0, to_s=20.0, sensor=SensorKind.COMPASS,
            severity=Severity.WARNING, size=100.0, unit="mG", evidence="seen",
            name=""):  # fmt: skip
    return Finding(kind, Sensor(sensor, number), severity, from_s, to_s, size, unit,
                   f"{kind.value} {number}", evidence, name)  # fmt: skip


def gathered(*whole, live=()):
    """All findings, those of the whole flight first."""
    return all_findings(SimpleNamespace(findings=live), Analysis(findings=whole))


@pytest.mark.parametrize(
    ("other", "is_one"),
    [
        ({}, True),
        ({"from_s": 12.0}, True),
        ({"from_s": 12.1}, False),
        ({"to_s": 18.0}, True),
        ({"to_s": 22.1}, False),
        ({"size": 125.0}, True),
        ({"size": 126.0}, False),
        ({"size": 75.0}, True),
        ({"size": 74.0}, False),
        ({"number": 1}, False),  # again the same
        ({"number": None}, False),
        ({"kind": Kind.COMPASS_FROZEN}, False),
        ({"severity": Severity.NOTICE}, False),
        ({"unit": "deg"}, False),
        ({"sensor": SensorKind.IMU}, False),
    ],
)
def test_what_two_sensors_show_alike_is_one_finding(other, is_one):
    assert len(merged([finding(), finding(**{"number": 2} | other)])) == (1 if is_one else 2)


def test_of_several_the_widest_time_the_largest_size_and_all_evidence_are_kept():
    parts = [
        finding(number=3, from_s=10.5, size=101.0, evidence="one"),
        finding(number=1, to_s=21.0, size=120.0, evidence="two"),
        finding(number=2, size=110.0, evidence="three", name="of.its.own"),
    ]
    (one,) = merged(parts)
    assert one.sensor.numbers == (3, 1, 2)
    assert (one.from_s, one.to_s, one.size, one.id) == (10.0, 21.0, 120.0, "")
    assert one.evidence == "compass 3: one; compass 1: two; compass 2: three"
    (one,) = merged([finding(number=number) for number in (1, 2, 3)])
    assert one.evidence == "seen; compass 2 alike; compass 3 alike"
    (one,) = merged([*parts[:1], parts[0]._replace(sensor=Sensor(SensorKind.COMPASS, 1)), parts[2]])
    assert one.evidence == "compass 3: one; compass 1 alike; compass 2: three"


def test_everyone_has_a_name_of_his_own():
    some = [finding(name="compass_step.compass1.1"), finding(), finding(), finding(number=2)]
    assert [one.id for one in identified(some)] == [
        "compass_step.compass1.1", "compass_step.compass1.2", "compass_step.compass1.3",
        "compass_step.compass2.1",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("from_s", "is_told"), [(19.9, False), (20.1, True), (5.0, False), (0.0, True)]
)
def test_velocities_that_stay_away_without_a_fix_are_not_told_again(from_s, is_told):
    lost = finding(Kind.GPS_LOST, None, sensor=SensorKind.GPS)
    away = finding(Kind.VELOCITY_LOST, None, from_s, from_s + 6.0, SensorKind.GPS, name="away")
    assert ("away" in {one.id for one in gathered(lost, live=(away,))}) == is_told


@pytest.mark.parametrize(
    ("void", "is_told"),
    [
        ({}, False),
        ({"from_s": 20.1, "to_s": 30.0}, True),  # at another time
        ({"number": 2}, True),  # of another sensor
        ({"number": None}, False),
        ({"severity": Severity.NOTICE}, True),
        ({"kind": Kind.COMPASS_FROZEN}, True),  # which takes nothing away
    ],
)
def test_what_shows_nothing_meanwhile_is_not_told(void, is_told):
    iron = finding(Kind.COMPASS_HARD_IRON)
    kinds = {one.kind for one in gathered(iron, finding(**{"kind": Kind.COMPASS_MOTORS} | void))}
    assert (Kind.COMPASS_HARD_IRON in kinds) == is_told


@pytest.mark.parametrize(("from_s", "number", "count"), [(19.0, 1, 1), (21.0, 1, 2), (19.0, 2, 2)])
def test_a_vibration_that_a_check_saw_late_is_one(from_s, number, count):
    shaken = {"kind": Kind.VIBRATION, "sensor": SensorKind.IMU, "unit": "m/s^2"}
    late = finding(number=number, from_s=from_s, to_s=40.0, severity=Severity.ERROR, size=500.0,
                   name="live", **shaken)  # fmt: skip
    found = gathered(finding(**shaken), live=(late,))
    assert len(found) == count
    if count == 1:
        assert (found[0].from_s, found[0].to_s, found[0].severity) == (10.0, 40.0, Severity.ERROR)
        assert found[0].evidence == "seen; vibration 1: seen"


def test_the_worst_is_first_and_of_equals_the_earliest():
    found = gathered(
        finding(from_s=15.0), finding(number=2, from_s=40.0, to_s=50.0, severity=Severity.ERROR),
        finding(number=3, from_s=1.0, to_s=3.0),
    )  # fmt: skip
    assert [one.sensor.number for one in found] == [2, 3, 1]
