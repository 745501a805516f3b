"""What the viewer remembers: the newest of everything, its age, and never too much."""

import pytest
from live_records import UNIX_NS, Clock, estimate, finding, health, lane, status

from h2nav.attitude.samples import Trust
from h2nav.integrity.severity import Severity
from h2nav.live import state as live_state
from h2nav.live.state import LiveState
from h2nav.maths.units import SECOND_NS
from h2nav.service.records import RejectionRecord


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def state(clock):
    return LiveState(clock)


def test_the_newest_record_of_each_kind_is_kept(state):
    for record in (lane(1, sent=True), lane(2, sent=False), lane(2, sent=True)):
        state.take("/lanes", UNIX_NS, record)
    assert [seen.record for seen in state.all_of("/lanes")] == [
        lane(1, sent=True), lane(2, sent=True)
    ]  # fmt: skip
    assert state.newest("/lanes", 2).record.sent
    assert state.newest("/health") is None


def test_ages_do_not_follow_the_hosts_clock(state, clock):
    state.take("/estimate", UNIX_NS, estimate())
    clock.pass_s(2.0)
    state.take("/health", UNIX_NS - 3600 * SECOND_NS, health())
    assert state.age_s(state.newest("/estimate").heard_ns) == 2.0
    assert state.silent_s == 0.0
    clock.pass_s(1.0)
    assert state.silent_s == 1.0


def test_a_line_of_output_is_heard_too(state, clock):
    clock.pass_s(3.0)
    state.text(UNIX_NS, Severity.INFO, "active")
    assert state.silent_s == 0.0
    assert state.age_s(state.texts[-1].heard_ns) == 0.0


def test_a_finding_begins_grows_ends_and_comes_back(state, clock):
    state.take("/finding", UNIX_NS, finding())
    (told,) = state.findings
    assert told.finding.is_open
    assert state.age_s(told.began_ns) == pytest.approx(1.0)  # it had lasted when it was told
    state.take("/finding", UNIX_NS, finding(phase="update", to_s=43.0, size=30.0))
    assert [told.finding.size for told in state.findings] == [30.0]
    state.take("/finding", UNIX_NS, finding(phase="end", is_open=False, to_s=44.0))
    (told,) = state.findings
    assert (told.finding.is_open, told.finding.to_s) == (False, 44.0)
    state.take("/finding", UNIX_NS, finding(to_s=47.0))
    state.take("/finding", UNIX_NS, finding(id="attitude_velocity.gps.2", from_s=80.0, to_s=80.5))
    assert [told.finding.is_open for told in state.findings] == [True, True]
    assert state.findings_begun == 2


def test_an_end_that_was_lost_shows_in_the_status(state):
    state.take("/finding", UNIX_NS, finding())
    state.take("/finding", UNIX_NS, finding(id="attitude_velocity.gps.2"))
    state.take("/status", UNIX_NS, status(open_findings="attitude_velocity.gps.2"))
    assert [told.finding.is_open for told in state.findings] == [False, True]


def test_a_finding_that_begins_after_the_status_is_open(state):
    state.take("/status", UNIX_NS, status(open_findings=""))
    state.take("/finding", UNIX_NS, finding())
    assert [told.finding.is_open for told in state.findings] == [True]


def test_counters_become_rates_over_about_a_second(state):
    def sent(after_s, count):
        state.take("/health", UNIX_NS + round(after_s * SECOND_NS), health(estimates_sent=count))

    sent(0.0, 1000)
    assert state.per_s("/health", "estimates_sent") is None
    sent(0.1, 1000)  # a change of the state is written at once, and too soon for a rate
    assert state.per_s("/health", "estimates_sent") is None
    sent(1.0, 1050)
    assert state.per_s("/health", "estimates_sent") == pytest.approx(50.0)
    sent(2.0, 1075)
    assert state.per_s("/health", "estimates_sent") == pytest.approx(25.0)


def test_what_estimates_rest_on_is_remembered_with_its_age(state, clock):
    state.take("/estimate", UNIX_NS, estimate(trust=int(Trust.ALIGNED | Trust.FIELD_USED)))
    clock.pass_s(1.0)
    state.take("/estimate", UNIX_NS, estimate(trust=int(Trust.ALIGNED)))
    assert state.trusted_s() == {Trust.ALIGNED: 0.0, Trust.FIELD_USED: 1.0}


def test_a_line_with_a_path_that_is_no_text_can_be_shown(state):
    state.text(UNIX_NS, Severity.ERROR, "log: /logs/\udcff: disk full")
    assert state.texts[0].text == "log: /logs/?: disk full"


def test_nothing_grows_without_bound(state):
    for number in range(1000):
        state.take("/finding", UNIX_NS, finding(id=f"vibration.imu1.{number}"))
        state.take("/rejected", UNIX_NS, RejectionRecord(f"reason {number}", 1))
        state.text(UNIX_NS, Severity.INFO, f"line {number}")
    assert len(state.findings) == live_state.MAX_FINDINGS
    assert len(state.texts) == live_state.MAX_TEXTS
    assert state.texts[-1].text == "line 999"
    assert len(list(state.all_of("/rejected"))) == live_state.MAX_CURRENT
    assert state.findings_begun == 1000


@pytest.mark.parametrize(("later_s", "rate"), [(0.799, None), (0.8, 62.5), (2.0, 25.0)])
def test_a_rate_is_that_of_records_almost_a_second_apart(state, later_s, rate):
    state.take("/health", UNIX_NS, health(estimates_sent=1000))
    later_ns = round(later_s * SECOND_NS)
    state.take("/health", UNIX_NS + later_ns, health(estimates_sent=1050))
    found = state.per_s("/health", "estimates_sent")
    assert found == (None if rate is None else pytest.approx(rate))


def test_a_clock_that_was_set_back_gives_no_rate(state):
    state.take("/health", UNIX_NS, health(estimates_sent=1000))
    state.take("/health", UNIX_NS - SECOND_NS, health(estimates_sent=1050))
    assert state.per_s("/health", "estimates_sent") is None
    state.take("/health", UNIX_NS, health(estimates_sent=1100))
    assert state.per_s("/health", "estimates_sent") == pytest.approx(50.0)


def test_fifty_findings_and_lines_and_256_records_are_kept(state):
    for number in range(300):
        state.take("/finding", UNIX_NS, finding(id=f"vibration.imu1.{number}"))
        state.take("/rejected", UNIX_NS, RejectionRecord(f"reason {number}", 1))
        state.text(UNIX_NS, Severity.INFO, f"line {number}")
    state.take("/rejected", UNIX_NS, RejectionRecord("reason 0", 7))  # what is known goes on
    kept = [seen.record for seen in state.all_of("/rejected")]
    assert (len(state.findings), len(state.texts), len(kept)) == (50, 50, 256)
    assert kept[0].total == 7
    assert state.findings[0].finding.id == "vibration.imu1.250"


def test_what_is_wrong_is_told_line_by_line(state):
    assert (state.alarms, state.preflight) == ((), ())
    state.take("/status", UNIX_NS, status(alarms="one\ntwo", preflight="three"))
    assert (state.alarms, state.preflight) == (("one", "two"), ("three",))
