"""Processor time of reading and checking a recording's frames, many at a time and one by one.

Run: python tools/bench_front_end.py FLIGHT
"""

import argparse
import time
from pathlib import Path

from h2nav.recordings.recording import open_recording
from h2nav.wire.deframer import Deframer
from h2nav.wire.frame_scan import FrameScan

ROUNDS = 3


def together(path: Path) -> int:
    scan = FrameScan()
    return sum(len(scan.frames_of(batch).arrivals) for batch in open_recording(path).batches())


def one_by_one(path: Path) -> int:
    deframer = Deframer()
    return sum(len(deframer.feed(data)) for _, data in open_recording(path).received())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flight", type=Path, metavar="FLIGHT")
    path = parser.parse_args().flight
    for name, work in (("together", together), ("one by one", one_by_one)):
        best = float("inf")
        for _ in range(ROUNDS):
            start = time.process_time()
            frames = work(path)
            best = min(best, time.process_time() - start)
        print(f"{name:10} {frames} frames, {1e6 * best / frames:.2f} us each")


if __name__ == "__main__":
    main()
