"""Which tests a mutant has to face: those that run its line, the quick ones first.

The map is recorded once per test file (`line_recorder`) and kept until that file, what it imports
beside the tests, or a module of h2nav in which it runs a line changes. A line that only the import
runs (a constant, a row of a table) is judged by the tests that run a line where its name is used,
and where there is none by all that run the module.
"""

import ast
import functools
import hashlib
import json
import math
import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence, Set
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

from mutation.operators import Mutant

# A browser is a process: what only it notices is not stated by any test.
NO_JUDGES = frozenset({"test_page_in_browser.py"})
TOOLS = Path(__file__).resolve().parent.parent
QUICK = ("-m", "not thorough")  # the lane of `make test`
ARGUMENTS = ("-q", "-p", "no:cacheprovider", "-p", "pytest_timeout")


class Chosen(NamedTuple):
    """The tests that judge one mutant.

    Attributes:
        tests: files or pytest's node ids, in the order in which they run.
        slowest_s: what the slowest of them took on the sound package, by the clock.
        slowest_processor_s: the same by the processor.
        budget_s: no test is begun after so much of the processor.
        options: further ones for pytest.
    """

    tests: tuple[str, ...]
    slowest_s: float = 0.0
    slowest_processor_s: float = 0.0
    budget_s: float = math.inf
    options: tuple[str, ...] = ()

    def only(self, test: str) -> "Chosen":
        """One test, with the same limits."""
        return self._replace(tests=(test,))

    def without(self, tests: Set[str]) -> "Chosen":
        """The other tests, with the same limits."""
        left = tuple(test for test in self.tests if test not in tests)
        left_out = tuple(f"--deselect={test}" for test in sorted(tests))
        return self._replace(tests=left, options=(*self.options, *left_out))


class LineMap:
    """Lines by test.

    Args:
        repository: a tree with h2nav and its tests.
        recordings: what `record` gave.
        budget_s: tests are added until they take the processor this long together; the clock
            would count what else was running when they were recorded.
    """

    def __init__(
        self, repository: Path, recordings: Sequence[dict[str, dict]], budget_s: float
    ) -> None:
        self._repository = repository
        self._budget_s = budget_s
        self._seconds: dict[str, float] = {}
        self._processor_s: dict[str, float] = {}
        self._tests_of: dict[tuple[str, int], set[str]] = {}
        for recording in recordings:
            for test, row in recording.items():
                self._seconds[test] = row["seconds"]
                self._processor_s[test] = row["processor_s"]
                for module, lines in row["lines"].items():
                    for line in lines:
                        self._tests_of.setdefault((module, line), set()).add(test)
        self._names = _Names(repository)

    def choose(self, mutant: Mutant) -> Chosen:
        """The tests for a mutant: its own line's first, then the rest of their files."""
        direct = self._running(self._names.lines(mutant))
        if not direct:
            direct = self._running(self._names.bodies(mutant.module))
        files = {_file(test) for test in direct}
        others = {test for test in self._seconds if _file(test) in files} - direct
        chosen: list[str] = []
        used_s = 0.0
        for test in (*self._in_order(direct, mutant), *self._in_order(others, mutant)):
            if chosen and used_s + self._processor_s[test] > self._budget_s:
                continue
            chosen.append(test)
            used_s += self._processor_s[test]
        return Chosen(
            tuple(chosen),
            max((self._seconds[test] for test in chosen), default=0.0),
            max((self._processor_s[test] for test in chosen), default=0.0),
        )

    def _running(self, lines: Iterable[tuple[str, int]]) -> set[str]:
        found = (self._tests_of.get(line, set()) for line in lines)
        return set().union(*found)

    def _in_order(self, tests: set[str], mutant: Mutant) -> list[str]:
        """Those of the module's own test file first, then the quick ones."""
        own = f"test_{Path(mutant.module).stem}"
        return sorted(
            tests,
            key=lambda test: (
                not Path(_file(test)).stem.startswith(own),
                self._seconds[test],
                test,
            ),
        )


class _Names:
    """Where in the package a mutant shows: where its line runs, or where its name is used."""

    def __init__(self, repository: Path) -> None:
        self._trees = {
            str(path.relative_to(repository)): ast.parse(path.read_bytes())
            for path in sorted((repository / "h2nav").rglob("*.py"))
        }

    def lines(self, mutant: Mutant) -> list[tuple[str, int]]:
        """Module and number of the lines whose tests have to notice the mutant.

        What only the import runs would count for the test that happened to import it first.
        """
        function = self._function(mutant)
        if function is None:
            return self._uses(self._assigned(mutant))
        body = range(function.body[0].lineno, (function.end_lineno or 0) + 1)
        if mutant.line not in body:  # a default value
            return [(mutant.module, line) for line in body]
        return [(mutant.module, line) for line in self._statement(mutant)]

    def bodies(self, module: str) -> list[tuple[str, int]]:
        """All lines of a module that are inside functions."""
        functions = [n for n in ast.walk(self._trees[module]) if isinstance(n, ast.FunctionDef)]
        return [
            (module, line)
            for function in functions
            for line in range(function.body[0].lineno, (function.end_lineno or 0) + 1)
        ]

    def _function(self, mutant: Mutant) -> ast.FunctionDef | None:
        """The innermost function around a mutant."""
        around = [
            node
            for node in ast.walk(self._trees[mutant.module])
            if isinstance(node, ast.FunctionDef)
            and node.lineno <= mutant.line <= (node.end_lineno or 0)
        ]
        return max(around, key=lambda node: node.lineno, default=None)

    def _statement(self, mutant: Mutant) -> range:
        """The lines of the smallest statement around a mutant; a tracer may see only its first."""
        best = range(mutant.line, mutant.line + 1)
        for node in ast.walk(self._trees[mutant.module]):
            is_simple = isinstance(node, ast.stmt) and not hasattr(node, "body")
            if is_simple and node.lineno <= mutant.line <= (node.end_lineno or 0):
                best = range(node.lineno, (node.end_lineno or 0) + 1)
        return best

    def _uses(self, names: set[str]) -> list[tuple[str, int]]:
        """The lines that read one of these names."""
        lines = []
        for module, tree in self._trees.items():
            for node in ast.walk(tree):
                name = getattr(node, "id", None) or getattr(node, "attr", None)
                if name in names and isinstance(getattr(node, "ctx", None), ast.Load):
                    lines.append((module, node.lineno))
        inside = {
            line for module in {module for module, _ in lines} for line in self.bodies(module)
        }
        return [line for line in lines if line in inside]

    def _assigned(self, mutant: Mutant) -> set[str]:
        """The names that the statement around the mutant gives a value."""
        names: set[str] = set()
        for node in ast.walk(self._trees[mutant.module]):
            if not isinstance(node, (ast.Assign, ast.AnnAssign)):
                continue
            if node.lineno <= mutant.line <= (node.end_lineno or 0):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                for target in targets:
                    names |= {n.id for n in ast.walk(target) if isinstance(n, ast.Name)}
        return names


def test_files(repository: Path, suites: Iterable[str]) -> list[Path]:
    """The test files of suites, which are files or folders relative to the tree."""
    found = (path for suite in suites for path in _test_files(repository / suite))
    return list(dict.fromkeys(found))


def own_first(repository: Path, module: str, files: Iterable[Path]) -> list[str]:
    """Test files, relative to the tree: the own of module and folder first, then the short ones.

    Of those with the module's name, or without, the ones that import it come first: that of
    another module may begin alike.
    """
    files = list(files)
    names = [f"test_{Path(module).stem}", f"test_{Path(module).parent.name}"]
    direct = _importers(module, files)

    def place(path: Path) -> tuple[list[bool], bool, int, Path]:
        is_other = [not path.stem.startswith(name) for name in names]
        return is_other, path not in direct, path.stat().st_size, path

    return [str(path.relative_to(repository)) for path in sorted(files, key=place)]


def in_reach(
    repository: Path, module: str, files: Sequence[Path], everywhere: Sequence[Path]
) -> tuple[str, ...]:
    """Test files that may notice a fault of a module, relative to the tree, the likeliest first.

    The `nearest` of its room's `files`, those of `everywhere` that import it, and those of its room
    that import what imports it.
    """
    package = sorted((repository / "h2nav").rglob("*.py"))
    above = (str(path.relative_to(repository)) for path in _importers(module, package))
    circles = (
        nearest(repository, module, files),
        _importers(module, everywhere),
        [path for one in above for path in _importers(one, files)],
    )
    found = (path for circle in circles for path in own_first(repository, module, circle))
    return tuple(dict.fromkeys(found))


def nearest(repository: Path, module: str, files: Sequence[Path]) -> list[Path]:
    """Those of some test files that import a module or have its name.

    Where there is none, those that import a module that imports it, and so on; for a command, which
    is loaded by its name, those that name it; and else all.
    """
    package = sorted((repository / "h2nav").rglob("*.py"))
    stem = Path(module).stem
    near = {path for path in files if path.stem.startswith(f"test_{stem}")}
    near |= _importers(module, files)
    modules, seen = {module}, {module}
    while modules and not near:
        near = {path for one in modules for path in _importers(one, files)}
        above = {path for one in modules for path in _importers(one, package)}
        modules = {str(path.relative_to(repository)) for path in above} - seen
        seen |= modules
    if not near:
        words = [f'"{word}"' for word in stem.split("_")]
        near = {path for path in files if all(word in path.read_text("utf-8") for word in words)}
    return [path for path in files if path in near] or list(files)


@functools.cache
def _imports(path: Path) -> frozenset[str]:
    """What a file imports: the modules, and what is taken from a package, dotted."""
    found = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(str(node.module))
            found |= {f"{node.module}.{name.name}" for name in node.names}
    return frozenset(found)


def _importers(module: str, files: Iterable[Path]) -> set[Path]:
    dotted = module.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    return {path for path in files if dotted in _imports(path)}


def record(
    repository: Path, kept: Path, files: Sequence[Path], jobs: int, compiled: bool
) -> dict[Path, dict]:
    """Runs every test file once under the recorder, as far as that is not kept.

    Args:
        repository: the tree to run in.
        kept: folder of the recordings.
        files: test files of the tree.
        jobs: how many at once.
        compiled: with the compiled kernels, where the tree has them.

    Returns:
        For each file: test -> seconds and lines by module.
    """
    kept.mkdir(parents=True, exist_ok=True)
    support = {path.stem: path for path in sorted((repository / "tests").glob("*.py"))}

    def recorded(path: Path) -> dict:
        made_of = _digest([path, *_supporting(path, support)])
        target = kept / f"{path.stem}-{made_of[:12]}-{'compiled' if compiled else 'python'}.json"
        if not (target.exists() and _is_current(target, repository)):
            _run_recorder(repository, path, target, compiled)
        return json.loads(target.read_text(encoding="utf-8"))["tests"]

    with ThreadPoolExecutor(jobs) as pool:
        rounds = pool.map(recorded, files)
        progress = tqdm(rounds, total=len(files), desc="which test runs which line", unit="file")
        return dict(zip(files, progress, strict=True))


def environment(repository: Path, compiled: bool) -> dict[str, str]:
    """For a pytest that imports h2nav from `repository`; `compiled` allows the compiled kernels."""
    shared = os.environ.get("H2NAV_SHARED_DATA", TOOLS.parent.parent / "shared" / "data")
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(
            (str(repository), str(TOOLS), os.environ.get("PYTHONPATH", ""))
        ),
        "H2NAV_NATIVE": "" if compiled else "forbid",
        # most of the time that pytest needs to start goes into plugins that are not used here
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
        "H2NAV_SHARED_DATA": str(shared),
        "H2NAV_REQUIRE_ALL": "0",
    }


def _is_current(target: Path, repository: Path) -> bool:
    """Whether the modules whose lines a recording has are what they were."""
    modules = json.loads(target.read_text(encoding="utf-8"))["modules"]
    paths = {module: repository / module for module in modules}
    return all(
        path.exists() and _digest([path]) == modules[module] for module, path in paths.items()
    )


def _supporting(path: Path, support: Mapping[str, Path]) -> list[Path]:
    """The modules beside the tests that a test file imports, itself or through another one."""
    found: dict[str, Path] = {}
    waiting = [path]
    while waiting:
        for node in ast.walk(ast.parse(waiting.pop().read_bytes())):
            name = node.module if isinstance(node, ast.ImportFrom) else None
            if name in support and name not in found:
                found[name] = support[name]
                waiting.append(support[name])
    return [found[name] for name in sorted(found)]


def _run_recorder(repository: Path, path: Path, target: Path, compiled: bool) -> None:
    part = target.with_suffix(".part")
    settings = {"LINES_OUT": str(part), "LINES_OF": str(repository / "h2nav")}
    command = [
        sys.executable,
        "-m",
        "pytest",
        *ARGUMENTS,
        "-p",
        "mutation.line_recorder",
        str(path.relative_to(repository)),
    ]
    done = subprocess.run(
        command,
        cwd=repository,
        env=environment(repository, compiled) | settings,
        capture_output=True,
        text=True,
        check=False,
    )
    if not part.exists():
        raise RuntimeError(f"{path}: pytest failed\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    tests = json.loads(part.read_text(encoding="utf-8"))
    modules = sorted({module for row in tests.values() for module in row["lines"]})
    digests = {module: _digest([repository / module]) for module in modules}
    target.write_text(json.dumps({"modules": digests, "tests": tests}), encoding="utf-8")
    part.unlink()


def _file(test: str) -> str:
    return test.partition("::")[0]


def _test_files(suite: Path) -> list[Path]:
    files = [suite] if suite.is_file() else sorted(suite.rglob("test_*.py"))
    return [path for path in files if path.name not in NO_JUDGES]


def _digest(paths: Sequence[Path]) -> str:
    hashed = hashlib.sha256()
    for path in paths:
        hashed.update(str(path.name).encode() + b"\0" + path.read_bytes() + b"\0")
    return hashed.hexdigest()
