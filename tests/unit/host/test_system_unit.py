"""Whether systemd runs the computer, and what its unit says."""

from pathlib import Path

import pytest

from h2nav.host import system_unit


def test_systemd_runs_where_its_folder_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(system_unit, "RUNNING", tmp_path)
    assert system_unit.is_booted() is True
    monkeypatch.setattr(system_unit, "RUNNING", tmp_path / "none")
    assert system_unit.is_booted() is False


def test_the_unit_starts_the_program_at_its_path() -> None:
    text = system_unit.unit_text("/somewhere/h2nav")
    assert "ExecStart=/somewhere/h2nav " in text
    assert system_unit.PROGRAM_OF_THE_PACKAGE not in text
