"""A pytest plugin: tries mutants in forks of one pytest that has imported the tests.

Load it with ``-p mutation.forks``. FORKS_IN names a JSON file of mutants, each with its test files;
a line with the verdict on each is appended to FORKS_OUT. A fork begins with fresh caches and
fixtures, without what it costs to start pytest and to import the package. There the functions that
a mutant changes get its code; what is worked out at import would need a new one, and is left to a
process of its own (``elsewhere``).
"""

import ast
import contextlib
import gc
import json
import os
import resource
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import NamedTuple

import pytest
from _pytest.runner import runtestprotocol

from mutation.operators import Mutant

ELSEWHERE = "elsewhere"
NEAR_BUDGET_S = 12.0  # of the processor: no test begins after it
TEST_S = 10.0  # of the processor, for one test
WAIT_S = 300.0  # of the clock, for all
MEMORY_BYTES = 4 << 30

Swap = tuple[FunctionType, CodeType]


class Failure(NamedTuple):
    """The first test that failed."""

    item: pytest.Item
    fate: str  # ``killed``, or ``timeout``


def pytest_runtestloop(session: pytest.Session) -> bool:
    """Instead of running the tests."""
    root = Path.cwd()
    functions = _functions(root / "h2nav")
    items: dict[str, list[pytest.Item]] = {}
    for item in session.items:
        items.setdefault(item.nodeid.partition("::")[0], []).append(item)
    tasks = json.loads(Path(os.environ["FORKS_IN"]).read_text(encoding="utf-8"))
    with Path(os.environ["FORKS_OUT"]).open("w", encoding="utf-8") as out:
        for number, (mutant, files) in enumerate(tasks):
            chosen = [item for file in files for item in items.get(file, ())]
            trial = _Trial(root, Mutant(*mutant), functions)
            out.write(json.dumps(trial.verdict(chosen, 1_500_000_000 + 2 * number)) + "\n")
            out.flush()
    return True


class _Trial:
    """One mutant."""

    def __init__(
        self, root: Path, mutant: Mutant, functions: dict[tuple[str, str, int], list[FunctionType]]
    ) -> None:
        self._path = root / mutant.module
        self._note = root / "fork.txt"
        self._sound = self._path.read_bytes()
        self._mutated = mutant.applied(self._sound)
        self._swaps: list[Swap] | None = []
        if any(path == str(self._path) for path, *_ in functions):
            self._swaps = _swaps(self._path, self._sound, self._mutated, functions)

    def verdict(self, items: list[pytest.Item], time_s: int) -> tuple[str, str]:
        """Fate, and the test that failed; a test that fails without the mutant too is no judge.

        Args:
            items: in the order in which they run.
            time_s: of the changed file, so that no compiled one is taken for it; and one more.
        """
        if self._swaps is None:
            return ELSEWHERE, ""
        while items:
            self._write(self._mutated, time_s)
            try:
                failure = self._forked(items, self._swaps)
            finally:
                self._write(self._sound, time_s + 1)
            if failure is None:
                return "survived", ""
            if self._forked([failure.item], []) is None:
                return failure.fate, failure.item.nodeid
            items = [item for item in items if item is not failure.item]
        return "untested", ""

    def _write(self, text: bytes, time_s: int) -> None:
        """For what is imported later, and by other processes."""
        self._path.write_bytes(text)
        os.utime(self._path, (time_s, time_s))

    def _forked(self, items: Sequence[pytest.Item], swaps: Sequence[Swap]) -> Failure | None:
        self._note.write_text("0", encoding="utf-8")
        pid = os.fork()
        if pid == 0:
            try:
                self._run(items, swaps)
            finally:
                os._exit(1)
        status = _ended(pid)
        if status == 0:
            return None
        place, _, word = self._note.read_text(encoding="utf-8").partition(" ")
        return Failure(items[int(place)], word or ("timeout" if status is None else "killed"))

    def _run(self, items: Sequence[pytest.Item], swaps: Sequence[Swap]) -> None:
        """In the fork, which ends here."""
        os.setsid()
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        for function, code in swaps:
            function.__code__ = code
        place = 0

        def end(_signal: int, _frame: FrameType | None) -> None:
            self._note.write_text(f"{place} timeout", encoding="utf-8")
            os._exit(1)

        signal.signal(signal.SIGPROF, end)
        begun_s = time.process_time()
        for place, item in enumerate(items):
            if time.process_time() - begun_s > NEAR_BUDGET_S:
                break
            self._note.write_text(f"{place}", encoding="utf-8")
            signal.setitimer(signal.ITIMER_PROF, TEST_S)
            following = items[place + 1] if place + 1 < len(items) else None
            reports = runtestprotocol(item, nextitem=following, log=False)
            signal.setitimer(signal.ITIMER_PROF, 0.0)
            if any(report.failed for report in reports):
                os._exit(1)
        os._exit(0)


def _ended(pid: int) -> int | None:
    """The status of a fork, not 0 where a signal ended it; None after `WAIT_S`."""
    until_s = time.monotonic() + WAIT_S
    ended, status = os.waitpid(pid, os.WNOHANG)
    while not ended and time.monotonic() < until_s:
        time.sleep(0.01)
        ended, status = os.waitpid(pid, os.WNOHANG)
    with contextlib.suppress(ProcessLookupError):  # it, and what its tests have started
        os.killpg(pid, signal.SIGKILL)
    if not ended:
        os.waitpid(pid, 0)
        return None
    return status


def _functions(package: Path) -> dict[tuple[str, str, int], list[FunctionType]]:
    """File, qualified name and first line -> the functions of a package that are imported."""
    gc.unfreeze()
    found: dict[tuple[str, str, int], list[FunctionType]] = {}
    for each in gc.get_objects():
        if isinstance(each, FunctionType) and each.__code__.co_filename.startswith(str(package)):
            found.setdefault(_place(each.__code__), []).append(each)
    gc.freeze()
    return found


def _place(code: CodeType) -> tuple[str, str, int]:
    return code.co_filename, code.co_qualname, code.co_firstlineno


def _swaps(
    path: Path,
    sound: bytes,
    mutated: bytes,
    functions: dict[tuple[str, str, int], list[FunctionType]],
) -> list[Swap] | None:
    """Functions that a mutant changes, with their code; None where a new import would be needed."""
    pairs = _pairs(compile(sound, str(path), "exec"), compile(mutated, str(path), "exec"))
    if pairs is None:
        return None
    swaps: list[Swap] = []
    at_import = used_at_import(sound)
    for old, new in pairs:
        own = functions.get(_place(old), [])
        if not own or any(each.__code__.co_freevars != new.co_freevars for each in own):
            return None
        if old.co_qualname in at_import:  # what it has returned stays
            return None
        swaps += [(each, new) for each in own]
    return swaps


def used_at_import(source: bytes) -> frozenset[str]:
    """The functions of a module that its own statements use, directly or through each other."""
    body = ast.parse(source).body
    functions = {each.name: each for each in body if isinstance(each, ast.FunctionDef)}
    waiting = [each for each in body if not isinstance(each, ast.FunctionDef | ast.ClassDef)]
    found: set[str] = set()
    while waiting:
        for node in ast.walk(waiting.pop()):
            if isinstance(node, ast.Name) and node.id in functions and node.id not in found:
                found.add(node.id)
                waiting.append(functions[node.id])
    return frozenset(found)


def _pairs(old: CodeType, new: CodeType) -> list[tuple[CodeType, CodeType]] | None:
    """The functions outside of others that differ; None where anything else does."""
    if _own(old) != _own(new):
        return None
    found = []
    for was, becomes in zip(_inner(old), _inner(new), strict=True):
        if was.co_flags & 0x1:  # CO_OPTIMIZED: a function, not the body of a class
            if _whole(was) != _whole(becomes):
                found.append((was, becomes))
        else:
            inside = _pairs(was, becomes)
            if inside is None:
                return None
            found += inside
    return found


def _inner(code: CodeType) -> list[CodeType]:
    return [each for each in code.co_consts if isinstance(each, CodeType)]


def _own(code: CodeType) -> tuple[object, ...]:
    """What it does, without its functions and its place in the file."""
    values = tuple(repr(each) for each in code.co_consts if not isinstance(each, CodeType))
    return code.co_code, values, code.co_names, code.co_varnames, len(_inner(code))


def _whole(code: CodeType) -> tuple[object, ...]:
    return (*_own(code), *map(_whole, _inner(code)))
