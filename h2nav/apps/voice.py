"""Writes text without blocking: at once if there is room for it, otherwise not at all.

A pipe that is not read, a terminal stopped with Ctrl-S or a journal that hangs would block a
program that writes to it. The daemon must not block.
"""

import contextlib
import io
import os
import select
from typing import TextIO

# A pipe reports room for this many bytes (POSIX: PIPE_BUF on Linux).
ROOM_BYTES = 4096


class Voice:
    """Writes to a stream without ever waiting for its reader.

    Args:
        stream: standard output, standard error, or a text buffer.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream: TextIO | None = stream
        self._descriptor: int | None = None
        self._terminal: int | None = None
        self._rest = b""
        with contextlib.suppress(io.UnsupportedOperation, ValueError):
            self._descriptor = stream.fileno()
            self._terminal = _opened_anew(self._descriptor)

    def say(self, text: str) -> bool:
        """Writes a text completely or not at all.

        Returns:
            Whether it was written, or begun where the rest will follow.
        """
        if self._stream is None:
            return False
        try:
            if self._terminal is not None:
                return self._to_terminal(self._terminal, text)
            if self._descriptor is not None and not _has_room(self._descriptor, text):
                return False
            self._stream.write(text)
            if self._descriptor is not None:
                self._stream.flush()
        except OSError:
            self._give_up()
            return False
        return True

    def _to_terminal(self, terminal: int, text: str) -> bool:
        """Writes to a terminal, which may take a part; the next call writes the rest first."""
        if self._rest:
            self._rest = _written(terminal, self._rest)
        if self._rest:
            return False
        self._rest = _written(terminal, text.encode(errors="backslashreplace"))
        return True

    def _give_up(self) -> None:
        if self._terminal is not None:
            os.close(self._terminal)
        if self._stream is not None:
            discard(self._stream)
        self._terminal = self._stream = None


def _written(descriptor: int, data: bytes) -> bytes:
    """Writes what fits; returns the rest."""
    try:
        return data[os.write(descriptor, data) :]
    except BlockingIOError:
        return data


def _opened_anew(descriptor: int) -> int | None:
    """Opens a terminal again, non-blocking; returns None if it is not one or cannot be opened.

    The mode belongs to the open file, which other processes share, such as the shell. A terminal
    that reports room does not say for how much, so asking does not suffice.
    """
    try:
        name = os.ttyname(descriptor)
        return os.open(name, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None


def _has_room(descriptor: int, text: str) -> bool:
    """Whether a write would not block."""
    if len(text.encode(errors="replace")) > ROOM_BYTES:
        return False
    return bool(select.select([], [descriptor], [], 0)[1])


def discard(stream: TextIO) -> None:
    """Redirects a stream whose reader is gone, so that flushing it at exit does not fail."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)
