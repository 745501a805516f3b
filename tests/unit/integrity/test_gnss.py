"""The verdict on satellite navigation: by the receiver's word, and by the force."""

import math

import pytest

from h2nav.attitude.samples import VelocityFix
from h2nav.integrity.findings import Kind, Severity
from h2nav.integrity.gnss import GnssVerdict, SignalState
from h2nav.integrity.gnss_signals import SignalLevels

PERIOD_US = 200_000
DEG_PER_M = 1.0 / math.radians(6_371_000.0)


def hear(
    verdict: GnssVerdict,
    fix: VelocityFix,
    latitude_deg: float,
    longitude_deg: float,
    *,
    is_false: bool,
) -> VelocityFix | None:
    """Has the verdict take a fix, with the least of noise: no receiver measures twice the same."""
    north, east, down = fix.v_n
    noise = 1e-12 * fix.t_us
    fix = fix._replace(v_n=(north + noise, east + noise, down))
    found = verdict.fix(fix, latitude_deg, longitude_deg)
    verdict.judge(is_false=is_false)
    return found


def flown(north_m_s, *, follows: float = 1.0, from_s: float = 5.0, end_s: float = 10.0):
    """The verdict after a flight northwards whose velocity is known to be false from a time on."""
    verdict, north = GnssVerdict(), 0.0
    for i in range(round(end_s * 1e6 / PERIOD_US)):
        t_s = 1e-6 * i * PERIOD_US
        speed = north_m_s(t_s)
        north += follows * speed * 1e-6 * PERIOD_US
        fix = VelocityFix(i * PERIOD_US, (speed, 0.0, math.nan), 0.2)
        hear(verdict, fix, 47.0 + north * DEG_PER_M, 8.0, is_false=t_s >= from_s)
    return verdict


def ramp(t_s: float) -> float:
    return 2.0 + 0.5 * t_s


def test_a_false_velocity_that_the_position_follows_may_be_spoofed() -> None:
    (alarm,) = flown(ramp).alarms()
    assert (alarm.kind, alarm.severity) == (Kind.GNSS_SPOOFED, Severity.NOTICE)
    assert not alarm.is_decided
    assert alarm.since_s == pytest.approx(4.8, abs=0.3)


def test_a_velocity_may_be_false_from_time_zero_on() -> None:
    (alarm,) = flown(ramp, from_s=0.0).alarms()
    assert alarm.since_s == pytest.approx(9.8)


@pytest.mark.parametrize(
    ("follows", "kinds"), [(0.0, []), (0.3, [Kind.GPS_VELOCITY]), (2.0, [Kind.GPS_VELOCITY])]
)
def test_a_false_velocity_that_the_position_does_not_follow_is_the_receivers(
    follows, kinds
) -> None:
    assert [alarm.kind for alarm in flown(ramp, follows=follows).alarms()] == kinds


def test_a_velocity_that_is_not_false_is_not_spoofed_and_one_that_ends_no_longer_is() -> None:
    assert flown(ramp, from_s=99.0).alarms() == []
    verdict = flown(ramp)
    hear(verdict, VelocityFix(10_000_000, (7.0, 0.0, math.nan), 0.2), 47.0, 8.0, is_false=False)
    assert verdict.alarms() == []


def test_a_receiver_that_states_its_own_inaccuracy_claims_nothing() -> None:
    verdict = flown(ramp, end_s=5.0)
    for i in range(25, 50):
        fix = VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 2.5)
        hear(verdict, fix, 47.0 + i * DEG_PER_M, 8.0, is_false=True)
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
        hear(verdict, fix, 47.0, 8.0, is_false=False)
    alarms = verdict.alarms()
    assert [(a.severity, a.is_decided) for a in alarms] == [(Severity.NOTICE, False)] * is_told


def said(verdict: GnssVerdict) -> None:
    verdict.state(10_000_000, SignalState(0, 3, 1))


def followed(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        fix = VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 0.2)
        hear(verdict, fix, 47.0 + i * DEG_PER_M, 8.0, is_false=True)


def frozen(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        verdict.fix(VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 0.2), 47.0, 8.0)


def denied_by_places(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        fix = VelocityFix(i * PERIOD_US, (-5.0, 0.0, math.nan), 0.2)
        hear(verdict, fix, 47.0 + i * DEG_PER_M, 8.0, is_false=False)


def apart(verdict: GnssVerdict) -> None:
    for i in range(20, 51):
        fix = VelocityFix(i * PERIOD_US, (1.0, 0.0, math.nan), 0.2)
        verdict.other_fix(fix, 47.1, 8.0)
        hear(verdict, fix, 47.0, 8.0, is_false=False)


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
        (frozen, 20_000_000),
        (denied_by_places, 20_000_000),
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


# --- what is just enough, and just too little --------------------------------------------------

SIGMA_M_S = 0.2


def ended(speed_m_s=5.0, error_m_s=0.0, sigma_m_s=SIGMA_M_S, length_s=5.0, period_us=PERIOD_US):
    """The alarms of a flight eastwards over the date line whose last velocity is false.

    Args:
        error_m_s: by which the position goes faster than the velocity says.
    """
    verdict, end_us = GnssVerdict(), 1_000_000 + round(1e6 * length_s)
    for t_us in range(1_000_000, end_us + 1, period_us):
        east_m = 1e-6 * (t_us - 1_000_000) * (speed_m_s + error_m_s)
        longitude_deg = 179.9999 + east_m * DEG_PER_M / math.cos(math.radians(60.0))
        fix = VelocityFix(t_us, (0.0, speed_m_s, math.nan), sigma_m_s)
        wrapped_deg = (longitude_deg + 180.0) % 360.0 - 180.0
        hear(verdict, fix, 60.0, wrapped_deg, is_false=t_us + period_us > end_us)
    return verdict.alarms()


@pytest.mark.parametrize(
    ("how", "is_followed"),
    [
        ({}, True),
        # within 3 m and a fifth of the way of 25 m
        ({"error_m_s": 1.59}, True),
        ({"error_m_s": 1.61}, False),
        ({"error_m_s": -1.59}, True),
        ({"error_m_s": -1.61}, False),
        # a way of 3 m at least
        ({"speed_m_s": 0.61}, True),
        ({"speed_m_s": 0.59}, False),
        # of a receiver that claims to be right
        ({"sigma_m_s": 1.5}, True),
        ({"sigma_m_s": 1.51}, False),
        # over 2.5 s at least, between fixes that are no farther apart
        ({"length_s": 2.6}, True),
        ({"length_s": 2.4}, False),
        ({"length_s": 4.8, "period_us": 2_400_000}, True),
        ({"length_s": 5.0, "period_us": 2_500_000}, False),
    ],
)
def test_a_position_follows_within_a_share_of_the_way(how, is_followed) -> None:
    assert bool(ended(**how)) is is_followed


def test_a_way_is_told_with_what_the_position_differs_by() -> None:
    (alarm,) = ended(error_m_s=0.5)
    assert (alarm.unit, alarm.text) == ("m", "GNSS may be spoofed")
    assert alarm.size == pytest.approx(25.0)
    assert alarm.evidence == (
        "the velocity contradicts the force, and the position follows it: 25 m within 2.5 m, "
        "at a stated accuracy of 0.2 m/s"
    )


@pytest.mark.parametrize(("jumped_s", "is_followed"), [(0.2, True), (0.4, False)])
def test_a_position_is_compared_over_5_s(jumped_s, is_followed) -> None:
    verdict = GnssVerdict()
    for i in range(27):
        t_s = 0.2 * i
        jump_m = 100.0 if t_s > jumped_s - 0.1 else 0.0
        fix = VelocityFix(1_000_000 + i * PERIOD_US, (5.0, 0.0, math.nan), SIGMA_M_S)
        hear(verdict, fix, 47.0 + (5.0 * t_s + jump_m) * DEG_PER_M, 8.0, is_false=i == 26)
    assert bool(verdict.alarms()) is is_followed


def two(apart_m=0.0, apart_m_s=0.0, length_s=5.0, old_us=0):
    """The alarms on two receivers that differ northwards, whose velocities are as uncertain."""
    verdict = GnssVerdict()
    for i in range(round(5.0 * length_s) + 1):
        t_us = 2_000_000 + i * PERIOD_US
        other = VelocityFix(t_us - old_us, (1.0 + apart_m_s, 0.0, math.nan), SIGMA_M_S)
        verdict.other_fix(other, 47.0 + apart_m * DEG_PER_M, 8.0)
        mine = VelocityFix(t_us, (1.0, 0.0, math.nan), SIGMA_M_S)
        hear(verdict, mine, 47.0, 8.0, is_false=False)
    return verdict.alarms()


@pytest.mark.parametrize(
    ("how", "is_told"),
    [
        ({"apart_m": 30.1}, True),
        ({"apart_m": 29.9}, False),
        # 3 m/s and three deviations of the difference
        ({"apart_m_s": 3.86}, True),
        ({"apart_m_s": 3.84}, False),
        ({"apart_m": 60.0, "length_s": 4.8}, False),
        ({"apart_m": 60.0, "old_us": 1_000_000}, True),
        ({"apart_m": 60.0, "old_us": 1_000_001}, False),
    ],
)
def test_receivers_differ_beyond_a_limit_for_5_s(how, is_told) -> None:
    assert bool(two(**how)) is is_told


def test_receivers_that_differ_are_told_by_how_much() -> None:
    (alarm,) = two(60.0, 2.0)
    assert (alarm.kind, alarm.unit, alarm.since_s) == (Kind.GNSS_SPOOFED, "m", 5.0)
    assert alarm.size == pytest.approx(60.0)
    assert alarm.text == "GPS receivers differ, undecided"
    assert alarm.evidence == (
        "their positions differ by 60 m and their velocities by 2.0 m/s; nothing shows which one "
        "is wrong"
    )


@pytest.mark.parametrize(
    ("state", "text", "said"),
    [
        (2, "GNSS may be jammed", "mitigated"),
        (3, "GNSS is jammed", "detected"),
        (4, "GNSS may be jammed", "state 4"),
    ],
)
def test_what_a_receiver_says_is_told_with_its_number(state, text, said) -> None:
    verdict = GnssVerdict()
    verdict.state(1, SignalState(0, state, 0))
    (alarm,) = verdict.alarms()
    assert (alarm.text, alarm.size, alarm.unit) == (text, state, "")
    assert alarm.evidence == f"receiver 1 says so itself: {said}"


def test_of_several_receivers_one_that_is_sure_counts_for_10_s() -> None:
    verdict = GnssVerdict()
    for receiver, state in enumerate((2, 3, 7)):
        verdict.state(1_000_000, SignalState(receiver, state, 2))
    jammed, spoofed = verdict.alarms()
    assert (jammed.kind, jammed.size, jammed.is_decided) == (Kind.GNSS_JAMMED, 3.0, True)
    assert jammed.evidence == "receiver 2 says so itself: detected"
    assert (spoofed.kind, spoofed.size, spoofed.is_decided) == (Kind.GNSS_SPOOFED, 2.0, False)
    verdict.count(10_999_999, 9)
    assert len(verdict.alarms()) == 2
    verdict.count(11_000_000, 9)
    assert verdict.alarms() == []


@pytest.mark.parametrize("loses", [False, True])
def test_raised_power_is_jamming_where_satellites_are_lost(loses) -> None:
    verdict = GnssVerdict()
    for t_s in range(31):
        noise = 300.0 if t_s > 26 else 100.0
        verdict.levels(t_s * 1_000_000, 0, SignalLevels(noise, 0.0, 0.0))
        verdict.count(t_s * 1_000_000, 4 if loses and t_s > 27 else 12)
    (alarm,) = verdict.alarms()
    assert (alarm.kind, alarm.is_decided, alarm.size) == (
        Kind.GNSS_JAMMED,
        loses,
        3.0 if loses else 2.0,
    )
    assert alarm.severity is (Severity.WARNING if loses else Severity.NOTICE)
    assert alarm.text == ("GNSS is jammed" if loses else "GNSS may be jammed")
    lost = "; satellites 12 -> 4" if loses else ""
    assert alarm.evidence == f"the receiver measures noise 300 (usually 100){lost}"
    assert alarm.since_s == pytest.approx(3.0)


def test_a_time_that_jumped_is_told_with_its_receiver() -> None:
    verdict = GnssVerdict()
    for t_us in range(0, 50_000_001, PERIOD_US):
        verdict.time(t_us, 1, 1e9 + 1e-6 * t_us - (90.0 if t_us > 40_000_000 else 0.0))
    (alarm,) = verdict.alarms()
    assert (alarm.kind, alarm.severity) == (Kind.GNSS_SPOOFED, Severity.NOTICE)
    assert (alarm.size, alarm.unit) == (pytest.approx(90.0), "s")
    assert alarm.evidence == (
        "the time of receiver 2 jumped by -90 s against the autopilot's clock"
    )
    assert alarm.since_s == pytest.approx(9.8)
    verdict.restart()
    assert verdict.alarms() == []


# --- a receiver that contradicts itself ----------------------------------------------------------


def test_a_velocity_that_repeats_is_frozen_and_not_used() -> None:
    verdict = GnssVerdict()
    used = [
        verdict.fix(VelocityFix(i * PERIOD_US, (3.0, 4.0, math.nan), 0.2), 47.0, 8.0)
        for i in range(12)
    ]
    assert used[0] is not None
    assert used[1:] == [None] * 11
    (alarm,) = verdict.alarms()
    assert (alarm.kind, alarm.severity) == (Kind.GPS_FROZEN, Severity.WARNING)
    assert alarm.text == "GPS velocity is frozen and not used"
    assert alarm.since_s == pytest.approx(2.2)
    assert alarm.evidence.startswith("12 fixes in a row")
    moved = VelocityFix(12 * PERIOD_US, (3.0, 4.01, math.nan), 0.2)
    assert verdict.fix(moved, 47.0, 8.0) == moved
    assert verdict.alarms() == []


def denied(*, error_m_s: float, end_s: float, until_s: float = 99.0, is_false: bool = False):
    """The verdict where places go northwards faster than the velocity, and its latest fix."""
    verdict, north_m, found = GnssVerdict(), 0.0, None
    for i in range(round(5.0 * end_s) + 1):
        t_s = 0.2 * i
        fix = VelocityFix(i * PERIOD_US, (5.0, 0.0, math.nan), 0.2)
        found = hear(verdict, fix, 47.0 + north_m * DEG_PER_M, 8.0, is_false=is_false)
        north_m += 0.2 * (5.0 + (error_m_s if t_s < until_s else 0.0))
    return verdict, found


@pytest.mark.parametrize(
    ("error_m_s", "is_denied"), [(1.7, False), (1.9, True), (-1.7, False), (-1.9, True)]
)
def test_places_deny_a_velocity_from_5_m_in_3_s_on(error_m_s, is_denied) -> None:
    _, found = denied(error_m_s=error_m_s, end_s=4.0)
    assert found.is_denied is is_denied


@pytest.mark.parametrize(("end_s", "is_told"), [(3.6, False), (4.0, True)])
def test_that_is_told_undecided_after_2_s(end_s, is_told) -> None:
    verdict, _ = denied(error_m_s=3.2, end_s=end_s)
    alarms = verdict.alarms()
    told = [(a.kind, a.severity, a.is_decided, a.text) for a in alarms]
    text = "GPS velocity and place differ, undecided"
    assert told == [(Kind.GPS_VELOCITY, Severity.NOTICE, False, text)] * is_told


def test_a_receiver_that_contradicted_itself_is_not_spoofed() -> None:
    assert denied(error_m_s=0.0, end_s=8.0, is_false=True)[0].alarms()[0].kind is Kind.GNSS_SPOOFED
    verdict, found = denied(error_m_s=5.0, end_s=16.0, until_s=6.0, is_false=True)
    assert not found.is_denied
    assert verdict.alarms() == []
