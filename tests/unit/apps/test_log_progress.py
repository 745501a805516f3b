"""Bars are drawn on a terminal alone, and leave nothing behind."""

import io
import itertools
import sys

import pytest

from h2nav.apps.log_progress import byte_bar, count_bar


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(
    "bar", [lambda: byte_bar("reading"), lambda: count_bar("hearing", "ports")]
)
def test_a_pipe_gets_no_bar(monkeypatch, bar):
    monkeypatch.setattr(sys, "stderr", pipe := io.StringIO())
    with bar() as progress:
        progress(1, 2)
    assert pipe.getvalue() == ""


@pytest.mark.parametrize(
    ("bar", "total", "shown"),
    [
        (lambda: byte_bar("reading"), 4000, ("reading:  50%", "2.00k/4.00k")),
        (lambda: count_bar("hearing", "ports"), 4000, ("hearing:  50%", "2000/4000", "ports/s")),
    ],
)
def test_a_terminal_gets_one_that_ends_with_the_work(monkeypatch, bar, total, shown):
    monkeypatch.setattr(sys, "stderr", terminal := Terminal())
    # A second between any two draws.
    monkeypatch.setattr("tqdm.std.time", map(float, itertools.count()).__next__)
    with bar() as progress:
        progress(total // 4, total)
        progress(total // 2, total)
    drawn = terminal.getvalue()
    assert all(text in drawn for text in shown)
    assert drawn.split("\r")[-2].strip() == ""
