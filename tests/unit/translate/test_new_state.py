"""The recipe "a state of the velocity-aided filter" of ARCHITECTURE.md, executed on a copy."""

import filecmp
import re
import shutil
import subprocess
import sys
from pathlib import Path

from needs import REPOSITORY

ROOM = "h2nav/attitude/velocity_aided"
# file -> what is replaced in it, and by what
CHANGES = {
    f"{ROOM}/memory.py": (
        '    turning: float = real("(rad/s)^2"',
        '    bias_halved: list[float] = reals(3, "rad/s", "half of a sum", BIAS_SUM)\n'
        '    turning: float = real("(rad/s)^2"',
    ),
    f"{ROOM}/kernel/theta.py": (
        "        s.bias_moved[i] = s.bias_moved[i] + w.dtheta[i]\n",
        "        s.bias_moved[i] = s.bias_moved[i] + w.dtheta[i]\n"
        "        s.bias_halved[i] = s.bias_halved[i] + 0.5 * w.dtheta[i]\n",
    ),
    "h2nav/translate/recipes_velocity_aided.py": (
        '        ("s.bias_moved", "s.bias_expected"),\n',
        '        ("s.bias_moved", "s.bias_expected", "s.bias_halved"),\n',
    ),
}
# what `python tools/derive.py` writes
WRITTEN = {
    f"{ROOM}/integer/kernel/derived.py",
    f"{ROOM}/integer/shared_fields.py",
    "docs/fixed-point.md",
}
CHECK = """
from h2nav.apps.export_c import kernel_sources
from h2nav.attitude.kernel_files import VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.record import row
from h2nav.attitude.velocity_aided.integer.memory import State
from h2nav.translate.c99 import translate

assert row(State, "bias_halved").range == row(State, "bias_moved").range
for kernel in (VELOCITY_AIDED, VELOCITY_AIDED_INTEGER):
    assert "s->bias_halved[i]" in translate(kernel_sources(kernel), [kernel.entry]).code
"""


def test_a_state_costs_three_files_in_both_arithmetics(tmp_path: Path) -> None:
    for part in ("h2nav", "tools", "docs", "pyproject.toml"):
        source = REPOSITORY / part
        if source.is_dir():
            ignored = shutil.ignore_patterns("__pycache__", "*.so")
            shutil.copytree(source, tmp_path / part, ignore=ignored)
        else:
            shutil.copy(source, tmp_path / part)
    for path, (old, new) in CHANGES.items():
        text = (tmp_path / path).read_text(encoding="utf-8")
        assert text.count(old) == 1, path
        (tmp_path / path).write_text(text.replace(old, new), encoding="utf-8")
    for command in (["tools/derive.py"], ["-c", CHECK]):
        environment = {"PYTHONPATH": str(tmp_path), "H2NAV_NATIVE": "forbid", "PATH": "/usr/bin"}
        done = subprocess.run(
            [sys.executable, *command],
            cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
    assert changed_files(tmp_path) == set(CHANGES) | WRITTEN


def changed_files(copy: Path) -> set[str]:
    names = [
        str(path.relative_to(copy))
        for part in ("h2nav", "docs", "tools")
        for path in (copy / part).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    return set(filecmp.cmpfiles(REPOSITORY, copy, names, shallow=False)[1])


def test_the_recipe_names_these_files() -> None:
    text = (REPOSITORY / "ARCHITECTURE.md").read_text(encoding="utf-8")
    found = re.search(r"\* \*A state of the velocity-aided filter\*,(.*?)\n\* \*", text, re.DOTALL)
    assert found is not None
    named = set(re.findall(r"`((?:attitude|translate)/[\w/]+\.py)`", found[1]))
    assert {f"h2nav/{name}" for name in named} == set(CHANGES)
