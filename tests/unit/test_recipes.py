"""The recipes of ARCHITECTURE.md, "Where to add something": executed on a copy, and what they name.

`tests/unit/translate/test_new_state.py` executes that of a filter's state.
"""

import filecmp
import os
import re
import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from lanes import few
from needs import REPOSITORY

TOP = ("docs", "gains", "tests", "tools", "configs", "packaging", "native")
A_FILE = re.compile(r"[\w./*-]+(?:\.(?:py|md|yaml|toml|json|js|sh|css)|/)")
# What a recipe tells to create, and generated folders.
NEW = {"attitude/NAME/", "attitude/NAME/kernel/"}

# A recipe that a test executes is a file: its docstring is the recipe's name, `CHANGES` what it
# writes (file -> the text of a new one, or pairs of what is there once and what it becomes), and
# `WRITTEN`, if there is one, the files that the tools which it names write. Run as a program in the
# changed copy, it checks what then holds.
EXECUTED = sorted((REPOSITORY / "tests" / "recipes").glob("*.py"))
# Of the tests the copy has what a recipe changes, before ours.
COPIED = (
    *("h2nav", "configs", "docs", "gains", "packaging", "tools"),
    *("README.md", "CHANGELOG.md", "pyproject.toml"),
)
# A module that a recipe makes keeps to the rules of imports.
IMPORTS = "import importlinter.cli as cli, sys; sys.exit(cli.lint_imports(no_cache=True))"


def where_to_add() -> dict[str, str]:
    """Recipe -> its text."""
    text = (REPOSITORY / "ARCHITECTURE.md").read_text(encoding="utf-8")
    section = text[text.index("## Where to add something") : text.index("## What holds everywhere")]
    parts = re.split(r"(?:^\* |(?<=\. ))\*(An? [^*]+)\*[,:]", section, flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


@pytest.mark.parametrize("recipe", where_to_add())
def test_what_a_recipe_names_exists(recipe: str) -> None:
    text = where_to_add()[recipe]
    named = {
        word for quoted in re.findall(r"`([^`]+)`", text) for word in quoted.split()
        if A_FILE.fullmatch(word)
    }  # fmt: skip
    lost = {name for name in named if not exists(name)}
    assert not lost - (NEW if recipe == "A filter" else set())


def exists(name: str) -> bool:
    """At the top; inside `h2nav/`; or, where the recipe has named the room, anywhere in it."""
    if (name.partition("/")[0] in TOP or "/" not in name) and any(REPOSITORY.glob(name)):
        return True
    return any((REPOSITORY / "h2nav").glob(name)) or any((REPOSITORY / "h2nav").rglob(name))


def test_the_check_sees_a_file_that_is_gone() -> None:
    assert exists("reviews/page.py")
    assert not exists("reviews/no_such_page.py")
    assert len(where_to_add()) > 30


def test_every_recipe_is_carried_out() -> None:
    executed = {runpy.run_path(str(recipe))["__doc__"] for recipe in EXECUTED}
    assert set(where_to_add()) == executed | {"A state of the velocity-aided filter"}


@pytest.mark.parametrize("recipe", few(8, EXECUTED), ids=lambda path: path.stem)
def test_a_recipe_does_what_it_says_and_touches_no_other_file(recipe: Path, tmp_path: Path) -> None:
    about = runpy.run_path(str(recipe))
    text = where_to_add()[about["__doc__"]]
    copy_to(tmp_path)
    for path, change in about["CHANGES"].items():
        place = tmp_path / path
        room = f"{Path(path).parent}/".removeprefix("h2nav/").replace("/made/", "/NAME/")
        assert path.removeprefix("h2nav/") in text or Path(path).name in text or room in text
        place.parent.mkdir(parents=True, exist_ok=True)
        if isinstance(change, str):
            assert not place.exists()
            place.write_text(change, encoding="utf-8")
            continue
        whole = (REPOSITORY / path).read_text(encoding="utf-8")
        for before, after in change:
            assert whole.count(before) == 1, (path, before)
            whole = whole.replace(before, after)
        place.write_text(whole, encoding="utf-8")
    run_in(tmp_path, str(recipe))
    if any(isinstance(change, str) for change in about["CHANGES"].values()):
        run_in(tmp_path, "-c", IMPORTS)
    assert changed_in(tmp_path) == set(about["CHANGES"]) | set(about.get("WRITTEN", ()))


def run_in(place: Path, *command: str) -> None:
    """Runs Python with the copy's modules before ours."""
    copied, ours = ((str(root), str(root / "tests")) for root in (place, REPOSITORY))
    done = subprocess.run(
        [sys.executable, *command],
        cwd=place, env={"PYTHONPATH": os.pathsep.join((*copied, *ours)), "PATH": "/usr/bin"},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


def copy_to(place: Path) -> None:
    """Copies what a recipe may change; the compiled kernels are those of other kernels then."""
    ignored = shutil.ignore_patterns("*.so")
    for name in COPIED:
        if (REPOSITORY / name).is_dir():
            shutil.copytree(REPOSITORY / name, place / name, ignore=ignored)
        else:
            shutil.copy(REPOSITORY / name, place / name)


def changed_in(place: Path) -> set[str]:
    """The files of a copy that are new or other than ours."""
    names = [str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()]
    names = [name for name in names if "__pycache__" not in name]
    _, other, new = filecmp.cmpfiles(REPOSITORY, place, names, shallow=False)
    return {*other, *new}
