"""Which recordings are found behind the addresses that people type."""

import re
import zipfile
from pathlib import Path
from typing import ClassVar

import fsspec
import pytest

from h2nav.errors import BadInput
from h2nav.fleet.sources import FlightSource, find


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


def test_a_key_is_32_digits_and_takes_names_of_any_bytes() -> None:
    source = FlightSource("/logs/flight-\udcff.tlog", 5, "1")
    assert re.fullmatch(r"[0-9a-f]{32}", source.key("work"))
    others = [source._replace(address="/a"), source._replace(size=6), source._replace(stamp="2")]
    assert len({each.key("work") for each in (source, *others)}) == 4


class Files(fsspec.AbstractFileSystem):
    """A store of one file that says of it what a test wants."""

    protocol = "h2navtest"
    about: ClassVar[dict[str, object]] = {}

    def exists(self, path, **_):
        return bool(self.info(path))  # other stores tell of errors too

    def info(self, path, **_):
        if path.endswith("denied"):
            raise PermissionError(13, "Permission denied")
        if path.endswith("odd"):
            raise RuntimeError("no  such\nbucket")
        if path.endswith("silent"):
            raise ValueError
        if not path.endswith("a.bin"):
            raise FileNotFoundError(path)
        return {"name": path, "type": "file", **self.about}


@pytest.fixture
def files(monkeypatch: pytest.MonkeyPatch) -> type[Files]:
    fsspec.register_implementation("h2navtest", Files, clobber=True)
    return Files


@pytest.mark.parametrize(
    ("about", "size", "stamp"),
    [
        ({}, 0, ""),
        ({"size": None}, 0, ""),
        ({"size": 7, "mtime": 5.5}, 7, "5.5"),
        ({"mtime": 5.5, "ETag": "x"}, 0, "x"),
        ({"ETag": None, "modified": 0}, 0, "0"),
        ({"modified": 2, "CRC": 1}, 0, "1"),
    ],
)
def test_the_version_of_a_file_is_its_tag_or_else_its_time(
    files: type[Files], monkeypatch: pytest.MonkeyPatch, about: dict, size: int, stamp: str
) -> None:
    monkeypatch.setattr(files, "about", about)
    files.clear_instance_cache()
    (found,) = find(["h2navtest://a.bin"])
    assert (found.address, found.size, found.stamp) == ("h2navtest://a.bin", size, stamp)


def test_each_address_that_leads_nowhere_has_a_line_with_its_reason(
    files: type[Files], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    typed = ["none.tlog", "empty", "h2navtest://denied", "h2navtest://odd", "h2navtest://silent"]
    with pytest.raises(BadInput) as caught:
        find(typed)
    assert caught.value.lines == (
        "none.tlog: no such file or folder; expected recordings",
        "empty: no recordings (.tlog .bin .log .ulg .mcap .mcap.active .bytes) in it; name files "
        "or a folder",
        "h2navtest://denied: Permission denied; expected a recording or a folder",
        "h2navtest://odd: RuntimeError: no such bucket",
        "h2navtest://silent: ValueError; expected a recording or a folder",
    )


@pytest.mark.parametrize(
    ("address", "name", "is_local"),
    [
        ("/logs/a.bin", "a.bin", True),
        ("s3://bucket/a.bin", "a.bin", False),
        ("zip://day/a.bin::/logs/x.zip", "a.bin", False),
        ("zip::/logs/x.zip", "zip", False),
        ("s3://bucket/folder/", "folder", False),
    ],
)
def test_the_name_is_that_of_the_file(address: str, name: str, is_local: bool) -> None:
    source = FlightSource(address, 0, "")
    assert (source.name, source.is_local) == (name, is_local)


def test_a_folder_of_a_name_like_a_recording_is_none(tmp_path: Path) -> None:
    (tmp_path / "a.bin").mkdir()
    (tmp_path / "a.bin" / "b.BIN").write_bytes(b"1")
    (found,) = find([f"{tmp_path}/*.bin/*", f"{tmp_path}/a*/b*"])
    assert found.name == "b.BIN"
    with pytest.raises(BadInput, match="no recordings"):
        find([f"{tmp_path}/*.bin"])
