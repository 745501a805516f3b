"""Redrawn lines at the bottom of a terminal, below the text that scrolls."""

import os
from collections.abc import Sequence
from typing import TextIO

from h2nav.apps.voice import Voice

UP = "\x1b[{}A"
ERASE_LINE = "\x1b[K"
ERASE_BELOW = "\x1b[J"
NO_WRAP, WRAP = "\x1b[?7l", "\x1b[?7h"
USUAL_SIZE = os.terminal_size((80, 24))


class TerminalFooter:
    """Draws lines, writes text above them, and removes them without a trace.

    The cursor rests at the end of the last line. Nothing has to be restored if the program dies.
    """

    def __init__(self, stream: TextIO, voice: Voice) -> None:
        self._stream = stream
        self._voice = voice
        self._drawn: list[str] = []

    def draw(self, lines: Sequence[str]) -> None:
        """Replaces the lines, as far as they fit on the terminal."""
        self._write("", lines)

    def above(self, text: str) -> None:
        """Writes a whole text above the lines, where it stays."""
        self._write(f"{_printable(text)}\n", self._drawn)

    def remove(self) -> None:
        """Erases the lines and moves the cursor to their beginning."""
        self._write("", ())

    def _write(self, text: str, lines: Sequence[str]) -> None:
        columns, rows = _size(self._stream)
        # A line scrolled off the top could not be redrawn.
        shown = [_printable(line)[: columns - 1] for line in lines[: max(rows - 1, 1)]]
        body = "\n".join(line + ERASE_LINE for line in shown)
        if self._voice.say(f"{self._to_its_top(columns)}{text}{NO_WRAP}{body}{WRAP}{ERASE_BELOW}"):
            self._drawn = shown

    def _to_its_top(self, columns: int) -> str:
        """Moves to the beginning of the first line and erases below; counts drawn lines as wrapped
        by a terminal that has become narrower since.
        """
        if not self._drawn:
            return ""
        rows = sum(max(1, -(-len(line) // columns)) for line in self._drawn)
        return f"\r{UP.format(rows - 1) if rows > 1 else ''}{ERASE_BELOW}"


def _printable(line: str) -> str:
    """The line without characters that move the cursor."""
    return "".join(letter if letter.isprintable() else "?" for letter in line)


def _size(stream: TextIO) -> os.terminal_size:
    try:
        known = os.get_terminal_size(stream.fileno())
    except OSError:  # the terminal is closed
        return USUAL_SIZE
    # 0 if a terminal does not know its size
    return os.terminal_size(
        known_side or usual for known_side, usual in zip(known, USUAL_SIZE, strict=True)
    )
