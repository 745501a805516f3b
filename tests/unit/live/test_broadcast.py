"""What viewers are sent, and how often it is made."""

import json

import pytest
from live_records import UNIX_NS, Clock, finding, flying_state

from h2nav.integrity.severity import Severity
from h2nav.live.broadcast import ATTITUDES_PER_OVERVIEW, PERIOD_MS, Broadcast


@pytest.fixture
def state():
    return flying_state(Clock())


def content(broadcast, name):
    """The content of an event, whose form is that of Server-Sent Events."""
    first, second, *end = broadcast.events[name].split(b"\n")
    assert (first, end) == (f"event: {name}".encode(), [b"", b""])
    assert second.startswith(b"data: ")
    return json.loads(second.removeprefix(b"data: "))


def test_nothing_is_made_for_nobody(state):
    broadcast = Broadcast(state)
    for _ in range(20):
        broadcast._tick()
    assert broadcast.events == {}
    assert broadcast.viewers == 0


def test_a_new_viewer_gets_everything(state):
    broadcast = Broadcast(state)
    with broadcast.viewer():
        assert broadcast.viewers == 1
        assert broadcast.events.keys() == {"attitudes", "overview", "told"}
        assert content(broadcast, "attitudes")["h2nav"]["roll_deg"] == 10.4
        assert content(broadcast, "overview")["health"]["state"] == "active"
        assert [line["text"] for line in content(broadcast, "told")["lines"]] == ["active"]
        # What is unknown is null.
        assert content(broadcast, "overview")["status"]["force_ratio"] is None
    assert broadcast.viewers == 0


def test_attitudes_come_ten_times_a_second_and_the_overview_twice(state):
    assert PERIOD_MS * ATTITUDES_PER_OVERVIEW == 500
    broadcast = Broadcast(state)
    with broadcast.viewer():
        made = []
        for _ in range(10):
            broadcast.events.clear()
            broadcast._tick()
            made.append(set(broadcast.events))
    assert made == ([{"attitudes"}] * 4 + [{"attitudes", "overview"}]) * 2


def test_long_reports_are_made_when_they_are_new(state):
    broadcast = Broadcast(state)
    with broadcast.viewer():
        changes = (
            lambda: state.take("/finding", UNIX_NS, finding()),
            lambda: state.text(UNIX_NS, Severity.ERROR, "log: disk full"),
            lambda: None,
            lambda: state.take("/finding", UNIX_NS, finding(size=30.0)),
        )
        made = []
        for change in changes:
            change()
            broadcast.events.clear()
            for _ in range(ATTITUDES_PER_OVERVIEW):
                broadcast._tick()
            made.append("told" in broadcast.events)
    assert made == [True, True, False, True]
