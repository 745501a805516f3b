"""A series of log files: rotation, retries after a disk failure, repair of old files."""

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from h2nav import __version__
from h2nav.integrity.severity import Severity
from h2nav.log.file import LogFile
from h2nav.log.folder import (
    RUN_FILES,
    LogLimits,
    final_name,
    left_over_logs,
    make_room,
    next_log_path,
    our_logs,
    run_budget,
    trim_run,
)
from h2nav.log.repair import DamagedLog, complete_in_place, replace_damaged

SYNC_S = 0.75  # with one poll of the recorder and a slow fsync, below the promised second
RETRY_FIRST_S = 1.0
RETRY_LAST_S = 30.0
SOUND_AGE_S = 60.0  # after a file that lasted this long, a failure is retried at once
REPAIR_PAUSE_S = 0.002

Write = Callable[[LogFile], None]


class RecorderNotice(NamedTuple):
    """An event of the recording, to be reported once."""

    severity: Severity  # of it
    text: str  # one line
    # identifies the event while names and figures in the text change; default: the text
    cause: str = ""


class FolderTarget:
    """New files in a folder, within limits."""

    retries = True

    def __init__(self, folder: Path, limits: LogLimits) -> None:
        self.folder = folder
        self.limits = limits
        self._run: set[Path] = set()  # final names
        self._budget = 0

    def left_over(self) -> list[Path]:
        """Logs that an earlier run did not close."""
        try:
            return left_over_logs(self.folder)
        except OSError:
            return []  # no folder yet, or an unreadable one: opening a log will report it

    def open(self) -> LogFile:
        """Opens the next log; raises OSError."""
        self.folder.mkdir(parents=True, exist_ok=True)
        self._budget = self._budget or run_budget(self.folder, self.limits)
        make_room(self.folder, self.limits, None)
        file = LogFile(next_log_path(self.folder, time.time_ns()))
        self._run.add(file.path)
        return file

    def is_full(self, file: LogFile, age_s: float) -> bool:
        """Whether the next file is due."""
        largest = min(self.limits.file_bytes, self._budget // RUN_FILES)
        return file.size >= largest or age_s >= self.limits.file_age_s

    def check_room(self, file: LogFile) -> None:
        """Keeps run and disk within the limits; raises OSError when that is not possible."""
        run = [path for path in our_logs(self.folder) if final_name(path) in self._run]
        # A run over its budget deletes its own files; only then those of earlier runs.
        trim_run(run, file.active_path, self._budget)
        make_room(self.folder, self.limits, file.active_path)


class SingleTarget:
    """A single file of a given name, without limits."""

    retries = False

    def __init__(self, path: Path) -> None:
        self.folder = path.parent
        self._path = path

    def left_over(self) -> list[Path]:
        """Returns none: other files belong to others."""
        return []

    def open(self) -> LogFile:
        """Opens the log; raises OSError."""
        return LogFile(self._path)

    def is_full(self, file: LogFile, age_s: float) -> bool:
        """Never."""
        return False

    def check_room(self, file: LogFile) -> None:
        """Does nothing: there is no other file to delete."""


class LogSeries:
    """The files of one run. Runs on the recorder's thread, except where noted.

    Args:
        target: where the files are created.
        unix_offset_ns: written into each file for its readers.
        monotonic_s: the clock of flushes, rotation and retries.

    Attributes:
        trouble: why recording is stopped, None while it works (read from any thread).
        notices: events for the operator, oldest first (taken from any thread).
        path: final name of the current (or last) file.
        repairing: the thread that repairs left-over files; None if there were none.
    """

    def __init__(
        self,
        target: FolderTarget | SingleTarget,
        unix_offset_ns: int,
        monotonic_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self.trouble: str | None = None
        self.notices: deque[RecorderNotice] = deque(maxlen=100)
        self.path: Path | None = None
        self.repairing: threading.Thread | None = None
        self.opened = self.lost = self.rejected = 0
        self._written_before = 0
        self._target = target
        self._monotonic_s = monotonic_s
        self._unix_offset_ns = unix_offset_ns
        self._name = ""
        self._file: LogFile | None = None
        self._opened_at_s = self._sync_due_s = self._retry_at_s = 0.0
        self._retry_s = RETRY_FIRST_S
        self._headers: dict[tuple[str, str], Write] = {}
        self._new_headers: deque[tuple[tuple[str, str], Write]] = deque()
        self._reported: set[str] = set()
        self._stop_repair = threading.Event()
        self._is_to_roll = False

    @property
    def written(self) -> int:
        """Number of messages in the files of this run."""
        return self._written_before + (self._file.written if self._file else 0)

    @property
    def file_bytes(self) -> int:
        """Size of the current file on disk."""
        return self._file.size if self._file else 0

    def keep(self, kind: str, name: str, write: Write) -> None:
        """Adds a header to this file and every later one; called from any thread."""
        self._new_headers.append(((kind, name), write))

    def roll(self) -> None:
        """Ends the present file at the next `tend`; called from any thread."""
        self._is_to_roll = True

    def begin(self) -> None:
        """Opens the first file and starts the repair of files left over from earlier runs."""
        left_over = self._target.left_over()
        self._open()
        if left_over:
            self.repairing = threading.Thread(
                target=self._repair, args=(left_over,), name="h2nav-log-repair", daemon=True
            )
            self.repairing.start()

    def write(self, write: Write) -> None:
        """Writes one message, or counts the failure."""
        if self._new_headers:
            self._adopt_headers()
        if self._file is None:
            self.lost += 1
        self._try(write)

    def tend(self) -> None:
        """Does what is due: new attachments, flush to disk, rotation, retry."""
        now_s = self._monotonic_s()
        if self._new_headers:
            self._adopt_headers()
        if self._file is None:
            if self._target.retries and now_s >= self._retry_at_s:
                self._open()
        elif now_s >= self._sync_due_s:
            self._sync(now_s)
        rolls, self._is_to_roll = self._is_to_roll, False
        file = self._file
        if file and (rolls or self._target.is_full(file, now_s - self._opened_at_s)):
            self._close()
            self._open()

    def end(self) -> None:
        """Closes the current file."""
        self._stop_repair.set()
        self._close()

    def give_up(self, error: Exception) -> None:
        """Reports that recording has ended."""
        self.trouble = f"{type(error).__name__}: {error}"
        self.notices.append(RecorderNotice(Severity.ERROR, f"recording ended: {self.trouble}"))

    def _open(self) -> None:
        now_s = self._monotonic_s()
        try:
            file = self._target.open()
        except OSError as error:
            self._suffer(error)
            return
        self._file, self.path = file, file.path
        self._opened_at_s, self._sync_due_s = now_s, now_s + SYNC_S
        self.opened += 1
        self._name = self._name or file.path.stem
        about = {
            "h2nav_version": __version__,
            "unix_offset_ns": str(self._unix_offset_ns),
            "series": self._name,
            "part": str(self.opened),
        }
        self._try(lambda opened: opened.describe("recording", about))
        for header in self._headers.values():
            self._try(header)
        self._try(LogFile.sync)

    def _try(self, write: Write) -> None:
        if self._file is not None:
            try:
                write(self._file)
            except OSError as error:
                self._fail(error)
            except Exception as error:  # one message must never end the recording of the others
                self.rejected += 1
                self._report_once(f"not recorded: {type(error).__name__}: {error}")

    def _adopt_headers(self) -> None:
        while self._new_headers:
            key, write = self._new_headers.popleft()
            self._headers[key] = write
            self._try(write)
        self._try(LogFile.sync)

    def _sync(self, now_s: float) -> None:
        file = self._file
        if file is None:
            return
        self._sync_due_s = now_s + SYNC_S
        try:
            file.sync()
        except OSError as error:
            self._fail(error)
            return
        if self.trouble is not None:
            self.trouble = None
            lost = f"{self.lost} messages lost so far"
            text = f"recording again to {file.path}; {lost}"
            self.notices.append(RecorderNotice(Severity.NOTICE, text, "recording again"))
        try:
            self._target.check_room(file)
        except OSError as error:
            self._close()
            self._suffer(error)

    def _close(self) -> None:
        file = self._file
        if file is None:
            return
        try:
            file.close()
        except OSError as error:
            self._fail(error)
            return
        self._written_before += file.written
        self._file = None

    def _fail(self, error: OSError) -> None:
        """Leaves a file that failed readable, and schedules a retry."""
        file, self._file = self._file, None
        if file is None:
            return
        file.abandon()
        self.lost += file.unsaved
        self._written_before += file.written - file.unsaved
        # Without space for an index, streaming readers still work; the next start repairs the file.
        with contextlib.suppress(OSError, DamagedLog):
            complete_in_place(file.active_path)
        if self._monotonic_s() - self._opened_at_s >= SOUND_AGE_S:
            self._retry_s = 0.0
        self._suffer(error)

    def _suffer(self, error: OSError) -> None:
        self._retry_at_s = self._monotonic_s() + self._retry_s
        self._retry_s = min(max(2 * self._retry_s, RETRY_FIRST_S), RETRY_LAST_S)
        place = error.filename or self._target.folder
        text = f"{place}: {error.strerror or error}"
        if self.trouble is None:
            again = "trying again" if self._target.retries else "giving up"
            stopped = f"recording stopped: {text}; {again}"
            cause = f"recording stopped: {error.strerror or error}"
            self.notices.append(RecorderNotice(Severity.ERROR, stopped, cause))
        self.trouble = text

    def _report_once(self, text: str) -> None:
        if text not in self._reported and len(self._reported) < 100:
            self._reported.add(text)
            self.notices.append(RecorderNotice(Severity.WARNING, text))

    def _repair(self, paths: list[Path]) -> None:
        """Repairs files on a separate thread, slowly: attitude and the new log come first."""

        def pause() -> None:
            if self._stop_repair.wait(REPAIR_PAUSE_S):
                raise InterruptedError("recording ended")

        for path in paths:
            try:
                try:
                    final = complete_in_place(path, pause)
                except DamagedLog:
                    final = replace_damaged(path, pause)
            except BlockingIOError:
                continue  # in use by another process
            except InterruptedError:
                return
            except OSError as error:
                self.notices.append(
                    RecorderNotice(Severity.WARNING, f"{path}: not repaired: {error}")
                )
                continue
            self.notices.append(
                RecorderNotice(Severity.NOTICE, f"{os.fspath(final)}: repaired", "log repaired")
            )
