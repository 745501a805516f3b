"""Ctrl-C ends a worker at once, as a shell ends a program."""

import os
import signal

import pytest

from h2nav.fleet.interrupts import dask_setup


def test_an_interrupt_ends_a_worker_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    before, ended = signal.getsignal(signal.SIGINT), []
    monkeypatch.setattr(os, "_exit", ended.append)
    try:
        dask_setup(None)
        signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert ended == [128 + signal.SIGINT]
