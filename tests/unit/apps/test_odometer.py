"""The command `h2nav odometer`, and the file of components."""

import json
import math

import pytest

from h2nav.airframes import odometer
from h2nav.airframes.odometer import Odometer
from h2nav.cli import BAD_INPUT, SUCCESS, main


@pytest.fixture
def reviews(tmp_path):
    folder = tmp_path / "reviews"
    folder.mkdir()
    for day in (1, 2, 3):
        own = {
            "name": f"flight {day}",
            "airframe": {"id": "uid:1"},
            "start_utc": f"2026-01-0{day}T00:00:00Z",
            "features": {},
            "flown": {"flown_s": 1800.0, "distance_m": 5e3, "landings": 1, "hard_landings": 0},
        }
        (folder / f"{day}.json").write_text(json.dumps(own))
    return folder


def test_the_sums_are_told(reviews, tmp_path, capsys):
    components = tmp_path / "components.yaml"
    components.write_text('uid:1:\n  motor 2: "2026-01-02"\n')
    assert main(["odometer", str(reviews), "--components", str(components)]) == SUCCESS
    whole, motor = capsys.readouterr().out.splitlines()
    assert whole.startswith(
        "uid:1: 3 flights, 1.50 h, 15.0 km, 3 landings, 0 of them hard, since 2"
    )
    assert motor.startswith("  motor 2: 2 flights, 1.00 h")
    assert main(["odometer", str(reviews), "--json"]) == SUCCESS
    (found,) = json.loads(capsys.readouterr().out)
    assert found["flown_s"] == 5400.0
    assert found["since_utc"] == "2026-01-01T00:00:00Z"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("uid:1: 3\n", "uid:1: expected a date in quotes"),
        ("uid:1:\n  motor 2: soon\n  motor 1: 4\n", "motor 2: 'soon'; expected a date"),
        ("uid:1:\n  motor 2: 2026-01-02\n", "put it in quotes"),
        ("uid:1:\n  motor 2: '0001-01-01T00:00:00+01:00'\n", "expected a date"),
        ("uid:1:\n  motor 2: '9999-12-31T23:59:59-01:00'\n", "expected a date"),
    ],
)
def test_a_wrong_file_is_named_with_the_remedy(reviews, tmp_path, capsys, text, said):
    components = tmp_path / "components.yaml"
    components.write_text(text)
    assert main(["odometer", str(reviews), "--components", str(components)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert "components.yaml" in error
    assert said in error


@pytest.mark.parametrize(
    ("found", "said"),
    [
        ((), ["no flight of a known airframe"]),
        (
            (
                Odometer("uid:1", "", 1_767_225_600.9, 3, 5400.0, 15_040.0, 4, 1),
                Odometer("uid:1", "motor 2", math.nan, 1, 90.0, 950.0, 0, 0),
            ),
            [
                "uid:1: 3 flights, 1.50 h, 15.0 km, 4 landings, 1 of them hard, "
                "since 2026-01-01T00:00:00Z",
                "  motor 2: 1 flights, 0.03 h, 0.9 km, 0 landings, 0 of them hard, "
                "since an unknown date",
            ],
        ),
    ],
)
def test_each_airframe_and_component_has_a_line_and_a_document(
    tmp_path, monkeypatch, capsys, found, said
):
    monkeypatch.setattr(odometer, "odometers", lambda rows, changes: found)
    assert main(["odometer", str(tmp_path)]) == SUCCESS
    assert capsys.readouterr().out.splitlines() == said
    assert main(["odometer", "--json", str(tmp_path)]) == SUCCESS
    dates = ["2026-01-01T00:00:00Z", None]
    assert json.loads(capsys.readouterr().out) == [
        {
            "airframe": one.airframe, "component": one.component, "flights": one.flights,
            "flown_s": one.flown_s, "distance_m": one.distance_m, "landings": one.landings,
            "hard_landings": one.hard_landings, "since_utc": date,
        }
        for one, date in zip(found, dates, strict=False)
    ]  # fmt: skip


def test_all_folders_count_and_only_components_that_are_named(reviews, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    (reviews / "3.json").rename(other / "3.json")
    assert main(["odometer", str(reviews), str(other)]) == SUCCESS
    (line,) = capsys.readouterr().out.splitlines()
    assert line.startswith("uid:1: 3 flights")
