"""Where orders come from: keys of a terminal that is given back as it was, lines of a pipe."""

import os
import pty
import select
import signal
import sys
import termios
from contextlib import contextmanager

import pytest

from h2nav.apps.order_input import LONGEST_LINE, order_input

KEYS = {"g": "gps-lost", "0": "clear"}


@pytest.fixture
def pipe():
    """Both ends: what is written into the one is read from the other."""
    reader, writer = os.pipe()
    with os.fdopen(reader) as there, os.fdopen(writer, "wb", buffering=0) as here:
        yield there, here


def test_lines_of_a_pipe_come_whole(pipe):
    there, here = pipe
    with order_input(KEYS, there) as orders:
        assert orders.fileno() == there.fileno()
        here.write(b"gps-lost on\nscen")
        assert orders.read() == ["gps-lost on"]
        here.write(b"ario rest\n\n")
        assert orders.read() == ["scenario rest", ""]


def test_at_its_end_nothing_is_waited_for_any_more(pipe):
    there, here = pipe
    with order_input(KEYS, there) as orders:
        here.write(b"clear\nstatus")
        here.close()
        assert [orders.read(), orders.read()] == [["clear"], ["status"]]
        assert orders.fileno() is None


def test_a_line_without_an_end_takes_no_memory(pipe):
    there, here = pipe
    with order_input(KEYS, there) as orders:
        for _ in range(10):
            here.write(b"x" * 4000)
            assert orders.read() == []
        here.write(b"\xff\n")
        (line,) = orders.read()
        assert len(line) == LONGEST_LINE + 1


def test_a_program_may_have_no_standard_input():
    nowhere = open(os.devnull)  # noqa: SIM115
    nowhere.close()
    with order_input(KEYS, nowhere) as orders:
        assert orders.fileno() is None
        assert orders.read() == []


# A program that says what it was ordered, and in the end whether its terminal is as it was.
PROGRAM = """
import os, select, sys, termios
from h2nav.apps.order_input import order_input

report, is_in_background = os.fdopen(int(sys.argv[1]), "w", buffering=1), sys.argv[2:] == ["&"]
if is_in_background:
    child = os.fork()
    if child:
        os.waitpid(child, 0)
        sys.exit()
    os.setpgid(0, 0)
before = termios.tcgetattr(0)
with order_input({"g": "gps-lost", "0": "clear", "q": "quit"}) as orders:
    said = [] if is_in_background else [""]
    print("ready", orders.fileno(), file=report)
    while said and "quit" not in said:
        select.select([orders.fileno()], [], [])
        said = orders.read() or [""]
        for order in filter(None, said):
            print(order, file=report)
print(termios.tcgetattr(0) == before, file=report)
"""


@contextmanager
def on_a_terminal(*words):
    """The program on a terminal of its own: the keyboard, and what it reports."""
    reader, writer = os.pipe()
    os.set_inheritable(writer, True)
    child, keyboard = pty.fork()
    if child == 0:
        os.execv(sys.executable, [sys.executable, "-c", PROGRAM, str(writer), *words])
    os.close(writer)
    try:
        with os.fdopen(reader) as reports:
            yield keyboard, reports
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(keyboard)


def wait_for_line_mode(keyboard):
    while not termios.tcgetattr(keyboard)[3] & termios.ICANON:
        select.select([], [], [], 0.01)


def wait_for_keys(keyboard):
    while termios.tcgetattr(keyboard)[3] & termios.ICANON:
        select.select([], [], [], 0.01)


def test_keys_act_at_once_a_colon_begins_a_line_and_the_terminal_is_given_back():
    with on_a_terminal() as (keyboard, reports):
        assert reports.readline() == "ready 0\n"
        os.write(keyboard, b"g")
        assert reports.readline() == "gps-lost\n"
        os.write(keyboard, b"x\x1b[A0")  # neither a letter without a meaning nor an arrow
        assert reports.readline() == "clear\n"
        os.write(keyboard, b":")
        wait_for_line_mode(keyboard)
        os.write(keyboard, b"drop=0.3 onn\x7f\r")
        assert reports.readline() == "drop=0.3 on\n"
        os.write(keyboard, b":")
        wait_for_line_mode(keyboard)
        os.write(keyboard, b"\x04")  # Ctrl-D: no line after all
        wait_for_keys(keyboard)
        as_the_shell_does = termios.tcgetattr(keyboard)
        as_the_shell_does[3] |= termios.ICANON | termios.ECHO
        termios.tcsetattr(keyboard, termios.TCSANOW, as_the_shell_does)
        os.write(keyboard, b"0\n")
        assert reports.readline() == "clear\n"
        wait_for_keys(keyboard)
        os.write(keyboard, b"gq")
        assert [reports.readline() for _ in range(3)] == ["gps-lost\n", "quit\n", "True\n"]


def test_in_the_background_the_terminal_is_left_alone():
    with on_a_terminal("&") as (_, reports):
        assert reports.read() == "ready None\nTrue\n"
