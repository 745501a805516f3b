"""What README.md, docs/library.md and the docstrings show of the library, run as it stands."""

import doctest
import importlib
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from needs import REPOSITORY, need_package

RATE_HZ = 100.0
LEVEL = np.tile([0.0, 0.0, 9.81], (300, 1))


def run(page: str, **given: Any) -> dict[str, Any]:
    """The names that the page's blocks of Python have made, one block after another."""
    text = (REPOSITORY / page).read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert len(blocks) == 3
    for block in blocks:
        exec(compile(block, page, "exec"), given)
    return given


def test_the_examples_of_the_readme(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(REPOSITORY)
    made = run("README.md")
    assert np.isfinite(made["found"].q[-1]).all()
    assert made["smoothed"].q.shape == made["found"].q.shape
    quaternion, bias, verdict = capsys.readouterr().out.splitlines()
    assert quaternion.startswith("[")
    assert bias.startswith("[")
    assert "Looked at: " in verdict


def test_the_examples_of_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    need_package("vqf")
    shutil.copy(REPOSITORY / "tests" / "data" / "takeoff_40s.tlog", tmp_path / "flight.bin")
    monkeypatch.chdir(tmp_path)
    still = np.zeros((300, 3))
    field = np.tile([0.0, 20.0, -43.0], (300, 1))
    made = run("docs/library.md", gyr=still, acc=LEVEL, mag=field, rate_hz=RATE_HZ)
    # East-north-up both: a body that lies level with its y axis to the north.
    assert made["out"].q[-1] == pytest.approx([1.0, 0.0, 0.0, 0.0], abs=1e-3)
    assert np.isfinite(made["found"].sigma_heading_rad[-1])


@pytest.mark.parametrize("name", ["h2nav", "h2nav.library.estimation"])
def test_the_examples_of_the_docstrings(name: str) -> None:
    result = doctest.testmod(importlib.import_module(name))
    assert result.attempted > 0
    assert result.failed == 0
