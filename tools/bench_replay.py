"""How many times faster than real time recordings are played and reviewed, by processor time.

Playing is the service alone, without a live view or a log. A review is all of `h2nav review` except
imports and page.

Run: python tools/bench_replay.py FLIGHT... [--rounds N]
"""

import argparse
import time
from pathlib import Path

from h2nav.apps import playback
from h2nav.apps.playback import Playback, PlaybackOptions
from h2nav.apps.reviewing import review
from h2nav.attitude.native import backend
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.integrity.findings import Severity
from h2nav.recordings.opening import open_flight
from h2nav.wire.deframer import Frame


class Nobody:
    """Looks on and sees nothing."""

    message_ids: frozenset[int] = frozenset()

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Frames are not looked at."""

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Estimates are not looked at."""

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Notices are not looked at."""


def played(path: Path) -> float:
    """How many times faster than real time a recording is played, once it is open."""
    source = open_flight(path)
    inputs = playback.inputs_for(source, PlaybackOptions())
    pipeline = playback.pipeline_for(source, inputs, None, Nobody())
    playing = Playback(source, whole_frames=inputs.whole_frames)
    begun_s = time.process_time()
    for _ in playing.through(pipeline):
        pass
    return playing.span_ns * 1e-9 / (time.process_time() - begun_s)


def reviewed(path: Path) -> float:
    """How many times faster than real time it is opened and reviewed."""
    begun_s = time.process_time()
    length_s = review(open_flight(path), PlaybackOptions()).flight.context.duration_s
    return length_s / (time.process_time() - begun_s)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="+", type=Path, metavar="FLIGHT")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    print(f"kernels: {backend()}; slowest and quickest of {args.rounds}")
    for path in args.flights:
        for work in (played, reviewed):
            found = [work(path) for _ in range(args.rounds)]
            print(f"{path.name:30} {work.__name__:9} {min(found):5.1f} to {max(found):5.1f} x")


if __name__ == "__main__":
    main()
