"""``h2nav setup`` with autopilots that run: on serial lines, and two of them at once."""

import socket
import subprocess
from contextlib import ExitStack
from pathlib import Path

import pytest
from daemon_process import H2NAV, fake_autopilot, free_udp_port

from h2nav.apps import configuration


def set_up(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [*H2NAV, "setup", "--yes", "--no-service", "-o", str(folder / "config.yaml"), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


def await_line(line: Path) -> None:
    """Until the pseudo-terminal is there."""
    command = ["sh", "-c", f"until test -e {line}; do sleep 0.05; done"]
    subprocess.run(command, timeout=60, check=True)


@pytest.mark.thorough
def test_two_autopilots_on_two_lines_are_shown_and_the_user_says_which(tmp_path: Path) -> None:
    with ExitStack() as stack:
        lines = [tmp_path / "left", tmp_path / "right"]
        for line, make in zip(lines, ("ardupilot", "px4"), strict=True):
            stack.enter_context(fake_autopilot(f"pty:{line}", "--autopilot", make))
            await_line(line)
        both = [word for line in lines for word in ("--connect", str(line))]
        undecided = set_up(tmp_path, *both)
        assert undecided.returncode == 1
        for found in ("ArduPilot quadrotor 1/1", "PX4 quadrotor 1/1"):
            assert f"    {found}, firmware" in undecided.stdout
            assert f"{found} at serial:{tmp_path}" in undecided.stderr
        assert not (tmp_path / "config.yaml").exists()
        decided = set_up(tmp_path, "--connect", str(lines[1]))
    assert decided.returncode == 0, decided.stderr
    url = configuration.read(tmp_path / "config.yaml").link.url
    assert url.startswith(f"serial:{lines[1]}:")


def await_datagram(port: int) -> None:
    """Until the autopilot runs."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as ear:
        ear.bind(("127.0.0.1", port))
        ear.settimeout(60.0)
        ear.recv(1)


@pytest.mark.thorough
def test_of_two_autopilots_on_one_link_the_system_id_decides(tmp_path: Path) -> None:
    url = f"udpin:127.0.0.1:{(port := free_udp_port())}"
    with fake_autopilot(f"udpout:127.0.0.1:{port}", "--fault", "second-autopilot@0"):
        await_datagram(port)
        undecided = set_up(tmp_path, "--connect", url)
        assert "--system-id" in undecided.stderr
        absent = set_up(tmp_path, "--connect", url, "--system-id", "7")
        assert "no autopilot with system id 7 was heard, but 1, 2" in absent.stderr
        assert not (tmp_path / "config.yaml").exists()
        for system_id in (1, 2):
            folder = tmp_path / str(system_id)
            folder.mkdir()
            decided = set_up(folder, "--connect", url, "--system-id", str(system_id))
            assert decided.returncode == 0, decided.stderr
            chosen = configuration.read(folder / "config.yaml")
            assert (chosen.link.url, chosen.autopilot.system_id) == (url, system_id)
