"""Processes beside ours: whose modules they run."""

import subprocess
from pathlib import Path

import pytest

from h2nav.apps.own_process import start_module


def test_a_file_of_the_working_directory_is_no_module_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "platform.py").write_text("raise SystemExit('not this one')\n")
    monkeypatch.chdir(tmp_path)
    with start_module("platform", "--terse", stdout=subprocess.PIPE) as process:
        assert process.communicate()[0].startswith(b"Linux")
    assert process.returncode == 0
