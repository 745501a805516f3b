"""What the page is told: both attitudes, what holds ours, and what is wrong."""

import math

import pytest
from live_records import UNIX_NS, Clock, estimate, finding, flying_state, health, status

from h2nav import __version__
from h2nav.attitude.samples import Trust
from h2nav.integrity.severity import Severity
from h2nav.live import messages
from h2nav.live.state import LiveState
from h2nav.maths.units import SECOND_NS
from h2nav.service.records import AidingRecord


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def state(clock):
    return flying_state(clock)


def test_of_nothing_nothing_is_told():
    state = LiveState(Clock())
    nothing = {"silent_s": 0.0, "h2nav": None, "autopilot": None, "difference": None}
    assert messages.attitudes(state) == nothing
    told = messages.overview(state)
    unknown = {"status", "health", "velocity", "link", "recorder", "daemon"}
    assert {name for name, content in told.items() if content is None} == unknown
    assert told["version"] == __version__
    assert (told["alarms"], told["preflight"]) == ((), ())
    assert (told["holding"], told["lanes"], told["refused"]) == ([], [], [])
    assert set(told["per_s"].values()) == {None}
    assert messages.reports(state) == {"findings": [], "lines": []}


def test_both_attitudes_and_their_difference(state, clock):
    clock.pass_s(0.25)
    told = messages.attitudes(state)
    assert told["silent_s"] == pytest.approx(0.25)
    assert told["h2nav"] == {
        "roll_deg": 10.4,
        "pitch_deg": -5.2,
        "heading_deg": 81.0,
        "sigma_tilt_deg": 0.3,
        "sigma_heading_deg": 1.5,
        "has_north": True,
        "age_s": pytest.approx(0.25),
    }
    assert told["autopilot"] == {
        "source": "autopilot",
        "roll_deg": pytest.approx(10.0),
        "pitch_deg": pytest.approx(-5.0),
        "heading_deg": pytest.approx(80.0),
        "age_s": pytest.approx(0.25),
    }
    assert told["difference"] == {
        "tilt_deg": 0.4,
        "heading_deg": -1.25,
        "sigma_tilt_deg": 0.6,
        "sigma_heading_deg": 2.0,
        "tilt_verdict": "undecided",
        "heading_verdict": "undecided",
    }


def test_a_heading_is_from_0_to_360_deg(state):
    state.take("/estimate", UNIX_NS, estimate(yaw_deg=-90.0))
    state.take("/status", UNIX_NS, status(yaw_deg=-1.0))
    told = messages.attitudes(state)
    assert told["h2nav"]["heading_deg"] == 270.0
    assert told["autopilot"]["heading_deg"] == pytest.approx(359.0)


def test_a_heading_without_a_reference_has_no_north(state):
    state.take("/estimate", UNIX_NS, estimate(trust=int(Trust.ALIGNED)))
    assert messages.attitudes(state)["h2nav"]["has_north"] is False


def test_what_the_autopilot_said_is_as_old_as_it_says_and_turned_by_our_motion():
    clock = Clock()
    state = LiveState(clock)
    for yaw_deg in (0.0, 10.0, 20.0, 30.0):
        state.take("/estimate", UNIX_NS, estimate(yaw_deg=yaw_deg))
        clock.pass_s(0.1)
    state.take("/status", UNIX_NS, status(yaw_deg=12.0, autopilot_age_ms=300.0))
    clock.pass_s(0.5)
    told = messages.attitudes(state)["autopilot"]
    # 0.3 s before it was told, we were at 10 deg; the newest of ours is 20 deg further.
    assert told["heading_deg"] == pytest.approx(32.0, abs=1e-6)
    assert told["age_s"] == pytest.approx(0.8)


def test_an_autopilot_that_says_nothing_has_no_attitude_and_no_difference(state):
    state.take("/status", UNIX_NS, status(autopilot_q_w=None, tilt_deg=None))
    told = messages.attitudes(state)
    assert (told["autopilot"], told["difference"]) == (None, None)


def test_an_overview_has_each_record(state, clock):
    clock.pass_s(1.0)
    state.take("/health", UNIX_NS + SECOND_NS, health(samples_used=2100, estimates_sent=1050))
    state.take("/status", UNIX_NS, status(alarms="IMU 1: frozen\nGPS lost", preflight="gyro 1"))
    told = messages.overview(state)
    assert told["health"]["samples_used"] == 2100
    assert told["status"]["vehicle"] == "ArduPilot multirotor 1/1"
    assert told["alarms"] == ("IMU 1: frozen", "GPS lost")
    assert told["preflight"] == ("gyro 1",)
    assert [(lane["imu"], lane["sent"]) for lane in told["lanes"]] == [(1, True), (2, False)]
    assert told["refused"] == [{"reason": "duplicate", "total": 3}]
    assert told["link"]["bytes_in"] == 100_000
    assert told["recorder"]["written"] == 9000
    assert told["daemon"]["cpu_s"] == 3.2
    rates = told["per_s"]
    assert (rates["samples_used"], rates["estimates_sent"]) == (100.0, 50.0)
    assert rates["samples_rejected"] == 0.0
    assert [name for name, rate in rates.items() if rate is None] == [
        "bytes_in", "bytes_out", "written", "cpu_s",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("after_s", "holding"),
    [(0.0, ["gravity", "compass", "velocity"]), (1.99, ["gravity", "compass", "velocity"]),
     (2.0, [])],
)  # fmt: skip
def test_what_corrected_within_two_seconds_holds_the_attitude(state, clock, after_s, holding):
    clock.pass_s(after_s)
    assert messages.overview(state)["holding"] == holding


def test_a_rest_holds_too(state):
    state.take("/estimate", UNIX_NS, estimate(trust=int(Trust.REST)))
    assert messages.overview(state)["holding"] == ["gravity", "compass", "velocity", "rest"]


@pytest.mark.parametrize(("is_own", "source"), [(True, "GPS receiver"), (False, "autopilot")])
def test_whose_velocity_was_used_last(state, clock, is_own, source):
    state.take("/aiding", UNIX_NS, AidingRecord("velocity", independent=is_own))
    clock.pass_s(1.5)
    assert messages.overview(state)["velocity"] == {"source": source, "age_s": 1.5}


def test_findings_and_lines_come_newest_first_with_their_ages(clock):
    state = LiveState(clock)
    state.take("/finding", UNIX_NS, finding())
    state.text(UNIX_NS, Severity.WARNING, "first")
    clock.pass_s(2.0)
    state.take("/finding", UNIX_NS, finding(id="attitude_velocity.gps.2", to_s=40.5))
    state.text(UNIX_NS, Severity.INFO, "second")
    told = messages.reports(state)
    ids = [found["id"] for found in told["findings"]]
    assert ids == ["attitude_velocity.gps.2", "attitude_velocity.gps.1"]
    # from the beginning of each, which was before it was told
    assert [found["age_s"] for found in told["findings"]] == pytest.approx([0.5, 3.0])
    assert told["lines"] == [
        {"level": "info", "text": "second", "age_s": 0.0},
        {"level": "warning", "text": "first", "age_s": pytest.approx(2.0)},
    ]


def test_unknown_numbers_are_not_numbers(state):
    assert math.isnan(messages.overview(state)["status"]["force_ratio"])
