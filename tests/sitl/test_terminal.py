"""`h2nav run` on a terminal, as an emulated terminal shows it, and for programs with `--json`."""

import fcntl
import os
import pty
import select
import signal
import struct
import termios
import time
from contextlib import contextmanager

import pyte
import pytest
from daemon_process import H2NAV, WAIT_S, daemon, fake_autopilot, free_udp_port

ROWS, COLUMNS = 24, 100


class Screen:
    """The terminal of a program."""

    def __init__(self, *words):
        self._screen = pyte.HistoryScreen(COLUMNS, ROWS, history=1000)
        self._stream = pyte.ByteStream(self._screen)
        self.child, self._terminal = pty.fork()
        if self.child == 0:
            os.execve(words[0], words, {**os.environ, "TERM": "xterm"})
        self.resize(COLUMNS, ROWS)

    def resize(self, columns, rows):
        fcntl.ioctl(self._terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
        self._screen.resize(rows, columns)

    @property
    def lines(self):
        return [line.rstrip() for line in self._screen.display]

    def until(self, condition):
        """Reads until the lines fulfil a condition; the lines."""
        end = time.monotonic() + WAIT_S
        while not condition(self.lines):
            assert time.monotonic() < end, "\n".join(self.lines)
            if select.select([self._terminal], [], [], 0.2)[0]:
                self._stream.feed(os.read(self._terminal, 65536))
        return self.lines

    def end(self, number=signal.SIGTERM):
        """Ends the program; its status, and what is left on the screen."""
        os.kill(self.child, number)
        try:
            while data := os.read(self._terminal, 65536):
                self._stream.feed(data)
        except OSError:  # the last process with this terminal has gone
            pass
        _, status = os.waitpid(self.child, 0)
        self.child = 0
        return os.waitstatus_to_exitcode(status), self.lines

    def close(self):
        if self.child:
            self.end(signal.SIGKILL)
        os.close(self._terminal)


@contextmanager
def screen_of(*words):
    screen = Screen(*words)
    try:
        yield screen
    finally:
        screen.close()


def starting_with(lines, text):
    return [line for line in lines if line.startswith(text)]


def shows_attitudes(lines):
    """Both attitudes and their difference have figures."""
    rows = [starting_with(lines, name) for name in ("h2nav  ", "autopilot  ", "difference tilt")]
    return all(rows) and all("." in row[0] for row in rows)


@pytest.fixture
def flying():
    """The URL at which a hovering vehicle is heard."""
    port = free_udp_port()
    with fake_autopilot(f"udpout:127.0.0.1:{port}", "--scenario", "hover"):
        yield f"udpin:127.0.0.1:{port}"


@pytest.mark.thorough
def test_the_panel_lives_survives_another_size_and_leaves_a_clean_screen(flying, tmp_path):
    with screen_of(*H2NAV, "run", "--connect", flying, "--log-dir", str(tmp_path)) as screen:
        lines = screen.until(shows_attitudes)
        for name in ("h2nav  ", "autopilot  ", "difference ", "log  "):
            assert len(starting_with(lines, name)) == 1, lines
        assert starting_with(lines, "active")
        assert starting_with(lines, "HIGHRES_IMU")
        assert starting_with(lines, "info: bound to ArduPilot quadrotor 1/1")
        screen.resize(50, 8)
        # what was read may end in the midst of a frame
        screen.until(lambda ls: max(map(len, ls)) == 49 and len(starting_with(ls, "h2nav  ")) == 1)
        screen.resize(COLUMNS, ROWS)
        screen.until(lambda lines: max(map(len, lines)) > 50)
        status, left = screen.end()
    assert status == 0
    text = "\n".join(left)
    assert "attitudes sent; log: " in text
    for gone in ("h2nav  ", "autopilot  ", "difference "):
        assert not starting_with(left, gone), text


@pytest.mark.thorough
def test_events_carry_time_and_attitude(flying):
    before_s = time.time()
    with daemon("--connect", flying) as running:
        event = running.wait_for(
            lambda event: event["event"] == "status" and event["autopilot_tilt_deg"] is not None
        )
        assert running.stop() == 0
    assert before_s < event["unix_s"] < time.time()
    ours, theirs = event["attitude"], event["autopilot_attitude"]
    assert abs(ours["roll_deg"] - theirs["roll_deg"]) < 5.0
    assert len(ours["q_nb"]) == len(theirs["q_nb"]) == 4
    assert 0.0 <= event["age_ms"] < 1000.0
    assert ours["sigma_tilt_deg"] > 0.0
