"""Feeds made-up input to all interfaces that take input from outside, for a given time.

``make fuzz MINUTES=60``, or ``python tools/fuzz.py explore --minutes 60 --targets service``. An
input that breaks something is reduced, written to ``out/fuzz/`` and shown with the command that
repeats it. Once fixed, move the file to ``tests/fuzz/corpus/TARGET/``, which every run of the tests
repeats.
"""

import argparse
import itertools
import os
import shlex
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

from tqdm import tqdm

REPOSITORY = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPOSITORY / "tests"))

from fuzz import wire_targets  # noqa: E402
from fuzz.shrink import shrunk, signature  # noqa: E402

FOUND = REPOSITORY / "out" / "fuzz"
SHRINK_S = 60.0
# The service has the most to say; its inputs are the longest, too.
TURNS = ("service", "service", "service", "deframer", "codec")


class Outcome(NamedTuple):
    """What became of one input.

    Attributes:
        target: that took it.
        frames: fed to it.
        slowest_s: time of the slowest step.
        most_told: notices in the worst minute.
        failure: signature of what broke; empty when all was well.
        data: the input that broke it.
        text: traceback.
    """

    target: str
    frames: int = 0
    slowest_s: float = 0.0
    most_told: int = 0
    failure: str = ""
    data: bytes = b""
    text: str = ""


def main() -> int:
    """Explores, or repeats one input."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    actions = parser.add_subparsers(dest="action", required=True)
    exploring = actions.add_parser("explore", help="new inputs for a while")
    exploring.add_argument("--minutes", type=float, default=5.0, metavar="M")
    exploring.add_argument("--frames", type=int, default=None, metavar="N", help="end earlier")
    exploring.add_argument("--targets", default=",".join(targets()), metavar="A,B")
    exploring.add_argument("--seed", type=int, default=1, help="of the first input")
    exploring.add_argument("--jobs", type=int, default=os.cpu_count() or 1)
    repeating = actions.add_parser("repeat", help="one input again, with its traceback")
    repeating.add_argument("target", choices=targets())
    repeating.add_argument("file", type=Path)
    args = parser.parse_args()
    if args.action == "repeat":
        with tempfile.TemporaryDirectory() as folder:
            run(args.target, args.file.read_bytes(), Path(folder))
        print(f"{args.file}: nothing breaks")
        return 0
    return explore(args)


def targets() -> tuple[str, ...]:
    """Everything that can be fuzzed."""
    return wire_targets.TARGETS + _file_targets()


def _file_targets() -> tuple[str, ...]:
    if find_spec("fuzz.file_targets") is None:
        return ()
    from fuzz import file_targets

    return tuple(file_targets.TARGETS)


def run(target: str, data: bytes, folder: Path) -> None:
    """Gives an input to its target."""
    if target in wire_targets.TARGETS:
        wire_targets.run(target, data, folder)
    else:
        from fuzz import file_targets

        file_targets.run(target, data, folder)


def explore(args: argparse.Namespace) -> int:
    """New inputs until the time is over; 1 where something broke."""
    wanted = args.targets.split(",")
    turns = [name for name in TURNS if name in wanted]
    turns += [name for name in wanted if name not in TURNS]
    inputs = zip(itertools.cycle(turns), itertools.count(args.seed), strict=False)
    totals: Counter[str] = Counter()
    failures: dict[str, Outcome] = {}
    slowest_s, most_told = 0.0, 0
    begun_s = time.monotonic()
    for outcome in _outcomes(inputs, args.jobs, 60.0 * args.minutes, args.frames):
        totals["inputs"] += 1
        totals["frames"] += outcome.frames
        slowest_s = max(slowest_s, outcome.slowest_s)
        most_told = max(most_told, outcome.most_told)
        if outcome.failure:
            totals["failures"] += 1
            known = failures.get(outcome.failure)
            if known is None or len(outcome.data) < len(known.data):
                failures[outcome.failure] = outcome
    seconds = time.monotonic() - begun_s
    for outcome in failures.values():
        _show(outcome)
    print(
        f"{totals['inputs']} inputs, {totals['frames']} frames in {seconds:.0f} s "
        f"({totals['frames'] / seconds:.0f} frames/s), slowest step {slowest_s * 1e3:.0f} ms, "
        f"at most {most_told} notices a minute, "
        f"{totals['failures']} failures of {len(failures)} kinds"
    )
    return 1 if failures else 0


def _outcomes(
    inputs: Iterator[tuple[str, int]], jobs: int, seconds: float, frames: int | None
) -> Iterator[Outcome]:
    """Runs inputs on all cores until time or frames are used up."""
    begun_s = time.monotonic()
    left = frames
    with (
        ProcessPoolExecutor(jobs) as pool,
        tqdm(total=round(seconds), unit="s", desc="fuzz") as bar,
    ):
        running: set[Future[Outcome]] = set()
        failed = 0
        while True:
            elapsed_s = time.monotonic() - begun_s
            bar.update(min(round(elapsed_s), bar.total) - bar.n)
            is_over = elapsed_s > seconds or (left is not None and left <= 0)
            while len(running) < jobs and not is_over:
                running.add(pool.submit(_try, *next(inputs)))
            if not running:
                return
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                outcome = future.result()
                left = None if left is None else left - outcome.frames
                failed += bool(outcome.failure)
                bar.set_postfix(failures=failed)
                yield outcome


def _try(target: str, seed: int) -> Outcome:
    """One input, in a process of the pool."""
    with tempfile.TemporaryDirectory() as folder:
        if target in wire_targets.TARGETS:
            try:
                explored = wire_targets.explore(target, seed, Path(folder))
            except wire_targets.FailureError as failure:
                return _failed(target, failure.data, failure.__cause__ or failure)
            return Outcome(target, *explored)
        from fuzz import file_targets

        data = file_targets.case(target, seed)
        begun_s = time.perf_counter()
        try:
            run(target, data, Path(folder))
        except Exception as error:
            return _failed(target, data, error)
        return Outcome(target, 1, time.perf_counter() - begun_s)


def _failed(target: str, data: bytes, error: BaseException) -> Outcome:
    text = "".join(traceback.format_exception(error)[-6:])
    return Outcome(target, failure=signature(error), data=data, text=text)


def _show(outcome: Outcome) -> None:
    """Shrinks, writes and prints what broke something."""
    data = b"".join(_parts(outcome.target, outcome.data))
    parts = _parts(outcome.target, data)
    small = shrunk(parts[1:], lambda some: _fails_so(outcome, [parts[0], *some]), SHRINK_S)
    text = b"".join((parts[0], *small))
    path = FOUND / _slug(outcome.target) / _slug(outcome.failure)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text)
    again = ("python", "tools/fuzz.py", "repeat", outcome.target, str(path.relative_to(REPOSITORY)))
    print(f"\n{outcome.text}{outcome.target}: {len(parts) - 1} parts shrunk to {len(small)}")
    print(f"repeat it: {shlex.join(again)}")


def _slug(text: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in text.lower()).split())


def _parts(target: str, data: bytes) -> list[bytes]:
    """What may be left out of an input: events of a session, else bytes; the first part stays."""
    if target == "service":
        return data.splitlines(keepends=True)
    return [b"", *(data[i : i + 1] for i in range(len(data)))]


def _fails_so(outcome: Outcome, parts: Sequence[bytes]) -> bool:
    with tempfile.TemporaryDirectory() as folder:
        try:
            run(outcome.target, b"".join(parts), Path(folder))
        except Exception as error:
            return signature(error) == outcome.failure
    return False


if __name__ == "__main__":
    sys.exit(main())
