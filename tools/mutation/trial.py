"""One mutant against its tests, in a copy of the repository that nobody else works in."""

import contextlib
import difflib
import os
import resource
import shutil
import signal
import subprocess
from pathlib import Path
from typing import NamedTuple

from mutation.line_map import PYTEST, Chosen, environment
from mutation.operators import Mutant

COPIED = ("h2nav", "tests", "tools", "configs", "gains", "native", "docs", "pyproject.toml")
START_S = 30.0  # for pytest and its imports on a busy machine
SLOWER = 3.0  # than on the sound package; beyond, the mutant does not come to an end
TEST_S = 10.0  # a test may take this and `SLOWER` times what the slowest one takes
MEMORY_BYTES = 4 << 30
PASSED = 0  # exit status of pytest, as the following
# A module that cannot be imported hides the tests that were asked for: a wrong use, to pytest.
NOTICED = frozenset({1, 2, 4})


class Verdict(NamedTuple):
    """What became of a mutant.

    Attributes:
        fate: ``killed``, ``timeout`` (killed too), ``survived`` or ``untested``.
        by: the test that failed first.
    """

    fate: str
    by: str = ""


class Workplace:
    """A copy of the repository in which one mutant at a time is tried.

    Args:
        repository: what is copied.
        folder: where to; made here.
    """

    def __init__(self, repository: Path, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True)
        ignore = shutil.ignore_patterns("__pycache__", "*.so", ".hypothesis")
        for name in COPIED:
            source = repository / name
            if source.is_dir():
                shutil.copytree(source, folder / name, ignore=ignore)
            else:
                shutil.copy(source, folder / name)
        self._trials = 0

    def judge(self, mutant: Mutant, chosen: Chosen) -> Verdict:
        """Runs the tests on the mutant until one fails."""
        if not chosen.tests:
            return Verdict("untested")
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

    def _run(self, chosen: Chosen) -> Verdict:
        test_s = TEST_S + SLOWER * chosen.slowest_s
        command = [*PYTEST, "-x", "--tb=no", f"--timeout={test_s:g}", *chosen.tests]
        process = subprocess.Popen(
            command,
            cwd=self.folder,
            env=environment(self.folder),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
        )
        resource.prlimit(process.pid, resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        try:
            output, _ = process.communicate(timeout=START_S + SLOWER * chosen.seconds)
        except subprocess.TimeoutExpired:
            return Verdict("timeout")
        finally:
            _end(process)
        if process.returncode == PASSED:
            return Verdict("survived")
        if process.returncode in NOTICED or process.returncode < 0:
            return Verdict("killed", _first_failure(output))
        raise RuntimeError(f"pytest ended with {process.returncode}:\n{output[-2000:]}")


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


def _end(process: "subprocess.Popen[str]") -> None:
    """Ends pytest and whatever its tests have started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def _first_failure(output: str) -> str:
    for line in output.splitlines():
        if line.startswith(("FAILED ", "ERROR ")):
            return line.split(" ")[1]
    return "collection"
