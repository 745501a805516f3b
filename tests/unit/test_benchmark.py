"""tools/benchmark/score.py, on made reviews: shares, intervals, what counts and what not."""

import json
from pathlib import Path

import pytest
from needs import tool


@pytest.fixture
def score():
    return tool("benchmark/score")


def finding(kind, from_s, to_s=None, severity="warning", cause=None, source="IMU 1"):
    return {
        "id": f"{kind}.1", "kind": kind, "source": source, "severity": severity, "from_s": from_s,
        "to_s": to_s or from_s, "consequence_of": cause,
    }  # fmt: skip


def label(sha256, kind, from_s, verdict):
    row = {"sha256": sha256, "kind": kind, "source": "IMU 1"}
    return {**row, "from_s": from_s, "verdict": verdict}


def test_an_interval_is_wilsons(score):
    low, high = score.Share(9, 10).interval
    assert (low, high) == pytest.approx((0.5958, 0.9821), abs=1e-4)
    assert score.Share(0, 0).interval == (0.0, 1.0)
    assert str(score.Share(5, 5)).startswith("5 of 5 = 100.0 % (56.6 to 100.0)")


def test_made_reviews_are_scored_by_every_label_file(score, monkeypatch):
    tables = {
        "events.csv": [
            {"sha256": "a", "event": "crash", "t_s": "50", "first_cause": "vibration"},
            {"sha256": "a", "event": "vibration", "t_s": "40", "first_cause": ""},
            {"sha256": "b", "event": "no_crash", "t_s": "", "first_cause": ""},
            {"sha256": "elsewhere", "event": "crash", "t_s": "1", "first_cause": "battery"},
        ],
        "judged.csv": [
            label("a", "vibration", "41", "true"),
            label("b", "gyro_bias", "0", "false"),
            label("b", "baro", "5", "unclear"),
        ],
        "sentences.csv": [
            {"sha256": "a", "begins": "Vibration", "verdict": "true"},
            {"sha256": "b", "begins": "Nothing", "verdict": "true"},
        ],
    }  # fmt: skip
    monkeypatch.setattr(score, "rows", tables.__getitem__)
    reviews = {
        "a": {
            "file": "a.bin",
            "verdict": "Vibration grew, then it crashed.",
            "findings": [
                finding("crash", 52.0, severity="critical", cause="vibration.1"),
                finding("vibration", 41.0),
            ],
        },
        "b": {
            "file": "b.bin",
            "verdict": "A gyro was off.",
            "findings": [
                finding("crash", 3.0, severity="critical"),
                finding("gyro_bias", 1.0, severity="error"),
                finding("baro", 5.0),
                finding("gps_lost", 9.0, severity="notice"),
            ],
        },
    }
    told, false, short = score.recall(reviews)
    assert told == {"crash": (1, 1), "vibration": (1, 1)}
    assert false == {"crash": (1, 1)}
    shares, unclear, new, wrong = score.judged(reviews)
    assert shares == {"error": (0, 1), "warning": (1, 1)}
    assert (unclear, new) == (1, 2)
    assert score.sentences(reviews) == ((1, 1), 1)
    assert score.first_causes(reviews) == (1, 1)
    assert score.delays(reviews) == {"crash": [2.0], "vibration": [1.0]}
    assert (len(short), len(wrong)) == (1, 1)
    assert "| true: errors | 0 of 1" in score.table(reviews, lists=True)


def test_logs_without_labels_are_refused_in_one_line(score, tmp_path, capsys):
    (tmp_path / "own.bin").write_bytes(b"no labelled log")
    assert score.main([str(tmp_path)]) == 1
    assert "docs/benchmark.md" in capsys.readouterr().err


def test_every_label_is_complete(score):
    verdicts = {"true", "false", "unclear"}
    assert {row["verdict"] for row in score.rows("judged.csv")} <= verdicts
    assert {row["verdict"] for row in score.rows("sentences.csv")} <= verdicts
    for row in score.rows("judged.csv"):
        assert len(row["sha256"]) == 16
        assert json.loads(row["from_s"]) >= 0.0
        assert row["measured"] in verdicts
        # Empty: judged once.
        assert row["measured_again"] in verdicts | {""}


def test_logs_of_one_name_have_reviews_of_their_own(score):
    known = {"1f": Path("a/00000001.BIN"), "2f": Path("b/00000001.BIN"), "3f": Path("a/2.BIN")}
    places = score.folders(known, Path("reviews"))
    assert len(set(places.values())) == 3
    assert places["3f"] == Path("reviews/2.BIN")
