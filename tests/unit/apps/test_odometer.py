"""The command `h2nav odometer`, and the file of components."""

import json

import pytest

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
