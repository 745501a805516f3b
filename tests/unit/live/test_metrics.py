"""The metrics are what Prometheus expects, by a parser of its own and by its rules for names."""

import math
import re

import pytest
from live_records import FLYING, UNIX_NS, finding, flying_state, status
from needs import need_package

from h2nav.live.metrics import metrics_text
from h2nav.live.state import LiveState
from h2nav.service.health import ServiceState


def families(state, viewers=0):
    parser = need_package("prometheus_client.parser")
    text = metrics_text(state, viewers).decode()
    return {family.name: family for family in parser.text_string_to_metric_families(text)}


def values(family):
    return {tuple(sample.labels.values()): sample.value for sample in family.samples}


def test_everything_that_is_known_is_told():
    told = families(flying_state(), viewers=2)
    assert values(told["h2nav_state"]) == {
        (each.value,): float(each is ServiceState.ACTIVE) for each in ServiceState
    }
    assert values(told["h2nav_samples_used"]) == {(): 2000.0}
    assert values(told["h2nav_lateness_seconds"]) == {(): 0.002}
    assert values(told["h2nav_sample_age_seconds"]) == {(): 0.004}
    assert values(told["h2nav_attitude_degrees"]) == {
        ("roll",): 10.4, ("pitch",): -5.2, ("yaw",): 81.0
    }  # fmt: skip
    assert values(told["h2nav_difference_degrees"]) == {("tilt",): 0.4, ("heading",): -1.25}
    assert values(told["h2nav_test_ratio"]) == {
        ("velocity",): 0.2, ("field",): 0.15, ("turn",): 0.1
    }  # fmt: skip
    assert values(told["h2nav_refusals"]) == {("duplicate",): 3.0}
    assert values(told["h2nav_lane_ratio"]) == {("1",): 0.2, ("2",): 0.2}
    assert values(told["h2nav_cpu_seconds"]) == {(): 3.2}
    assert values(told["h2nav_live_viewers"]) == {(): 2.0}
    assert values(told["h2nav_alarms"]) == {(): 0.0}


def test_troubles_are_counted():
    state = flying_state()
    state.take("/status", UNIX_NS, status(alarms="compass disturbed\nGPS lost"))
    state.take("/finding", UNIX_NS, finding())
    told = families(state)
    assert values(told["h2nav_alarms"]) == {(): 2.0}
    assert values(told["h2nav_findings"]) == {(): 1.0}


@pytest.mark.parametrize("topics", [FLYING, ()], ids=["flying", "nothing heard"])
def test_names_and_values_follow_the_rules(topics):
    state = LiveState()
    for topic, record in topics:
        state.take(topic, UNIX_NS, record)
    text = metrics_text(state, 0).decode()
    assert text.endswith("\n")
    for family in families(state).values():
        assert re.fullmatch(r"h2nav_[a-z][a-z0-9_]*", family.name)
        assert family.documentation.endswith(".")
        # promtool: base units, and no unit twice
        assert not re.search(r"_(ms|milliseconds|kilobytes|percent|deg|hz)(_|$)", family.name)
        for sample in family.samples:
            assert sample.name.endswith("_total") == (family.type == "counter")
            assert not math.isnan(sample.value)


def test_a_label_may_be_any_text():
    state = flying_state()
    record = next(record for topic, record in FLYING if topic == "/rejected")
    hostile = 'x"} 1\nh2nav_state{state="active"} 7\n\\'
    state.take("/rejected", UNIX_NS, record._replace(reason=hostile, total=5))
    told = families(state)
    assert values(told["h2nav_refusals"])[hostile,] == 5.0
    assert values(told["h2nav_state"])["active",] == 1.0
