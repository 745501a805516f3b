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
        self._terminal: int | None = None
        self._rest = b""
        with contextlib.suppress(io.UnsupportedOperation, ValueError):
            self._descriptor = stream.fileno()
            self._terminal = _opened_anew(self._descriptor)

    def say(self, text: str) -> bool:
        """Writes a text, whole or not at all.

        Returns:
            Whether it was written, or at least begun, where the rest will follow.
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
        """A terminal may take a part; the rest goes first the next time, so that none is torn."""
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
    """What there was no room for."""
    try:
        return data[os.write(descriptor, data) :]
    except BlockingIOError:
        return data


def _opened_anew(descriptor: int) -> int | None:
    """A terminal that does not make us wait; None where it is none, or cannot be opened.

    To be made not to wait, it has to be ours alone: others hold the stream too, such as the shell.
    That there is room on a terminal does not say for how much, so asking is not enough.
    """
    try:
        name = os.ttyname(descriptor)
        return os.open(name, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError:
        return None


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
