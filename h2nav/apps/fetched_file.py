"""A file that arrives in parts: written on a thread of its own, named when it is whole.

Beside the parts a second file says what is still missing, so that the next start goes on with them.
"""

import contextlib
import os
import threading
import time
from collections import deque
from pathlib import Path

import orjson

from h2nav.fetch.gaps import MAX_GAPS
from h2nav.fetch.log_fetch import LARGEST_LOG_BYTES, PartOfLog
from h2nav.files.whole_file import replace_whole, sync_folder

PART_SUFFIX = ".part"
MISSING_SUFFIX = ".part.json"
FILE_MODE = 0o640
# More waiting parts than a link brings in a second mean a disk that hangs.
MAX_WAITING = 4096
# What has come is noted so often; a power cut costs no more of it.
NOTE_S = 5.0
# Unfinished logs in a folder; an autopilot deletes its oldest ones too.
MAX_UNFINISHED = 4
_MAX_NOTE_BYTES = 1 << 20


class FetchedFile:
    """One file; the caller never waits for the disk.

    Args:
        path: its name once it is whole; until then it has the suffix `PART_SUFFIX`.
        part: the log; where parts of it are there already, the rest is written between them.
    """

    def __init__(self, path: Path, part: PartOfLog) -> None:
        self.path = path
        self.trouble = ""  # why it cannot be written
        self.is_whole = False  # it has its name
        self._size = part.size
        self._is_begun = part.gaps != ((0, part.size),)
        self._part = path.with_name(path.name + PART_SUFFIX)
        self._note = path.with_name(path.name + MISSING_SUFFIX)
        self._waiting: deque[tuple[int, bytes] | PartOfLog] = deque()
        self._wake = threading.Event()
        self._noted_s = time.monotonic()
        self._is_complete = self._is_set_aside = self._is_given_up = False
        self._thread = threading.Thread(target=self._run, name="h2nav-fetched", daemon=True)
        self._thread.start()

    @property
    def has_room(self) -> bool:
        """Whether the disk keeps up."""
        return len(self._waiting) < MAX_WAITING

    @property
    def wants_note(self) -> bool:
        """Whether what is missing has not been noted for a while."""
        return time.monotonic() - self._noted_s > NOTE_S

    def write(self, offset: int, data: bytes) -> None:
        """Writes a part."""
        self._waiting.append((offset, data))
        self._wake.set()

    def note(self, part: PartOfLog) -> None:
        """Notes what is missing besides all that was given to `write`."""
        self._noted_s = time.monotonic()
        self._waiting.append(part)
        self._wake.set()

    def complete(self) -> None:
        """Every part was given: the file gets its name when it is on the disk."""
        self._is_complete = True
        self._wake.set()

    def set_aside(self, part: PartOfLog) -> None:
        """Ends writing; what there is stays, to be gone on with."""
        self.note(part)
        self._is_set_aside = True
        self._wake.set()

    def give_up(self) -> None:
        """Removes what there is of it, unless it is whole."""
        self._is_given_up = True
        self._wake.set()

    def wait(self, timeout_s: float) -> None:
        """Waits until writing has ended."""
        self._thread.join(timeout_s)

    def _run(self) -> None:
        try:
            self._written()
        except OSError as error:
            self.trouble = f"{self._part}: {error.strerror or error}"
        finally:
            if not self.is_whole and (self.trouble or not self._is_set_aside):
                remove_unfinished(self.path)

    def _written(self) -> None:
        # What was begun has to be there: without it the rest would stand between holes.
        flags = os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC
        flags |= 0 if self._is_begun else os.O_CREAT | os.O_TRUNC
        with open(os.open(self._part, flags, FILE_MODE), "r+b", buffering=0) as stream:
            while not self._is_given_up:
                ends = self._is_complete or self._is_set_aside  # before: nothing is given after
                while self._waiting:
                    self._take(stream.fileno(), self._waiting.popleft())
                if ends:
                    break
                self._wake.wait()
                self._wake.clear()
            if not self._is_complete or self._is_given_up:
                return
            os.fsync(stream.fileno())
            if os.fstat(stream.fileno()).st_size != self._size:
                raise OSError(5, "has another size than the autopilot said", str(self._part))
        self._part.rename(self.path)
        sync_folder(self.path.parent)
        self._note.unlink(missing_ok=True)
        self.is_whole = True

    def _take(self, descriptor: int, given: tuple[int, bytes] | PartOfLog) -> None:
        if isinstance(given, PartOfLog):
            os.fsync(descriptor)  # the note is true only of what is on the disk
            replace_whole(self._note, orjson.dumps(given._asdict()), FILE_MODE)
        else:
            os.pwrite(descriptor, given[1], given[0])


def remove_unfinished(path: Path) -> None:
    """Removes what there is of a file that is not whole; `path` is the name that it would get."""
    for suffix in (MISSING_SUFFIX, PART_SUFFIX):
        with contextlib.suppress(OSError):
            path.with_name(path.name + suffix).unlink(missing_ok=True)


def unfinished(folder: Path) -> list[tuple[Path, PartOfLog]]:
    """The files of a folder that were begun, newest first, by the names that they will get.

    Beyond `MAX_UNFINISHED` they are removed, and so are those that nobody can go on with.
    """
    found: list[tuple[Path, PartOfLog]] = []
    for part in sorted(folder.glob(f"*{PART_SUFFIX}"), reverse=True):
        path = part.with_suffix("")
        begun = _noted(path)
        if begun is not None and not path.exists() and len(found) < MAX_UNFINISHED:
            found.append((path, begun))
        else:
            remove_unfinished(path)
    return found


def _noted(path: Path) -> PartOfLog | None:
    """What a note says; None if it cannot be true."""
    try:
        with path.with_name(path.name + MISSING_SUFFIX).open("rb") as stream:
            said = orjson.loads(stream.read(_MAX_NOTE_BYTES))
        gaps = tuple((int(start), int(end)) for start, end in said["gaps"])
        part = PartOfLog(int(said["size"]), int(said["time_utc"]), gaps)
    except (OSError, ValueError, TypeError, KeyError):
        return None
    places = [place for gap in gaps for place in gap]
    is_in_order = places == sorted(places) and 0 < len(gaps) <= MAX_GAPS
    is_within = 0 < part.size < LARGEST_LOG_BYTES and min(places, default=0) >= 0
    return part if is_in_order and is_within and max(places, default=0) <= part.size else None
