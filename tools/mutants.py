"""Puts small faults into h2nav, one at a time, and shows those that no test notices.

``make mutants ROOMS=service,wire N=300 SEED=1``. Lines of the rooms are drawn at random, and one
mutant of each. It faces the tests that run its line, in a copy of the repository; golden files and
processes are no judges here: what only they notice is not stated by any test. Verdicts are kept in
``.mutants/`` and reused until the module (for a survivor: the tests) changes, so a run that was
broken off goes on. Survivors that were found to be equivalent stand in
``tools/mutation/equivalent.yaml`` with their reasons.

Ends with status 1 where a mutant survived that is not in that list.
"""

import argparse
import hashlib
import json
import os
import random
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import SimpleQueue
from typing import NamedTuple

import yaml
from mutation.line_map import LineMap, record
from mutation.operators import Mutant, code_lines, mutants
from mutation.trial import Verdict, Workplace, change, diff
from tqdm import tqdm

REPOSITORY = Path(__file__).resolve().parent.parent
KEPT = REPOSITORY / ".mutants"
EQUIVALENT = REPOSITORY / "tools" / "mutation" / "equivalent.yaml"
BUDGET_S = 30.0  # of the processor, for the tests that a mutant faces
KILLED = ("killed", "timeout")


class Room(NamedTuple):
    """Where mutants are made, and who judges them.

    Attributes:
        modules: patterns of their paths.
        suites: test files and folders.
    """

    modules: tuple[str, ...]
    suites: tuple[str, ...]


# Those with the most to say of the service for their time; the others fly for minutes.
SCENARIOS = ("before_arming", "comparison", "hostile_messages")
ROOMS = {
    "service": Room(
        ("h2nav/service/**/*.py",),
        (
            "tests/unit/service",
            "tests/wire",
            *(f"tests/scenarios/test_{name}.py" for name in SCENARIOS),
        ),
    ),
    "wire": Room(("h2nav/wire/**/*.py",), ("tests/unit/wire", "tests/wire", "tests/unit/service")),
    "links": Room(("h2nav/links/**/*.py",), ("tests/unit/links", "tests/wire", "tests/unit/apps")),
    "log": Room(("h2nav/log/**/*.py",), ("tests/unit/log", "tests/unit/apps")),
    "recordings": Room(
        ("h2nav/recordings/**/*.py",),
        (
            "tests/unit/recordings",
            "tests/unit/apps/test_recorded_trials.py",
            "tests/unit/apps/test_recording_notices.py",
            "tests/unit/apps/test_review.py",
        ),
    ),
    "reviews": Room(
        ("h2nav/reviews/**/*.py",), ("tests/unit/reviews", "tests/unit/test_schemas.py")
    ),
    "motion": Room(
        ("h2nav/motion/**/*.py",),
        (
            "tests/unit/motion",
            "tests/unit/service",
            "tests/unit/evaluation/test_observer.py",
            "tests/unit/calibration/test_odometry.py",
            "tests/scenarios/test_motion_twist.py",
            "tests/scenarios/test_motion_wheels.py",
            "tests/agreement/test_odometry_paths.py",
            "tests/agreement/test_odometry_solvers.py",
        ),
    ),
    "integrity": Room(
        ("h2nav/integrity/**/*.py",),
        ("tests/unit/integrity", "tests/unit/service/test_judgement.py"),
    ),
    "airframes": Room(("h2nav/airframes/**/*.py",), ("tests/unit/airframes",)),
    "fetch": Room(("h2nav/fetch/**/*.py",), ("tests/unit/fetch",)),
    "flights": Room(("h2nav/flights/**/*.py",), ("tests/unit/flights", "tests/unit/live")),
    "maths": Room(("h2nav/maths/**/*.py",), ("tests/unit/maths", "tests/laws")),
    "kernels": Room(
        ("h2nav/attitude/**/kernel/*.py", "h2nav/attitude/integer/*.py"),
        (
            "tests/unit/attitude",
            "tests/contract",
            "tests/scenarios/test_velocity_aided_faults.py",
            "tests/scenarios/test_velocity_aided_trials.py",
            "tests/scenarios/test_lost_attitude.py",
            "tests/agreement/test_fixed_float.py",
        ),
    ),
}


class Results:
    """Verdicts on the disk, one JSON document per line, appended as they come."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._tests = _digest(sorted((REPOSITORY / "tests").rglob("*.py")))
        self._known: dict[str, dict[str, str]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                row = json.loads(line)
                self._known[row["key"]] = row

    def verdict(self, mutant: Mutant) -> Verdict | None:
        """What is known; a survivor has to face changed tests again."""
        row = self._known.get(_key(mutant))
        if row is None or (row["fate"] not in KILLED and row["tests"] != self._tests):
            return None
        return Verdict(row["fate"], row["by"])

    def keep(self, mutant: Mutant, verdict: Verdict) -> None:
        """Appends a verdict."""
        row = {"key": _key(mutant), "tests": self._tests, **verdict._asdict()}
        row["mutant"] = f"{mutant.module}:{mutant.line} {mutant.kind} {mutant.text!r}"
        with self._path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(row) + "\n")


def main() -> int:
    """Draws, judges, reports."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--rooms", default=",".join(ROOMS), metavar="A,B", help=", ".join(ROOMS))
    parser.add_argument("-n", type=int, default=300, metavar="N", help="how many mutants")
    parser.add_argument("--seed", type=int, default=1, metavar="SEED", help="of the draw")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="how many at once")
    args = parser.parse_args()
    rooms = [ROOMS[name] for name in args.rooms.split(",")]
    reasons = equivalents()
    sample = draw(rooms, args.n, args.seed)
    verdicts = judge(sample, rooms, args.jobs)
    return report(sample, verdicts, reasons)


def draw(rooms: Sequence[Room], count: int, seed: int) -> list[Mutant]:
    """Mutants of lines drawn at random, one each; the same seed draws the same ones.

    A line's lot depends on its text alone, so an edit elsewhere does not change the draw.
    """
    lots = []
    for line in (line for room in rooms for line in _lines(room)):
        texts = "".join(f"{mutant.kind} {mutant.text}\0" for mutant in line)
        source = (REPOSITORY / line[0].module).read_bytes().split(b"\n")[line[0].line - 1]
        rng = random.Random(f"{seed} {line[0].module} {source!r} {texts}")
        lots.append((rng.random(), rng.choice(line)))
    return [mutant for _, mutant in sorted(lots)[:count]]


def _lines(room: Room) -> Iterator[list[Mutant]]:
    for path in sorted(path for pattern in room.modules for path in REPOSITORY.glob(pattern)):
        module = str(path.relative_to(REPOSITORY))
        for _, of_line in code_lines(mutants(module, path.read_bytes())):
            yield of_line


def judge(sample: Sequence[Mutant], rooms: Sequence[Room], jobs: int) -> list[Verdict]:
    """The verdicts on a sample, in its order."""
    KEPT.mkdir(exist_ok=True)
    compiled = ROOMS["kernels"] not in rooms
    results = Results(KEPT / "results.jsonl")
    with tempfile.TemporaryDirectory(prefix="h2nav-mutants-") as folder:
        free: SimpleQueue[Workplace] = SimpleQueue()
        for number in range(jobs):
            free.put(Workplace(REPOSITORY, Path(folder) / str(number), compiled))
        sound = Workplace(REPOSITORY, Path(folder) / "sound", compiled)
        suites = [suite for room in rooms for suite in room.suites]
        recordings = record(sound.folder, KEPT / "lines", suites, jobs, compiled)
        lines = LineMap(sound.folder, recordings, BUDGET_S)

        def verdict(mutant: Mutant) -> Verdict:
            known = results.verdict(mutant)
            if known is not None:
                return known
            workplace = free.get()
            try:
                found = workplace.judge(mutant, lines.choose(mutant))
            finally:
                free.put(workplace)
            results.keep(mutant, found)
            return found

        with ThreadPoolExecutor(jobs) as pool:
            return list(tqdm(pool.map(verdict, sample), total=len(sample), unit="mutant"))


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
