"""One mutant against its tests, in a copy of the repository that nobody else works in."""

import contextlib
import difflib
import json
import multiprocessing
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from mutation.forks import ELSEWHERE
from mutation.line_map import ARGUMENTS, QUICK, Chosen, environment
from mutation.operators import Mutant

COPIED = ("h2nav", "tests", "tools", "configs", "gains", "native", "docs", "pyproject.toml")
SLOWER = 3.0  # than on the sound package; beyond, the mutant does not come to an end
TEST_S = 10.0  # of the processor: a test may take this and `SLOWER` times what the slowest takes
WAIT_S = 60.0  # of the clock: as `TEST_S`, for a mutant that waits for what does not come
WHOLE_S = 1200.0  # of the clock, for all tests of a mutant
MEMORY_BYTES = 4 << 30
PASSED = 0  # exit status of pytest, as the following
NO_TESTS = 5
# A module that cannot be imported hides the tests that were asked for: a wrong use, to pytest.
NOTICED = frozenset({1, 2, 4})
TIMEOUTS = ("from pytest-timeout", "processor timeout")
LOST = "ERROR: not found: "
# Libraries that nearly every test imports: each pytest starts as a fork of a process that has them.
_SERVER = multiprocessing.get_context("forkserver")
_SERVER.set_forkserver_preload(
    ["__main__", "pytest", "numpy", "scipy.signal", "scipy.optimize", "scipy.spatial.transform"]
)


class Verdict(NamedTuple):
    """What became of a mutant.

    Attributes:
        fate: ``killed``, ``timeout`` (killed too), ``survived``, ``untested``, or ``undecided``
            where the tests did not come to an end and which of them is to blame is not known.
        by: the test that failed first.
    """

    fate: str
    by: str = ""


class Workplace:
    """A copy of the repository in which one mutant at a time is tried.

    Args:
        repository: what is copied.
        folder: where to; made here.
        compiled: whether tests may use the compiled kernels.
    """

    def __init__(self, repository: Path, folder: Path, compiled: bool) -> None:
        self.folder = folder
        folder.mkdir(parents=True)
        left_out = (".hypothesis", *(() if compiled else ("*.so",)))
        ignore = shutil.ignore_patterns(*left_out)
        for name in COPIED:
            source = repository / name
            if source.is_dir():
                shutil.copytree(source, folder / name, ignore=ignore)
            else:
                shutil.copy(source, folder / name)
        self._environment = environment(folder, compiled)
        self._trials = 0

    def judge(self, mutant: Mutant, chosen: Chosen) -> Verdict:
        """Runs the tests on the mutant until one fails that passes, right after, on the sound text.

        A test that fails there too, as it may on a machine that is too busy, or that is gone
        because the mutant gives it another name, is left out, and the others judge.
        """
        while chosen.tests:
            status, output = self._try(mutant, chosen)
            if status is None:
                return Verdict("undecided")
            if status == PASSED:
                return Verdict("survived")
            if status == NO_TESTS:
                break
            if status not in NOTICED and status >= 0:
                raise RuntimeError(f"pytest ended with {status}:\n{output[-2000:]}")
            lost = _lost(output)
            by = _first_failure(output)
            if not lost and ("::" not in by or self._run(chosen.only(by))[0] == PASSED):
                return Verdict("timeout" if any(m in output for m in TIMEOUTS) else "killed", by)
            chosen = chosen.without(lost or {by})
        return Verdict("untested")

    def judge_forked(
        self, tasks: Sequence[tuple[Mutant, Sequence[str]]]
    ) -> Iterator[Verdict | None]:
        """Mutants, each with its test files, in forks of one pytest (`forks`), as they come.

        None where that cannot tell: `judge` has to.
        """
        files = sorted({file for _, own in tasks for file in own})
        asked, said = self.folder / "forks-in.json", self.folder / "forks-out.jsonl"
        asked.write_text(json.dumps(tasks), encoding="utf-8")
        said.write_text("", encoding="utf-8")
        command = [sys.executable, "-m", "pytest", *ARGUMENTS, *QUICK, "-p", "mutation.forks"]
        with (self.folder / "output.txt").open("w") as output, said.open(encoding="utf-8") as lines:
            process = subprocess.Popen(
                [*command, *files],
                cwd=self.folder,
                env=self._environment | {"FORKS_IN": str(asked), "FORKS_OUT": str(said)},
                stdout=output,
                stderr=output,
            )
            try:
                for _ in tasks:
                    line = lines.readline()
                    while not line and process.poll() is None:
                        time.sleep(0.1)
                        line = lines.readline()
                    fate, by = json.loads(line or f'["{ELSEWHERE}", ""]')
                    yield None if fate == ELSEWHERE else Verdict(fate, by)
            finally:
                process.kill()
                process.wait()

    def _try(self, mutant: Mutant, chosen: Chosen) -> tuple[int | None, str]:
        path = self.folder / mutant.module
        sound = path.read_bytes()
        try:
            self._write(path, mutant.applied(sound))
            return self._run(chosen)
        finally:
            self._write(path, sound)

    def _write(self, path: Path, text: bytes) -> None:
        """Each text with its own time, so that no compiled file of another one is taken for it."""
        self._trials += 1
        path.write_bytes(text)
        time_s = 1_000_000_000 + self._trials
        os.utime(path, (time_s, time_s))

    def _run(self, chosen: Chosen) -> tuple[int | None, str]:
        """The exit status of pytest, None where it did not end, and its output."""
        output = self.folder / "output.txt"
        limits = {
            "--timeout": WAIT_S + SLOWER * chosen.slowest_s,
            "--processor-s": TEST_S + SLOWER * chosen.slowest_processor_s,
            "--budget-s": chosen.budget_s,
        }
        arguments = [*ARGUMENTS, "-p", "mutation.processor_limit", "-x", "--tb=no"]
        arguments += [f"{name}={limit:g}" for name, limit in limits.items()]
        arguments += chosen.options
        process = _SERVER.Process(
            target=_pytest,
            args=(self.folder, [*arguments, *chosen.tests], output, self._environment),
        )
        process.start()
        process.join(WHOLE_S)
        status = process.exitcode
        with contextlib.suppress(ProcessLookupError):  # pytest, and what its tests have started
            os.killpg(process.pid or 0, signal.SIGKILL)
        process.join()
        return status, output.read_text(encoding="utf-8", errors="replace")


def _pytest(folder: Path, arguments: list[str], output: Path, variables: dict[str, str]) -> None:
    """Runs in a process of its own and ends it."""
    os.setsid()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    written = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(written, 1)
    os.dup2(written, 2)
    os.environ.update(variables)
    os.chdir(folder)
    sys.dont_write_bytecode = False  # or every mutant compiles the whole package again
    sys.path.insert(0, str(folder))
    status = int(pytest.main(arguments))
    sys.stdout.flush()
    os._exit(status)


def diff(sound: bytes, mutant: Mutant) -> str:
    """The mutant as a unified diff."""
    lines = difflib.unified_diff(
        sound.decode().splitlines(),
        mutant.applied(sound).decode().splitlines(),
        f"a/{mutant.module}",
        f"b/{mutant.module}",
        n=2,
        lineterm="",
    )
    return "\n".join(lines)


def change(sound: bytes, mutant: Mutant) -> tuple[str, str]:
    """The lines that differ, before and after, as one line each."""
    lines = diff(sound, mutant).splitlines()[2:]
    parts = ([line[1:].strip() for line in lines if line[0] == sign] for sign in "-+")
    was, becomes = (" ".join(part) for part in parts)
    return was, becomes


def _lost(output: str) -> set[str]:
    """The tests that were asked for and are not there, in modules that were imported."""
    if any(line.startswith("ERROR tests/") for line in output.splitlines()):
        return set()
    lines = (line for line in output.splitlines() if line.startswith(LOST))
    return {line[line.index("/tests/") + 1 :] for line in lines}


def _first_failure(output: str) -> str:
    """The node id, which may have blanks in it."""
    for line in output.splitlines():
        if line.startswith(("FAILED ", "ERROR ")):
            return line.partition(" ")[2].partition(" - ")[0]
    return "collection"
