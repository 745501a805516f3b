"""A pytest plugin: ends pytest when a test takes too much of the processor, skips what is over all.

Load it with ``-p mutation.processor_limit``. Unlike a limit by the clock it does not depend on what
else the machine does.
"""

import math
import os
import signal
import time
from collections.abc import Iterator
from types import FrameType

import pytest

IMPORTS_S = 60.0  # for the modules of all tests
_BEGUN_S = pytest.StashKey[float]()
_TERMINAL = os.dup(2)  # before pytest captures what tests print


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options."""
    parser.addoption("--processor-s", type=float, required=True, help="limit of each test")
    parser.addoption("--budget-s", type=float, default=math.inf, help="no test begins after this")


def pytest_configure() -> None:
    """A module may be what does not come to an end."""
    _limit("import", IMPORTS_S)


@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session: pytest.Session) -> None:
    """What imports took is not counted."""
    session.config.stash[_BEGUN_S] = time.process_time()


@pytest.hookimpl(tryfirst=True, specname="pytest_runtest_protocol")
def skip_beyond_budget(item: pytest.Item) -> bool | None:
    """A test that is not begun is neither passed nor failed."""
    used_s = time.process_time() - item.config.stash[_BEGUN_S]
    return True if used_s > item.config.getoption("--budget-s") else None


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
