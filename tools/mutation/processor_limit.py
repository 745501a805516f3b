"""A pytest plugin: ends pytest when a test takes too much of the processor.

Load it with ``-p mutation.processor_limit``. Unlike a limit by the clock it does not depend on what
else the machine does.
"""

import os
import signal
from collections.abc import Iterator
from types import FrameType

import pytest

IMPORTS_S = 60.0  # for the modules of all tests
_TERMINAL = os.dup(2)  # before pytest captures what tests print


def pytest_addoption(parser: pytest.Parser) -> None:
    """The option."""
    parser.addoption("--processor-s", type=float, required=True, help="limit of each test")


def pytest_configure() -> None:
    """A module may be what does not come to an end."""
    _limit("import", IMPORTS_S)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """The time begins anew with each test."""
    _limit(item.nodeid, item.config.getoption("--processor-s"))
    return (yield)


def _limit(subject: str, seconds: float) -> None:
    def end(_signal: int, _frame: FrameType | None) -> None:
        os.write(_TERMINAL, f"\nFAILED {subject} - processor timeout\n".encode())
        os._exit(int(pytest.ExitCode.TESTS_FAILED))

    signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, seconds)
