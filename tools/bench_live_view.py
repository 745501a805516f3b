"""What the live view costs the daemon: how late is ATTITUDE, what CPU and memory, by who looks on.

The same sender feeds each candidate over UDP loopback, as in `bench_live`:

* no live view;
* a viewer's process: nobody looks on; a Foxglove client that subscribes to everything and reads;
  one that subscribes to everything and never reads; ten that read; and
* the same viewer as a thread of the daemon, which was the alternative.

Clients run as processes of their own, on the same machine and niced. Candidates take turns in
every round, so that what else the machine does hits all of them.

Run: python tools/bench_live_view.py [--seconds S] [--rounds N] [--rates HZ ...] [--only WORD]
"""

import argparse
import asyncio
import json
import multiprocessing
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bench_live import WARM_UP_S, Sender, cpu_seconds, free_port
from tornado.websocket import websocket_connect

CONFIG = """
link: {{url: "udpin:127.0.0.1:{port}"}}
autopilot: {{imu_rate_hz: {hz:.0f}, request_streams: false}}
output: {{attitude_rate_hz: {hz:.0f}, attitude_quaternion_rate_hz: 0}}
log: {{folder: {folder}}}
live: {{address: "{address}", foxglove_port: {foxglove}}}
"""
# The viewer's end of the feed goes to a thread instead of to a process.
IN_A_THREAD = """
import asyncio, sys, threading
from h2nav.apps import live_view
from h2nav.cli import main
from h2nav.io.live_feed import FeedReader
from h2nav.live.viewer import _show

class Thread:
    def poll(self): return None
    def kill(self): pass
    def wait(self, timeout=None): return 0

def start(end):
    feed = FeedReader(end.dup())
    def work():
        try:
            asyncio.run(_show(feed, feed.greeting()))
        except ConnectionError:
            pass
    threading.Thread(target=work, daemon=True).start()
    return Thread()

live_view.start_viewer = start
sys.exit(main(sys.argv[1:]))
"""
PROCESS, THREAD, NOTHING = "process", "thread", "no live view"
START_S = 3.0
CLIENT_NICENESS = 10


class Candidate(NamedTuple):
    """Who runs, and who looks on.

    Attributes:
        viewer: PROCESS, THREAD or NOTHING.
        readers: Foxglove clients that subscribe to everything and read.
        deaf: those that never read.
    """

    viewer: str
    readers: int = 0
    deaf: int = 0

    @property
    def name(self) -> str:
        """Such as ``process, 10 readers``."""
        who = f"{self.readers} reading" if self.readers else "nobody"
        who = f"{self.deaf} never reading" if self.deaf else who
        return self.viewer if self.viewer == NOTHING else f"{self.viewer}, {who}"


CANDIDATES = (
    Candidate(NOTHING),
    Candidate(PROCESS),
    Candidate(PROCESS, readers=1),
    Candidate(PROCESS, deaf=1),
    Candidate(PROCESS, readers=10),
    Candidate(THREAD),
    Candidate(THREAD, readers=1),
    Candidate(THREAD, readers=10),
)


class Figures(NamedTuple):
    """Of one flight.

    Attributes:
        late_us: from the datagram to its ATTITUDE.
        sent: samples.
        cpu: of the daemon, s/s.
        viewer_cpu: of the viewer's process.
        memory_mib: of the daemon.
    """

    late_us: list[float]
    sent: int
    cpu: float
    viewer_cpu: float
    memory_mib: float


def look_on(port: int, count: int, reads: bool, ready: "multiprocessing.Event") -> None:
    """Connects clients that subscribe to everything, and reads for ever, or never."""
    os.nice(CLIENT_NICENESS)

    async def client() -> None:
        connection = await websocket_connect(
            f"ws://127.0.0.1:{port}/", subprotocols=["foxglove.sdk.v1"]
        )
        while True:
            message = await connection.read_message()
            if isinstance(message, str) and json.loads(message)["op"] == "advertise":
                channels = json.loads(message)["channels"]
                wanted = [{"id": c["id"], "channelId": c["id"]} for c in channels]
                await connection.write_message(
                    json.dumps({"op": "subscribe", "subscriptions": wanted})
                )
                ready.release()
                while not reads:
                    await asyncio.sleep(3600.0)

    async def clients() -> None:
        await asyncio.gather(*(client() for _ in range(count)))

    asyncio.run(clients())


@contextmanager
def lookers_on(port: int, candidate: Candidate) -> Iterator[None]:
    """The clients of a candidate, while the block lasts."""
    count = candidate.readers or candidate.deaf
    if not count:
        yield
        return
    ready = multiprocessing.Semaphore(0)
    process = multiprocessing.Process(
        target=look_on, args=(port, count, bool(candidate.readers), ready), daemon=True
    )
    process.start()
    try:
        for _ in range(count):
            if not ready.acquire(timeout=20.0):
                raise SystemExit("a client could not subscribe")
        yield
    finally:
        process.kill()
        process.join()


def child_of(pid: int) -> int | None:
    """The viewer's process."""
    children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return int(children[0]) if children else None


def free_tcp_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def fly(candidate: Candidate, seconds: float, rate_hz: float) -> Figures:
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        port, foxglove = free_port(), free_tcp_port()
        address = "" if candidate.viewer == NOTHING else "127.0.0.1:0"
        config = Path(folder) / "config.yaml"
        config.write_text(
            CONFIG.format(port=port, folder=folder, hz=rate_hz, address=address, foxglove=foxglove)
        )
        program = ["-c", IN_A_THREAD] if candidate.viewer == THREAD else ["-m", "h2nav"]
        process = subprocess.Popen(
            [sys.executable, *program, "run", "-c", str(config)],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        stack.callback(process.wait)
        stack.callback(process.terminate)
        time.sleep(START_S)
        stack.enter_context(lookers_on(foxglove, candidate))
        sender = Sender(port, rate_hz)
        sender.fly(WARM_UP_S)
        sender.forget()
        pids = [process.pid, *filter(None, [child_of(process.pid)])]
        before = [cpu_seconds(pid) for pid in pids]
        sender.fly(seconds)
        cpu, *viewer = (
            (cpu_seconds(pid) - start) / seconds for pid, start in zip(pids, before, strict=True)
        )
        memory = Path(f"/proc/{process.pid}/status").read_text().split("VmHWM:")[1].split()[0]
    return Figures(sender.latencies_us, sender.sent, cpu, sum(viewer), int(memory) / 1024)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rates", type=float, nargs="+", default=(100.0, 400.0), metavar="HZ")
    parser.add_argument("--only", default="", help="candidates whose name has this in it")
    args = parser.parse_args()
    candidates = [candidate for candidate in CANDIDATES if args.only in candidate.name]
    for hz in args.rates:
        found: dict[Candidate, list[Figures]] = defaultdict(list)
        for _ in range(args.rounds):
            for candidate in candidates:
                found[candidate].append(fly(candidate, args.seconds, hz))
        for candidate, flights in found.items():
            late = np.array([late for flight in flights for late in flight.late_us])
            p50, p99 = np.percentile(late, [50, 99]) if len(late) else (np.nan, np.nan)
            cpu, viewer_cpu = (
                100.0 * float(np.median([getattr(flight, name) for flight in flights]))
                for name in ("cpu", "viewer_cpu")
            )
            print(
                f"{hz:3.0f} Hz  {candidate.name:24} answered {len(late)}/"
                f"{sum(flight.sent for flight in flights)}  p50 {p50:5.0f} us  p99 {p99:6.0f} us  "
                f"CPU {cpu:5.1f} %  viewer {viewer_cpu:5.1f} %  "
                f"memory {max(flight.memory_mib for flight in flights):.0f} MiB",
                flush=True,
            )


if __name__ == "__main__":
    main()
