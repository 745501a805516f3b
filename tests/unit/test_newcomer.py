"""What somebody meets first: two commands under the first picture; a missing program is named."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from needs import REPOSITORY, need_program


def test_the_two_commands_stand_under_the_first_picture() -> None:
    text = (REPOSITORY / "README.md").read_text(encoding="utf-8")
    below = re.search(r"!\[.*?\]\(.*?\)\n\n\*.*?\*\n\n```\n(.*?)```", text, re.DOTALL)
    assert below is not None
    assert "```" not in text[: below.start()]
    assert below[1].splitlines() == ["make demo", "make test"]


def test_the_two_lanes_are_all_of_the_tests_and_ci_runs_both() -> None:
    makefile = (REPOSITORY / "Makefile").read_text(encoding="utf-8")
    lanes = re.findall(r"/pytest .*-m (.+)$", makefile, re.MULTILINE)
    assert lanes == ["'not thorough'", "thorough"]
    ci = (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    (whole,) = re.findall(r"^\.venv/bin/pytest.*$", ci, re.MULTILINE)
    assert " -m " not in whole


def only(folder: Path, *programs: str) -> dict[str, str]:
    """An environment in which no other program is found."""
    for name in programs:
        (folder / name).symlink_to(need_program(name))
    return {**os.environ, "PATH": str(folder)}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["image.py"], "not installed: buildah, mmdebstrap; apt-get install -y buildah mmdebstrap"),
        (["debian_package.py", "build"], "not installed: mmdebstrap; apt-get install"),
        (["wheels.py"], "not installed: mmdebstrap; apt-get install -y mmdebstrap"),
        (["bench_mcu.py"], "-y gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm gcc"),
    ],
)
def test_a_tool_names_the_package_of_a_program_that_is_missing(
    tmp_path: Path, words: list[str], said: str
) -> None:
    command = [sys.executable, str(REPOSITORY / "tools" / words[0]), *words[1:]]
    done = subprocess.run(
        command, env=only(tmp_path), cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert said in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize("target", ["demo", "test", "deb"])
def test_make_names_the_package_of_python(tmp_path: Path, target: str) -> None:
    programs = tmp_path / "programs"
    programs.mkdir()
    for name in ("Makefile", "pyproject.toml", "setup.py"):
        shutil.copy(REPOSITORY / name, tmp_path)
    done = subprocess.run(
        [need_program("make"), target],
        env=only(programs, "sh"),
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "not installed: python3; apt-get install -y python3-venv" in done.stderr
