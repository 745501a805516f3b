"""`h2nav evaluate campaign` with flights that cost nothing: which are flown, kept and told."""

import functools
import json

import pytest
import yaml
from one_command import main

from h2nav.apps import evaluate_campaign, extras
from h2nav.cli import BAD_INPUT, SUCCESS
from h2nav.evaluation.campaign.draw import as_text, read_draw
from h2nav.fleet import program

READ = functools.cache(evaluate_campaign.read_distribution)


class Campaign:
    """Flies draws without an attitude; `flown` has their seeds in the order of flight."""

    def __init__(self, monkeypatch, folder):
        self.folder, self.flown, self.bad, self.digest = folder, [], set(), "this"
        monkeypatch.setattr(evaluate_campaign, "fly", self.fly)
        monkeypatch.setattr(evaluate_campaign, "read_distribution", READ)
        monkeypatch.setattr(program, "program_digest", lambda: self.digest)

    def fly(self, draw):
        self.flown.append(draw.seed)
        row = {
            "seed": draw.seed,
            "vehicle": draw.flight.vehicle,
            "length_s": draw.length_s,
            "imus": draw.imu.count,
            "rate_hz": draw.imu.rate_hz,
            "draw": as_text(draw),
            "cpu_s": 0.5,
            "handler_errors": 0,
            "estimated_share": 1.0,
        }
        if draw.seed in self.bad:
            return row
        percentiles = {"p50": 0.1, "p95": 0.2, "p100": 0.3}
        return row | {
            "heading_deg": percentiles, "tilt_deg": percentiles, "heading_wrong_s": 0.0,
            "tilt_wrong_s": 0.0, "nees_tilt": 1.0, "nees_heading": 1.0, "calm_h": 0.1,
            "false_accusations": [], "false_alarms": [], "faults": [],
        }  # fmt: skip

    def run(self, *words):
        self.flown.clear()
        words = [*words, "--workers", "1"] if "--scheduler" not in words else words
        return main(["evaluate", "campaign", *map(str, words)])


@pytest.fixture
def campaign(monkeypatch, tmp_path):
    return Campaign(monkeypatch, tmp_path)


def test_the_seeds_are_those_from_the_first_on_and_the_longest_flight_is_first(campaign, capsys):
    assert campaign.run("--flights", 5, "--first", 7, "--json") == SUCCESS
    assert sorted(campaign.flown) == [7, 8, 9, 10, 11]
    found = json.loads(capsys.readouterr().out)
    assert found["summary"]["flights"] == 5
    assert found["worst"] == []
    shipped = evaluate_campaign.read_distribution(evaluate_campaign._shipped())
    draws = [shipped.draw(seed) for seed in campaign.flown]
    costs = [draw.length_s * draw.imu.count * draw.imu.rate_hz for draw in draws]
    assert costs == sorted(costs, reverse=True)


def test_results_are_kept_and_those_of_another_program_are_flown_again(campaign, tmp_path):
    words = ("--flights", 3, "-o", tmp_path / "out")
    assert campaign.run(*words) == SUCCESS
    files = sorted((tmp_path / "out" / "flights").iterdir())
    assert [path.name for path in files] == ["0.json", "1.json", "2.json"]
    assert campaign.run(*words) == SUCCESS
    assert campaign.flown == []
    files[1].write_text("[]")
    assert campaign.run("--flights", 4, "-o", tmp_path / "out") == SUCCESS
    assert sorted(campaign.flown) == [1, 3]
    campaign.digest = "another"
    assert campaign.run(*words) == SUCCESS
    assert sorted(campaign.flown) == [0, 1, 2]
    assert campaign.run("--flights", 1, "--first", 1, "-o", tmp_path / "out") == SUCCESS
    assert campaign.flown == []


def test_without_a_folder_nothing_is_kept(campaign, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert campaign.run("--flights", 2) == SUCCESS
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("names_one", [False, True])
def test_people_get_the_command_that_flies_the_worst_again(campaign, capsys, tmp_path, names_one):
    campaign.bad = {1}
    mine = tmp_path / "mine.yaml"
    mine.write_text(evaluate_campaign._shipped().read_text())
    words = ["--distribution", mine] if names_one else []
    assert campaign.run("--flights", 3, *words) == SUCCESS
    option = f" --distribution {mine}" if names_one else ""
    assert f"h2nav evaluate campaign{option} --seed 1\n" in capsys.readouterr().out


def test_one_seed_is_shown_with_its_figures_as_remarks_of_its_draw(campaign, capsys, tmp_path):
    assert campaign.run("--seed", 3) == SUCCESS
    text = capsys.readouterr().out
    assert campaign.flown == [3]
    assert yaml.safe_load(text)["seed"] == 3
    assert "# cpu_s: 0.5\n" in text
    assert '# heading_deg: {"p50": 0.1, "p95": 0.2, "p100": 0.3}\n' in text
    assert "# draw" not in text
    (tmp_path / "one.yaml").write_text(text)
    assert campaign.run("--draw", tmp_path / "one.yaml", "--json") == SUCCESS
    row = json.loads(capsys.readouterr().out)
    assert (row["seed"], row["cpu_s"]) == (3, 0.5)


def test_shrinking_prints_the_small_draw_alone_and_says_how_bad_it_is(campaign, capsys, tmp_path):
    campaign.bad = {3}
    assert campaign.run("--seed", 3, "--shrink") == SUCCESS
    told = capsys.readouterr()
    (tmp_path / "small.yaml").write_text(told.out)
    small = read_draw(tmp_path / "small.yaml")
    assert small.seed == 3
    lines = told.err.splitlines()
    assert lines[-1] == "h2nav: badness 1000000"
    assert lines[0].startswith("h2nav: badness 1000000, ")
    assert lines[0].endswith(" faults")
    assert len(lines) <= evaluate_campaign.TRIALS + 1
    assert set(campaign.flown) == {3}


def test_of_a_campaign_the_worst_is_shrunk_if_any_is_bad(campaign, capsys):
    assert campaign.run("--flights", 2, "--shrink") == SUCCESS
    assert capsys.readouterr().err == ""
    campaign.bad = {1}
    assert campaign.run("--flights", 2, "--shrink") == SUCCESS
    told = capsys.readouterr()
    assert "seed: 1\n" in told.out
    assert told.err.splitlines()[-1] == "h2nav: badness 1000000"


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--flights", 1], ""),
        (["--seed", 0], ""),
        (["--seed", -1], "--first and --seed: expected at least 0"),
        (["--flights", -1], "--flights: expected at least 1, found -1"),
        (
            ["--scheduler", "tcp://host:1", "--workers", 2],
            "--workers: the cluster at --scheduler has its own; leave one out",
        ),
    ],
)
def test_numbers_have_their_limits(campaign, capsys, monkeypatch, words, said):
    monkeypatch.setattr(extras, "require", lambda *needs: None)
    assert campaign.run(*words) == (BAD_INPUT if said else SUCCESS)
    assert capsys.readouterr().err == (f"h2nav: {said}\n" if said else "")


def test_what_pictures_and_clusters_need_is_asked_for_first(campaign, monkeypatch):
    asked = []

    def require(*needs):
        asked.append(needs)
        raise KeyboardInterrupt

    monkeypatch.setattr(extras, "require", require)
    campaign.run("--plots", "p")
    campaign.run("--scheduler", "tcp://host:1")
    assert asked == [
        ("plots", "--plots", "matplotlib.pyplot"),
        ("fleet", "--scheduler", "distributed"),
    ]
    assert campaign.flown == []
