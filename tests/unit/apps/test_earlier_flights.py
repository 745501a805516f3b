"""Rows of earlier flights out of folders of reviews."""

import json

import pytest

from h2nav.apps import earlier_flights
from h2nav.apps.earlier_flights import row_in, rows_in
from h2nav.errors import BadInput


def document(name, **changes):
    own = {
        "name": name,
        "airframe": {"id": "uid:1"},
        "start_utc": "2026-01-01T00:00:00Z",
        "features": {"motor_1_us": 3.0},
        "flown": {"flown_s": 60.0, "distance_m": 1.0, "landings": 1, "hard_landings": 0},
    }
    return json.dumps({**own, **changes})


def test_documents_are_rows_and_other_files_are_passed_over(tmp_path):
    (tmp_path / "a.json").write_text(document("a"))
    (tmp_path / "b.json").write_text(document("b", features=None))
    (tmp_path / "c.json").write_text("{")
    (tmp_path / "d.json").write_text("[1]")
    (tmp_path / "e.html").write_text(document("e"))
    (tmp_path / "f.json").mkdir()
    assert [row.flight for row in rows_in([tmp_path])] == ["a"]
    assert rows_in([]) == ()


def test_a_missing_folder_is_named(tmp_path):
    with pytest.raises(BadInput, match="nowhere: No such file"):
        rows_in([tmp_path / "nowhere"])


def test_several_folders_are_read_in_their_order_each_by_the_names_of_its_files(tmp_path):
    for folder, names in (("b", "yx"), ("a", "z")):
        (tmp_path / folder).mkdir()
        for name in names:
            (tmp_path / folder / f"{name}.json").write_text(document(name))
    found = rows_in([tmp_path / "b", tmp_path / "a"])
    assert [row.flight for row in found] == ["x", "y", "z"]


@pytest.mark.parametrize(("more", "is_read"), [(0, True), (1, False)])
def test_what_is_larger_than_any_review_is_not_read(tmp_path, monkeypatch, more, is_read):
    assert earlier_flights._MAX_BYTES == 64 * 1024 * 1024
    path = tmp_path / "a.json"
    path.write_text(document("a"))
    monkeypatch.setattr(earlier_flights, "_MAX_BYTES", path.stat().st_size - more)
    assert (row_in(path) is not None) == is_read
    assert row_in(tmp_path / "none.json") is None
