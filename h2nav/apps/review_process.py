"""Runs `h2nav.apps.reviewer` in a process of its own, watched without waiting."""

import contextlib
import os
import subprocess
from pathlib import Path
from typing import IO, Any, NamedTuple

import orjson

from h2nav.apps.json_output import json_text
from h2nav.apps.own_process import start_module
from h2nav.apps.reviewer import ReviewJob
from h2nav.flights.folder import FlightFolder

MAX_SAID_BYTES = 1 << 20
MAX_LAST_WORDS = 200
_READ_BYTES = 65536


class ReviewOutcome(NamedTuple):
    """How a review process ended."""

    flight: str = ""  # id of the flight that it reviewed; empty if none was waiting
    name: str = ""  # of the recording
    error: str = ""  # why there is no review
    severity: str = ""  # of the sentence, a word
    text: str = ""  # the sentence about the flight
    summary: dict[str, Any] = {}  # noqa: RUF012 - never changed; the row of the list
    trouble: str = ""  # why nothing could be done; the recording is not to blame
    is_busy: bool = False  # another process reviews in this folder

    @property
    def did_nothing(self) -> bool:
        """Whether every flight has a review, or is left to another process."""
        return not self.flight and not self.trouble


class ReviewProcess:
    """At most one process at a time."""

    def __init__(self, job: ReviewJob) -> None:
        self._job = job
        self._process: subprocess.Popen[bytes] | None = None
        self._said = self._complained = b""

    @property
    def is_running(self) -> bool:
        """Whether a process was started and its outcome not yet taken."""
        return self._process is not None

    def start(self) -> None:
        """Starts it; raises OSError."""
        self._said = self._complained = b""
        self._process = start_module(
            "h2nav.apps.reviewer",
            json_text(self._job._asdict()),  # paths may hold bytes that are no text
            env=dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,  # not the journal: a recording could flood it
        )
        for stream in (self._process.stdout, self._process.stderr):
            assert stream is not None
            os.set_blocking(stream.fileno(), False)

    def outcome(self) -> ReviewOutcome | None:
        """Returns what came of it, once; None while it runs."""
        process = self._process
        if process is None:
            return None
        self._listen(process)
        if process.poll() is None:
            return None
        self._listen(process)
        self._close(process)
        return self._made(process.returncode)

    def stop(self) -> None:
        """Ends it at once; what it was at is taken up again by the next one."""
        process = self._process
        if process is None:
            return
        process.kill()
        process.wait()
        self._listen(process)
        self._close(process)
        began = self._last("began")
        if began:
            FlightFolder(Path(self._job.root), Path(self._job.reviews)).forget_attempt(began)

    def _listen(self, process: "subprocess.Popen[bytes]") -> None:
        self._said = _heard(process.stdout, self._said)
        self._complained = _heard(process.stderr, self._complained)

    def _close(self, process: "subprocess.Popen[bytes]") -> None:
        for stream in (process.stdout, process.stderr):
            assert stream is not None
            stream.close()
        self._process = None

    def _lines(self) -> list[dict[str, Any]]:
        found = []
        for line in self._said.splitlines():
            try:
                said = orjson.loads(line)
            except ValueError:
                continue
            if isinstance(said, dict):
                found.append(said)
        return found

    def _last(self, key: str) -> str:
        return next((str(said[key]) for said in reversed(self._lines()) if key in said), "")

    def _made(self, status: int) -> ReviewOutcome:
        for said in reversed(self._lines()):
            if "trouble" in said:
                return ReviewOutcome(trouble=str(said["trouble"]))
            if "nothing" in said or "busy" in said:
                return ReviewOutcome(is_busy="busy" in said)
            if "id" in said:
                return ReviewOutcome(
                    str(said["id"]),
                    str(said.get("name", "")),
                    str(said.get("error", "")),
                    str(said.get("severity", "")),
                    str(said.get("text", "")),
                    dict(said.get("summary", {})),
                )
        reason = f"signal {-status}" if status < 0 else f"status {status}"
        last = self._complained.decode(errors="replace").strip().rpartition("\n")[2]
        if last:  # such as a library's that ends the process where it lacks memory
            shown = "".join(each if each.isprintable() else "_" for each in last)
            reason += f": {shown[:MAX_LAST_WORDS]}"
        at = self._last("name")
        self._job = self._job._replace(ended=(self._last("began"), reason))
        return ReviewOutcome(trouble=f"the review{f' of {at}' if at else ''} ended with {reason}")


def _heard(stream: IO[bytes] | None, before: bytes) -> bytes:
    """The last of what came from a pipe before and has come by now."""
    assert stream is not None
    with contextlib.suppress(BlockingIOError):
        while data := os.read(stream.fileno(), _READ_BYTES):
            before = (before + data)[-MAX_SAID_BYTES:]
    return before
