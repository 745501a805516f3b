"""A review as a row of the table of flights, and how a run of many is told."""

import json
import os
from contextlib import contextmanager
from types import SimpleNamespace

import pytest
from one_command import main

from h2nav.apps import extras
from h2nav.apps.fleet import row_of
from h2nav.cli import SUCCESS
from h2nav.fleet import program, running, sources
from h2nav.fleet.running import TaskOutcome
from h2nav.fleet.tables import TableRow

REVIEW = {
    "kind": "tlog",
    "name": "a",
    "vehicle": "quadrotor",
    "firmware": "4.5",
    "autopilot": "ardupilot",
    "duration_s": 200.0,
    "imu_message": "RAW_IMU",
    "start_utc": "2026-03-01T10:00:00Z",
    "imus": [{"rate_hz": 50.0}, {"rate_hz": 100.0}, {"rate_hz": None}, {}],
    "certainty": {
        "states_s": {"active": 100.0, "degraded: gps": 30.0, "degraded: compass": 20.0, "no_imu": 9}
    },
    "differences": [
        {"is_truth": True, "tilt": {"largest_deg": 90.0}, "heading": {"largest_deg": 90.0}},
        {"is_truth": False, "tilt": {"largest_deg": 3.0}, "heading": {"largest_deg": None}},
        {"is_truth": False, "tilt": {"largest_deg": 5.0}, "heading": {"largest_deg": None}},
    ],
    "findings": [
        {"kind": "crash", "from_s": 150.0},
        {"kind": "magnet", "from_s": 1.0},
        {"kind": "crash", "from_s": 140.0},
    ],
    "why_no_estimate": "",
    "verdict": "it crashed",
    "airframe": {"id": "abc"},
    "features": {"x": 1.0},
    "flown": {"armed_s": 180.0},
}


def test_a_review_becomes_a_row():
    row = row_of(REVIEW)
    assert row == {
        "kind": "tlog",
        "vehicle": "quadrotor",
        "firmware": "4.5",
        "autopilot": "ardupilot",
        "duration_s": 200.0,
        "imu_message": "RAW_IMU",
        "start": "2026-03-01T10:00:00Z",
        "imus": 4,
        "imu_rate_hz": 100.0,
        "active_share": 0.5,
        "degraded_share": 0.25,  # of all its reasons
        "no_estimate": "",
        "verdict": "it crashed",
        "crash_s": 140.0,
        "airframe": "abc",
        "armed_s": 180.0,
        "remembered": {
            "name": "a",
            "airframe": {"id": "abc"},
            "start_utc": "2026-03-01T10:00:00Z",
            "features": {"x": 1.0},
            "flown": {"armed_s": 180.0},
        },
        "largest_tilt_deg": 5.0,
        "largest_heading_deg": None,
    }


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"duration_s": 0.0}, {"active_share": None, "degraded_share": None}),
        ({"certainty": {"states_s": {}}}, {"active_share": 0.0, "degraded_share": 0.0}),
        ({"imus": []}, {"imus": 0, "imu_rate_hz": None}),
        ({"findings": []}, {"crash_s": None}),
        ({"differences": REVIEW["differences"][:1]}, {"largest_tilt_deg": None}),
    ],
)
def test_what_a_flight_does_not_have_is_unknown_and_not_zero(change, expected):
    row = row_of(REVIEW | change)
    assert {name: row[name] for name in expected} == expected


class Cluster:
    """A fleet whose outcome a test makes; what it was asked for is kept."""

    def __init__(self, monkeypatch, folder):
        self.folder, self.workers_there, self.asked = folder, {"one": {}}, {}
        monkeypatch.setattr(extras, "require", lambda *words: None)
        monkeypatch.setattr(running, "cluster", self.cluster)
        monkeypatch.setattr(running, "run_fleet", self.run_fleet)
        monkeypatch.setattr(program, "program_digest", lambda: "digest")
        monkeypatch.setattr(sources, "find", lambda places: [*places, "more"])

    @contextmanager
    def cluster(self, scheduler, workers, memory_mib):
        self.asked = {"scheduler": scheduler, "workers": workers, "memory_mib": memory_mib}
        yield SimpleNamespace(
            dashboard_link="http://dash",
            scheduler_info=lambda n_workers: {"workers": self.workers_there},
        )

    def run_fleet(self, client, found, work, store, on_finished, changes):
        self.asked |= {"limits": work.limits, "changes": changes, "version": work.version}
        rows = [
            {"source": "a", "error": "", "duration_s": 5400.0, "finding_count": 2},
            {"source": "b", "error": "cut off", "duration_s": None, "finding_count": 0},
            {"source": "c", "error": "", "duration_s": 1800.0, "finding_count": 1},
        ]
        costs = [{"cpu_s": 1.26, "peak_mib": 90.0}, {"cpu_s": 2.0, "peak_mib": 120.0}]
        return TaskOutcome([TableRow(row, ()) for row in rows], 1, costs)

    def run(self, *words):
        return main(["fleet", "logs", "-o", str(self.folder / "out"), *words])


@pytest.fixture
def fleet(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    return Cluster(monkeypatch, tmp_path)


def test_the_document_sums_up_all_flights(fleet, capsys):
    assert fleet.run("--json") == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert 0.0 <= found.pop("elapsed_s") < 60.0
    assert found.pop("output").rstrip("/").endswith("out")
    assert found == {
        "flights": 3,
        "done_before": 1,
        "failed": 1,
        "findings": 3,
        "flight_hours": 2.0,
        "cpu_s": 3.3,
        "peak_worker_mib": 120.0,
        "errors": [{"source": "b", "error": "cut off"}],
    }


def test_people_get_the_sum_the_failures_and_the_page(fleet, capsys):
    assert fleet.run() == SUCCESS
    told = capsys.readouterr()
    sums, failed, page = told.out.splitlines()
    assert sums == "3 flights, 2.0 h, 3 findings; 1 were done before"
    assert failed == "not reviewed: b: cut off"
    assert page.endswith("out/index.html")
    assert told.err == "h2nav: 2 flights, dashboard http://dash\n"


def test_where_no_worker_is_there_yet_it_says_how_to_start_one(fleet, capsys):
    fleet.workers_there = {}
    assert fleet.run("--scheduler", "tcp://host:8786") == SUCCESS
    assert capsys.readouterr().err.splitlines()[1] == (
        "h2nav: no workers there yet, this waits; start some with: dask worker tcp://host:8786"
    )


def test_limits_and_components_are_those_of_the_command_line(fleet, tmp_path, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 3)
    assert fleet.run() == SUCCESS
    assert fleet.asked["limits"] == (1800.0, 600)
    assert (fleet.asked["workers"], fleet.asked["memory_mib"]) == (3, 600)
    assert (fleet.asked["scheduler"], fleet.asked["changes"]) == (None, ())
    (tmp_path / "parts.yaml").write_text('abc: {motor 2: "2026-03-01"}\n')
    words = ["--longest-s", "9.5", "--memory-mb", "1", "--workers", "1"]
    assert fleet.run(*words, "--components", "parts.yaml") == SUCCESS
    assert fleet.asked["limits"] == (9.5, 1)
    assert (fleet.asked["workers"], fleet.asked["memory_mib"]) == (1, 1)
    ((airframe, component, since_unix_s),) = fleet.asked["changes"]
    assert (airframe, component, since_unix_s) == ("abc", "motor 2", 1_772_323_200.0)


def test_results_are_of_the_options_and_of_a_configurations_content(fleet, tmp_path):
    def version(*words):
        assert fleet.run(*words) == SUCCESS
        return fleet.asked["version"]

    plain = version()
    assert plain.startswith("digest ")
    (tmp_path / "a.yaml").write_text("autopilot: {imu_rate_hz: 100}\n")
    (tmp_path / "b.yaml").write_text("autopilot: {imu_rate_hz: 100}\n")
    one, other = version("-c", "a.yaml"), version("-c", "b.yaml")
    assert plain == version()
    assert one == other != plain
    (tmp_path / "b.yaml").write_text("autopilot: {imu_rate_hz: 50}\n")
    assert version("-c", "b.yaml") != one
    assert version("--class", "rover") != plain != version("--filter", "constant_gain")
