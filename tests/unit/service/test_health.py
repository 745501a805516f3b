import pytest

from h2nav.integrity.severity import Severity
from h2nav.service.health import AT_START, Objection, ServiceState, Signs, judge
from h2nav.service.notices import Notices
from h2nav.service.standing import Standing

NOW_NS = 100_000_000_000
MS_NS = 1_000_000
WELL = Signs(
    bytes_are_junk=False,
    link_error=None,
    stall_ns=0,
    autopilot_known=True,
    last_sample_ns=NOW_NS - 10 * MS_NS,
    last_gap_ns=10 * MS_NS,
    no_imu=lambda: Objection("silent", "no IMU messages arrive"),
    has_estimate=True,
    late_ns=0,
    objections=(),
    rate_hz=100.0,
    granted_rate_hz=100.0,
)


def state(**signs):
    return judge(WELL._replace(**signs), NOW_NS).state


def test_all_is_well():
    assert judge(WELL, NOW_NS) == (ServiceState.ACTIVE, "", "")


@pytest.mark.parametrize(
    ("signs", "expected"),
    [
        ({"link_error": ""}, ServiceState.NO_LINK),
        ({"autopilot_known": False}, ServiceState.NO_AUTOPILOT),
        ({"autopilot_known": False, "bytes_are_junk": True}, ServiceState.NO_AUTOPILOT),
        ({"bytes_are_junk": True}, ServiceState.ACTIVE),
        ({"last_sample_ns": None}, ServiceState.NO_IMU),
        ({"last_sample_ns": NOW_NS - 501 * MS_NS}, ServiceState.NO_IMU),
        ({"last_gap_ns": None}, ServiceState.ACTIVE),
        ({"has_estimate": False}, ServiceState.ALIGNING),
        ({"objections": (Objection("stuck", "gyro x is stuck"),)}, ServiceState.DEGRADED),
        ({"late_ns": 400 * MS_NS}, ServiceState.DEGRADED),
        ({"stall_ns": 2_000 * MS_NS, "last_sample_ns": None}, ServiceState.DEGRADED),
    ],
)
def test_the_worst_sign_decides(signs, expected):
    assert state(**signs) is expected


def test_a_single_sample_after_a_silence_ends_no_silence():
    assert state(last_gap_ns=1000 * MS_NS) is ServiceState.NO_IMU
    assert state(last_gap_ns=500 * MS_NS) is ServiceState.ACTIVE


@pytest.mark.parametrize(
    ("rate_hz", "granted_hz", "expected"),
    [
        (49.0, 100.0, ServiceState.DEGRADED),
        (51.0, 100.0, ServiceState.ACTIVE),
        (40.0, 40.0, ServiceState.ACTIVE),
        (12.0, 15.0, ServiceState.ACTIVE),
        (10.0, None, ServiceState.ACTIVE),
        (None, 100.0, ServiceState.ACTIVE),
    ],
)
def test_a_rate_is_low_against_what_was_settled_on(rate_hz, granted_hz, expected):
    assert state(rate_hz=rate_hz, granted_rate_hz=granted_hz) is expected


def test_figures_change_the_text_and_not_the_cause():
    late = [judge(WELL._replace(late_ns=s * 1000 * MS_NS), NOW_NS) for s in (1, 3)]
    assert late[0].cause == late[1].cause
    assert [verdict.text for verdict in late] == [
        "degraded: late by 1.0 s",
        "degraded: late by 3.0 s",
    ]


def reports(*rounds):
    """What is reported of these signs, each a minute after the one before."""
    standing = Standing(Notices(as_status_text=False))
    found = []
    for number, signs in enumerate(rounds):
        t_ns = NOW_NS + 61_000 * MS_NS * number
        standing.judge(t_ns, WELL._replace(last_sample_ns=t_ns, **signs))
        found.append([notice.text for notice in standing.report(t_ns, is_starting=False)])
    return found


def test_a_state_that_stays_is_reported_once_whatever_its_figures():
    bad = [{"objections": (Objection("field", f"field {ut} uT"),)} for ut in (90, 91, 92)]
    assert reports(*bad) == [["degraded: field 90 uT"], [], []]
    assert reports({}, {}, *bad[:1], {}) == [["active"], [], ["degraded: field 90 uT"], ["active"]]


def test_a_change_is_one_of_the_state_or_of_its_cause():
    standing = Standing(Notices(as_status_text=False))
    rounds = ((), (), ("field", "1"), ("field", "2"), ("force", "2"))
    changed = [
        standing.judge(NOW_NS, WELL._replace(objections=(Objection(*told),) if told else ()))
        for told in rounds
    ]
    assert changed == [True, False, True, False, True]


def told(*rounds):
    """The severities and texts of these signs, each half a second after the one before."""
    standing, found = Standing(Notices(as_status_text=False)), []
    for number, signs in enumerate(rounds):
        t_ns = NOW_NS + 500 * MS_NS * number
        standing.judge(t_ns, WELL._replace(last_sample_ns=t_ns, **signs))
        notices = standing.report(t_ns, is_starting=False)
        found.append([(notice.severity, notice.text) for notice in notices])
    return found


def test_an_all_clear_follows_each_complaint_at_once():
    slow, late = ({"objections": (Objection(what, what),)} for what in ("slow", "late"))
    found = told({}, slow, {}, slow, late, {}, late, {}, {})
    texts = [[text for _, text in each] for each in found]
    # A complaint comes once a minute, and then its all-clear.
    expected = ["active", "degraded: slow", "active", None, "degraded: late", "active", None]
    assert texts == [[text] if text else [] for text in (*expected, None, None)]


def test_an_autopilot_that_has_not_been_heard_yet_is_no_warning():
    silent = {"autopilot_known": False}
    (first,), (_,), (again,) = told(silent, {}, silent)
    assert first == (Severity.INFO, "no_autopilot: no autopilot heartbeat")
    assert again == (Severity.WARNING, "no_autopilot: no autopilot heartbeat")


@pytest.mark.parametrize(
    ("signs", "state", "cause", "reason"),
    [
        ({"link_error": ""}, ServiceState.NO_LINK, "link is down", "link is down"),
        ({"link_error": "no such port"}, ServiceState.NO_LINK, "no such port", "no such port"),
        ({"stall_ns": 1500 * MS_NS, "late_ns": 900 * MS_NS}, ServiceState.DEGRADED, "late",
         "late by 1.5 s"),
        ({"stall_ns": 1500 * MS_NS, "late_ns": 2300 * MS_NS}, ServiceState.DEGRADED, "late",
         "late by 2.3 s"),
        ({"autopilot_known": False}, ServiceState.NO_AUTOPILOT, "heartbeat",
         "no autopilot heartbeat"),
        ({"autopilot_known": False, "bytes_are_junk": True}, ServiceState.NO_AUTOPILOT, "junk",
         "bytes, no MAVLink: wrong baud rate?"),
        ({"last_sample_ns": NOW_NS - 500 * MS_NS}, ServiceState.ACTIVE, "", ""),
        ({"last_sample_ns": NOW_NS - 500 * MS_NS - 1}, ServiceState.NO_IMU, "silent",
         "no IMU messages arrive"),
        ({"last_gap_ns": 500 * MS_NS + 1}, ServiceState.NO_IMU, "silent",
         "no IMU messages arrive"),
        ({"has_estimate": False}, ServiceState.ALIGNING, "alignment",
         "finding the first attitude"),
        ({"rate_hz": 49.9}, ServiceState.DEGRADED, "rate", "IMU rate 50 of 100 Hz"),
        ({"rate_hz": 50.0}, ServiceState.ACTIVE, "", ""),
        ({"rate_hz": 20.0, "late_ns": 400 * MS_NS, "objections": (Objection("stuck", "x stuck"),)},
         ServiceState.DEGRADED, "late; stuck; rate",
         "late by 0.4 s; x stuck; IMU rate 20 of 100 Hz"),
    ],
)  # fmt: skip
def test_each_state_has_its_cause_and_its_reason(signs, state, cause, reason):
    verdict = judge(WELL._replace(**signs), NOW_NS)
    assert verdict == (state, cause, reason)
    assert verdict.text == (f"{state.value}: {reason}" if reason else state.value)


def test_the_first_state_is_that_of_a_link_that_is_down():
    assert judge(WELL._replace(link_error=""), NOW_NS) == AT_START
