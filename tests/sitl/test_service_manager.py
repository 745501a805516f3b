"""The daemon under systemd: what it tells the manager, and how its unit is confined."""

import os
import re
import signal
import socket
import subprocess

import pytest
from daemon_process import H2NAV, WAIT_S
from needs import REPOSITORY, need_program

WATCHDOG_S = 0.6
UNIT = REPOSITORY / "packaging" / "systemd" / "h2nav.service"
LARGEST_EXPOSURE = 2.0


class Manager:
    """systemd's end of the notification socket.

    Args:
        address: a path, or a name that begins with @ for the abstract name space.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)
        self._socket.settimeout(WAIT_S)
        self.statuses: list[str] = []

    def hear(self) -> str:
        """The next notification that is no status line; those are kept apart."""
        while (said := self._socket.recv(4096).decode()).startswith("STATUS="):
            self.statuses.append(said.removeprefix("STATUS="))
        return said

    def close(self) -> None:
        self._socket.close()


@pytest.fixture(params=["path", "abstract"])
def manager(request, tmp_path):
    name = f"@h2nav-test-{os.getpid()}" if request.param == "abstract" else str(tmp_path / "notify")
    ear = Manager(name)
    yield ear
    ear.close()


def test_ready_watchdog_and_stopping_are_told(manager):
    environment = {
        **os.environ,
        "NOTIFY_SOCKET": manager.address,
        "WATCHDOG_USEC": str(round(WATCHDOG_S * 1e6)),
    }
    daemon = subprocess.Popen(
        [*H2NAV, "run", "--connect", "udpin:127.0.0.1:0"],
        env=environment,
        stderr=subprocess.DEVNULL,
    )
    try:
        assert manager.hear() == "READY=1"
        assert [manager.hear() for _ in range(4)] == ["WATCHDOG=1"] * 4
        daemon.send_signal(signal.SIGTERM)
        last = manager.hear()
        while last == "WATCHDOG=1":
            last = manager.hear()
        assert last == "STOPPING=1"
        assert daemon.wait(WAIT_S) == 0
        assert manager.statuses[0].startswith("no_autopilot")
    finally:
        daemon.kill()
        daemon.wait()


@pytest.mark.thorough
def test_a_stopped_loop_starves_the_watchdog(manager):
    """The notifications come from the loop that does the work, not from a thread beside it."""
    environment = {**os.environ, "NOTIFY_SOCKET": manager.address, "WATCHDOG_USEC": "300000"}
    script = (
        "import sys, time\n"
        "from h2nav import cli\n"
        "from h2nav.apps.console import Console\n"
        "Console.status = lambda *_: time.sleep(3600)\n"
        "cli.main(['run', '--connect', 'udpin:127.0.0.1:0'])\n"
    )
    daemon = subprocess.Popen([H2NAV[0], "-c", script], env=environment, stderr=subprocess.DEVNULL)
    try:
        assert manager.hear() == "READY=1"
        assert manager.hear() == "WATCHDOG=1"  # of the first round, which never ends
        manager._socket.settimeout(1.0)
        with pytest.raises(TimeoutError):
            manager.hear()
    finally:
        daemon.kill()
        daemon.wait()


def test_the_unit_is_confined(tmp_path):
    """systemd's own rating: 0 is fully confined, 10 is not at all."""
    command = [need_program("systemd-analyze"), "security", "--offline=true", "--no-pager", UNIT]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    found = re.search(r"exposure level for \S+: ([0-9.]+)", done.stdout)
    assert found is not None, done.stdout + done.stderr
    assert float(found[1]) <= LARGEST_EXPOSURE
