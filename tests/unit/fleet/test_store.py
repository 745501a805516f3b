"""The store of results: the same in a folder and behind an address."""

import pickle
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest

from h2nav.fleet import store as stores
from h2nav.fleet.store import Store


@pytest.fixture(params=["folder", "address"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Store]:
    if request.param == "folder":
        yield Store(str(tmp_path / "out"))
        return
    files = fsspec.filesystem("memory")
    try:
        yield Store("memory://store-of-a-test")
    finally:
        if files.exists("/store-of-a-test"):
            files.rm("/store-of-a-test", recursive=True)


def test_what_was_written_is_read_until_it_is_removed(store: Store) -> None:
    assert store.read("results/a") is None
    assert store.names("results") == set()
    store.write("results/a", b"1")
    store.write("results/a", b"2")
    store.write("results/b", b"3")
    assert store.read("results/a") == b"2"
    assert store.names("results") == {"a", "b"}
    store.remove("results/a")
    store.remove("results/a")
    assert store.names("results") == {"b"}


def test_a_file_is_taken_as_it_is(store: Store, tmp_path: Path) -> None:
    file = tmp_path / "page"
    file.write_bytes(b"page")
    store.take(file, "reviews/x/page.html")
    assert store.read("reviews/x/page.html") == b"page"
    assert file.exists()
    assert store.names("reviews/x") == {"page.html"}


def test_many_are_read_in_the_order_that_is_asked_for(
    store: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stores, "_BATCH", 2)
    names = [f"r/{number}" for number in range(5, 0, -1)]
    for name in names:
        store.write(name, name.encode())
    assert list(store.read_all(iter(names))) == [(name, name.encode()) for name in names]


def test_another_process_finds_the_same(store: Store) -> None:
    store.write("a", b"1")
    other = pickle.loads(pickle.dumps(store))
    assert (other.address, other.is_folder, other.read("a")) == (
        store.address,
        store.is_folder,
        b"1",
    )


@pytest.mark.parametrize(
    ("typed", "is_folder", "place"),
    [
        ("out", True, "CWD/out/a"),
        ("file://HOME/out/", True, "HOME/out/a"),
        ("~/out", True, "HOME/out/a"),
        ("memory://out/", False, "memory://out/a"),
    ],
)
def test_a_folder_has_a_whole_path_and_an_address_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, typed: str, is_folder: bool, place: str
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))

    def named(text: str) -> str:
        return text.replace("CWD", str(tmp_path)).replace("HOME", str(tmp_path / "home"))

    made = Store(named(typed))
    assert (made.is_folder, made.place("a")) == (is_folder, named(place))


@pytest.mark.parametrize("is_taken", [False, True])
def test_in_a_folder_a_file_has_its_name_when_it_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_taken: bool
) -> None:
    made, file = Store(str(tmp_path / "out")), tmp_path / "file"
    file.write_bytes(b"whole")
    begun = []
    rename = Path.replace

    def renamed(path: Path, target: Path) -> Path:
        begun.append((path.name, path.read_bytes(), target.exists()))
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", renamed)
    if is_taken:
        made.take(file, "a")
    else:
        made.write("a", b"whole")
    assert begun == [(".a.part", b"whole", False)]
    assert made.names("") == {"a"}
