"""The verdict on satellite navigation: by the receiver's word, and by the force."""

import math

import pytest

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.findings import Kind, Severity
from h2nav.integrity.gnss import GnssVerdict, SignalState
from h2nav.integrity.gnss_signals import SignalLevels

PERIOD_US = 200_000
DEG_PER_M = 1.0 / math.radians(6_371_000.0)


def flown(north_m_s, *, follows: float = 1.0, from_s: float = 5.0, end_s: float = 10.0):
    """The verdict after a flight northwards whose velocity is known to be false from a time on."""
    verdict, north = GnssVerdict(), 0.0
    for i in range(round(end_s * 1e6 / PERIOD_US)):
        t_s = 1e-6 * i * PERIOD_US
        speed = north_m_s(t_s)
        north += follows * speed * 1e-6 * PERIOD_US
        fix = VelocityFix(i * PERIOD_US, (speed, 0.0, math.nan), 0.2)
        verdict.fix(fix, 47.0 + north * DEG_PER_M, 8.0, is_false=t_s >= from_s)
    return verdict


def ramp(t_s: float) -> float:
    return 2.0 + 0.5 * t_s


def test_a_false_velocity_that_the_position_follows_may_be_spoofed() -> None:
    (alarm,) = flown(ramp).alarms()
    assert (alarm.kind, alarm.severity) == (Kind.GNSS_SPOOFED, Severity.NOTICE)
    assert not alarm.is_decided
    assert alarm.since_s == pytest.approx(4.8, abs=0.3)


@pytest.mark.parametrize("follows", [0.0, 0.3, 2.0])
def test_a_false_velocity_that_the_position_does_not_follow_is_the_receivers(follows) -> None:
    assert flown(ramp, follows=follows).alarms() == []


def test_a_velocity_that_is_not_false_is_not_spoofed_and_one_that_ends_no_longer_is() -> None:
    assert flown(ramp, from_s=99.0).alarms() == []
    verdict = flown(ramp)
    verdict.fix(VelocityFix(10_000_000, (7.0, 0.0, math.nan), 0.2), 47.0, 8.0, is_false=False)
    assert verdict.alarms() == []


def test_a_receiver_that_states_its_own_inaccuracy_claims_nothing() -> None:
    verdict = flown(ramp, end_s=5.0)
    for i in range(25, 50):
        fix = VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 2.5)
        verdict.fix(fix, 47.0 + i * DEG_PER_M, 8.0, is_false=True)
    assert verdict.alarms() == []


@pytest.mark.parametrize(
    ("jamming", "spoofing", "kind", "severity", "is_decided"),
    [
        (3, 1, Kind.GNSS_JAMMED, Severity.WARNING, True),
        (2, 1, Kind.GNSS_JAMMED, Severity.NOTICE, False),
        (1, 3, Kind.GNSS_SPOOFED, Severity.WARNING, True),
        (1, 7, Kind.GNSS_SPOOFED, Severity.NOTICE, False),  # of a newer dialect
    ],
)
def test_what_a_receiver_says_counts_at_once(jamming, spoofing, kind, severity, is_decided) -> None:
    verdict = GnssVerdict()
    verdict.state(1_000_000, SignalState(1, jamming, spoofing))
    (alarm,) = verdict.alarms()
    assert (alarm.kind, alarm.severity, alarm.is_decided) == (kind, severity, is_decided)
    assert "receiver 2" in alarm.evidence


def test_a_receiver_that_is_sound_or_silent_is_not_reported() -> None:
    verdict = GnssVerdict()
    verdict.state(1_000_000, SignalState(0, 1, 1))
    assert verdict.alarms() == []
    verdict.state(1_000_000, SignalState(1, 3, 1))
    verdict.state(20_000_000, SignalState(0, 0, 0))
    assert verdict.alarms() == []


@pytest.mark.parametrize(("apart_m", "is_told"), [(5.0, False), (60.0, True)])
def test_two_receivers_that_differ_accuse_nobody(apart_m, is_told) -> None:
    verdict = GnssVerdict()
    for i in range(40):
        fix = VelocityFix(i * PERIOD_US, (1.0, 0.0, math.nan), 0.2)
        verdict.other_fix(fix, 47.0 + apart_m * DEG_PER_M, 8.0)
        verdict.fix(fix, 47.0, 8.0, is_false=False)
    alarms = verdict.alarms()
    assert [(a.severity, a.is_decided) for a in alarms] == [(Severity.NOTICE, False)] * is_told


def said(verdict: GnssVerdict) -> None:
    verdict.state(10_000_000, SignalState(0, 3, 1))


def followed(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        fix = VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 0.2)
        verdict.fix(fix, 47.0 + i * DEG_PER_M, 8.0, is_false=True)


def apart(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        fix = VelocityFix(i * PERIOD_US, (1.0, 0.0, math.nan), 0.2)
        verdict.other_fix(fix, 47.1, 8.0)
        verdict.fix(fix, 47.0, 8.0, is_false=False)


def of_another_time(verdict: GnssVerdict) -> None:
    for t_us in range(-40_000_000, 10_000_001, PERIOD_US):
        verdict.time(t_us, 0, 1e9 + 1e-6 * t_us + (90.0 if t_us > 0 else 0.0))


def of_more_power(verdict: GnssVerdict) -> None:
    for t_us in range(0, 10_000_001, 1_000_000):
        verdict.levels(t_us, 0, SignalLevels(300.0 if t_us > 8_000_000 else 100.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("shown", "until_us"),
    [
        (said, 20_000_000),
        (followed, 20_000_000),
        (apart, 20_000_000),
        (of_another_time, 20_000_000),
        (of_more_power, 22_000_001),
    ],
)
def test_nothing_is_held_against_a_receiver_that_is_heard_no_more(shown, until_us) -> None:
    verdict = GnssVerdict()
    shown(verdict)
    for t_us, alarms in ((until_us - 1, 1), (until_us, 0)):
        verdict.forget_old(t_us)
        assert len(verdict.alarms()) == alarms
