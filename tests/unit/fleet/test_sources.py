"""Which recordings are found behind the addresses that people type."""

import zipfile
from pathlib import Path

import fsspec
import pytest

from h2nav.errors import BadInput
from h2nav.fleet.sources import find


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("b.tlog", "a/c.BIN", "a/d.ulg", "a/notes.txt", "e.mcap"):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(name.encode())
    return tmp_path


def test_folders_are_searched_with_all_below_them(folder: Path) -> None:
    found = find([str(folder), str(folder / "b.tlog")])
    assert [source.address for source in found] == [
        str(folder / name) for name in ("a/c.BIN", "a/d.ulg", "b.tlog", "e.mcap")
    ]
    assert [source.size for source in found] == [7, 7, 6, 6]
    assert all(source.is_local for source in found)


def test_a_named_file_is_taken_whatever_its_name(folder: Path) -> None:
    (source,) = find([str(folder / "a" / "notes.txt")])
    assert source.name == "notes.txt"


def test_patterns_and_file_urls(folder: Path) -> None:
    by_pattern = find([f"{folder}/**/*.ulg"])
    assert by_pattern == find([f"file://{folder}/a/d.ulg"])
    (folder / "odd[1].tlog").write_bytes(b"x")
    assert [source.name for source in find([f"{folder}/odd[1].tlog"])] == ["odd[1].tlog"]


def test_archives_and_object_stores(folder: Path) -> None:
    archive = folder / "logs.zip"
    with zipfile.ZipFile(archive, "w") as target:
        target.writestr("day/one.tlog", b"1")
        target.writestr("day/readme.txt", b"2")
    (inside,) = find([f"zip::file://{archive}"])
    assert inside.address == f"zip://day/one.tlog::file://{archive}"
    assert (inside.name, inside.size, inside.is_local) == ("one.tlog", 1, False)
    assert find([f"zip://day/*.tlog::file://{archive}"]) == [inside]
    with fsspec.open(inside.address) as stream:
        assert stream.read() == b"1"
    store = fsspec.filesystem("memory")
    store.pipe("/fleet/x.tlog", b"123")
    try:
        (remote,) = find(["memory://fleet"])
        assert remote.address == "memory:///fleet/x.tlog"
    finally:
        store.rm("/fleet", recursive=True)


def test_the_key_changes_with_file_and_work(folder: Path) -> None:
    (before,) = find([str(folder / "b.tlog")])
    (folder / "b.tlog").write_bytes(b"longer than it was")
    (after,) = find([str(folder / "b.tlog")])
    keys = {before.key("1"), after.key("1"), after.key("2"), after.key("1", "x")}
    assert len(keys) == 4
    assert after.key("1") == find([str(folder / "b.tlog")])[0].key("1")


@pytest.mark.parametrize(
    "address", ["none.tlog", "*.none", "file:///no/such", "zip::b.tlog", "nope://x", "empty"]
)
def test_what_leads_to_nothing_is_named(
    folder: Path, monkeypatch: pytest.MonkeyPatch, address: str
) -> None:
    monkeypatch.chdir(folder)
    (folder / "empty").mkdir()
    with pytest.raises(BadInput) as caught:
        find([address, str(folder)])
    (line,) = caught.value.lines
    assert line.startswith(f"{address}: ")
