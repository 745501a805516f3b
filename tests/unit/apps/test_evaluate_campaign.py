"""`h2nav evaluate campaign`: flights of a minute, from the command line."""

import json

import pytest
import yaml
from needs import REPOSITORY, need_package

from h2nav.apps import campaign_flights, evaluate_campaign
from h2nav.cli import main
from h2nav.errors import BadInput
from h2nav.evaluation.campaign.draw import Draw

SHIPPED = REPOSITORY / "configs" / "campaign.yaml"


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A distribution of flights that cost a second each."""
    ranges = yaml.safe_load(SHIPPED.read_text())
    ranges["flight"] |= {"length_min": {"value": 1.0}, "rest_s": {"value": 8.0}}
    ranges["imu"] |= {"count": {"value": 1}, "rate_hz": {"value": 50.0}}
    path = tmp_path_factory.mktemp("campaign") / "short.yaml"
    path.write_text(yaml.safe_dump(ranges))
    return path


def campaign(*words):
    return main(["evaluate", "campaign", *map(str, words)])


@pytest.fixture(scope="module")
def flown(short, tmp_path_factory):
    """Two flights, with results on disk and pictures."""
    folder = tmp_path_factory.mktemp("flown")
    lines: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.stdout.write", lines.append)
        words = ("--distribution", short, "--flights", 2, "-o", folder, "--workers", 1)
        assert campaign(*words, "--json") == 0
    return folder, json.loads("".join(lines))


def test_the_json_has_the_keys_that_others_read(flown):
    _, document = flown
    assert set(document) == {"summary", "worst"}
    found = document["summary"]
    assert found["flights"] == 2
    assert found["hours"] == pytest.approx(2 / 60)
    assert found["without_attitude"] == found["handler_errors"] == 0
    assert {"errors_deg", "nees", "false_accusations_per_100_h", "faults", "by_fault"} <= set(found)
    assert found["faults"]["count"] == sum(row["count"] for row in found["by_fault"].values())


def test_an_interrupted_campaign_goes_on_where_it_was(flown, short, monkeypatch, capsys):
    folder, document = flown
    (folder / "flights" / "1.json").write_text('{"seed": 1, "cut o')
    again: list[int] = []
    fly = evaluate_campaign.fly
    monkeypatch.setattr(evaluate_campaign, "fly", lambda draw: again.append(draw.seed) or fly(draw))
    words = ("--distribution", short, "--flights", 2, "-o", folder, "--workers", 1)
    assert campaign(*words, "--json") == 0
    assert again == [1]
    found = json.loads(capsys.readouterr().out)
    for each in (found, document):
        del each["summary"]["cpu_s"]
    assert found["summary"] == document["summary"]


def test_results_of_another_distribution_are_flown_again(flown, short, monkeypatch, capsys):
    folder, _ = flown
    other = short.with_name("other.yaml")
    other.write_text(short.read_text() + "\n# changed\n")
    again: list[int] = []
    row = json.loads((folder / "flights" / "0.json").read_text())
    monkeypatch.setattr(
        evaluate_campaign, "fly", lambda draw: again.append(draw.seed) or row | {"seed": draw.seed}
    )
    words = ("--distribution", other, "--flights", 2, "-o", folder, "--workers", 1)
    assert campaign(*words) == 0
    assert sorted(again) == [0, 1]
    assert "2 flights, 0.0 h" in capsys.readouterr().out


def test_a_seed_and_its_printed_draw_are_the_same_flight(short, tmp_path, capsys):
    assert campaign("--distribution", short, "--seed", 0) == 0
    printed = capsys.readouterr().out
    path = tmp_path / "draw.yaml"
    path.write_text(printed)
    assert campaign("--draw", path, "--json") == 0
    row = json.loads(capsys.readouterr().out)
    assert f"# heading_deg: {json.dumps(row['heading_deg'])}" in printed
    assert row["seed"] == 0


@pytest.mark.thorough
def test_pictures_are_drawn(flown, short, tmp_path, capsys):
    need_package("matplotlib")
    folder, _ = flown
    words = ("--distribution", short, "--flights", 2, "-o", folder, "--workers", 1)
    assert campaign(*words, "--plots", tmp_path) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"survival.png", "faults.png"}
    capsys.readouterr()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--flights", "0"], "--flights: expected at least 1, found 0"),
        (["--workers", "0"], "--workers: expected at least 1, found 0"),
        (["--first", "-1"], "--first and --seed: expected at least 0"),
        (["--shrink", "--json"], "leave out --json"),
        (["--distribution", "nowhere.yaml"], "nowhere.yaml: cannot be read"),
        (["--draw", "nowhere.yaml"], "nowhere.yaml: cannot be read"),
    ],
)
def test_bad_input_is_one_line(words, said, capsys):
    assert campaign(*words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_fault_that_no_campaign_scores_is_refused(tmp_path, capsys):
    path = tmp_path / "draw.yaml"
    path.write_text("seed: 1\nfaults: ['gyro-zero@40+20', 'drop@40+20']\n")
    assert campaign("--draw", path) == 2
    assert f"{path}: faults: no campaign has drop; leave it out" in capsys.readouterr().err


def test_a_worker_of_another_program_flies_nothing(monkeypatch):
    monkeypatch.setattr(campaign_flights, "fly", lambda draw: {"seed": draw.seed})
    monkeypatch.setattr(campaign_flights, "program_digest", lambda: "this")
    assert campaign_flights.fly_by("this", Draw(3)) == {"seed": 3}
    with pytest.raises(BadInput, match="another h2nav than here"):
        campaign_flights.fly_by("another", Draw(3))
