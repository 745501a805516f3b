"""The channels of a log as tables: one per topic, until a message of it cannot be exported."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from h2nav.errors import BadInput
from h2nav.log.csv_export import export_csv

START_NS = 1_795_260_679_000_000_000


def log_of(path: Path, messages: list[tuple[str, object]]) -> Path:
    """A log of others: JSON messages by topic, a millisecond apart."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        channels = {
            topic: writer.register_channel(topic, "json", 0)
            for topic in dict.fromkeys(topic for topic, _ in messages)
        }
        for number, (topic, content) in enumerate(messages):
            t_ns = START_NS + 1_000_000 * number
            writer.add_message(channels[topic], t_ns, json.dumps(content).encode(), t_ns)
        writer.finish()
    return path


def test_each_topic_is_a_table_and_one_that_is_none_is_named(tmp_path: Path) -> None:
    messages = [
        ("/a", {"x": 1.5, "name": "one"}),
        ("/list", [1, 2]),
        ("/a", {"x": 2.5, "name": "two"}),
        ("/../b", {"y": 3}),
    ]
    found = export_csv(log_of(tmp_path / "a.mcap", messages), tmp_path / "out")
    assert {file.path.name: file.rows for file in found.files} == {"a.csv": 2, "b.csv": 1}
    assert found.skipped == {"/list": "messages are not JSON objects"}
    with (tmp_path / "out" / "a.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["x"], row["name"]) for row in rows] == [("1.5", "one"), ("2.5", "two")]
    assert [int(row["log_time [unix ns]"]) - START_NS for row in rows] == [0, 2_000_000]


def test_a_topic_that_is_not_there_is_named_with_those_that_are(tmp_path: Path) -> None:
    path = log_of(tmp_path / "a.mcap", [("/a", {"x": 1})])
    with pytest.raises(BadInput, match=r"no topic /c; the log has /a"):
        export_csv(path, tmp_path / "out", ["/c"])


def test_topics_that_make_one_name_have_files_of_their_own(tmp_path: Path) -> None:
    messages = [("/a/b", {"x": 1}), ("/a_b", {"y": 2}), ("/a b", {"z": 3}), ("/a/b", {"x": 4})]
    found = export_csv(log_of(tmp_path / "a.mcap", messages), tmp_path / "out")
    rows = {file.path.name: file.rows for file in found.files}
    assert rows == {"a_b.csv": 2, "a_b_.csv": 1, "a_b__.csv": 1}


@pytest.mark.parametrize(("sec", "nsec"), [(None, 1), ("1", "2"), ([1], 2), (1.5, 2), (1, None)])
def test_what_only_looks_like_a_time_stays_as_it_is(tmp_path: Path, sec: Any, nsec: Any) -> None:
    messages = [("/a", {"t_ns": {"sec": sec, "nsec": nsec}})]
    found = export_csv(log_of(tmp_path / "a.mcap", messages), tmp_path / "out")
    assert found.skipped == {}
    with found.files[0].path.open(encoding="utf-8") as stream:
        (row,) = csv.DictReader(stream)
    assert row["t_ns [ns]"] == str({"sec": sec, "nsec": nsec})


def test_no_table_is_left_of_an_export_that_failed(tmp_path: Path) -> None:
    path = log_of(tmp_path / "a.mcap", [("/a", {"x": 1}), ("/b", {"x": 1})])
    out = tmp_path / "out"
    with pytest.raises(BadInput, match="no topic /c"):
        export_csv(path, out, ["/a", "/c"])
    assert list(out.iterdir()) == []
    kept = export_csv(path, out, ["/b"]).files[0].path
    with pytest.raises(BadInput, match="exists"):
        export_csv(path, out)
    assert list(out.iterdir()) == [kept]
