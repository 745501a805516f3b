"""The daemon and the fake autopilot as processes, as a user runs them."""

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

WAIT_S = 30.0
# Daemons of tests share no socket.
NO_FOLDER = "/nonexistent/runtime"
H2NAV = [sys.executable, "-m", "h2nav"]


def free_udp_port() -> int:
    """A port that nobody has at the moment."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class DaemonProcess:
    """``h2nav run --json`` and what it says.

    Args:
        arguments: further words of the command line.
        environment: variables on top of ours.
        program: what is started in place of ``h2nav``.

    Attributes:
        events: all that was read so far, by `wait_for` or `read_events`.
    """

    def __init__(
        self,
        *arguments: str,
        environment: dict[str, str] | None = None,
        program: Sequence[str] = H2NAV,
    ) -> None:
        self.process = subprocess.Popen(
            [*program, "run", "--json", *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            env={**os.environ, "XDG_RUNTIME_DIR": NO_FOLDER, **(environment or {})},
        )
        self.events: list[dict[str, Any]] = []
        self._buffer = b""

    def wait_for(self, wanted: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        """The first event that `wanted` accepts."""
        for event in self._events():
            if wanted(event):
                return event
        raise AssertionError(f"the daemon ended: {self.process.stderr.read().decode()}")

    def wait_for_samples(self, count: int) -> dict[str, Any]:
        """Waits until so many samples were used."""
        return self.wait_for(lambda event: event.get("samples_used", 0) >= count)

    def read_events(self) -> list[dict[str, Any]]:
        """All events so far; does not wait for any."""
        assert self.process.stdout is not None
        while select.select([self.process.stdout], [], [], 0.0)[0]:
            if not self._read_chunk():
                break
        return self.events

    def stop(self, number: int = signal.SIGTERM) -> int:
        """Sends a signal; the exit status."""
        self.process.send_signal(number)
        return self.process.wait(WAIT_S)

    def _events(self) -> Iterator[dict[str, Any]]:
        assert self.process.stdout is not None
        end = time.monotonic() + WAIT_S
        while (left := end - time.monotonic()) > 0:
            if not select.select([self.process.stdout], [], [], left)[0]:
                break
            before = len(self.events)
            if not self._read_chunk():
                return
            yield from self.events[before:]
        raise AssertionError(f"not seen within {WAIT_S:.0f} s")

    def _read_chunk(self) -> bool:
        """Reads once; False at the end of the stream."""
        assert self.process.stdout is not None
        chunk = self.process.stdout.read1(65536)
        *lines, self._buffer = (self._buffer + chunk).split(b"\n")
        self.events += [json.loads(line) for line in lines]
        return bool(chunk)


@contextmanager
def daemon(*arguments: str, **how: Any) -> Iterator[DaemonProcess]:
    """A daemon that is gone after the block, whatever happens in it."""
    running = DaemonProcess(*arguments, **how)
    try:
        yield running
    finally:
        if running.process.poll() is None:
            running.process.kill()
        running.process.communicate()


@contextmanager
def fake_autopilot(url: str, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """A fake autopilot that is gone after the block."""
    command = [*H2NAV, "fake-autopilot", "--connect", url, *arguments]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(WAIT_S)


def the_log(folder: Path, suffix: str = ".mcap") -> Path:
    """The one log of a folder."""
    (path,) = folder.glob(f"*{suffix}")
    return path
