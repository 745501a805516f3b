"""A receiver's time that jumps against the autopilot's clock."""

import pytest

from h2nav.integrity.findings import Kind, Severity
from h2nav.integrity.gnss import GnssVerdict

UNIX_S = 1.7e9


def heard(jump_s: float, *, rate: float = 1.0, gap_s: float = 0.2, at_s: float = 60.0, back=False):
    """The alarms once a second of a receiver of 5 Hz whose time jumps; its number is 1."""
    verdict, found = GnssVerdict(), []
    for i in range(600):
        t_s = 0.2 * i
        if at_s <= t_s < at_s + gap_s:
            continue
        has_jumped = t_s >= at_s and not (back and t_s >= at_s + 1.0)
        unix_s = UNIX_S + rate * t_s + (jump_s if has_jumped else 0.0)
        verdict.time(round(1e6 * t_s), 1, unix_s)
        if i % 5 == 0:
            found.append((t_s, verdict.alarms()))
    return found


@pytest.mark.parametrize("gap_s", [0.0, 30.0])
def test_a_time_that_jumps_may_be_spoofed_after_three_seconds(gap_s: float) -> None:
    found = heard(-86_400.0, gap_s=gap_s)
    told_s = min(t_s for t_s, alarms in found if alarms)
    assert told_s == pytest.approx(63.0 + gap_s, abs=1.0)
    (alarm,) = found[-1][1]
    assert (alarm.kind, alarm.severity, alarm.unit) == (Kind.GNSS_SPOOFED, Severity.NOTICE, "s")
    assert not alarm.is_decided
    assert "receiver 2 jumped by -86400 s" in alarm.evidence


def test_it_is_over_once_the_time_is_back() -> None:
    verdict = GnssVerdict()
    for i in range(120):
        verdict.time(1_000_000 * i, 0, UNIX_S + i + (3600.0 if 60 <= i < 80 else 0.0))
        assert bool(verdict.alarms()) == (63 <= i < 80)


@pytest.mark.parametrize(
    "sound",
    [
        {"jump_s": 3.0},  # leap seconds that it learns late
        {"jump_s": 0.0, "rate": 1.083, "gap_s": 50.0},  # an autopilot's clock that is fast
        {"jump_s": 3600.0, "at_s": 20.0},  # it has only just learnt the time
        {"jump_s": 3600.0, "back": True},  # a fix or a row that is damaged
    ],
    ids=("leap", "fast", "new", "damaged"),
)
def test_what_sound_receivers_and_clocks_do_is_no_jump(sound) -> None:
    assert not any(alarms for _, alarms in heard(**sound))
