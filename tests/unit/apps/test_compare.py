"""The command `h2nav compare`."""

import json

import pytest
from replayed import rewritten

from h2nav.cli import BAD_INPUT, SUCCESS, main


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return rewritten(tmp_path_factory.mktemp("flight") / "short.tlog", first_s=12.0)


def test_a_flight_and_its_review_are_alike(flight, tmp_path, capsys):
    assert main(["review", str(flight), "-o", str(tmp_path), "--no-smooth"]) == SUCCESS
    capsys.readouterr()
    review = tmp_path / "short.json"
    assert main(["compare", str(flight), str(review), "--json"]) == SUCCESS
    found = json.loads(capsys.readouterr().out)
    assert found["flights"][0]["verdict"] == found["flights"][1]["verdict"]
    assert found["same_airframe"] is True
    assert found["parameters"] == {}
    assert found["features"]
    assert all(pair["first"] == pytest.approx(pair["second"]) for pair in found["features"])
    assert main(["compare", str(review), str(review)]) == SUCCESS
    said = capsys.readouterr().out
    assert said.count("short.tlog") == 2
    assert "imu_1_force_at_rest_m_s2" in said


@pytest.mark.parametrize("text", ["{", "[]", "{}", "3", '{"verdict": "", "airframe": "a"}'])
def test_what_is_no_review_is_named(tmp_path, capsys, text):
    path = tmp_path / "bad.json"
    path.write_text(text)
    assert main(["compare", str(path), str(path)]) == BAD_INPUT
    assert "bad.json: not the JSON document of a review" in capsys.readouterr().err
