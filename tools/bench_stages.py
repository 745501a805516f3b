"""Where a replay or a review spends its processor time, by what it is spent on.

The stack is looked at every 4 ms of processor time; what counts is the first row of `STAGES` of
which a function is on it.

Run: python tools/bench_stages.py replay|review FLIGHT...
"""

import contextlib
import io
import signal
import sys
import tempfile
from collections import Counter
from pathlib import Path
from types import FrameType

from h2nav.cli import main as h2nav

PERIOD_S = 0.004
# What it is, and which functions show it: names, or module.name where a name says too little.
STAGES = {
    "start-up": ("_find_and_load",),
    "smoother": ("reviewing._smoothed",),
    "calibration": ("reviewing._calibration",),
    "analysis and page": ("analyse", "reviews.page", "page.page"),
    "filter": ("shell.update",),
    "votes, twins, compasses": ("voting.take", "_vote", "_find_twins", "_compare_compasses"),
    "witness": ("comparing.on_sample", "comparing.on_report"),
    "lateness": ("lateness.seen",),
    "velocities": ("monitor.fix", "on_receiver"),
    "sensor checks": ("_checked", "monitor.check"),
    "state, looks, timers": ("judgement.look", "_judge", "_look", "on_timer"),
    "reading": ("batches", "frames_of", "events", "wanted", "open_flight", "pipeline.read"),
    "a sample's way": ("play", "imported", "through", "_imported"),
}


def stage_of(frame: FrameType | None) -> str:
    """The stage of a stack."""
    names = set[str]()
    while frame is not None:
        name = frame.f_code.co_name
        names |= {name, f"{Path(frame.f_code.co_filename).stem}.{name}"}
        frame = frame.f_back
    return next((stage for stage, shown in STAGES.items() if names & {*shown}), "other")


def main() -> None:
    command, *flights = sys.argv[1:]
    counts = Counter[str]()
    signal.signal(signal.SIGPROF, lambda _, frame: counts.update([stage_of(frame)]))
    with tempfile.TemporaryDirectory() as pages:
        words = ["--no-log"] if command == "replay" else ["-o", pages]
        for flight in flights:
            signal.setitimer(signal.ITIMER_PROF, PERIOD_S, PERIOD_S)
            with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
                h2nav([command, flight, *words])
            signal.setitimer(signal.ITIMER_PROF, 0.0)
    for stage, count in counts.most_common():
        print(f"{stage:26}{count / counts.total():6.1%}")


if __name__ == "__main__":
    main()
