"""The live loop at 400 Hz over UDP loopback: is every sample used, how late is ATTITUDE, what CPU?

Both candidates run as processes of their own and are fed by the same sender in the same way:

* ``h2nav run`` with its log on, sending ATTITUDE for every sample, and
* a bare pymavlink echo: ``recv_match`` in a loop, one ATTITUDE sent per RAW_IMU, nothing computed.

Run: python tools/bench_live.py [--seconds S]
"""

import argparse
import contextlib
import os
import select
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

RATE_HZ = 400.0
WARM_UP_S = 3.0
ECHO = """
import os, sys
os.environ["MAVLINK20"] = "1"
from pymavlink import mavutil
url = f"udpin:127.0.0.1:{sys.argv[1]}"
link = mavutil.mavlink_connection(url, source_system=1, source_component=191)
while True:
    message = link.recv_match(type="RAW_IMU", blocking=True)
    link.mav.attitude_send(message.time_usec // 1000 & 0xFFFFFFFF, 0, 0, 0, 0, 0, 0)
"""
CONFIG = """
link: {{url: "udpin:127.0.0.1:{port}"}}
autopilot: {{imu_rate_hz: 400, request_streams: false}}
output: {{attitude_rate_hz: 400, attitude_quaternion_rate_hz: 0}}
log: {{folder: {folder}}}
"""


class Sender:
    """A vehicle at rest that sends RAW_IMU and waits for the ATTITUDE of each sample."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.setblocking(False)
        self._mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        self._sent_ns: dict[int, int] = {}
        self._t_ms = 10_000.0
        self.latencies_us: list[float] = []
        self.sent = 0

    def forget(self) -> None:
        """The warm-up does not count."""
        self.sent = 0
        self.latencies_us.clear()
        self._sent_ns.clear()

    def fly(self, seconds: float) -> None:
        """Sends for `seconds` and collects the answers' latencies."""
        start_ns = time.monotonic_ns()
        beat_ns = start_ns
        for i in range(round(seconds * RATE_HZ)):
            due_ns = start_ns + round(i * 1e9 / RATE_HZ)
            self._listen_until(due_ns)
            if time.monotonic_ns() >= beat_ns:
                beat_ns += 1_000_000_000
                self._send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3))
            self._t_ms += 1e3 / RATE_HZ
            t_ms = round(self._t_ms)
            self._sent_ns[t_ms] = time.monotonic_ns()
            self._send(
                mavlink.MAVLink_raw_imu_message(
                    t_ms * 1000, 1, 2, -1000, 1, 0, 0, 224, 80, -528, 0, 2500
                )
            )
            self.sent += 1
        self._listen_until(time.monotonic_ns() + 300_000_000)
        self._t_ms += 300.0  # a clock that stood still would make all that follows late

    def _send(self, message: mavlink.MAVLink_message) -> None:
        with contextlib.suppress(ConnectionRefusedError):
            self._socket.send(message.pack(self._mav))

    def _listen_until(self, due_ns: int) -> None:
        while (wait_ns := due_ns - time.monotonic_ns()) > 0:
            if not select.select([self._socket], [], [], wait_ns * 1e-9)[0]:
                return
            try:
                data = self._socket.recv(2048)
            except ConnectionRefusedError:
                continue
            now_ns = time.monotonic_ns()
            if int.from_bytes(data[7:10], "little") == mavlink.MAVLINK_MSG_ID_ATTITUDE:
                # MAVLink 2 cuts zero bytes off the end of a payload, here down to the time.
                t_ms = int.from_bytes(data[10 : 10 + min(data[1], 4)], "little")
                sent_ns = self._sent_ns.pop(t_ms, None)
                if sent_ns is not None:
                    self.latencies_us.append((now_ns - sent_ns) * 1e-3)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def measure(name: str, command: list[str], port: int, seconds: float) -> None:
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        time.sleep(2.0)
        sender = Sender(port)
        sender.fly(WARM_UP_S)
        sender.forget()
        before = cpu_seconds(process.pid)
        sender.fly(seconds)
        cpu = (cpu_seconds(process.pid) - before) / seconds
        memory = Path(f"/proc/{process.pid}/status").read_text().split("VmHWM:")[1].split()[0]
    finally:
        process.terminate()
        process.wait()
    late = np.array(sender.latencies_us)
    p50, p99 = np.percentile(late, [50, 99]) if len(late) else (np.nan, np.nan)
    print(
        f"{name:22} answered {len(late)}/{sender.sent}  p50 {p50:6.0f} us  p99 {p99:6.0f} us  "
        f"CPU {100 * cpu:5.1f} %  memory {int(memory) / 1024:.0f} MiB"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    seconds = parser.parse_args().seconds
    with tempfile.TemporaryDirectory() as folder:
        port = free_port()
        config = Path(folder) / "config.yaml"
        config.write_text(CONFIG.format(port=port, folder=folder))
        ours = [sys.executable, "-m", "h2nav", "run", "-c", str(config)]
        measure("h2nav run, with log", ours, port, seconds)
        port = free_port()
        measure("pymavlink echo", [sys.executable, "-c", ECHO, str(port)], port, seconds)


if __name__ == "__main__":
    main()
