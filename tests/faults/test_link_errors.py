"""A link that cannot be opened says so, with its cause, and the daemon waits for it."""

import socket

import pytest
from daemon_process import daemon

pytestmark = pytest.mark.thorough


def wait_for_cause(running, *words):
    """A notice that names the cause in one of the words of operating systems."""
    running.wait_for(
        lambda event: (
            event["event"] == "notice" and any(word in event["text"].lower() for word in words)
        )
    )
    assert running.stop() == 0


def test_a_serial_device_that_is_not_there(tmp_path):
    with daemon("--connect", f"serial:{tmp_path}/ttyABSENT:115200") as running:
        wait_for_cause(running, "no such")


def test_a_host_that_nobody_knows():
    with daemon("--connect", "udpout:no-such-host.invalid:14550") as running:
        wait_for_cause(running, "not known", "no address", "resolution", "no-such-host")


def test_a_port_that_another_program_has():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        port = taken.getsockname()[1]
        with daemon("--connect", f"udpin:127.0.0.1:{port}") as running:
            wait_for_cause(running, "in use", "another program")
