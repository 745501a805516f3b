"""What systemd is told, and where a daemon without it leaves its socket."""

import os
import signal
import socket
from pathlib import Path

import pytest

from h2nav.host.runtime_folder import USUAL_SOCKET, own_socket
from h2nav.host.service_manager import ServiceManager
from h2nav.host.stop_signals import STOPPING, StopSignals

PERIOD_US = 3_000_000
THIRD_NS = PERIOD_US * 1000 // 3


@pytest.fixture
def ear(tmp_path, monkeypatch):
    """The end of systemd."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as end:
        end.bind(os.fspath(tmp_path / "notify"))
        end.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", os.fspath(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", str(PERIOD_US))
        yield end


def heard(ear):
    found = []
    while True:
        try:
            found.append(ear.recv(4096).decode())
        except BlockingIOError:
            return found


def test_the_manager_is_told_what_it_understands(ear):
    manager = ServiceManager()
    manager.ready()
    manager.status("active, RAW_IMU 100 Hz")
    manager.stopping()
    assert heard(ear) == ["READY=1", "STATUS=active, RAW_IMU 100 Hz", "STOPPING=1"]


def test_the_watchdog_is_fed_three_times_a_period(ear):
    manager = ServiceManager()
    for t_ns in (THIRD_NS - 1, THIRD_NS, 2 * THIRD_NS - 1, 2 * THIRD_NS):
        manager.alive(t_ns)
    assert heard(ear) == ["WATCHDOG=1"] * 2


def test_without_a_watchdog_it_is_not_fed(ear, monkeypatch):
    monkeypatch.delenv("WATCHDOG_USEC")
    ServiceManager().alive(10 * THIRD_NS)
    assert heard(ear) == []


def test_a_manager_that_does_not_listen_or_is_not_there_is_no_fault(tmp_path, monkeypatch):
    for address in (os.fspath(tmp_path / "nobody"), "@nobody", ""):
        monkeypatch.setenv("NOTIFY_SOCKET", address)
        ServiceManager().ready()


@pytest.mark.parametrize(
    ("folder", "user", "expected"),
    [
        ("/run/user/7", 7, Path("/run/user/7/h2nav/events")),
        ("/run/user/7", 0, Path("/run/user/7/h2nav/events")),
        ("", 0, USUAL_SOCKET),
        ("", 7, None),
    ],
)
def test_the_socket_of_a_daemon_is_in_its_users_folder(monkeypatch, folder, user, expected):
    monkeypatch.setenv("XDG_RUNTIME_DIR", folder)
    monkeypatch.setattr(os, "geteuid", lambda: user)
    assert own_socket() == expected


@pytest.mark.parametrize("number", STOPPING)
def test_a_signal_stops_and_wakes_and_the_handlers_of_before_return(number):
    before = signal.getsignal(number)
    with StopSignals().installed() as stop:
        assert not stop.stopped
        signal.raise_signal(number)
        assert stop.stopped
        assert stop.wake.recv(1) == bytes([number])
    assert signal.getsignal(number) == before
