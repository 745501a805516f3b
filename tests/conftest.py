"""Options that every test may use."""

import gc
import os

import pytest

# Before numpy is imported: its matrices are small here, and threads that wait for each other beside
# the other workers take several times the processor time of the work itself.
for library in ("OPENBLAS", "OMP", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Half as many again as there are cores: many tests wait for a process, a link or a clock."""
    cores = len(os.sched_getaffinity(0))
    return cores + cores // 2


# Folders of tests that wait for processes, links and clocks most of the time.
WAITING = ("authorities", "faults", "sitl")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with long tests come first, so that none of these is left alone at the end.

    Of these such that wait: meanwhile other tests, and in CI the packages, have the processor.
    """
    long = {item.path for item in items if item.get_closest_marker("thorough") is not None}
    items.sort(key=lambda i: (i.path not in long, i.path.parent.name not in WAITING))


def pytest_collection() -> None:
    """Six thousand tests are made of what stays: it need not be searched for garbage."""
    gc.disable()


def pytest_collection_finish() -> None:
    gc.collect()
    gc.freeze()
    gc.enable()
    # Reviews and flights make many objects and few cycles; see docs/performance.md.
    gc.set_threshold(100_000)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--update-golden", action="store_true", help="rewrite golden outputs")


@pytest.fixture
def update_golden(request: pytest.FixtureRequest) -> bool:
    return bool(request.config.getoption("--update-golden"))
