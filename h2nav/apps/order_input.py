"""Orders from standard input, all optional: keys on a terminal, lines from a pipe."""

import contextlib
import os
import sys
import termios
import tty
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Protocol, TextIO

READ_BYTES = 4096
LONGEST_LINE = 1000
TYPE_A_LINE = ":"
QUIT = "quit"  # the order that ends a program


class OrderInput(Protocol):
    """A source of orders."""

    has_keys: bool  # it may be a user at a terminal

    def fileno(self) -> int | None:
        """The descriptor to wait on; None while there is no input."""

    def read(self) -> list[str]:
        """Returns new orders; called when `fileno` is readable."""


@contextmanager
def order_input(keys: Mapping[str, str], stream: TextIO | None = None) -> Iterator[OrderInput]:
    """Switches a terminal to single keys inside the block, and restores it afterwards.

    Args:
        keys: the order of each key; ``:`` begins a line that is read as typed.
        stream: the source; standard input by default.
    """
    source = sys.stdin if stream is None else stream
    if source is None or source.closed:
        yield _Nobody()
    elif not source.isatty():
        yield _Lines(source.fileno())
    else:
        terminal = _Keys(source.fileno(), keys)
        try:
            yield terminal
        finally:
            terminal.leave()


class _Nobody:
    """A program that was started without standard input."""

    has_keys = False

    def fileno(self) -> int | None:
        return None

    def read(self) -> list[str]:
        return []


class _Lines:
    """A pipe, a file, or /dev/null."""

    has_keys = False

    def __init__(self, descriptor: int) -> None:
        self._descriptor: int | None = descriptor
        self._begun = b""

    def fileno(self) -> int | None:
        return self._descriptor

    def read(self) -> list[str]:
        data = _read(self._descriptor)
        if not data:
            self._descriptor = None
            data = b"\n" if self._begun else b""  # the last line may lack its line break
        *whole, begun = (self._begun + data).split(b"\n")
        # A longer line is no order; its end alone will be rejected as one.
        self._begun = begun[-LONGEST_LINE:]
        return [line.decode(errors="replace") for line in whole]


class _Keys:
    """A terminal, while in its foreground: reading it in the background would stop the process."""

    has_keys = True

    def __init__(self, descriptor: int, keys: Mapping[str, str]) -> None:
        self._descriptor = descriptor
        self._keys = keys
        self._as_it_was = termios.tcgetattr(descriptor)
        self._is_gone = False
        self._types_line = False

    def fileno(self) -> int | None:
        if not self._is_in_foreground():
            return None
        # Also after the process was stopped, when the shell had the terminal.
        if not self._types_line and self._gathers_lines():
            self._set(as_it_was=False)
        return self._descriptor

    def read(self) -> list[str]:
        data = _read(self._descriptor)
        text = data.decode(errors="replace")
        if self._types_line:
            self._set(as_it_was=False)
            return text.splitlines()
        self._is_gone = not data
        if TYPE_A_LINE in text:
            self._set(as_it_was=True)
        return [self._keys[key] for key in text if key in self._keys]

    def leave(self) -> None:
        """Restores the terminal."""
        if self._is_in_foreground():
            self._set(as_it_was=True)

    def _is_in_foreground(self) -> bool:
        try:
            return not self._is_gone and os.tcgetpgrp(self._descriptor) == os.getpgrp()
        except OSError:
            return False

    def _gathers_lines(self) -> bool:
        try:
            return bool(termios.tcgetattr(self._descriptor)[3] & termios.ICANON)
        except termios.error:
            return False

    def _set(self, *, as_it_was: bool) -> None:
        """Switches the terminal to lines, with its own editing, or to single keys."""
        self._types_line = as_it_was
        with contextlib.suppress(termios.error):
            if as_it_was:
                termios.tcsetattr(self._descriptor, termios.TCSANOW, self._as_it_was)
            else:
                tty.setcbreak(self._descriptor, termios.TCSANOW)


def _read(descriptor: int | None) -> bytes:
    """Returns the available bytes; none if the other side is closed."""
    try:
        return b"" if descriptor is None else os.read(descriptor, READ_BYTES)
    except OSError:
        return b""
