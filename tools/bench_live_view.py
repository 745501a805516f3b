"""Cost of the live view to the daemon, by its clients: delay of ATTITUDE, CPU time and memory.

The same sender feeds each candidate over UDP loopback, as in `bench_live`:

* no live view; the same while flights are reviewed beside it, one after the other;
* a viewer's process: without clients; with a Foxglove client that subscribes to everything and the
  page's stream; with both, never read; with ten readers; with hostile uploads (`hostile_flights`),
  one after the other, which are reviewed beside it; and
* the same viewer as a thread of the daemon, which was the alternative.

Clients run as processes of their own, on the same machine and niced. Candidates take turns in
every round, so that other load on the machine affects them alike.

Beside the figures of each candidate stands by how much its p99 is later than that of the first one
in the same round: the median, and the least and the most of the middle half of the rounds.

On a machine that others use, ``--nice -10`` (as root) keeps them out of the figures, and
``--review-priority normal`` gives reviews a share of the processors.

Run: python tools/bench_live_view.py [--seconds S] [--rounds N] [--rates HZ ...] [--only WORD ...]
    [--imus N] [--review-priority idle|normal]
"""

import argparse
import asyncio
import contextlib
import functools
import json
import multiprocessing
import os
import random
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.parse
import urllib.request
from collections import defaultdict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import hostile_flights
import numpy as np
from bench_live import WARM_UP_S, Sender, cpu_seconds, free_port
from tornado.websocket import websocket_connect

CONFIG = """
link: {{url: "udpin:127.0.0.1:{port}"}}
autopilot: {{imu_rate_hz: {hz:.0f}, request_streams: false}}
output: {{attitude_rate_hz: {hz:.0f}, attitude_quaternion_rate_hz: 0}}
log: {{folder: {folder}}}
live: {{address: "{address}", foxglove_port: {foxglove}}}
flights: {{token_file: {folder}/token, review_priority: {priority}}}
"""
# The viewer's end of the feed goes to a thread instead of to a process.
IN_A_THREAD = """
import asyncio, sys, threading
from h2nav.apps import live_view
from h2nav.cli import main
from h2nav.links.live_feed import FeedReader
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
START_S = 2.0
LONGEST_START_S = 30.0
CLIENT_NICENESS = 10
FLIGHT = Path(__file__).resolve().parent.parent / "tests/data/takeoff_40s.tlog"
WAITING_FLIGHTS = 200
LARGE_BYTES = 10_000_000


class Candidate(NamedTuple):
    """Who runs, and who looks on.

    Attributes:
        viewer: PROCESS, THREAD or NOTHING.
        readers: who read, each a Foxglove client and a stream of the page.
        deaf: who never read.
        uploads: somebody uploads without a pause.
        reviews: flights wait for their reviews.
    """

    viewer: str
    readers: int = 0
    deaf: int = 0
    uploads: bool = False
    reviews: bool = False

    @property
    def name(self) -> str:
        """Such as ``process, 10 readers``."""
        who = f"{self.readers} reading" if self.readers else "nobody"
        who = f"{self.deaf} never reading" if self.deaf else who
        who = "uploads" if self.uploads else who
        who = "reviews" if self.reviews else who
        is_alone = self.viewer == NOTHING and not self.reviews
        return self.viewer if is_alone else f"{self.viewer}, {who}"


CANDIDATES = (
    Candidate(NOTHING),
    Candidate(NOTHING, reviews=True),
    Candidate(PROCESS),
    Candidate(PROCESS, readers=1),
    Candidate(PROCESS, deaf=1),
    Candidate(PROCESS, readers=10),
    Candidate(PROCESS, uploads=True),
    Candidate(THREAD),
    Candidate(THREAD, readers=1),
    Candidate(THREAD, readers=10),
)


class Figures(NamedTuple):
    """Of one flight.

    Attributes:
        late_us: from the datagram to its ATTITUDE, of each sample.
        sent: samples.
        cpu: of the daemon, s/s.
        viewer_cpu: of the viewer's process.
        memory_mib: of the daemon.
        reviewed: flights meanwhile.
    """

    late_us: list[float]
    sent: int
    cpu: float
    viewer_cpu: float
    memory_mib: float
    reviewed: int


class Ports(NamedTuple):
    """Where a candidate shows what it shows."""

    page: int
    foxglove: int


def look_on(ports: Ports, count: int, reads: bool, ready: Any) -> None:
    """Connects so many who subscribe to everything, and read for ever, or never."""
    os.nice(CLIENT_NICENESS)

    async def foxglove() -> None:
        url = f"ws://127.0.0.1:{ports.foxglove}/"
        connection = await websocket_connect(url, subprotocols=["foxglove.sdk.v1"])
        while True:
            message = await connection.read_message()
            if isinstance(message, str) and json.loads(message)["op"] == "advertise":
                channels = json.loads(message)["channels"]
                wanted = [{"id": c["id"], "channelId": c["id"]} for c in channels]
                subscription = {"op": "subscribe", "subscriptions": wanted}
                await connection.write_message(json.dumps(subscription))
                ready.release()
                while not reads:
                    await asyncio.sleep(3600.0)

    async def page() -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", ports.page)
        writer.write(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{ports.page}\r\n\r\n".encode())
        assert b"200" in await reader.readline(), "the page has no stream"
        ready.release()
        while not reads or await reader.read(65536):
            await asyncio.sleep(0.0 if reads else 3600.0)

    async def all_of_them() -> None:
        await asyncio.gather(*(each() for each in (foxglove, page) for _ in range(count)))

    asyncio.run(all_of_them())


def upload(port: int, token_file: Path, done: Any) -> None:
    """Uploads hostile files, and a large one in between."""
    os.nice(CLIENT_NICENESS)
    dice, number = random.Random(1), 0
    content = FLIGHT.read_bytes()
    makers = [
        functools.partial(hostile_flights._random, dice=dice),
        functools.partial(hostile_flights._bomb, dice=dice),
        *(
            functools.partial(made, dice=dice, content=content, suffix=".tlog")
            for made in (hostile_flights._cut, hostile_flights._flipped)
        ),
    ]
    while True:
        number += 1
        with tempfile.TemporaryDirectory() as folder:
            made = makers[number % len(makers)](Path(folder))
            body = made.read_bytes()
        if number % 10 == 0:
            body += dice.randbytes(LARGE_BYTES)
        name = urllib.parse.quote(f"{number} {made.name}")
        asked = urllib.request.Request(
            f"http://127.0.0.1:{port}/flights/uploads?name={name}",
            body,
            {"Authorization": f"Bearer {token_file.read_text().strip()}"},
        )
        with contextlib.suppress(urllib.error.HTTPError):  # one at a time
            urllib.request.urlopen(asked, timeout=30.0).close()
            with done.get_lock():
                done.value += 1


@contextmanager
def uploads(port: int, folder: Path) -> Iterator[None]:
    """Somebody uploads while the block lasts."""
    done = multiprocessing.Value("i", 0)
    process = multiprocessing.Process(
        target=upload, args=(port, folder / "token", done), daemon=True
    )
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()
    print(f"{done.value} uploads", file=sys.stderr)


@contextmanager
def lookers_on(ports: Ports, candidate: Candidate) -> Iterator[None]:
    """Those of a candidate, while the block lasts."""
    count = candidate.readers or candidate.deaf
    if not count:
        yield
        return
    ready = multiprocessing.Semaphore(0)
    process = multiprocessing.Process(
        target=look_on, args=(ports, count, bool(candidate.readers), ready), daemon=True
    )
    process.start()
    try:
        for _ in range(2 * count):
            if not ready.acquire(timeout=20.0):
                raise SystemExit("somebody could not look on")
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


def wait_for(ports: Ports) -> None:
    """Until both are listened on."""
    end_s = time.monotonic() + LONGEST_START_S
    for port in ports:
        while True:
            try:
                socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
                break
            except OSError:
                if time.monotonic() > end_s:
                    raise
                time.sleep(0.1)


def fly(candidate: Candidate, seconds: float, rate_hz: float, imus: int, priority: str) -> Figures:
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        port, ports = free_port(), Ports(free_tcp_port(), free_tcp_port())
        address = "" if candidate.viewer == NOTHING else f"127.0.0.1:{ports.page}"
        config = Path(folder) / "config.yaml"
        config.write_text(
            CONFIG.format(
                port=port,
                folder=folder,
                hz=rate_hz,
                address=address,
                foxglove=ports.foxglove,
                priority=priority,
            )
        )
        if candidate.reviews:
            waiting = Path(folder) / "uploads"
            waiting.mkdir()
            for number in range(WAITING_FLIGHTS):
                shutil.copy(FLIGHT, waiting / f"{number}.tlog")
        program = ["-c", IN_A_THREAD] if candidate.viewer == THREAD else ["-m", "h2nav"]
        process = subprocess.Popen(
            [sys.executable, *program, "run", "-c", str(config)],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        stack.callback(process.wait)
        stack.callback(process.terminate)
        time.sleep(START_S)
        if address:
            wait_for(ports)
        stack.enter_context(lookers_on(ports, candidate))
        if candidate.uploads:
            stack.enter_context(uploads(ports.page, Path(folder)))
        sender = Sender(port, rate_hz, imus)
        sender.fly(WARM_UP_S)
        sender.forget()
        viewer_pid = child_of(process.pid) if candidate.viewer == PROCESS else None
        pids = [process.pid, *filter(None, [viewer_pid])]
        before = [cpu_seconds(pid) for pid in pids]
        sender.fly(seconds)
        cpu, *viewer = (
            (cpu_seconds(pid) - start) / seconds for pid, start in zip(pids, before, strict=True)
        )
        memory = Path(f"/proc/{process.pid}/status").read_text().split("VmHWM:")[1].split()[0]
        reviewed = len(list((Path(folder) / "reviews").glob("*.flight.json")))
    return Figures(sender.latencies_us, sender.sent, cpu, sum(viewer), int(memory) / 1024, reviewed)


def told(flights: list[Figures], first: list[Figures]) -> str:
    """The median of all rounds: other work on the machine comes in bursts."""
    p99s = [[np.percentile(each.late_us, 99) for each in of] for of in (flights, first)]
    low, later, high = np.percentile(np.subtract(*p99s), [25, 50, 75])
    each = [np.percentile(flight.late_us, [50, 90, 99]) for flight in flights]
    p50, p90, p99 = np.median(each, axis=0)
    cpu, viewer_cpu, memory = np.median([flight[2:5] for flight in flights], axis=0)
    answered = sum(len(flight.late_us) for flight in flights)
    return (
        f"answered {answered}/{sum(flight.sent for flight in flights)}  p50 {p50:5.0f} us  "
        f"p90 {p90:5.0f} us  p99 {p99:6.0f} us  CPU {100 * cpu:5.1f} %  "
        f"viewer {100 * viewer_cpu:5.1f} %  memory {memory:.0f} MiB  "
        f"p99 later by {later:+.0f} us ({low:+.0f} to {high:+.0f}), "
        f"{sum(flight.reviewed for flight in flights)} reviews"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--rates", type=float, nargs="+", default=(100.0, 400.0), metavar="HZ")
    parser.add_argument("--only", nargs="+", default=("",), help="a part of the candidates' names")
    parser.add_argument("--nice", type=int, default=0, help="priority of everything (root: -10)")
    parser.add_argument("--imus", type=int, default=1, choices=(1, 2, 3))
    parser.add_argument("--review-priority", default="idle", choices=("idle", "normal"))
    args = parser.parse_args()
    os.nice(args.nice)
    candidates = [each for each in CANDIDATES if any(word in each.name for word in args.only)]
    for hz in args.rates:
        found: dict[Candidate, list[Figures]] = defaultdict(list)
        for _ in range(args.rounds):
            for candidate in candidates:
                flown = fly(candidate, args.seconds, hz, args.imus, args.review_priority)
                found[candidate].append(flown)
        first = found[candidates[0]]
        for candidate, flights in found.items():
            print(f"{hz:3.0f} Hz  {candidate.name:24} {told(flights, first)}", flush=True)


if __name__ == "__main__":
    main()
