"""`h2nav certify`: its statuses, and that each file is told what is wrong with it."""

import json
from types import SimpleNamespace

import pytest
from needs import REPOSITORY
from one_command import main

from h2nav.apps import extras
from h2nav.files import gain_files
from h2nav.synthesis import kinds

GOOD = str(REPOSITORY / "gains" / "rover_100hz.yaml")
WORSE = str(REPOSITORY / "gains" / "rover_50hz.yaml")


@pytest.fixture(autouse=True)
def judged(monkeypatch):
    """What is in a file is not looked at: every one is good but those of 50 Hz."""
    required = []

    def check(file, place):
        problems = ["unstable", "wide"] if "50hz" in place else []
        return SimpleNamespace(problems=problems, spectral_abscissa_per_s=-0.123456789, h2_norm=2.5)

    read = gain_files.read
    monkeypatch.setattr(kinds, "check", check)
    monkeypatch.setattr(gain_files, "read", lambda path: path if path.exists() else read(path))
    monkeypatch.setattr(extras, "require", lambda *words: required.append(words))
    return required


@pytest.mark.parametrize(
    ("files", "status"),
    [
        ([GOOD], 0),
        ([GOOD, WORSE], 1),
        ([WORSE, GOOD], 1),
        ([GOOD, "nowhere.yaml"], 2),
        ([WORSE, "nowhere.yaml"], 2),
    ],
)
def test_the_status_is_of_the_worst_file(files, status, capsys):
    assert main(["certify", *files, "--json"]) == status
    assert json.loads(capsys.readouterr().out)["ok"] is (status == 0)


def test_every_problem_is_a_line(judged, capsys):
    assert main(["certify", GOOD, WORSE, "no_such_name"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == (
        f"{GOOD}: certified: spectral abscissa -0.123457 1/s, H2 norm 2.5"
    )  # fmt: skip
    assert lines[1:3] == [
        f"{WORSE}: NOT certified: {WORSE}: unstable",
        f"{WORSE}: NOT certified: {WORSE}: wide",
    ]
    assert lines[3].startswith("no_such_name: NOT certified: gain file no_such_name: not shipped")
    assert judged == [("synthesis", "certify", "scipy.linalg")]


def test_the_document_has_the_figures_of_each_file(capsys):
    main(["certify", GOOD, WORSE, "nowhere.yaml", "--json"])
    files = json.loads(capsys.readouterr().out)["files"]
    assert files[GOOD] == {
        "ok": True, "unreadable": False, "spectral_abscissa": -0.123456789, "h2_norm": 2.5,
        "problems": [],
    }  # fmt: skip
    assert files[WORSE]["ok"] is False
    assert files[WORSE]["unreadable"] is False
    assert files[WORSE]["problems"] == [f"{WORSE}: unstable", f"{WORSE}: wide"]
    missing = files["nowhere.yaml"]
    assert (missing["ok"], missing["unreadable"], missing["h2_norm"]) == (False, True, None)
    assert missing["spectral_abscissa"] is None
    assert len(missing["problems"]) == 1
