"""Which tests a mutant has to face: those that run its line, the quick ones first.

The map is recorded once per test file (`line_recorder`) and kept until the package or that file
changes. A line that only the import runs (a constant, a row of a table) is judged by the tests that
run a line where its name is used, and where there is none by all that run the module.
"""

import ast
import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from mutation.operators import Mutant

TOOLS = Path(__file__).resolve().parent.parent


class Chosen(NamedTuple):
    """The tests that judge one mutant.

    Attributes:
        tests: pytest's node ids, in the order in which they run.
        seconds: what they take together on the sound package.
        slowest_s: what the slowest of them takes.
    """

    tests: tuple[str, ...]
    seconds: float
    slowest_s: float


class LineMap:
    """Lines by test.

    Args:
        repository: a tree with h2nav and its tests.
        recordings: what `record` gave.
        budget_s: tests are added until they take this long together.
    """

    def __init__(
        self, repository: Path, recordings: Sequence[dict[str, dict]], budget_s: float
    ) -> None:
        self._repository = repository
        self._budget_s = budget_s
        self._seconds: dict[str, float] = {}
        self._tests_of: dict[tuple[str, int], set[str]] = {}
        for recording in recordings:
            for test, row in recording.items():
                self._seconds[test] = row["seconds"]
                for module, lines in row["lines"].items():
                    for line in lines:
                        self._tests_of.setdefault((module, line), set()).add(test)
        self._names = _Names(repository)

    def choose(self, mutant: Mutant) -> Chosen:
        """The tests for a mutant, its own line's first, then the rest of their files."""
        direct = self._running(mutant.module, self._names.statement(mutant))
        if not direct:
            for module, line in self._names.uses(mutant):
                direct |= self._running(module, (line,))
        if not direct:
            direct = {t for (module, _), tests in self._tests_of.items()
                      if module == mutant.module for t in tests}  # fmt: skip
        files = {test.split("::")[0] for test in direct}
        others = {test for test in self._seconds if test.split("::")[0] in files} - direct
        chosen: list[str] = []
        total_s = 0.0
        for test in (*self._by_time(direct), *self._by_time(others)):
            if chosen and total_s + self._seconds[test] > self._budget_s:
                continue
            chosen.append(test)
            total_s += self._seconds[test]
        slowest_s = max((self._seconds[test] for test in chosen), default=0.0)
        return Chosen(tuple(chosen), total_s, slowest_s)

    def _running(self, module: str, lines: Sequence[int]) -> set[str]:
        found = (self._tests_of.get((module, line), set()) for line in lines)
        return set().union(*found)

    def _by_time(self, tests: set[str]) -> list[str]:
        return sorted(tests, key=lambda test: (self._seconds[test], test))


class _Names:
    """Where in the package the names of a module are used."""

    def __init__(self, repository: Path) -> None:
        self._trees = {
            str(path.relative_to(repository)): ast.parse(path.read_bytes())
            for path in sorted((repository / "h2nav").rglob("*.py"))
        }

    def statement(self, mutant: Mutant) -> range:
        """The lines of the smallest statement around a mutant; a tracer may see only its first."""
        best = range(mutant.line, mutant.line + 1)
        for node in ast.walk(self._trees[mutant.module]):
            is_simple = isinstance(node, ast.stmt) and not hasattr(node, "body")
            if is_simple and node.lineno <= mutant.line <= (node.end_lineno or 0):
                best = range(node.lineno, (node.end_lineno or 0) + 1)
        return best

    def uses(self, mutant: Mutant) -> list[tuple[str, int]]:
        """The lines inside functions that use the names which the mutant's statement defines."""
        names = self._defined(mutant)
        lines = []
        for module, tree in self._trees.items():
            for node in ast.walk(tree):
                name = getattr(node, "id", None) or getattr(node, "attr", None)
                if name in names and isinstance(getattr(node, "ctx", None), ast.Load):
                    lines.append((module, node.lineno))
        return lines

    def _defined(self, mutant: Mutant) -> set[str]:
        """Names of the assignments, functions and classes around the mutant."""
        names: set[str] = set()
        for node in ast.walk(self._trees[mutant.module]):
            if not hasattr(node, "lineno") or not node.lineno <= mutant.line <= node.end_lineno:
                continue
            if isinstance(node, ast.Assign):
                names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                names.add(node.target.id)
            elif isinstance(node, ast.FunctionDef):
                names.add(node.name)
        return names


def record(repository: Path, kept: Path, suites: Sequence[str], jobs: int) -> list[dict]:
    """Runs every test file of the suites once under the recorder, as far as that is not kept.

    Args:
        repository: the tree to run in.
        kept: folder of the recordings.
        suites: test files and folders, relative to the tree.
        jobs: how many at once.

    Returns:
        For each file: test -> seconds and lines by module.
    """
    kept.mkdir(parents=True, exist_ok=True)
    package = _digest(sorted((repository / "h2nav").rglob("*.py")))
    support = _digest(sorted((repository / "tests").glob("*.py")))
    paths = [path for suite in suites for path in _test_files(repository / suite)]
    files = list(dict.fromkeys(paths))

    def recorded(path: Path) -> dict:
        name = f"{path.stem}-{_digest([path])[:12]}-{package[:12]}-{support[:12]}.json"
        target = kept / name
        if not target.exists():
            _run_recorder(repository, path, target)
        return json.loads(target.read_text(encoding="utf-8"))

    with ThreadPoolExecutor(jobs) as pool:
        rounds = pool.map(recorded, files)
        return list(tqdm(rounds, total=len(files), desc="which test runs which line", unit="file"))


def environment(repository: Path) -> dict[str, str]:
    """For a pytest that imports h2nav from `repository`, with the kernels in Python."""
    shared = os.environ.get("H2NAV_SHARED_DATA", TOOLS.parent.parent / "shared" / "data")
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(
            (str(repository), str(TOOLS), os.environ.get("PYTHONPATH", ""))
        ),
        "H2NAV_NATIVE": "forbid",
        "H2NAV_SHARED_DATA": str(shared),
        "H2NAV_REQUIRE_ALL": "0",
    }


def _run_recorder(repository: Path, path: Path, target: Path) -> None:
    part = target.with_suffix(".part")
    settings = {"LINES_OUT": str(part), "LINES_OF": str(repository / "h2nav")}
    command = [sys.executable, "-m", "pytest", "-q", "-n", "0", "-p", "no:cacheprovider"]
    command += ["-p", "mutation.line_recorder", str(path.relative_to(repository))]
    done = subprocess.run(
        command,
        cwd=repository,
        env=environment(repository) | settings,
        capture_output=True,
        text=True,
        check=False,
    )
    if not part.exists():
        raise RuntimeError(f"{path}: pytest failed\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    part.rename(target)


def _test_files(suite: Path) -> list[Path]:
    return [suite] if suite.is_file() else sorted(suite.rglob("test_*.py"))


def _digest(paths: Sequence[Path]) -> str:
    hashed = hashlib.sha256()
    for path in paths:
        hashed.update(str(path.name).encode() + b"\0" + path.read_bytes() + b"\0")
    return hashed.hexdigest()
