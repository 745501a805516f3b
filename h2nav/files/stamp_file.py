"""The signing time stamp on disk: stamps increase over restarts whatever the host's clock reads.

The specification requires it to be stored at least once a minute. It is stored every
`SAVE_EVERY_S`, on a separate thread because a disk may be slow, and at the end.
"""

import threading
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from h2nav.files.whole_file import replace_whole
from h2nav.wire.signing import LARGEST_STAMP, STAMPS_PER_S, LocalStamp, stamp_at

SAVE_EVERY_S = 10.0

_LONGEST_FILE = 64


class StampFile:
    """One decimal number and a line feed, replaced atomically.

    Args:
        path: for one process and one key.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def load(self) -> int:
        """Returns the stored stamp; 0 if none was stored yet.

        Raises:
            OSError: the file exists and cannot be read.
            ValueError: it holds no stamp.
        """
        try:
            with self.path.open("rb") as stream:
                text = stream.read(_LONGEST_FILE)
        except FileNotFoundError:
            return 0
        stamp = int(text)
        if not 0 <= stamp <= LARGEST_STAMP:
            raise ValueError("no 48-bit number")
        return stamp

    def save(self, stamp: int) -> None:
        """Stores a stamp; after a power cut the file holds this stamp or the previous one.

        Raises:
            OSError: it cannot be stored; the previous stamp stays.
        """
        replace_whole(self.path, b"%d\n" % stamp)


class StampNotice(NamedTuple):
    """An event of the file, to be reported once."""

    is_error: bool  # the stamp is not safe on disk
    text: str  # one line


class StampKeeper:
    """Keeps the local stamp on disk until `close`.

    Attributes:
        stamp: the local stamp, never behind a stored one.
    """

    def __init__(self, path: Path, unix_ns: Callable[[], int]) -> None:
        self._file = StampFile(path)
        self._trouble = ""
        self._notices: deque[StampNotice] = deque()
        self.stamp = LocalStamp(unix_ns, self._start(unix_ns()))
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="h2nav-signing", daemon=True)
        self._thread.start()

    def notices(self) -> list[StampNotice]:
        """Returns the events since the last call; trouble appears when it begins or changes."""
        return [self._notices.popleft() for _ in range(len(self._notices))]

    def close(self, timeout_s: float | None = None) -> None:
        """Stores the stamp a last time; waits for a hanging disk until `timeout_s`."""
        self._closing.set()
        self._thread.join(timeout_s)

    def _start(self, now_unix_ns: int) -> int:
        """The first stamp: the stored one plus what may have been used after it.

        A clock behind the stored stamp is wrong. Stamps issued after the last save would then
        repeat, so a save interval's worth of stamps is skipped.
        """
        try:
            stored = self._file.load()
        except (OSError, ValueError) as error:
            self._report(
                True, f"cannot be read: {error}; it starts from the host's clock, right or wrong"
            )
            return 0
        if not stored or stamp_at(now_unix_ns) >= stored:
            return stored
        return min(stored + round(SAVE_EVERY_S * STAMPS_PER_S), LARGEST_STAMP)

    def _run(self) -> None:
        while not self._closing.is_set():
            self.save()
            self._closing.wait(SAVE_EVERY_S)
        self.save()

    def save(self) -> None:
        """Stores the stamp now; the keeper's thread also calls this periodically."""
        trouble = ""
        try:
            self._file.save(self.stamp.latest)
        except OSError as error:
            trouble = str(error)
        if trouble and trouble != self._trouble:
            self._report(
                True, f"cannot be stored: {trouble}; signing goes on, make its folder writable"
            )
        elif self._trouble and not trouble:
            self._report(False, "is stored again")
        self._trouble = trouble

    def _report(self, is_error: bool, text: str) -> None:
        self._notices.append(
            StampNotice(is_error, f"{self._file.path}: the signing time stamp {text}")
        )
