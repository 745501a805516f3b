"""The table of `h2nav evaluate flights`, of made figures, and in which order flights are played."""

import json

import pytest
from one_command import main

from h2nav.apps import evaluate_flights, extras
from h2nav.cli import BAD_INPUT, SUCCESS
from h2nav.evaluation.flights.scores import FlightScore


def figures(total, tilt=0.5, **more):
    return {"total": total, "tilt": tilt, "heading": 1.0, "estimates": 100, **more}


HONEST = {
    "nees_tilt": 1.234,
    "nees_heading": None,
    "tilt_beyond_3_sigma": 0.0123,
    "heading_beyond_3_sigma": None,
}
FLIGHT = {
    "whole": {"h2nav": figures(1.5, **HONEST), "ekf": figures(2.25)},
    "settled": {"h2nav": figures(1.25, **HONEST | {"nees_tilt": 2.0})},
    "airborne": {"h2nav": figures(3.0)},
    "phases": {"climb": {"ekf": figures(4.0)}, "empty": {}},
    "best": {"whole": "h2nav", "settled": "h2nav"},
    "truth": "SIMSTATE",
    "notes": [],
}


class Flown:
    """Flights with made figures; `documents` by name, of others they are `FLIGHT`."""

    def __init__(self, folder):
        self.folder, self.tasks, self.documents, self.required = folder, [], {}, []
        for name, size in (("a", 10), ("b", 30), ("long_name_of_a_flight", 20)):
            (folder / f"{name}.tlog").write_bytes(b"x" * size)

    def run(self, *words, place=""):
        return main(["evaluate", "flights", str(self.folder / place), *words])

    def __call__(self, function, tasks):
        self.tasks = list(tasks)
        for task in self.tasks:
            found = self.documents.get(task.name, FLIGHT)
            remark = "" if found else f"{task.path}: no truth"
            yield FlightScore(task.name, found, remark)


@pytest.fixture
def flown(monkeypatch, tmp_path):
    made = Flown(tmp_path)
    monkeypatch.setattr(evaluate_flights, "results", made)
    monkeypatch.setattr(extras, "require", lambda *words: made.required.append(words))
    return made


def test_the_longest_flight_is_played_first_and_all_are_told_in_the_order_of_their_names(
    flown, capsys
):
    assert flown.run("--json") == SUCCESS
    assert [task.name for task in flown.tasks] == ["b", "long_name_of_a_flight", "a"]
    found = json.loads(capsys.readouterr().out)
    assert list(found["flights"]) == ["a", "b", "long_name_of_a_flight"]
    assert found["mean"]["whole"]["h2nav"]["flights"] == 3
    assert found["left_out"] == {}


def test_one_flight_is_told_with_its_phases(flown, capsys):
    assert flown.run(place="a.tlog") == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "RMS errors in deg, total (tilt); * = nearest to the truth"
    rows = [line.split() for line in lines[4:6]]
    assert rows == [
        ["a", "h2nav", "1.50", "(0.50)*", "1.25", "(0.50)*", "2.00", "-", "1.2%", "-"],
        ["ekf", "2.25", "(0.50)", "-"],
    ]
    phases = {line.split()[0]: line.split()[1:] for line in lines[8:10]}
    assert phases == {"airborne": ["3.00", "(0.50)", "-"], "climb": ["-", "4.00", "(0.50)"]}
    assert not any("mean of flights" in line or "empty" in line for line in lines)
    assert lines[-2:] == [
        "Settled: from 60 s on. NEES (1 is honest) and the shares of time beyond 3 sigma are",
        "of the settled part, else of the whole.",
    ]


def test_of_several_the_mean_is_told_and_no_phases(flown, capsys):
    assert flown.run() == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    mean = [line for line in lines if line.startswith("mean of flights")]
    assert mean[0].split()[:5] == ["mean", "of", "flights", "h2nav", "1.50"]
    assert mean[0].endswith("(3 flights)")
    assert "*" not in mean[0]
    assert not any(line.startswith("airborne") for line in lines)
    starts = {line.index("h2nav") for line in lines if " h2nav " in line}
    assert starts == {len("long_name_of_a_flight") + 2}


@pytest.mark.parametrize(
    ("change", "remarks"),
    [
        ({}, []),
        ({"truth": "a_truth.csv"}, ["truth: a_truth.csv"]),
        ({"notes": ["cut off"]}, ["cut off"]),
        ({"truth": "a_truth.csv", "notes": ["x", "y"]}, ["truth: a_truth.csv", "x", "y"]),
    ],
)
def test_remarks_follow_the_rows_of_their_flight(flown, capsys, change, remarks):
    flown.documents["a"] = FLIGHT | change
    assert flown.run(place="a.tlog") == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert [line.strip() for line in lines[6 : 6 + len(remarks)]] == remarks
    assert lines[6 + len(remarks)] == ""


def test_before_it_has_settled_the_honesty_is_of_the_whole(flown, capsys):
    flown.documents["a"] = FLIGHT | {"settled": {}, "best": {"whole": "ekf"}}
    assert flown.run(place="a.tlog") == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[4].split() == ["a", "h2nav", "1.50", "(0.50)", "-", "1.23", "-", "1.2%", "-"]
    assert lines[5].split() == ["ekf", "2.25", "(0.50)*", "-"]


def test_what_cannot_be_scored_is_left_out_with_its_reason(flown, capsys, tmp_path):
    flown.documents = {"a": {}}
    assert flown.run("--json") == SUCCESS
    told = capsys.readouterr()
    assert told.err == f"left out: {tmp_path / 'a.tlog'}: no truth\n"
    found = json.loads(told.out)
    assert list(found["flights"]) == ["b", "long_name_of_a_flight"]
    assert list(found["left_out"]) == ["a"]


def test_where_none_can_be_scored_that_is_the_error(flown, capsys, tmp_path):
    flown.documents = {"a": {}, "b": {}, "long_name_of_a_flight": {}}
    assert flown.run(place="a.tlog") == BAD_INPUT
    assert capsys.readouterr().err == f"h2nav: {tmp_path / 'a.tlog'}: no truth\n"
    assert flown.run() == BAD_INPUT
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert lines[-1].startswith(f"h2nav: {tmp_path}")
    assert lines[-1].endswith(": no flight could be scored")


def test_phases_and_pictures_are_those_of_the_command_line(flown, tmp_path):
    assert flown.run() == SUCCESS
    assert (flown.tasks[0].phases, flown.tasks[0].plots) == (None, None)
    assert flown.required == []
    words = ["--phase", "climb=42-56", "--phase", "cruise=56-200.5"]
    assert flown.run(*words, "--plots", str(tmp_path / "new" / "pictures")) == SUCCESS
    assert flown.tasks[0].phases == (("climb", 42.0, 56.0), ("cruise", 56.0, 200.5))
    assert flown.tasks[0].plots == tmp_path / "new" / "pictures"
    assert flown.tasks[0].plots.is_dir()
    assert flown.required == [("plots", "--plots", "matplotlib.pyplot")]


@pytest.mark.parametrize("text", ["climb", "=1-2", "climb=2-1", "climb=a-b"])
def test_a_phase_of_another_form_is_a_wrong_word(flown, capsys, text):
    with pytest.raises(SystemExit) as ended:
        flown.run("--phase", text)
    assert ended.value.code == BAD_INPUT
    assert f"argument --phase: expected NAME=FROM-TO, found {text}" in capsys.readouterr().err
