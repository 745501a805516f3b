"""What every attack needs: the daemon as a process that is watched, and the record of a row."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

import numpy as np
from udp_vehicle import UdpVehicle

H2NAV = [sys.executable, "-m", "h2nav"]
START_S = 20.0
STOP_S = 5.0
KIB_PER_MIB = 1024.0
_STATES = ("no_link", "no_autopilot", "no_imu", "aligning", "degraded", "active", "recovering")


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late ATTITUDE came, in ms after the sending of its sample."""

    count: int
    p50_ms: float
    p99_ms: float
    max_ms: float

    @classmethod
    def of(cls, ages_s: list[float]) -> "Lateness | None":
        """Of the ages of messages; None where none came."""
        if not ages_s:
            return None
        p50, p99, most = np.percentile(np.array(ages_s) * 1e3, [50, 99, 100])
        return cls(len(ages_s), float(p50), float(p99), float(most))

    def __str__(self) -> str:
        return f"{self.p50_ms:.0f}/{self.p99_ms:.0f}/{self.max_ms:.0f}"


@dataclass(slots=True)
class Row:
    """One line of the table; what does not apply to a row stays empty.

    Attributes:
        name: of the row.
        done: what was done to the daemon.
        ended: exit status, and the last line of a traceback.
        used: samples used.
        sent: samples sent meanwhile.
        calm: lateness before the attack.
        late: lateness during the attack and shortly after.
        lines_per_minute: on standard error.
        rss_mib: resident memory at the start of the attack and at the end.
        bound: the autopilot that the daemon was bound to in the end.
        states: told in this order, repetitions left out.
        figures: what else was measured.
    """

    name: str
    done: str
    ended: str = ""
    used: int | None = None
    sent: int | None = None
    calm: Lateness | None = None
    late: Lateness | None = None
    lines_per_minute: float | None = None
    rss_mib: tuple[float, float] | None = None
    bound: str = ""
    states: list[str] = field(default_factory=list)
    figures: list[str] = field(default_factory=list)


class WatchedDaemon:
    """``h2nav run --json``: what it says on both streams, with host monotonic times in s.

    Args:
        words: further words of the command line.
        environment: variables on top of ours.
    """

    def __init__(self, words: list[str], environment: dict[str, str] | None = None) -> None:
        self.started_s = time.monotonic()
        self.process = subprocess.Popen(
            [*H2NAV, "run", "--json", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env={**os.environ, **(environment or {})},
        )
        assert self.process.stdout is not None
        assert self.process.stderr is not None
        self.said: list[tuple[float, str]] = []
        self._lines: list[tuple[float, str]] = []
        self._readers = [
            self._reader(self.process.stdout, self._lines),
            self._reader(self.process.stderr, self.said),
        ]

    @property
    def events(self) -> list[tuple[float, dict[str, Any]]]:
        """The events so far."""
        return [(t_s, json.loads(line)) for t_s, line in self._lines if line.startswith("{")]

    @property
    def statuses(self) -> list[tuple[float, dict[str, Any]]]:
        """The status events so far."""
        return [(t_s, event) for t_s, event in self.events if "state" in event]

    def notices(self, word: str = "", since_s: float = 0.0) -> list[tuple[float, str]]:
        """The notices that contain a word."""
        return [
            (t_s, f"{event['severity']}: {event['text']}")
            for t_s, event in self.events
            if event["event"] == "notice" and word in event["text"] and t_s >= since_s
        ]

    def state_since(self, state: str, since_s: float) -> float | None:
        """When the daemon is first known to be in a state after `since_s`."""
        for t_s, event in self.events:
            told = event.get("state") == state
            told = told or (event["event"] == "notice" and event["text"].startswith(state))
            if told and t_s >= since_s:
                return t_s
        return None

    def states(self) -> list[str]:
        """The states in their order, with their reasons."""
        told: list[str] = []
        for _, event in self.events:
            if event["event"] == "notice" and event["text"].split(":")[0] in _STATES:
                text = event["text"]
            elif "state" in event:
                reason = event.get("reason", "")
                text = f"{event['state']}: {reason}" if reason else event["state"]
            else:
                continue
            if not told or told[-1] != text:
                told.append(text)
        return told

    def wait(self, ready: Callable[[], bool], seconds: float = START_S) -> bool:
        """Waits until something is so; False when it took too long or the process ended."""
        end_s = time.monotonic() + seconds
        while time.monotonic() < end_s and self.process.poll() is None:
            if ready():
                return True
            time.sleep(0.02)
        return ready()

    def rss_mib(self) -> float:
        """Resident memory; 0 when the process is gone."""
        with contextlib.suppress(OSError):
            status = Path(f"/proc/{self.process.pid}/status").read_text()
            found = re.search(r"VmRSS:\s+(\d+)", status)
            if found:
                return int(found[1]) / KIB_PER_MIB
        return 0.0

    def stop(self) -> str:
        """Ends it; how it ended."""
        running = self.process.poll() is None
        if running:
            self.process.send_signal(signal.SIGCONT)
            self.process.terminate()
        try:
            status: int | str = self.process.wait(STOP_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
            status = f"killed {STOP_S:.0f} s after SIGTERM"
        for reader in self._readers:
            reader.join(STOP_S)
        end = f"{status}" if running else f"{status} BY ITSELF"
        crashed = any("Traceback" in line for _, line in self.said)
        return f"{end}, traceback: {self.said[-1][1]}" if crashed else end

    @staticmethod
    def _reader(stream: IO[str], into: list[tuple[float, str]]) -> threading.Thread:
        def read() -> None:
            for line in stream:
                into.append((time.monotonic(), line.rstrip("\n")))

        thread = threading.Thread(target=read, daemon=True)
        thread.start()
        return thread


@dataclass(slots=True)
class Scene:
    """A daemon and the vehicle that it listens to."""

    daemon: WatchedDaemon
    vehicle: UdpVehicle
    port: int
    folder: Path

    def until_active(self, seconds: float = 10.0) -> bool:
        """Flies until the daemon says that it is active."""
        return self.vehicle.fly(seconds, lambda: self.daemon.state_since("active", 0.0) is not None)

    def row(self, name: str, done: str) -> Row:
        """Ends the daemon and fills a row with what is known without further measurement."""
        rss_mib = self.daemon.rss_mib()
        ended = self.daemon.stop()
        statuses = self.daemon.statuses
        row = Row(name, done, ended, rss_mib=(0.0, rss_mib), states=self.daemon.states())
        row.sent = len(self.vehicle.sent)
        row.late = Lateness.of(self.vehicle.ages_s())
        row.lines_per_minute = self.lines_per_minute(self.daemon.started_s)
        if statuses:
            row.used = statuses[-1][1]["samples_used"]
            row.bound = statuses[-1][1]["autopilot"]
        return row

    def lines_per_minute(self, since_s: float) -> float:
        """Lines on standard error."""
        count = sum(t_s >= since_s for t_s, _ in self.daemon.said)
        return count / (time.monotonic() - since_s) * 60.0


@contextmanager
def scene(
    sections: str = "",
    environment: dict[str, str] | None = None,
    log: str = "{folder: logs}",
    **vehicle: Any,
) -> Iterator[Scene]:
    """A daemon that listens and a vehicle that has not sent anything yet.

    Args:
        sections: further lines of its configuration file.
        environment: variables of the daemon.
        log: the section of that name; `folder: logs` is a folder of the scene's own.
        vehicle: how the vehicle differs from the usual one.
    """
    port = free_udp_port()
    with tempfile.TemporaryDirectory(prefix="h2nav-attack-") as name:
        folder = Path(name)
        config = folder / "config.yaml"
        log = log.replace("folder: logs", f"folder: '{folder / 'logs'}'")
        config.write_text(f"link: {{url: 'udpin:127.0.0.1:{port}'}}\nlog: {log}\n{sections}\n")
        daemon = WatchedDaemon(["-c", str(config)], environment)
        flown = UdpVehicle(port, **vehicle)
        try:
            daemon.wait(lambda: port in listening_ports())
            yield Scene(daemon, flown, port, folder)
        finally:
            flown.close()
            daemon.stop()


def free_udp_port() -> int:
    """A port that nobody has at the moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def listening_ports() -> dict[int, int]:
    """The bound UDP ports of this machine and how many datagrams each has dropped."""
    lines = Path("/proc/net/udp").read_text().splitlines()[1:]
    rows = [line.split() for line in lines]
    return {int(row[1].split(":")[1], 16): int(row[-1]) for row in rows}
