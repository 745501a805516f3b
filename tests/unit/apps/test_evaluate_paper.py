"""`h2nav evaluate paper`: limits of its numbers, its document and its tables, of made figures."""

import json

import pytest
from one_command import main

from h2nav.apps import extras
from h2nav.cli import BAD_INPUT, SUCCESS
from h2nav.evaluation.paper import pictures, tables
from h2nav.evaluation.paper.tables import SLIDES, PaperRow


def _ours(row):
    extremes = [list(pair) for pair in row.min_max_deg]
    return PaperRow(list(row.rms_deg), [0.1, 0.2, 0.3], extremes)


@pytest.fixture
def paper(monkeypatch):
    """A function: runs the command with the slides' own figures as ours, but for the yaw of one."""
    asked: list = []

    def made(assumptions, seeds):
        asked.append((assumptions, seeds))
        found = {
            case: {name: _ours(row) for name, row in rows.items()} for case, rows in SLIDES.items()
        }
        found["case_1"]["eh2_paper"].rms_deg[2] = 0.2214  # twice the slides'
        return found

    monkeypatch.setattr(tables, "tables", made)
    monkeypatch.setattr(extras, "require", lambda *words: asked.append(words))

    def run(*words):
        asked.clear()
        return main(["evaluate", "paper", *words])

    run.asked = asked
    return run


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--seeds 1", ""),
        ("--seeds 10000", ""),
        ("--seeds 0", "--seeds 0: expected a number from 1 to 10000"),
        ("--seeds 10001", "--seeds 10001: expected a number from 1 to 10000"),
        ("--run-in-s 0", ""),
        ("--run-in-s 3600", ""),
        ("--run-in-s -0.1", "--run-in-s -0.1: expected a number from 0 to 3600"),
        ("--run-in-s 3600.5", "--run-in-s 3600.5: expected a number from 0 to 3600"),
        ("--run-in-s nan", "--run-in-s nan: expected a number from 0 to 3600"),
        ("--dip-deg 85", ""),
        ("--dip-deg -85", ""),
        ("--dip-deg 85.1", "--dip-deg 85.1: expected a number from -85 to 85"),
        ("--dip-deg nan", "--dip-deg nan: expected a number from -85 to 85"),
    ],
)
def test_each_number_has_its_limits(paper, capsys, words, said):
    assert paper(*words.split()) == (BAD_INPUT if said else SUCCESS)
    assert capsys.readouterr().err == (f"h2nav: {said}\n" if said else "")


def test_the_assumptions_are_those_of_the_command_line(paper):
    assert paper() == SUCCESS
    needs, (assumptions, seeds) = paper.asked
    assert needs == ("synthesis", "evaluate paper", "scipy.linalg")
    assert (assumptions.dip_deg, assumptions.run_in_s, seeds) == (42.0, 150.0, 20)
    assert paper("--seeds", "3", "--dip-deg", "60", "--run-in-s", "9") == SUCCESS
    _, (assumptions, seeds) = paper.asked
    assert (assumptions.dip_deg, assumptions.run_in_s, seeds) == (60.0, 9.0, 3)


def test_the_document_has_ours_the_slides_and_what_is_far_from_them(paper, capsys):
    assert paper("--json", "--seeds", "2") == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert set(found) == {
        "case_1", "case_2", "slides", "slides_rms_outside_factor",
        "slides_min_max_outside_factor", "seeds", "assumptions",
    }  # fmt: skip
    assert found["seeds"] == 2
    assert (
        found["case_1"]["ekf_unit"]["rms_deg"] == found["slides"]["case_1"]["ekf_unit"]["rms_deg"]
    )
    (outside,) = found["slides_rms_outside_factor"]
    assert outside.endswith("slides 0.1107, here 0.2214")
    assert found["slides_min_max_outside_factor"] == []
    assumed = found["assumptions"]
    assert (assumed["rate_hz"], assumed["field_norm_ut"], assumed["field_dip_deg"]) == (100, 50, 42)
    assert assumed["run_in_s"] == 150.0


def test_people_see_the_slides_beside_ours(paper, capsys):
    assert paper() == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "Assumed, because the slides do not say (20 seeds):"
    place = lines.index("Case I: 25/20/28 deg sin(pi/50 t), 50 s")
    assert lines[place - 1] == ""
    slides = next(line for line in lines[place:] if line.startswith("slides eh2"))
    assert slides.split()[2:7] == ["0.0331", "/", "0.0538", "/", "0.1107"]
    assert slides.endswith("[-0.152 0.125] [-0.284 0.240] [-0.423 0.402]")
    ours = next(line for line in lines[place:] if line.startswith("eh2_paper"))
    assert ours.split()[1:6] == ["0.0331", "/", "0.0538", "/", "0.2214"]
    assert "0.1000 / 0.2000 / 0.3000" in ours
    assert "11 of the slides' 12 RMS figures within a factor 1.5" in lines
    assert "24 of the slides' 24 min-max figures within a factor 1.5" in lines
    assert lines[lines.index("11 of the slides' 12 RMS figures within a factor 1.5") + 1].endswith(
        "slides 0.1107, here 0.2214"
    )


def test_pictures_are_drawn_where_they_are_wanted(paper, monkeypatch, tmp_path, capsys):
    drawn = []
    monkeypatch.setattr(pictures, "draw_cases", lambda *words: drawn.append(words))
    assert paper() == SUCCESS
    assert drawn == []
    assert paper("--plots", str(tmp_path)) == SUCCESS
    assert ("plots", "--plots", "matplotlib.pyplot") in paper.asked
    ((_, folder),) = drawn
    assert folder == tmp_path
    assert capsys.readouterr().err == f"{tmp_path}: pictures written\n"
