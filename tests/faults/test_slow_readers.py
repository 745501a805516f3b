"""23: nobody reads what the daemon writes. It goes on, and what is read at last is new."""

import fcntl
import itertools
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

pytestmark = pytest.mark.thorough

PIPE_BYTES = 4096
# A pseudo-terminal keeps some 70 kB, 8 s of what is sent.
UNREAD_SAMPLES = 1600
LOST_MS = 500


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


class SerialVehicle:
    """Heartbeats and RAW_IMU over a pseudo-terminal, at 100 Hz."""

    def __init__(self, device: PseudoDevice) -> None:
        self._device = device
        self._maker = FrameMaker()
        self._parser = mavlink.MAVLink(None)
        self._parser.robust_parsing = True
        self._start_s = time.monotonic()
        self.stamp_ms = 0

    def send(self, count: int) -> None:
        beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
        for number in range(count):
            if number % 50 == 0:
                self._device.send_all(self._maker.frame(beat))
            self.stamp_ms = 60_000 + round((time.monotonic() - self._start_s) * 1e3)
            self._device.send_all(self._maker.raw_imu(1000 * self.stamp_ms))
            time.sleep(0.01)

    def attitude_stamps_ms(self) -> list[int]:
        frames = self._parser.parse_buffer(bytearray(self._device.received())) or []
        return [frame.time_boot_ms for frame in frames if frame.get_type() == "ATTITUDE"]


def test_a_serial_line_that_nobody_reads_costs_old_frames_alone(tmp_path):
    """The queue is bounded, its oldest frames go first, and samples are used as before."""
    device = PseudoDevice(tmp_path / "autopilot")
    device.plug()
    vehicle = SerialVehicle(device)
    config = tmp_path / "config.yaml"
    config.write_text(
        f"link: {{url: 'serial:{device.path}:921600'}}\n"
        "output: {attitude_rate_hz: 100, attitude_quaternion_rate_hz: 100}\n"
    )
    with daemon("-c", str(config)) as running:
        end_s = time.monotonic() + WAIT_S
        while not vehicle.attitude_stamps_ms() and time.monotonic() < end_s:
            vehicle.send(10)  # what comes before the daemon opens its end is lost
        vehicle.send(UNREAD_SAMPLES // 2)
        before_mib = resident_mib(running.process.pid)
        vehicle.send(UNREAD_SAMPLES // 2)
        unread_ms = vehicle.stamp_ms
        stamps_ms: list[int] = []
        end_s = time.monotonic() + WAIT_S
        while max(stamps_ms, default=0) < unread_ms and time.monotonic() < end_s:
            stamps_ms += vehicle.attitude_stamps_ms()
            vehicle.send(10)
        assert resident_mib(running.process.pid) < before_mib + 8.0
        running.wait_for_samples(UNREAD_SAMPLES * 9 // 10)
    device.unplug()
    assert max(stamps_ms) >= unread_ms
    # The kernel has kept the oldest; between them and the newest our queue has let some go.
    assert max(b - a for a, b in itertools.pairwise(stamps_ms)) > LOST_MS
