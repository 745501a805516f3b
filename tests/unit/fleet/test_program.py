"""A changed program reviews again: what its digest tells apart."""

import shutil
from pathlib import Path

import pytest

from h2nav.fleet.program import digest_of, program_digest

FILES = {"cli.py": "a = 1", "review/page.py": "b = 2", "review/assets/page.css": "p {}"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / "h2nav" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    (tmp_path / "rover.yaml").write_text("gains: 1")
    return tmp_path


def digest(folder: Path) -> str:
    return digest_of(folder / "h2nav", {"rover": folder / "rover.yaml"})


def test_code_pages_and_gains_count(folder: Path) -> None:
    found = {digest(folder)}
    for name in (*(f"h2nav/{name}" for name in FILES), "rover.yaml"):
        with (folder / name).open("a") as stream:
            stream.write(" ")
        found.add(digest(folder))
    (folder / "h2nav/cli.py").rename(folder / "h2nav/cli2.py")
    found.add(digest(folder))
    assert len(found) == 6


def test_what_was_compiled_and_where_it_lies_do_not(folder: Path, tmp_path: Path) -> None:
    before = digest(folder)
    (folder / "h2nav/_native.so").write_bytes(b"\x7fELF")
    (folder / "h2nav/__pycache__").mkdir()
    (folder / "h2nav/__pycache__/cli.pyc").write_bytes(b"1")
    elsewhere = tmp_path / "elsewhere"
    shutil.copytree(folder / "h2nav", elsewhere / "h2nav")
    shutil.copy(folder / "rover.yaml", elsewhere)
    assert digest(folder) == digest(elsewhere) == before


def test_our_own_program_has_one() -> None:
    assert len(program_digest()) == 32
    assert program_digest() == program_digest()


def test_a_change_that_keeps_the_length_counts(folder: Path) -> None:
    found = {digest(folder)}
    for name in ("h2nav/cli.py", "rover.yaml"):
        path = folder / name
        path.write_text(path.read_text().replace("1", "2"))
        found.add(digest(folder))
    assert len(found) == 3
