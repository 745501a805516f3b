"""What people and programs get to see while the daemon runs."""

import io
import json
import os
import select

import pytest
from simulated_flight import SimulatedFlight

from h2nav.apps.console import Console
from h2nav.apps.panel import Sight
from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.findings import Severity

SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def flight():
    return SimulatedFlight("hover").run(30.0)


def sight_of(flight):
    service = flight.pipeline.service
    return lambda t_ns: Sight(service.health, service.status(flight.t_ns), None)


def never(t_ns):
    raise AssertionError("nobody wants to see it")


ESTIMATE = AttitudeEstimate(7_000_000, (1.0, 0.0, 0.0, 0.0), *[(0.0, 0.0, 0.0)] * 3, 0.01, Trust(0))


def all_of(screen):
    """What has been written to a terminal."""
    shown = ""
    while select.select([screen], [], [], 0)[0]:
        shown += os.read(screen, 65536).decode()
    return shown


@pytest.fixture
def terminal(monkeypatch):
    """A console on a terminal, and what that shows."""
    monkeypatch.setenv("TERM", "xterm")
    screen, keyboard = os.openpty()
    with os.fdopen(keyboard, "w") as stream:
        yield Console(stream=stream), lambda: all_of(screen)
    os.close(screen)


@pytest.mark.thorough
def test_the_panel_shows_both_attitudes_and_their_difference(flight, terminal):
    console, shown = terminal
    console.estimate(SECOND, ESTIMATE, 0)
    console.status(SECOND, sight_of(flight))
    panel = shown()
    assert "h2nav         +0.00" in panel
    assert "difference tilt 0." in panel
    assert "sigma)" in panel


def test_an_old_attitude_is_not_shown_as_the_present_one(flight, terminal):
    console, shown = terminal
    console.estimate(SECOND, ESTIMATE, 0)
    console.status(SECOND + SECOND // 2 + 1, sight_of(flight))
    assert "h2nav             -" in shown()


def test_it_is_redrawn_five_times_a_second_and_not_looked_at_in_between(flight, terminal):
    console, shown = terminal
    console.status(SECOND, sight_of(flight))
    console.status(SECOND + SECOND // 5 - 1, never)
    shown()
    console.status(SECOND + SECOND // 5, sight_of(flight))
    assert "difference" in shown()


def test_the_end_takes_the_panel_away(flight, terminal):
    console, shown = terminal
    console.status(SECOND, sight_of(flight))
    shown()
    console.closing(SECOND, flight.pipeline.service.health, None)
    assert shown().rstrip().endswith("attitudes sent; no log\r\n\x1b[?7l\x1b[?7h\x1b[J")


def test_a_terminal_that_cannot_be_drawn_on_gets_lines(monkeypatch):
    monkeypatch.setenv("TERM", "dumb")
    screen, keyboard = os.openpty()
    with os.fdopen(keyboard, "w") as stream:
        console = Console(stream=stream)
        console.status(SECOND, never)
        console.notice(SECOND, Severity.INFO, "active")
        assert all_of(screen) == "info: active\r\n"
    os.close(screen)


def test_without_a_terminal_there_are_lines_and_no_panel():
    stream = io.StringIO()
    console = Console(stream=stream)
    console.status(SECOND, never)
    console.notice(SECOND, Severity.WARNING, "late")
    assert stream.getvalue() == "warning: late\n"


def test_events_have_time_and_attitude(flight, capsys):
    console = Console(events_as_json=True, stream=io.StringIO())
    health = flight.pipeline.service.health
    console.notice(SECOND, Severity.NOTICE, "hello")
    console.estimate(2 * SECOND, ESTIMATE, 0)
    console.status(2 * SECOND, sight_of(flight))
    console.status(3 * SECOND - 1, never)
    console.closing(4 * SECOND, health, None)
    notice, status, stopped = map(json.loads, capsys.readouterr().out.splitlines())
    assert [event["event"] for event in (notice, status, stopped)] == [
        "notice",
        "status",
        "stopped",
    ]
    assert status["unix_s"] - notice["unix_s"] == pytest.approx(1.0, abs=0.002)
    assert notice["attitude"] is None
    assert stopped["attitude"] is None  # older than half a second
    assert status["attitude"] == {
        "t_us": 7_000_000, "roll_deg": 0.0, "pitch_deg": 0.0, "yaw_deg": 0.0,
        "q_nb": [1.0, 0.0, 0.0, 0.0],
        "sigma_tilt_deg": pytest.approx(0.573, abs=1e-3), "sigma_heading_deg": None,
    }  # fmt: skip
    assert health._asdict().keys() <= status.keys() & stopped.keys()
    assert status["autopilot_attitude"]["source"] == "autopilot"
    assert len(status["autopilot_attitude"]["q_nb"]) == 4
    assert status["autopilot_sigma_tilt_deg"] > 0.0
    assert status["alarms"] == []
    assert 0.0 < status["velocity_ratio"] < 1.0
