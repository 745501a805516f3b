"""The list of many flights: how long the index takes to be made anew, and a page of it.

Run: python tools/bench_flights.py [--flights N] [--folder DIR]
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from flight_folders import add_flights

from h2nav.flights.index import INDEX, SORTS, FlightIndex, Question


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=5000)
    parser.add_argument("--folder", help="for the flights; else temporary")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=args.folder) as root:
        folder = add_flights(Path(root), args.flights)
        (folder.reviews / INDEX).unlink(missing_ok=True)
        index = FlightIndex(folder)
        told("index made anew", [took(index.refresh)])
        told("folder looked at again", [took(index.refresh)])
        questions = [Question(sort=each, offset=args.flights // 2) for each in SORTS]
        questions += [Question(sort=each, search="crash plane") for each in SORTS]
        told("page", [took(lambda each=each: index.page(each)) for each in questions])
        index.close()


def took(work: Callable[[], object]) -> tuple[float, float]:
    """Time on the clock and of the processor, s."""
    begun = time.perf_counter(), time.process_time()
    work()
    return time.perf_counter() - begun[0], time.process_time() - begun[1]


def told(what: str, each: list[tuple[float, float]]) -> None:
    """Prints the longest."""
    wall_s, processor_s = map(max, zip(*each, strict=True))
    print(f"{what}: {1e3 * wall_s:.0f} ms, {1e3 * processor_s:.0f} ms of the processor")


if __name__ == "__main__":
    main()
