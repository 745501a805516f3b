"""`h2nav fleet` as a user meets it: real reviews, on two processes."""

import json
from pathlib import Path

import pytest
from needs import shared_data
from pyarrow import parquet

from h2nav.cli import main


@pytest.mark.thorough
def test_a_fleet_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs, output = tmp_path / "logs", tmp_path / "out"
    logs.mkdir()
    whole = shared_data("flights/takeoff_40s.tlog").read_bytes()
    (logs / "start.tlog").write_bytes(whole[: len(whole) // 4])
    (logs / "garbage.bin").write_bytes(bytes(range(256)) * 20)
    words = ["fleet", str(logs), "-o", str(output), "--workers", "1", "--json"]
    assert main(words) == 0
    told = capsys.readouterr()
    assert "2 flights, dashboard http://127.0.0.1:" in told.err
    document = json.loads(told.out)
    assert (document["flights"], document["failed"], document["done_before"]) == (2, 1, 0)
    assert document["errors"][0]["error"].startswith("garbage.bin: not a recording")
    broken, flown = parquet.read_table(output / "flights.parquet").to_pylist()
    assert broken["error"]
    assert (flown["kind"], flown["error"]) == ("tlog", "")
    assert flown["duration_s"] > 5.0
    assert flown["start"].year >= 2020
    page = (output / flown["review"]).read_text(encoding="utf-8")
    assert "start" in page
    assert flown["review"] in (output / "index.html").read_text(encoding="utf-8")
    assert main(words) == 0
    assert json.loads(capsys.readouterr().out)["done_before"] == 2


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["nothing_here"], "nothing_here: no such file or folder"),
        ([".", "--workers", "0"], "--workers: expected at least 1"),
        ([".", "--workers", "1", "--scheduler", "tcp://127.0.0.1:1"], "leave one of them out"),
        ([".", "--memory-mb", "0"], "expected more than 0"),
        ([".", "-c", "none.yaml"], "none.yaml: cannot be read"),
        ([".", "--longest-s", "nan"], "expected more than 0"),
    ],
)
def test_wrong_words_are_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    assert main(["fleet", *words, "-o", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error
    assert error.count("\n") == 1
    assert not (tmp_path / "out").exists()
