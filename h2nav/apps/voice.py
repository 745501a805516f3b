"""Text for whoever reads it: written at once where there is room for it, else dropped.

A pipe that nobody reads, a terminal that is held with Ctrl-S or a journal that hangs would stop a
program that writes to it. The daemon must not stop.
"""

import contextlib
import io
import os
import select
from typing import TextIO

# Whether a pipe has room is known for so many bytes (POSIX: PIPE_BUF on Linux).
ROOM_BYTES = 4096


class Voice:
    """Writes to a stream without ever waiting for its reader.

    Args:
        stream: standard output, standard error, or a text buffer.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream: TextIO | None = stream
        self._descriptor: int | None = None
        with contextlib.suppress(io.UnsupportedOperation, ValueError):
            self._descriptor = stream.fileno()

    def say(self, text: str) -> bool:
        """Writes a text, whole or not at all.

        Returns:
            Whether it was written.
        """
        if self._stream is None:
            return False
        try:
            if self._descriptor is not None and not _has_room(self._descriptor, text):
                return False
            self._stream.write(text)
            if self._descriptor is not None:
                self._stream.flush()
        except OSError:
            discard(self._stream)
            self._stream = None
        return self._stream is not None


def _has_room(descriptor: int, text: str) -> bool:
    """Whether a write would not wait."""
    if len(text.encode(errors="replace")) > ROOM_BYTES:
        return False
    return bool(select.select([], [descriptor], [], 0)[1])


def discard(stream: TextIO) -> None:
    """Redirects a stream whose reader has gone, so that its rest does not fail at exit."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
