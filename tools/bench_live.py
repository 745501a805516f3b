"""The live loop over UDP loopback: is every sample used, how late is ATTITUDE, what CPU?

Both candidates run as processes of their own and are fed by the same sender in the same way:

* ``h2nav run`` with its log on, sending ATTITUDE for every sample, and
* a bare pymavlink echo: ``recv_match`` in a loop, one ATTITUDE sent per RAW_IMU, nothing computed.

Then, in this process, what the stages of one sample of ours cost.

Run: python tools/bench_live.py [--seconds S] [--rates HZ ...]
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
from collections.abc import Callable
from pathlib import Path

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Outlets, Pipeline
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.service.service import Service, Surroundings
from h2nav.service.settings import AutopilotSettings, OutputSettings
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame
from h2nav.wire.readers import READERS

RAW_IMU = mavlink.MAVLINK_MSG_ID_RAW_IMU
OTHERS = (mavlink.MAVLink_scaled_imu2_message, mavlink.MAVLink_scaled_imu3_message)
UNIX_S = 1_795_000_000.0

RATES_HZ = (100.0, 400.0)
STAGE_SAMPLES = 20_000
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
autopilot: {{imu_rate_hz: {hz:.0f}, request_streams: false}}
output: {{attitude_rate_hz: {hz:.0f}, attitude_quaternion_rate_hz: 0}}
log: {{folder: {folder}}}
"""


class Sender:
    """A vehicle at rest that sends RAW_IMU and waits for the ATTITUDE of each sample.

    Args:
        imus: whose samples it sends, the further ones as SCALED_IMU2 and SCALED_IMU3.
    """

    def __init__(self, port: int, rate_hz: float, imus: int = 1) -> None:
        self._rate_hz = rate_hz
        self._others = OTHERS[: imus - 1]
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
        for i in range(round(seconds * self._rate_hz)):
            due_ns = start_ns + round(i * 1e9 / self._rate_hz)
            self._listen_until(due_ns)
            if time.monotonic_ns() >= beat_ns:
                beat_ns += 1_000_000_000
                self._send(mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3))
            self._t_ms += 1e3 / self._rate_hz
            t_ms = round(self._t_ms)
            self._sent_ns[t_ms] = time.monotonic_ns()
            self._send(
                mavlink.MAVLink_raw_imu_message(
                    t_ms * 1000, 1, 2, -1000, 1, 0, 0, 224, 80, -528, 0, 2500
                )
            )
            for message in self._others:
                self._send(message(t_ms, 1, 2, -1000, 1, 0, 0, 224, 80, -528, 2500))
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


def measure(name: str, command: list[str], port: int, seconds: float, rate_hz: float) -> None:
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        time.sleep(2.0)
        sender = Sender(port, rate_hz)
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
        f"{rate_hz:3.0f} Hz  {name:18} answered {len(late)}/{sender.sent}  p50 {p50:6.0f} us  "
        f"p99 {p99:6.0f} us  CPU {100 * cpu:5.1f} %  memory {int(memory) / 1024:.0f} MiB"
    )


class Quiet:
    """Looks on and sees nothing."""

    message_ids: frozenset[int] = frozenset()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not looked at."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Estimates are not looked at."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Notices are not looked at."""


def stages() -> dict[str, float]:
    """Processor time of one sample, us: of all, and of what can be told apart from outside."""
    settings = Configuration(
        autopilot=AutopilotSettings(imu_rate_hz=400, request_streams=False),
        output=OutputSettings(attitude_rate_hz=400, attitude_quaternion_rate_hz=0),
    )
    filters = FilterFactory.shipped(settings.filter, 400.0)
    service = Service(settings.service, Surroundings(filters.filter_for, earth_field_at, UNIX_S))
    outlets = Outlets(lambda t_ns: t_ns, lambda data: None, None, Quiet())
    pipeline = Pipeline(service, settings.output.component_id, outlets)
    sender = codec.Encoder(1, 1)
    pipeline.link(0, True)
    pieces = []
    for number in range(STAGE_SAMPLES):
        t_ns = 10_000_000_000 + number * 2_500_000
        if number % 400 == 0:
            beat = mavlink.MAVLink_heartbeat_message(2, 3, 81, 0, 3, 3)
            pieces.append((t_ns, sender.encode(beat)))
        noise = number % 7
        raw = mavlink.MAVLink_raw_imu_message(
            t_ns // 1000, noise, 2, -1000, 1, noise, 0, 224, 80, -528, 0, 2500
        )
        pieces.append((t_ns, sender.encode(raw)))

    def timed(work: Callable[[], object]) -> float:
        start = time.process_time()
        work()
        return (time.process_time() - start) / len(pieces) * 1e6

    def everything() -> None:
        for t_ns, data in pieces:
            pipeline.tick(t_ns)
            pipeline.received(t_ns, data)

    frames: list[Frame] = []
    deframer = Deframer()
    attitude = mavlink.MAVLink_attitude_message(1, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0)
    whole = timed(everything)
    found = {
        "everything": whole,
        "deframing": timed(lambda: [frames.extend(deframer.feed(data)) for _, data in pieces]),
        "decoding and reading": timed(
            lambda: [READERS[frame.msg_id](codec.decode(frame)) for frame in frames]
        ),
        "asking": timed(lambda: [service.on_arrival(t_ns, (1, 1), RAW_IMU) for t_ns, _ in pieces]),
        "encoding": timed(lambda: [sender.encode(attitude) for _ in pieces]),
    }
    return found | {"service and filter": 2.0 * whole - sum(found.values())}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=20.0)
    parser.add_argument("--rates", type=float, nargs="+", default=RATES_HZ, metavar="HZ")
    args = parser.parse_args()
    for hz in args.rates:
        with tempfile.TemporaryDirectory() as folder:
            port = free_port()
            config = Path(folder) / "config.yaml"
            config.write_text(CONFIG.format(port=port, folder=folder, hz=hz))
            ours = [sys.executable, "-m", "h2nav", "run", "-c", str(config)]
            measure("h2nav run, with log", ours, port, args.seconds, hz)
            port = free_port()
            echo = [sys.executable, "-c", ECHO, str(port)]
            measure("pymavlink echo", echo, port, args.seconds, hz)
    found = stages()
    print("processor time of a sample, without log, link and process:")
    for name, cost_us in found.items():
        print(f"  {name:20} {cost_us:6.1f} us  {100 * cost_us / found['everything']:3.0f} %")


if __name__ == "__main__":
    main()
