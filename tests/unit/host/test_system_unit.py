"""Whether systemd runs the computer, and what its unit says."""

from pathlib import Path
from types import SimpleNamespace

import pytest

from h2nav.errors import TaskFailed
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


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[tuple[str, ...]]:
    """The commands that are run, in a temporary folder of units; no package brought one."""
    commands: list[tuple[str, ...]] = []

    def run(words: tuple[str, ...], **_: object) -> SimpleNamespace:
        commands.append(words)
        return SimpleNamespace(returncode=0, stderr="")

    monkeypatch.setattr(system_unit.subprocess, "run", run)
    monkeypatch.setattr(system_unit, "UNIT_FOLDER", tmp_path)
    monkeypatch.setattr(system_unit, "PACKAGED_UNITS", (tmp_path / "packaged",))
    monkeypatch.setattr(system_unit.pwd, "getpwnam", lambda name: name)
    return commands


STARTED = [
    ("systemctl", "daemon-reload"),
    ("systemctl", "enable", "h2nav.service"),
    ("systemctl", "restart", "h2nav.service"),
]


def test_it_is_installed_enabled_and_started(installed, tmp_path, monkeypatch):
    monkeypatch.setattr(system_unit.sys, "executable", "/opt/venv/bin/python3")
    system_unit.install_and_start()
    assert installed == STARTED
    assert "ExecStart=/opt/venv/bin/h2nav " in (tmp_path / "h2nav.service").read_text()


def test_a_unit_of_a_package_is_left_alone(installed, tmp_path):
    (tmp_path / "packaged").touch()
    system_unit.install_and_start()
    assert installed == STARTED
    assert not (tmp_path / "h2nav.service").exists()


def test_its_user_is_made_first_where_there_is_none(installed, monkeypatch):
    def nobody(name: str) -> None:
        raise KeyError(name)

    monkeypatch.setattr(system_unit.pwd, "getpwnam", nobody)
    system_unit.install_and_start()
    made = ("useradd", "--system", "--user-group", "--groups", "dialout", "--no-create-home")
    assert installed == [(*made, "h2nav"), *STARTED]


@pytest.mark.parametrize(
    ("stderr", "text"),
    [(" Access denied\n", "systemctl daemon-reload: Access denied"),
     ("", "systemctl daemon-reload: 4")],
)  # fmt: skip
def test_a_step_that_fails_is_told_with_its_output(installed, monkeypatch, stderr, text):
    failed = SimpleNamespace(returncode=4, stderr=stderr)
    monkeypatch.setattr(system_unit.subprocess, "run", lambda *_, **__: failed)
    with pytest.raises(TaskFailed) as told:
        system_unit.install_and_start()
    assert str(told.value) == text


def test_a_tool_that_is_missing_is_named(installed, monkeypatch):
    def missing(*_: object, **__: object) -> None:
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(system_unit.subprocess, "run", missing)
    with pytest.raises(TaskFailed) as told:
        system_unit.install_and_start()
    assert str(told.value) == "systemctl: No such file or directory"
