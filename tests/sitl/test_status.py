"""``h2nav status`` asks the daemon that runs; what it says is what the panel shows."""

import json
import os
import subprocess
from pathlib import Path
from typing import Any

import pytest
from daemon_process import H2NAV, daemon, fake_autopilot, free_udp_port
from jsonschema import Draft202012Validator
from pseudo_devices import PseudoDevice

from h2nav.apps.event_schema import event_schema


def asked(socket: Path, *words: str) -> subprocess.CompletedProcess[str]:
    command = [*H2NAV, "status", "--socket", str(socket), *words]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)


def test_a_daemon_that_is_well_says_so_and_what_it_runs_on(tmp_path: Path) -> None:
    port, folder = free_udp_port(), {"RUNTIME_DIRECTORY": str(tmp_path)}
    with (
        daemon("--connect", f"udpin:127.0.0.1:{port}", environment=folder) as running,
        fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "hover"),
    ):
        running.wait_for(lambda event: event.get("state") == "active")
        shown = asked(tmp_path / "events")
        told = asked(tmp_path / "events", "--json")
    assert shown.returncode == 0, shown.stderr
    assert f"on udpin:127.0.0.1:{port}" in shown.stdout
    assert " kernels" in shown.stdout
    assert "ArduPilot quadrotor 1/1" in shown.stdout
    document = json.loads(told.stdout)
    check = Draft202012Validator(event_schema())
    check.validate({"event": "status", **document["status"]})
    check.validate({"event": "started", **document["started"]})


def test_a_daemon_without_a_configured_socket_is_found(tmp_path: Path) -> None:
    folder = {"XDG_RUNTIME_DIR": str(tmp_path)}
    url = f"udpin:127.0.0.1:{free_udp_port()}"
    with daemon("--connect", url, environment=folder) as running:
        running.wait_for(lambda event: event["event"] == "status")
        shown = subprocess.run(
            [*H2NAV, "status"],
            capture_output=True,
            text=True,
            timeout=30,
            check=False,
            env={**os.environ, **folder},
        )
        # Another one at the same time has no socket, and runs all the same.
        other = f"udpin:127.0.0.1:{free_udp_port()}"
        with daemon("--connect", other, environment=folder) as second:
            second.wait_for(lambda event: event["event"] == "status")
    assert shown.returncode == 1, shown.stderr
    assert f"on {url}" in shown.stdout
    assert "no autopilot heartbeat" in shown.stdout


def test_bytes_without_frames_ask_about_the_baud_rate(tmp_path: Path) -> None:
    device = PseudoDevice(tmp_path / "port")
    device.plug()
    url, folder = f"serial:{device.path}:921600", {"RUNTIME_DIRECTORY": str(tmp_path)}

    def is_junk(event: dict[str, Any]) -> bool:
        if event["event"] == "status":  # once a second
            device.send(bytes(range(128)) * 5)
        return event["event"] == "status" and "no MAVLink" in event["reason"]

    with daemon("--connect", url, environment=folder) as running:
        running.wait_for(is_junk)
        shown = asked(tmp_path / "events")
    assert "bytes, no MAVLink: wrong baud rate?" in shown.stdout
    assert shown.returncode == 1


@pytest.mark.parametrize("is_there", [False, True])
def test_where_no_daemon_listens_the_remedy_is_named(tmp_path: Path, is_there: bool) -> None:
    if is_there:
        (tmp_path / "events").touch()
    shown = asked(tmp_path / "events")
    assert shown.returncode == 1
    assert shown.stderr.startswith(f"h2nav: {tmp_path}/events: no daemon listens there")
