"""A pytest plugin: which test runs which lines of h2nav, and how long it takes.

Load it with ``-p mutation.line_recorder``; LINES_OUT names the JSON file that it writes. It starts
before h2nav is imported, so that the lines of the import itself (context "") are known as such.
"""

import json
import os
import time
from collections.abc import Iterator
from pathlib import Path

import coverage
import pytest

_PACKAGE = Path(os.environ["LINES_OF"])
_recording = coverage.Coverage(data_file=None, source=[str(_PACKAGE)], config_file=False)
_seconds: dict[str, float] = {}
_processor_s: dict[str, float] = {}
_failed: set[str] = set()
_recording.start()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """What runs from now on belongs to this test."""
    _recording.switch_context(item.nodeid)
    begun_s = time.process_time()
    try:
        return (yield)
    finally:
        _processor_s[item.nodeid] = time.process_time() - begun_s
        _recording.switch_context("")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Durations of set-up, call and tear-down; a test that does not pass can kill nothing."""
    _seconds[report.nodeid] = _seconds.get(report.nodeid, 0.0) + report.duration
    if not report.passed:
        _failed.add(report.nodeid)


def pytest_sessionfinish() -> None:
    """Writes test -> seconds, of the clock and of the processor, and lines by module."""
    _recording.stop()
    data = _recording.get_data()
    tests = {
        test: {
            "seconds": round(seconds, 3),
            "processor_s": round(_processor_s[test], 3),
            "lines": {},
        }
        for test, seconds in _seconds.items()
        if test not in _failed
    }
    for path in data.measured_files():
        module = str(Path(path).relative_to(_PACKAGE.parent))
        for line, contexts in data.contexts_by_lineno(path).items():
            for test in contexts:
                if test in tests:
                    tests[test]["lines"].setdefault(module, []).append(line)
    Path(os.environ["LINES_OUT"]).write_text(json.dumps(tests), encoding="utf-8")
