"""A file that arrives in parts: written on a thread of its own, named when it is whole."""

import contextlib
import os
import threading
from collections import deque
from pathlib import Path

from h2nav.files.whole_file import sync_folder

PART_SUFFIX = ".part"
FILE_MODE = 0o640
# More waiting parts than a link brings in a second mean a disk that hangs.
MAX_WAITING = 4096


class FetchedFile:
    """One file; the caller never waits for the disk.

    Args:
        path: its name once it is whole; until then it has the suffix `PART_SUFFIX`.
        size: of the whole file, bytes.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.path = path
        self.trouble = ""  # why it cannot be written
        self.is_whole = False  # it has its name
        self._size = size
        self._part = path.with_name(path.name + PART_SUFFIX)
        self._waiting: deque[tuple[int, bytes]] = deque()
        self._wake = threading.Event()
        self._is_complete = self._is_given_up = False
        self._thread = threading.Thread(target=self._run, name="h2nav-fetched", daemon=True)
        self._thread.start()

    @property
    def has_room(self) -> bool:
        """Whether the disk keeps up."""
        return len(self._waiting) < MAX_WAITING

    def write(self, offset: int, data: bytes) -> None:
        """Writes a part."""
        self._waiting.append((offset, data))
        self._wake.set()

    def complete(self) -> None:
        """Every part was given: the file gets its name when it is on the disk."""
        self._is_complete = True
        self._wake.set()

    def give_up(self, timeout_s: float = 1.0) -> None:
        """Removes what there is of it, unless it is whole."""
        self._is_given_up = True
        self._wake.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._written()
        except OSError as error:
            self.trouble = f"{self._part}: {error.strerror or error}"
        finally:
            if not self.is_whole:
                with contextlib.suppress(OSError):
                    self._part.unlink(missing_ok=True)

    def _written(self) -> None:
        flags = os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
        with open(os.open(self._part, flags, FILE_MODE), "r+b", buffering=0) as stream:
            while not self._is_given_up:
                ends = self._is_complete  # read before: nothing is given after it
                while self._waiting:
                    offset, data = self._waiting.popleft()
                    os.pwrite(stream.fileno(), data, offset)
                if ends:
                    break
                self._wake.wait()
                self._wake.clear()
            if self._is_given_up:
                return
            os.fsync(stream.fileno())
            if os.fstat(stream.fileno()).st_size != self._size:
                raise OSError(5, "has another size than the autopilot said", str(self._part))
        self._part.rename(self.path)
        sync_folder(self.path.parent)
        self.is_whole = True
