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


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "[]",
        "{}",
        "3",
        '{"verdict": "", "airframe": "a"}',
        '{"verdict": "", "features": [1]}',
        '{"verdict": "", "flown": "far"}',
        '{"verdict": "", "parameters": {"A": "one"}}',
        '{"verdict": "", "start_utc": 7}',
    ],
)
def test_what_is_no_review_is_named(tmp_path, capsys, text):
    path = tmp_path / "bad.json"
    path.write_text(text)
    assert main(["compare", str(path), str(path)]) == BAD_INPUT
    assert "bad.json: not the JSON document of a review" in capsys.readouterr().err


AIRFRAME = {"id": "abc"}
FIRST = {
    "file": "a.bin", "verdict": "all is well", "start_utc": "2026-03-01T10:00:00Z",
    "vehicle": "quadrotor", "firmware": "4.5", "airframe": AIRFRAME,
    "parameters": {"INS_ACC_ID": 1.0, "ATC_RAT_RLL_P": 0.135, "ONLY_A": 2.0, "NAN": None},
    "features": {"imu_1_force_at_rest_m_s2": 9.8, "imu_1_gyro_temperature_deg_c": 20.0},
}  # fmt: skip
SECOND = FIRST | {
    "file": "b.bin", "start_utc": None, "verdict": "a compass is off",
    "parameters": {"INS_ACC_ID": 1.0, "ATC_RAT_RLL_P": 0.25, "NAN": None},
    "features": {"imu_1_force_at_rest_m_s2": 10.8},
}  # fmt: skip


def compare(folder, first, second):
    for name, document in (("a.json", first), ("b.json", second)):
        (folder / name).write_text(json.dumps(document))
    return main(["compare", str(folder / "a.json"), str(folder / "b.json")])


def test_people_see_both_flights_what_is_set_otherwise_and_which_figures_are_apart(
    tmp_path, capsys
):
    assert compare(tmp_path, FIRST, SECOND) == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    assert lines[:4] == [
        "A  a.bin: quadrotor 4.5, 2026-03-01 10:00:00 UTC",
        "   all is well",
        "B  b.bin: quadrotor 4.5, date unknown",
        "   a compass is off",
    ]
    assert "  ATC_RAT_RLL_P             0.135         0.25" in lines
    assert "  ONLY_A                        2            -" in lines
    assert not any("INS_ACC_ID" in line for line in lines)
    assert lines[-4:-2] == [
        "",
        "figures                            A          B   deviations apart",
    ]
    figures = {line.split()[0]: line.split()[1:] for line in lines if line.startswith("  imu_1")}
    assert figures["imu_1_force_at_rest_m_s2"][:2] == ["9.8", "10.8"]
    assert figures["imu_1_force_at_rest_m_s2"][3] == "<"  # far apart


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"airframe": {"id": "another"}}, "not of one airframe"),
        ({"airframe": {}}, "it is unknown whether they are of one airframe"),
        ({}, None),
        ({"parameters": {}}, "B holds no parameters: none are compared"),
        ({"parameters": FIRST["parameters"]}, "all parameters are equal"),
    ],
)
def test_what_cannot_be_compared_is_said(tmp_path, capsys, other, said):
    assert compare(tmp_path, FIRST, SECOND | other) == SUCCESS
    lines = capsys.readouterr().out.splitlines()
    told = [line for line in lines if "airframe" in line or "parameters" in line]
    assert [line for line in told if not line.startswith("parameters:")] == [said] * bool(said)


def test_equal_flights_are_apart_in_nothing(tmp_path, capsys):
    assert compare(tmp_path, FIRST, FIRST) == SUCCESS
    assert "<" not in capsys.readouterr().out
