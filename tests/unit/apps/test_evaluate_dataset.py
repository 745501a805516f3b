"""`h2nav evaluate dataset`: what is run on what, what is left out, and how it is told."""

import json
from pathlib import Path

import pytest
from one_command import main

from h2nav.apps import evaluate_dataset, extras
from h2nav.cli import BAD_INPUT, FAILED, SUCCESS
from h2nav.evaluation.dataset.peers import installed
from h2nav.evaluation.dataset.scores import TrialScore
from h2nav.maths.attitude_errors import Rms


class Scored:
    """Scores tasks with made figures; `tasks` are those of the last command."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.tasks: list = []
        self.left_out: dict[str, str] = {}  # trial -> remark
        self.is_bad_input = True
        self.required: list[tuple[str, ...]] = []  # extras that were asked for
        for name in ("a", "long_name"):
            (folder / f"{name}.npz").touch()

    def run(self, *words: str) -> int:
        return main(["evaluate", "dataset", str(self.folder), *words])

    def __call__(self, function, tasks):
        self.tasks = list(tasks)
        for number, task in enumerate(self.tasks):
            score = TrialScore(task.trial, task.filter_name)
            if task.trial in self.left_out:
                yield score._replace(
                    remark=self.left_out[task.trial], is_bad_input=self.is_bad_input
                )
            else:
                rms = Rms(3.0 + number, 2.0, 1.5)
                yield score._replace(rms_deg=rms, us_per_sample=4.0, backend="native")


@pytest.fixture
def scored(monkeypatch, tmp_path):
    made = Scored(tmp_path)
    monkeypatch.setattr(evaluate_dataset, "results", made)
    # What they import costs half a second, and no made score needs it.
    monkeypatch.setattr(extras, "require", lambda *words: made.required.append(words))
    return made


@pytest.mark.parametrize(
    ("words", "names"),
    [
        ([], ["default"]),
        (
            ["--filter", "default_fixed", "--filter", "default", "--filter", "default_fixed"],
            ["default_fixed", "default"],
        ),
        (["--smooth"], ["default", "default_smoothed"]),
        (["--filter", "velocity_aided_smoothed", "--smooth"], ["velocity_aided_smoothed"]),
    ],
)
def test_each_filter_runs_once_on_each_trial_in_the_order_that_was_given(scored, words, names):
    assert scored.run(*words) == SUCCESS
    assert [(task.filter_name, task.trial) for task in scored.tasks] == [
        (name, trial) for name in names for trial in ("a", "long_name")
    ]
    assert [task.path.name for task in scored.tasks[:2]] == ["a.npz", "long_name.npz"]


def test_all_are_those_that_are_installed_each_under_one_name_without_smoothers(scored):
    assert scored.run("--filter", "all") == SUCCESS
    names = {task.filter_name for task in scored.tasks}
    assert {"default", "default_fixed"} <= names <= set(installed())
    assert not any("smoothed" in name or "offline" in name for name in names)
    assert not names & {"velocity_aided", "velocity_aided_integer"}


def test_the_conditions_are_those_of_the_command_line(scored, tmp_path):
    words = ["--class", "fixed-wing", "--gps", "--declination-deg", "3.5"]
    assert scored.run(*words, "--cruise-speed-m-s", "20") == SUCCESS
    assert scored.tasks[0].conditions == ("fixed-wing", True, 3.5, 20.0, False)
    assert scored.tasks[0].plots is None
    assert scored.required == []
    assert scored.run("--plots", str(tmp_path / "new" / "pictures")) == SUCCESS
    assert scored.tasks[0].conditions == ("handheld", False, 0.0, None, True)
    assert scored.tasks[0].plots == tmp_path / "new" / "pictures"
    assert scored.tasks[0].plots.is_dir()
    assert scored.required == [("plots", "--plots", "matplotlib.pyplot")]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--declination-deg", "180"], ""),
        (["--declination-deg", "-180"], ""),
        (["--declination-deg", "180.1"], "--declination-deg: expected a number within +-180"),
        (["--declination-deg", "-180.1"], "--declination-deg: expected a number within +-180"),
        (["--declination-deg", "nan"], "--declination-deg: expected a number within +-180"),
        (["--cruise-speed-m-s", "0"], ""),
        (["--cruise-speed-m-s", "300"], ""),
        (["--cruise-speed-m-s", "-0.1"], "--cruise-speed-m-s: expected a number from 0 to 300"),
        (["--cruise-speed-m-s", "300.1"], "--cruise-speed-m-s: expected a number from 0 to 300"),
        (["--cruise-speed-m-s", "nan"], "--cruise-speed-m-s: expected a number from 0 to 300"),
    ],
)
def test_numbers_within_their_limits(scored, capsys, words, said):
    assert scored.run(*words) == (BAD_INPUT if said else SUCCESS)
    assert capsys.readouterr().err == (f"h2nav: {said}\n" if said else "")
    assert bool(scored.tasks) == (not said)


def test_every_unknown_filter_is_named_with_those_there_are(scored, capsys):
    assert scored.run("--filter", "kalman", "--filter", "default", "--filter", "x") == BAD_INPUT
    lines = capsys.readouterr().err.splitlines()
    known = ", ".join(installed())
    assert lines == [
        f"h2nav: --filter {name}: not known; have {known}, all" for name in ("kalman", "x")
    ]


def test_what_a_filter_needs_is_asked_for_before_any_trial_is_read(scored, monkeypatch):
    monkeypatch.setitem(evaluate_dataset.NEEDS, "default", ("peers", "json"))
    assert scored.run("--filter", "default_fixed", "--filter", "default") == SUCCESS
    assert scored.required == [("peers", "--filter default", "json")]


def test_the_table_has_a_row_for_each_trial_and_their_mean(scored, capsys):
    assert scored.run() == SUCCESS
    assert capsys.readouterr().out.splitlines() == [
        "default      total  heading  inclination   (rms, deg)",
        "a            3.000    2.000        1.500",
        "long_name    4.000    2.000        1.500",
        "mean         3.500    2.000        1.500",
        "4.00 us per sample (native)",
        "",
    ]


def test_one_filter_is_the_document_and_of_several_the_first_with_all_beside(scored, capsys):
    assert scored.run("--json") == SUCCESS
    one = json.loads(capsys.readouterr().out)
    assert set(one) == {"class", "trials", "mean", "us_per_sample", "backend", "notes"}
    assert (one["class"], one["notes"], one["mean"]["total"]) == ("handheld", {}, 3.5)
    assert scored.run("--json", "--filter", "default", "--filter", "default_fixed") == SUCCESS
    two = json.loads(capsys.readouterr().out)
    assert set(two) == set(one) | {"filters"}
    assert list(two["filters"]) == ["default", "default_fixed"]
    assert two["trials"] == two["filters"]["default"]["trials"] == one["trials"]
    assert two["filters"]["default_fixed"]["mean"]["total"] == 5.5


def test_a_trial_that_could_not_be_scored_is_left_out_with_its_reason(scored, capsys):
    scored.left_out = {"a": "no truth"}
    assert scored.run() == SUCCESS
    told = capsys.readouterr()
    assert told.err == "a: default: left out: no truth\n"
    assert "mean         4.000" in told.out
    assert "\na " not in told.out


@pytest.mark.parametrize(("is_bad_input", "status"), [(True, BAD_INPUT), (False, FAILED)])
def test_where_nothing_could_be_scored_the_reasons_are_told(scored, capsys, is_bad_input, status):
    scored.is_bad_input = is_bad_input
    scored.left_out = {"a": "no truth", "long_name": "no truth"}
    assert scored.run() == status
    assert capsys.readouterr().err == "h2nav: no truth\n"
    scored.left_out = {"a": "no truth", "long_name": "cut off"}
    assert scored.run() == status
    assert capsys.readouterr().err.splitlines() == [
        "a: default: left out: no truth",
        "long_name: default: left out: cut off",
        f"h2nav: {scored.folder}: no trial could be scored",
    ]


def test_a_filter_that_failed_on_every_trial_is_said_to_have_no_figures(
    scored, capsys, monkeypatch
):
    def half(function, tasks):
        for score in Scored.__call__(scored, function, tasks):
            failed = score.filter_name == "default_fixed"
            yield score._replace(rms_deg=None, remark="it diverged") if failed else score

    monkeypatch.setattr(evaluate_dataset, "results", half)
    assert scored.run("--filter", "default_fixed", "--filter", "default") == SUCCESS
    out = capsys.readouterr().out
    assert out.startswith("default_fixed: no trial could be scored\n\ndefault ")


def test_notes_of_a_trial_follow_the_tables(scored, capsys, monkeypatch):
    def noted(function, tasks):
        for score in Scored.__call__(scored, function, tasks):
            yield score._replace(notes=("one", "two")) if score.trial == "a" else score

    monkeypatch.setattr(evaluate_dataset, "results", noted)
    assert scored.run() == SUCCESS
    assert capsys.readouterr().out.endswith("a: one\na: two\n")
    assert scored.run("--json") == SUCCESS
    assert json.loads(capsys.readouterr().out)["notes"] == {"a": ["one", "two"]}
