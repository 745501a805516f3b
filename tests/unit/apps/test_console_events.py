"""The events of the console, one by one: keys and values, times, and who gets them."""

import io
import json
import os

import pytest
from live_records import health, status

from h2nav.apps.console import Console
from h2nav.apps.panel import Sight
from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.findings import Finding, Kind, Phase, Sensor, SensorKind, Severity, as_mapping
from h2nav.maths.units import SECOND_NS

LEVEL = (1.0, 0.0, 0.0, 0.0)
ESTIMATE = AttitudeEstimate(7_000_000, LEVEL, *[(0.0, 0.0, 0.0)] * 3, 0.01, Trust(0))
FINDING = Finding(
    Kind.ACCELEROMETER_FROZEN,
    Sensor(SensorKind.IMU, 1), Severity.ERROR, 1.0, 2.0, 3.0, "deg", "text", "shown", id="a.1",
)  # fmt: skip


@pytest.fixture
def console():
    """A console without a terminal; `events` has what it has published, `lines` what people see."""
    stream = io.StringIO()
    made = Console(stream=stream)
    said: list[str] = []
    made.show_events(said.append)
    made.events = lambda: [json.loads(line) for line in said]
    made.raw, made.lines = said, lambda: stream.getvalue().splitlines()
    return made


def sight(**changes):
    return lambda t_ns: Sight(health(), status(**changes), None)


def test_every_sink_gets_each_event_as_one_line(console):
    other: list[str] = []
    console.show_events(other.append)
    console.notice(SECOND_NS, Severity.ERROR, "two\nlines")
    assert other == console.raw
    assert len(other) == 1
    assert other[0].count("\n") == 1
    (event,) = console.events()
    assert (event["event"], event["severity"]) == ("notice", "error")
    assert (event["text"], event["attitude"]) == ("two\nlines", None)
    assert console.lines() == ["error: two", "lines"]


def test_a_finding_is_an_event_with_its_phase_and_no_line(console):
    console.finding(SECOND_NS, Phase.BEGIN, FINDING)
    (event,) = console.events()
    assert (event["event"], event["phase"]) == ("finding", "begin")
    assert {**event, **as_mapping(FINDING)} == event
    assert console.lines() == []


def test_the_start_and_a_flight_are_events(console):
    console.started(SECOND_NS, {"version": "1"})
    console.flight(SECOND_NS, {"id": "a", "error": ""})
    started, flight = console.events()
    assert (started["event"], started["version"]) == ("started", "1")
    assert (flight["event"], flight["id"], flight["error"]) == ("flight", "a", "")


@pytest.mark.parametrize(
    ("age_ns", "is_fresh"), [(0, True), (SECOND_NS // 2, True), (SECOND_NS // 2 + 1, False)]
)
def test_an_attitude_is_fresh_for_half_a_second(console, age_ns, is_fresh):
    console.estimate(SECOND_NS, ESTIMATE, 0)
    console.notice(SECOND_NS + age_ns, Severity.INFO, "x")
    (event,) = console.events()
    assert (event["attitude"] is not None) == is_fresh
    if is_fresh:
        assert event["attitude"]["q_nb"] == list(LEVEL)
        assert event["attitude"]["t_us"] == 7_000_000


def test_times_are_of_the_unix_clock_to_the_millisecond(console):
    for t_ns in (0, 1_234_500_000):
        console.notice(t_ns, Severity.INFO, "x")
    first, second = (event["unix_s"] for event in console.events())
    assert second - first == pytest.approx(1.2345, abs=0.0011)
    assert first == round(first, 3)
    assert first > 1.7e9


def test_a_status_is_published_once_a_second(console):
    asked = []

    def look(t_ns):
        asked.append(t_ns)
        return sight()(t_ns)

    for t_ns in (SECOND_NS, 2 * SECOND_NS - 1, 2 * SECOND_NS, 2 * SECOND_NS + 1):
        console.status(t_ns, look)
    assert asked == [SECOND_NS, 2 * SECOND_NS]
    assert [event["event"] for event in console.events()] == ["status", "status"]


def test_a_status_compares_both_attitudes_and_lists_what_is_wrong(console):
    changes = {"alarms": "one\ntwo", "open_findings": "a.1 b.2", "autopilot_age_ms": 7.0}
    console.status(SECOND_NS, sight(roll_deg=10.0, pitch_deg=-20.0, yaw_deg=30.0, **changes))
    (event,) = console.events()
    theirs = event["autopilot_attitude"]
    assert (theirs["source"], theirs["age_ms"]) == ("autopilot", 7.0)
    angles = [theirs[f"{name}_deg"] for name in ("roll", "pitch", "yaw")]
    assert angles == pytest.approx([10.0, -20.0, 30.0])
    assert event["alarms"] == ["one", "two"]
    assert event["open_findings"] == ["a.1", "b.2"]
    expected = {
        "age_ms": 4.0, "autopilot_sigma_tilt_deg": 0.6, "autopilot_sigma_heading_deg": 2.0,
        "velocity_ratio": 0.2, "force_ratio": None, "field_ratio": 0.15, "turn_ratio": 0.1,
    }  # fmt: skip
    assert {name: event[name] for name in expected} == expected
    assert {**event, **health()._asdict()} == event


def test_where_the_autopilots_attitude_is_stale_there_is_none(console):
    console.status(SECOND_NS, sight(autopilot_q_x=None))
    (event,) = console.events()
    assert event["autopilot_attitude"] is None


def test_a_new_client_is_sent_what_it_has_missed(console):
    console.started(0, {"version": "1"})
    lines = console.catch_up(SECOND_NS, sight()(0), [FINDING, FINDING])
    caught = [json.loads(line) for line in lines]
    assert [event["event"] for event in caught] == ["started", "status", "finding", "finding"]
    assert caught[0]["version"] == "1"
    assert caught[1]["panel"][0].startswith("active")
    assert (caught[2]["phase"], caught[2]["id"]) == ("update", "a.1")
    assert all(line.endswith("\n") for line in lines)
    assert len(console.raw) == 1  # nobody else is sent them


@pytest.mark.parametrize("has_log", [False, True])
def test_the_end_is_told_with_its_counts_and_log(console, tmp_path, has_log):
    log = tmp_path / "a.mcap" if has_log else None
    console.closing(SECOND_NS, health(), log)
    (event,) = console.events()
    assert event["event"] == "stopped"
    assert event["log"] == (str(log) if has_log else None)
    assert event["samples_used"] == 2000
    end = f"log: {log}" if has_log else "no log"
    assert console.lines() == [f"2000 samples used, 3 refused, 1000 attitudes sent; {end}"]


@pytest.mark.parametrize(
    ("names_stream", "line"),
    [(True, "<4>late\n"), (False, "warning: late\n"), (None, "warning: late\n")],
)
def test_lines_for_the_journal_have_its_levels(monkeypatch, tmp_path, names_stream, line):
    path = tmp_path / "journal"
    with path.open("w") as stream:
        status_of = os.fstat(stream.fileno())
        named = f"{status_of.st_dev}:{status_of.st_ino + (not names_stream)}"
        monkeypatch.delenv("JOURNAL_STREAM", raising=False)
        if names_stream is not None:
            monkeypatch.setenv("JOURNAL_STREAM", named)
        Console(stream=stream).notice(SECOND_NS, Severity.WARNING, "late")
    assert path.read_text() == line
