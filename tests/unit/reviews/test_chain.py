"""What is linked to what: just before, just after, and what is nobody's consequence."""

from types import SimpleNamespace

import pytest

from h2nav.integrity.findings import Finding, Kind, Sensor, SensorKind, Severity
from h2nav.reviews.analysis import Analysis
from h2nav.reviews.chain import chain
from h2nav.reviews.heights import HEIGHT_LOST
from h2nav.reviews.subjects.motors_stopped import MOTORS_STOPPED

AT_S = 100.0


def finding(kind, from_s, to_s=None, severity=Severity.WARNING, sensor=SensorKind.VEHICLE,
            size=10.0):  # fmt: skip
    id_ = f"{getattr(kind, 'value', kind)}.{from_s:g}"
    to_s = from_s + 1.0 if to_s is None else to_s
    return Finding(kind, Sensor(sensor), severity, from_s, to_s, size, "", "", "", id_)


CRASH = finding(Kind.CRASH, AT_S, AT_S + 4.0, Severity.CRITICAL)


def linked(*found, **analysis):
    """Id -> finding, of all."""
    links = chain(SimpleNamespace(findings=found), Analysis(**analysis))
    return {one.id: one for one in links.findings}, links


def cause_of(one, *others):
    found, _ = linked(one, *others)
    return found[one.id].cause


@pytest.mark.parametrize(
    ("kind", "to_s", "is_cause"),
    [
        (Kind.LOSS_OF_CONTROL, AT_S - 11.9, True),
        (Kind.LOSS_OF_CONTROL, AT_S - 12.1, False),
        (Kind.MOTOR_FAILED, AT_S - 11.9, True),
        (Kind.MOTOR_FAILED, AT_S - 12.1, False),
        (Kind.MOTOR_SATURATED, AT_S - 4.9, True),
        (Kind.MOTOR_SATURATED, AT_S - 5.1, False),
        (Kind.SAID_EKF_FAILED, AT_S - 29.9, True),
        (Kind.SAID_EKF_FAILED, AT_S - 30.1, False),
        (HEIGHT_LOST, AT_S - 59.9, True),
        (HEIGHT_LOST, AT_S - 60.1, False),
        (Kind.COMPASS_FIELD, AT_S - 1.0, False),
    ],
)
def test_what_came_shortly_before_a_crash_is_its_cause(kind, to_s, is_cause):
    before = finding(kind, to_s - 1.0, to_s)
    assert cause_of(CRASH, before) == (before.id if is_cause else None)
    assert cause_of(CRASH, before._replace(severity=Severity.NOTICE)) == (
        before.id if is_cause and kind is Kind.LOSS_OF_CONTROL else None
    )


def test_the_most_certain_cause_counts_and_of_motors_the_first_that_failed():
    battery = finding(Kind.BATTERY, AT_S - 2.0)
    motors = [finding(Kind.MOTOR_FAILED, AT_S - later_s) for later_s in (3.0, 6.0)]
    assert cause_of(CRASH, battery, *motors) == motors[1].id
    stopped = finding(MOTORS_STOPPED, AT_S - 1.0)
    assert cause_of(CRASH, battery, *motors, stopped) == stopped.id
    lost = finding(Kind.LOSS_OF_CONTROL, AT_S - 1.0)
    assert cause_of(CRASH, battery, *motors, stopped, lost) == lost.id


@pytest.mark.parametrize(
    ("kind", "from_s", "follows"),
    [
        (Kind.COMPASS_FIELD, AT_S - 0.4, True),
        (Kind.COMPASS_FIELD, AT_S - 0.6, False),
        (Kind.COMPASS_FIELD, AT_S + 9.9, True),
        (Kind.COMPASS_FIELD, AT_S + 10.1, False),
        # control and motors were lost before
        (Kind.LOSS_OF_CONTROL, AT_S - 0.4, False),
        (Kind.MOTOR_FAILED, AT_S - 0.4, False),
        (Kind.LOSS_OF_CONTROL, AT_S + 0.1, True),
        # what holds throughout
        (Kind.COMPASS_DEAD, AT_S + 1.0, False),
    ],
)
def test_what_begins_after_a_blow_follows_from_it(kind, from_s, follows):
    assert cause_of(finding(kind, from_s), CRASH) == (CRASH.id if follows else None)


def test_while_it_lies_there_armed_all_that_begins_follows_and_so_do_further_blows():
    lies = CRASH._replace(to_s=AT_S + 30.0)
    assert cause_of(finding(Kind.COMPASS_FIELD, AT_S + 29.0), lies) == CRASH.id
    assert cause_of(finding(Kind.CRASH, AT_S + 30.0, severity=Severity.CRITICAL), lies) == CRASH.id
    assert cause_of(finding(Kind.CRASH, AT_S + 31.0, severity=Severity.CRITICAL), lies) is None


@pytest.mark.parametrize(("size", "is_cause"), [(5.1, True), (4.9, False)])
def test_a_gyro_that_is_wrong_throughout_leads_attitudes_astray(size, is_cause):
    gyro = finding(Kind.GYRO_BIAS, 500.0, severity=Severity.ERROR, size=size)
    lost = finding(Kind.LOSS_OF_CONTROL, 50.0, severity=Severity.CRITICAL)
    found, _ = linked(gyro, lost)
    assert found[lost.id].cause == (gyro.id if is_cause else None)
    # and then it is no loss, on a bench
    assert found[lost.id].severity is (Severity.NOTICE if is_cause else Severity.CRITICAL)


@pytest.mark.parametrize(
    ("begins_s", "is_cause"),
    [(49.0, True), (50.4, True), (50.6, False), (29.1, True), (28.9, False)],
)
def test_a_sensor_explains_what_begins_until_seconds_after_it(begins_s, is_cause):
    vibration = finding(Kind.VIBRATION, begins_s, severity=Severity.ERROR)
    switch = finding(Kind.ESTIMATOR_SWITCH, 50.0)
    assert cause_of(switch, vibration) == (vibration.id if is_cause else None)


def test_what_began_first_has_no_cause_among_its_own_consequences():
    struck = finding(Kind.SAID_GPS_GLITCH, 50.0, 60.0)
    field = finding(Kind.COMPASS_STEP, 50.2, 60.0)
    found, _ = linked(struck, field)
    causes = [one.cause for one in found.values() if one.cause]
    assert causes == [field.id]


@pytest.mark.parametrize(
    ("sensor", "severity"),
    [(SensorKind.GPS, Severity.NOTICE), (SensorKind.BATTERY, Severity.WARNING)],
)
def test_what_measures_shows_nothing_in_a_tumble(sensor, severity):
    found, _ = linked(CRASH, finding(Kind.GPS_VELOCITY, AT_S + 1.0, sensor=sensor))
    assert found[f"gps_velocity.{AT_S + 1.0:g}"].severity is severity


def test_an_attitude_of_ours_brings_nothing_about_and_is_a_note():
    own = finding(Kind.ATTITUDE_VELOCITY, 50.0, severity=Severity.ERROR)
    cleared = finding(Kind.GPS_VELOCITY, 51.0, severity=Severity.ERROR)
    found, links = linked(own, cleared, cleared=frozenset({cleared.id}))
    assert links.own == {own.id, cleared.id}
    assert {one.severity for one in found.values()} == {Severity.NOTICE}


def test_crashes_come_first_and_consequences_after_the_rest():
    lost = finding(Kind.LOSS_OF_CONTROL, AT_S - 1.0, severity=Severity.CRITICAL)
    motor = finding(Kind.MOTOR_FAILED, AT_S - 2.0, severity=Severity.CRITICAL)
    _, links = linked(motor, lost, finding(Kind.COMPASS_DEAD, 0.0), CRASH)
    assert [one.kind for one in links.findings] == [
        Kind.CRASH, Kind.LOSS_OF_CONTROL, Kind.MOTOR_FAILED, Kind.COMPASS_DEAD
    ]  # fmt: skip
