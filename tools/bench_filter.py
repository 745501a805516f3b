"""Cost of one attitude-filter step in plain Python: `python tools/bench_filter.py [NAME...]`.

Prints microseconds per sample, the best of several runs, for each filter in `FILTERS`.
"""

import argparse
import random
import time
from collections.abc import Callable

from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.gains import two_stage_gains
from h2nav.attitude.samples import ImuSample
from h2nav.attitude.two_stage import TwoStageFilter
from h2nav.io import gain_files

RATE_HZ = 100


def _two_stage() -> AttitudeFilter:
    name = "mpu9250_100hz"
    return TwoStageFilter(two_stage_gains(gain_files.load(name), name))


# Add a filter here: name -> maker of a fresh one with shipped gains for 100 Hz.
FILTERS: dict[str, Callable[[], AttitudeFilter]] = {"two_stage": _two_stage}


def samples(count: int) -> list[ImuSample]:
    """A vehicle at rest with a little noise; the cost does not depend on the motion."""
    noise = random.Random(1)
    return [
        ImuSample(
            t_us=i * 1_000_000 // RATE_HZ,
            w_b=(noise.gauss(0.01, 1e-3), noise.gauss(0.0, 1e-3), noise.gauss(0.0, 1e-3)),
            f_b=(noise.gauss(0.0, 0.02), noise.gauss(0.0, 0.02), noise.gauss(-9.8, 0.02)),
            m_b_ut=(noise.gauss(25.0, 0.2), noise.gauss(0.0, 0.2), noise.gauss(43.3, 0.2)),
        )
        for i in range(count)
    ]


def microseconds_per_sample(make: Callable[[], AttitudeFilter], runs: int, count: int) -> float:
    batch = samples(count)
    best = float("inf")
    for _ in range(runs):
        update = make().update
        started = time.thread_time()
        for sample in batch:
            update(sample)
        best = min(best, time.thread_time() - started)
    return best / count * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FILTERS))
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--samples", type=int, default=5000)
    args = parser.parse_args()
    for name in args.names or FILTERS:
        print(
            f"{name:12} {microseconds_per_sample(FILTERS[name], args.runs, args.samples):7.2f} us"
        )


if __name__ == "__main__":
    main()
