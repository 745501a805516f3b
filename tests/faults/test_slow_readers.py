"""23: nobody reads what the daemon writes. It goes on, and what is read at last is new."""

import fcntl
import os
import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from daemon_process import H2NAV, WAIT_S, daemon, free_udp_port
from pseudo_devices import PseudoDevice
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from udp_vehicle import UdpVehicle
from wire_frames import FrameMaker

PIPE_BYTES = 4096
# The queue holds 4096 bytes, a pseudo-terminal some more.
MOST_BACKLOG_BYTES = 64 * 1024
UNREAD_SAMPLES = 2000


@pytest.fixture
def full_pipe() -> Iterator[int]:
    """The writing end of a pipe that has room for a line at most and is never read."""
    reader, writer = os.pipe()
    fcntl.fcntl(writer, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
    os.write(writer, b"-" * (PIPE_BYTES - 100))
    yield writer
    os.close(writer)
    os.close(reader)


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_a_full_pipe_holds_no_attitude_back(full_pipe, stream):
    """A program that starts ``h2nav run --json`` and forgets to read costs the text alone."""
    port = free_udp_port()
    outlets = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, stream: full_pipe}
    running = subprocess.Popen(
        [*H2NAV, "run", "--json", "--connect", f"udpin:127.0.0.1:{port}"], **outlets
    )
    vehicle = UdpVehicle(port)
    try:
        assert vehicle.fly(WAIT_S, lambda: len(vehicle.messages("ATTITUDE")) >= 400)
        running.send_signal(signal.SIGTERM)
        assert running.wait(WAIT_S) == 0
    finally:
        running.kill()
        running.wait()
        vehicle.close()


def resident_mib(pid: int) -> float:
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{pid}/status").read_text())
    assert found is not None
    return int(found[1]) / 1024.0


def test_a_serial_line_that_nobody_reads_costs_old_frames_alone(tmp_path):
    """The queue is bounded, its oldest frames go first, and samples are used as before."""
    device = PseudoDevice(tmp_path / "autopilot")
    device.plug()
    maker = FrameMaker()
    beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
    with daemon("--connect", f"serial:{device.path}:921600") as running:
        for number in range(UNREAD_SAMPLES):
            if number % 100 == 0:
                device.send(maker.frame(beat))
                used = running.read_events()[-1]["samples_used"] if running.read_events() else 0
                if number == UNREAD_SAMPLES // 2:
                    before_mib = resident_mib(running.process.pid)
            device.send(maker.raw_imu(60_000_000 + 10_000 * number))
            time.sleep(0.002)
        running.wait_for_samples(UNREAD_SAMPLES // 2)
        assert used > 0
        assert resident_mib(running.process.pid) < before_mib + 8.0
        backlog = device.received()
    device.unplug()
    assert len(backlog) < MOST_BACKLOG_BYTES
    parser = mavlink.MAVLink(None)
    parser.robust_parsing = True
    frames = parser.parse_buffer(bytearray(backlog)) or []
    times_ms = [frame.time_boot_ms for frame in frames if frame.get_type() == "ATTITUDE"]
    newest_ms = 60_000 + 10 * (UNREAD_SAMPLES - 1)
    assert max(times_ms) > newest_ms - 1000
