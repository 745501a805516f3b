"""What is drawn at the bottom of a terminal, as an emulated terminal shows it."""

import fcntl
import os
import select
import struct
import termios

import pyte
import pytest

from h2nav.apps.terminal_footer import TerminalFooter
from h2nav.apps.voice import Voice

LINES = ["active", "roll  +1.00", "log  0.3 MB"]


class Terminal:
    """A terminal of some size: what the footer writes into it is shown by `rows`."""

    def __init__(self, columns=40, rows=10):
        self._screen_side, keyboard_side = os.openpty()
        self.stream = os.fdopen(keyboard_side, "w")
        self.footer = TerminalFooter(self.stream, Voice(self.stream))
        self.resize(columns, rows)

    def resize(self, columns, rows, text=""):
        """Another size, of which a terminal shows the same text wrapped anew, from the top."""
        fcntl.ioctl(self.stream, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self._screen = pyte.Screen(columns, rows)
        self._emulator = pyte.Stream(self._screen)
        self._emulator.feed(text.replace("\n", "\r\n"))

    @property
    def rows(self):
        """What is on the screen, without the empty rest."""
        while select.select([self._screen_side], [], [], 0)[0]:
            self._emulator.feed(os.read(self._screen_side, 65536).decode())
        return "\n".join(line.rstrip() for line in self._screen.display).rstrip("\n").split("\n")

    @property
    def cursor(self):
        return self._screen.cursor.y, self._screen.cursor.x

    def close(self):
        self.stream.close()
        os.close(self._screen_side)


@pytest.fixture
def terminal():
    made = Terminal()
    yield made
    made.close()


def test_it_is_drawn_in_the_same_place_again_and_again(terminal):
    for size_mb in range(5):
        terminal.footer.draw([*LINES[:2], f"log  {size_mb} MB"])
    assert terminal.rows == [*LINES[:2], "log  4 MB"]


def test_what_becomes_shorter_leaves_nothing_behind(terminal):
    terminal.footer.draw(["degraded: something is wrong", *LINES[1:], "! an alarm", "! another"])
    terminal.footer.draw(LINES)
    assert terminal.rows == LINES


def test_a_text_above_stays_and_may_be_longer_than_the_terminal_is_wide(terminal):
    terminal.footer.draw(LINES)
    terminal.footer.above("notice: first")
    terminal.footer.above(f"notice: {'long ' * 8}")
    terminal.footer.draw(LINES)
    assert terminal.rows == [
        "notice: first", "notice: long long long long long long lo", "ng long", *LINES
    ]  # fmt: skip


def test_the_bottom_of_the_terminal_scrolls(terminal):
    terminal.footer.draw(LINES)
    for number in range(20):
        terminal.footer.above(f"notice: {number}")
    assert terminal.rows == [*(f"notice: {number}" for number in range(13, 20)), *LINES]


def test_a_small_terminal_shows_what_fits(terminal):
    terminal.resize(20, 3)
    for _ in range(3):
        terminal.footer.draw(["x" * 50, "y" * 19, "z", "never"])
    assert terminal.rows == ["x" * 19, "y" * 19]
    terminal.resize(1, 1)
    terminal.footer.draw(LINES)
    terminal.footer.draw(LINES)
    assert terminal.rows == [""]


@pytest.mark.parametrize("columns", [29, 15, 11, 60])
def test_after_another_size_nothing_is_left_of_the_old_lines(terminal, columns):
    wide = [*LINES, "w" * 30, "v" * 39]
    terminal.footer.draw(wide)
    assert terminal.rows == wide
    terminal.resize(columns, 30, "notice: before\n" + "\n".join(wide))
    terminal.footer.draw(wide)
    shown = [line[: columns - 1] for line in wide]
    notice = ["notice: before"[at : at + columns] for at in range(0, 14, columns)]
    assert terminal.rows == [*notice, *shown]


def test_it_goes_without_a_trace(terminal):
    terminal.footer.above("notice: before")
    terminal.footer.draw(LINES)
    terminal.footer.remove()
    assert terminal.rows == ["notice: before"]
    assert terminal.cursor == (1, 0)
    terminal.footer.above("the end")
    assert terminal.rows == ["notice: before", "the end"]


def test_nothing_that_is_shown_moves_the_cursor(terminal):
    terminal.footer.draw(["log  \x1b[2J\r\n\x07 name", *LINES[1:]])
    terminal.footer.above("notice: \x1b[H\nx")
    assert terminal.rows == ["notice: ?[H?x", "log  ?[2J??? name", *LINES[1:]]


def test_nobody_reads_it_and_it_neither_waits_nor_loses_count(terminal):
    for number in range(2000):
        terminal.footer.above(f"notice: {number}")
        terminal.footer.draw(LINES)
    assert "notice: 1999" not in terminal.rows
    terminal.footer.draw(LINES)
    terminal.footer.above("read again")
    assert terminal.rows[-4:] == ["read again", *LINES]
