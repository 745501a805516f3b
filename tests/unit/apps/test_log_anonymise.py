"""The command `h2nav log anonymise`."""

import json

import pytest
from replayed import rewritten

from h2nav.apps import log_anonymise
from h2nav.apps.log_anonymise import differences
from h2nav.cli import BAD_INPUT, SUCCESS, main


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return rewritten(tmp_path_factory.mktemp("flight") / "short.tlog", first_s=12.0)


def test_a_flight_elsewhere_has_the_same_findings(flight, tmp_path, capsys):
    output = tmp_path / "new.tlog"
    assert main(["log", "anonymise", str(flight), "-o", str(output), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["remains"] == []
    assert found["differences"] == []
    assert found["moved"]
    assert found["weeks"] >= 1
    assert found["replaced"]["places"] > 50
    assert main(["log", "anonymise", str(flight), "-o", str(output)]) == BAD_INPUT
    assert "exists" in capsys.readouterr().err


def test_a_place_of_ones_own(flight, tmp_path, capsys):
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--no-check", "--keep-date"]
    assert main([*words, "--to", "47.4"]) == BAD_INPUT
    assert "expected LAT,LON" in capsys.readouterr().err
    assert main([*words, "--to", "47.4,8.5", "--far"]) == BAD_INPUT
    assert not output.exists()
    capsys.readouterr()
    assert main([*words, "--to", "47.4,8.5"]) == SUCCESS
    assert "not reviewed" in capsys.readouterr().out


ONE, OTHER = (
    {
        "kind": kind, "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.0,
        "text": "near a magnet",
    }
    for kind in ("magnet", "iron")
)  # fmt: skip


@pytest.fixture
def reviewed(monkeypatch):
    """Reviews that find what a test puts into the list; the bytes that they were given."""
    found, given = [], []

    def review(path):
        given.append(path.read_bytes())
        return {"airframe": {"uid": ""}, "findings": found[len(given) - 1]}

    monkeypatch.setattr(log_anonymise, "_reviewed", review)
    return found, given


def test_another_place_is_drawn_where_a_finding_is_at_its_limit(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE], [], [ONE]]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json"]
    assert main(words) == SUCCESS
    document = json.loads(capsys.readouterr().out)
    assert document["draws"] == 2
    assert document["differences"] == document["remains"] == []
    assert document["path"] == str(output)
    assert output.read_bytes() == given[2] != given[1]
    assert list(tmp_path.iterdir()) == [output]


@pytest.mark.thorough
def test_of_places_that_all_differ_the_best_is_kept(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE, OTHER], [], [], [ONE], [], [OTHER]]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json"]
    assert main(words) == 1
    document = json.loads(capsys.readouterr().out)
    assert document["draws"] == 5
    assert document["differences"] == ["no longer found: warning: 1.0 s: IMU 1: near a magnet"]
    assert output.read_bytes() == given[3]
    assert list(tmp_path.iterdir()) == [output]


def test_a_place_of_ones_own_is_drawn_once(flight, tmp_path, capsys, reviewed):
    found, given = reviewed
    found += [[ONE], []]
    output = tmp_path / "new.tlog"
    words = ["log", "anonymise", str(flight), "-o", str(output), "--json", "--to", "47.4,8.5"]
    assert main(words) == 1
    assert len(given) == 2


def test_what_cannot_be_done_is_named(tmp_path, capsys):
    path = tmp_path / "x.bin"
    path.write_bytes(b"nothing")
    assert main(["log", "anonymise", str(path), "-o", str(tmp_path / "y")]) == BAD_INPUT
    assert "not a recording" in capsys.readouterr().err


def test_findings_that_differ_are_told():
    one = {
        "kind": "magnet", "source": "IMU 1", "severity": "warning", "from_s": 1.0, "to_s": 2.0,
        "text": "near a magnet",
    }  # fmt: skip
    assert differences([one], [one]) == []
    assert differences([one], [{**one, "from_s": 1.3}]) == []
    assert len(differences([one], [{**one, "from_s": 3.0}])) == 2
    assert differences([one], []) == ["no longer found: warning: 1.0 s: IMU 1: near a magnet"]
