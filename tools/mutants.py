"""Puts small faults into h2nav, one at a time, and shows those that no test notices.

``make mutants ROOMS=service,wire N=300 SEED=1``. Lines of the rooms are drawn at random, and one
mutant of each. In a copy of the repository it faces first what ``make test`` runs of the files that
import the module, those of its room first, then of those that import what imports it, for some
seconds; then (without ``--near``) the tests of all its room that run its line, which takes hours to
find out. Golden files and processes are no judges here: what only they
notice is not stated by any test. Verdicts are kept in
``.mutants/`` and reused until the module (for a survivor: the tests) changes, so a run that was
broken off goes on. Survivors that were found to be equivalent stand in
``tools/mutation/equivalent.yaml`` with their reasons.

Ends with status 1 where a mutant survived that is not in that list.
"""

import argparse
import contextlib
import hashlib
import json
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from itertools import chain
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import yaml
from mutation.forks import NEAR_BUDGET_S
from mutation.line_map import QUICK, Chosen, LineMap, in_reach, record, test_files
from mutation.operators import Mutant, code_lines, mutants
from mutation.trial import Verdict, Workplace, change, diff
from tqdm import tqdm

REPOSITORY = Path(__file__).resolve().parent.parent
KEPT = REPOSITORY / ".mutants"
EQUIVALENT = REPOSITORY / "tools" / "mutation" / "equivalent.yaml"
BUDGET_S = 30.0  # of the processor, for the tests that a mutant faces
KILLED = ("killed", "timeout")
NEAR, ROOM = "near", "room"  # which tests a mutant faces


class Room(NamedTuple):
    """Where mutants are made, and who judges them.

    Attributes:
        modules: patterns of their paths.
        suites: test files and folders.
    """

    modules: tuple[str, ...]
    suites: tuple[str, ...]


# Beside `tests/unit/<room>`, with the most to say of it for their time; the others fly for minutes.
FURTHER = {
    "service": (
        "tests/wire",
        "tests/scenarios/test_before_arming.py",
        "tests/scenarios/test_comparison.py",
        "tests/scenarios/test_hostile_messages.py",
    ),
    "wire": ("tests/wire", "tests/unit/service"),
    "links": ("tests/wire", "tests/unit/apps"),
    "log": ("tests/unit/apps",),
    "recordings": (
        "tests/unit/apps/test_recorded_trials.py",
        "tests/unit/apps/test_recording_notices.py",
        "tests/unit/apps/test_review.py",
    ),
    "reviews": ("tests/unit/test_schemas.py",),
    "motion": (
        "tests/unit/service",
        "tests/unit/evaluation/test_observer.py",
        "tests/unit/calibration/test_odometry.py",
        "tests/scenarios/test_motion_twist.py",
        "tests/scenarios/test_motion_wheels.py",
        "tests/agreement/test_odometry_paths.py",
        "tests/agreement/test_odometry_solvers.py",
    ),
    "integrity": ("tests/unit/service/test_judgement.py",),
    "apps": ("tests/unit/test_cli.py", "tests/unit/evaluation/test_observer.py"),
    "attitude": ("tests/contract",),
    "flights": ("tests/unit/live",),
    "host": ("tests/unit/apps",),
    "maths": ("tests/laws",),
    "sim": ("tests/scenarios/test_streams.py",),
    "synthesis": ("tests/agreement/test_synthesis_shipped.py",),
    "translate": ("tests/unit/attitude",),
}
# Where a test of another room that imports a module may stand.
JUDGES = tuple(f"tests/{name}" for name in ("unit", "contract", "laws", "wire", "scenarios"))
# Their lines run in Python alone where the compiled ones are forbidden.
KERNELS = Room(
    ("h2nav/attitude/**/kernel/*.py", "h2nav/attitude/integer/*.py"),
    (
        "tests/unit/attitude",
        "tests/contract",
        "tests/scenarios/test_velocity_aided_faults.py",
        "tests/scenarios/test_velocity_aided_trials.py",
        "tests/scenarios/test_lost_attitude.py",
        "tests/agreement/test_fixed_float.py",
    ),
)
ROOMS = {
    folder.name: Room(
        (f"h2nav/{folder.name}/**/*.py",),
        (f"tests/unit/{folder.name}", *FURTHER.get(folder.name, ())),
    )
    for folder in sorted((REPOSITORY / "h2nav").iterdir())
    if (folder / "__init__.py").exists()
} | {
    "kernels": KERNELS,
    "package": Room(("h2nav/*.py",), ("tests/unit/test_cli.py", "tests/unit/test_validation.py")),
}


class Results:
    """Verdicts on the disk, one JSON document per line, appended as they come."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tests = _digest(sorted((REPOSITORY / "tests").rglob("*.py")))
        self._known: dict[str, dict[str, str]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                with contextlib.suppress(json.JSONDecodeError):  # cut off with its run
                    row = json.loads(line)
                    self._known[row["key"]] = row

    def verdict(self, mutant: Mutant, reach: str) -> Verdict | None:
        """What is known; a survivor has to face changed tests, and further ones, again."""
        row = self._known.get(_key(mutant))
        if row is None:
            return None
        has_lived = row["fate"] not in KILLED
        if has_lived and (row["tests"] != self._tests or row["reach"] not in (reach, ROOM)):
            return None
        return Verdict(row["fate"], row["by"])

    def keep(self, mutant: Mutant, verdict: Verdict, reach: str) -> None:
        """Appends a verdict."""
        row = {"key": _key(mutant), "tests": self._tests, "reach": reach, **verdict._asdict()}
        row["mutant"] = f"{mutant.module}:{mutant.line} {mutant.kind} {mutant.text!r}"
        with self._path.open("a", encoding="utf-8") as file:
            file.write("\n" + json.dumps(row) + "\n")
        self._known[row["key"]] = row


def main() -> int:
    """Draws, judges, reports."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--rooms", default=",".join(ROOMS), metavar="A,B", help=", ".join(ROOMS))
    parser.add_argument("-n", type=int, default=300, metavar="N", help="how many mutants")
    parser.add_argument("--seed", type=int, default=1, metavar="SEED", help="of the draw")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many at once")
    parser.add_argument("--near", action="store_true", help="only what is near the module")
    args = parser.parse_args()
    rooms = [ROOMS[name] for name in args.rooms.split(",")]
    reasons = equivalents()
    sample = draw(rooms, args.n, args.seed)
    verdicts = judge(sample, args.jobs, (NEAR,) if args.near else (NEAR, ROOM))
    return report(sample, verdicts, reasons)


def draw(rooms: Sequence[Room], count: int, seed: int) -> list[Mutant]:
    """Mutants of lines drawn at random, one each; the same seed draws the same ones.

    A line's lot depends on its text, so an edit elsewhere does not change the draw, and on how many
    equal ones are before it in the module, or all of them would be drawn together.
    """
    lots = []
    alike: Counter[str] = Counter()
    for line in (line for room in rooms for line in _lines(room)):
        texts = "".join(f"{mutant.kind} {mutant.text}\0" for mutant in line)
        source = (REPOSITORY / line[0].module).read_bytes().split(b"\n")[line[0].line - 1]
        place = f"{line[0].module} {source!r} {texts}"
        rng = random.Random(f"{seed} {alike[place]} {place}")
        alike[place] += 1
        lots.append((rng.random(), rng.choice(line)))
    return [mutant for _, mutant in sorted(lots)[:count]]


def _lines(room: Room) -> Iterator[list[Mutant]]:
    for module in _modules(room):
        for _, of_line in code_lines(mutants(module, (REPOSITORY / module).read_bytes())):
            yield of_line


def _modules(room: Room) -> list[str]:
    """Relative to the repository; a kernel is in no other room."""
    found = {path for pattern in room.modules for path in REPOSITORY.glob(pattern)}
    if room is not KERNELS:
        found -= {path for pattern in KERNELS.modules for path in REPOSITORY.glob(pattern)}
    return sorted(str(path.relative_to(REPOSITORY)) for path in found)


def judge(sample: Sequence[Mutant], jobs: int, reaches: Sequence[str]) -> list[Verdict]:
    """The verdicts on a sample, in its order."""
    KEPT.mkdir(exist_ok=True)
    results = Results(KEPT / "results.jsonl")
    room_of = {module: room for room in ROOMS.values() for module in _modules(room)}
    for reach in reaches:
        for compiled in (True, False):
            waiting = [
                mutant
                for mutant in sample
                if (room_of[mutant.module] is KERNELS) != compiled
                and results.verdict(mutant, reach) is None
            ]
            if waiting:
                suites = {mutant.module: room_of[mutant.module].suites for mutant in waiting}
                for mutant, verdict in _tried(waiting, suites, jobs, reach, compiled):
                    results.keep(mutant, verdict, reach)
    known = (results.verdict(mutant, reaches[-1]) for mutant in sample)
    return [verdict for verdict in known if verdict is not None]


def _tried(
    sample: Sequence[Mutant],
    suites: Mapping[str, Sequence[str]],
    jobs: int,
    reach: str,
    compiled: bool,
) -> Iterator[tuple[Mutant, Verdict]]:
    """Each mutant with its verdict, as they come; `suites` are those of each module's room."""
    with tempfile.TemporaryDirectory(prefix="h2nav-mutants-") as folder:
        places = [
            Workplace(REPOSITORY, Path(folder) / str(number), compiled) for number in range(jobs)
        ]
        free: SimpleQueue[Workplace] = SimpleQueue()
        for place in places:
            free.put(place)
        sound = places[0].folder
        files = {module: test_files(sound, found) for module, found in suites.items()}
        choose = _running(sound, files, jobs, compiled) if reach == ROOM else _near(sound, files)

        def tried(mutant: Mutant) -> tuple[Mutant, Verdict]:
            workplace = free.get()
            try:
                return mutant, workplace.judge(mutant, choose(mutant))
            finally:
                free.put(workplace)

        progress = tqdm(total=len(sample), desc=reach, unit="mutant")
        if reach == NEAR:
            left = []
            for room in sorted(set(suites.values())):
                own = [mutant for mutant in sample if suites[mutant.module] == room]
                tasks = [(mutant, choose(mutant).tests) for mutant in own]
                for mutant, verdict in zip(own, places[0].judge_forked(tasks), strict=True):
                    if verdict is None:
                        left.append(mutant)
                    else:
                        progress.update()
                        yield mutant, verdict
            sample = left
        with ThreadPoolExecutor(jobs) as pool:
            for future in as_completed([pool.submit(tried, mutant) for mutant in sample]):
                progress.update()
                yield future.result()


def _near(sound: Path, files: Mapping[str, Sequence[Path]]) -> Callable[[Mutant], Chosen]:
    """The quick tests of the files in reach of a mutant's module."""
    everywhere = test_files(sound, JUDGES)
    tests = {module: in_reach(sound, module, found, everywhere) for module, found in files.items()}
    return lambda mutant: Chosen(tests[mutant.module], budget_s=NEAR_BUDGET_S, options=QUICK)


def _running(
    sound: Path, files: Mapping[str, Sequence[Path]], jobs: int, compiled: bool
) -> Callable[[Mutant], Chosen]:
    """The tests that run a mutant's line, of all that run once to find out."""
    recordings = record(sound, KEPT / "lines", sorted({*chain(*files.values())}), jobs, compiled)
    lines = {
        module: LineMap(sound, [recordings[path] for path in found], BUDGET_S)
        for module, found in files.items()
    }
    return lambda mutant: lines[mutant.module].choose(mutant)


def report(
    sample: Sequence[Mutant],
    verdicts: Sequence[Verdict],
    reasons: Mapping[tuple[str, ...], str],
) -> int:
    """Prints survivors as diffs, and the score; 1 where one is not explained."""
    fates: Counter[str] = Counter()
    by_room: Counter[tuple[str, bool]] = Counter()
    unexplained = 0
    for mutant, verdict in zip(sample, verdicts, strict=True):
        text = (REPOSITORY / mutant.module).read_bytes()
        is_equivalent = (mutant.module, mutant.within, *change(text, mutant)) in reasons
        fate = verdict.fate
        if fate not in KILLED:
            fate = "equivalent" if is_equivalent else fate
            if not is_equivalent:
                unexplained += 1
                print(f"\n{verdict.fate}: {mutant.module}:{mutant.line}\n{diff(text, mutant)}")
        fates[fate] += 1
        if fate != "equivalent":
            by_room[mutant.module.rsplit("/", 1)[0], fate in KILLED] += 1
    print("\n" + ", ".join(f"{count} {fate}" for fate, count in sorted(fates.items())))
    for folder in sorted({folder for folder, _ in by_room}):
        killed, lived = by_room[folder, True], by_room[folder, False]
        print(f"{folder}: {killed} of {killed + lived} killed ({killed / (killed + lived):.0%})")
    return 1 if unexplained else 0


def equivalents() -> dict[tuple[str, ...], str]:
    """(module, function, line before, line after) -> why no test can notice it."""
    rows = yaml.safe_load(EQUIVALENT.read_text(encoding="utf-8")) or []
    place = ("module", "within", "was", "becomes")
    return {tuple(row[name] for name in place): row["reason"] for row in rows}


def _key(mutant: Mutant) -> str:
    text = (REPOSITORY / mutant.module).read_bytes()
    place = f"{mutant.module}:{mutant.start}:{mutant.stop}:{mutant.text}:"
    return hashlib.sha256(place.encode() + text).hexdigest()[:20]


def _digest(paths: Sequence[Path]) -> str:
    hashed = hashlib.sha256()
    for path in paths:
        hashed.update(path.read_bytes())
    return hashed.hexdigest()[:12]


if __name__ == "__main__":
    sys.exit(main())
