"""When a state of the service, and a change of it, is reported."""

import pytest

from h2nav.integrity.findings import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.health import Objection, Signs
from h2nav.service.notices import Notices
from h2nav.service.standing import Standing

T_NS = 100 * SECOND_NS
NO_IMU = Objection("nothing", "nothing arrives")
BAD = {"objections": (Objection("units", "wrong units"),)}
UNBOUND = {"autopilot_known": False}


def signs(t_ns, **how):
    usual = Signs(None, 0, False, True, t_ns, 10_000_000, lambda: NO_IMU, True, 0, (), None, None)
    return usual._replace(**how)


class Bench:
    def __init__(self):
        self.standing = Standing(Notices(as_status_text=False))

    def judge(self, t_s, *, is_starting=False, **how):
        """What is said of the state at a time."""
        t_ns = T_NS + round(t_s * SECOND_NS)
        changed = self.standing.judge(t_ns, signs(t_ns, **how))
        said = self.standing.report(t_ns, is_starting=is_starting)
        return changed, [(one.severity, one.text) for one in said]


ACTIVE = [(Severity.INFO, "active")]
DEGRADED = [(Severity.WARNING, "degraded: wrong units")]


def test_each_change_is_said_once_with_its_severity():
    bench = Bench()
    assert bench.judge(0.0) == (True, ACTIVE)
    assert bench.judge(1.0) == (False, [])
    assert bench.standing.is_active
    assert bench.standing.complaint == []
    assert bench.judge(2.0, **BAD) == (True, DEGRADED)
    assert not bench.standing.is_active
    assert bench.standing.complaint == DEGRADED
    assert bench.judge(3.0, **BAD) == (False, [])
    assert bench.judge(4.0) == (True, ACTIVE)


def test_a_change_that_comes_and_goes_within_a_minute_is_said_when_it_lasts():
    bench = Bench()
    bench.judge(0.0)
    assert bench.judge(1.0, **BAD)[1] == DEGRADED
    assert bench.judge(2.0)[1] == ACTIVE
    assert bench.judge(3.0, **BAD) == (True, [])
    assert bench.judge(4.0) == (True, [])  # it was not complained of
    assert bench.judge(5.0, **BAD) == (True, [])
    assert bench.judge(60.9, **BAD) == (False, [])
    assert bench.judge(61.0, **BAD) == (False, DEGRADED)
    assert bench.judge(61.1) == (True, ACTIVE)  # an all-clear follows at once


def test_a_changed_figure_is_no_change():
    bench = Bench()
    assert bench.judge(0.0, late_ns=3 * SECOND_NS) == (
        True,
        [(Severity.WARNING, "degraded: late by 3.0 s")],
    )
    assert bench.judge(1.0, late_ns=4 * SECOND_NS) == (False, [])
    assert bench.standing.complaint == [(Severity.WARNING, "degraded: late by 4.0 s")]


@pytest.mark.parametrize(
    ("is_starting", "said"),
    [(True, []), (False, [(Severity.WARNING, "no_imu: nothing arrives")])],
)
def test_a_lack_of_samples_is_not_said_at_a_start(is_starting, said):
    bench = Bench()
    assert bench.judge(0.0, is_starting=is_starting, last_sample_ns=None) == (True, said)


def test_an_autopilot_that_was_not_heard_yet_is_no_reason_to_warn():
    text = "no_autopilot: no autopilot heartbeat"
    bench = Bench()
    assert bench.judge(0.0, **UNBOUND)[1] == [(Severity.INFO, text)]
    bench.judge(1.0)
    assert bench.judge(2.0, **UNBOUND)[1] == [(Severity.WARNING, text)]
    junk = Bench()
    said = junk.judge(0.0, bytes_are_junk=True, **UNBOUND)[1]
    assert [severity for severity, _ in said] == [Severity.WARNING]


def test_finding_the_first_attitude_is_no_complaint():
    bench = Bench()
    said = bench.judge(0.0, has_estimate=False)[1]
    assert said == [(Severity.INFO, "aligning: finding the first attitude")]
    assert bench.standing.complaint == []
    assert not bench.standing.is_active


def test_how_long_each_state_has_lasted():
    bench = Bench()
    bench.judge(0.0)
    bench.judge(2.0)
    bench.judge(5.0, **BAD)
    bench.judge(9.0)
    bench.judge(8.0)  # the clock does not run back
    lasted_s = {name: ns / SECOND_NS for name, ns in bench.standing.lasted_ns.items()}
    assert lasted_s == {"no_link": 0.0, "active": 5.0, "degraded": 4.0}
