"""Cost of one filter step, compiled and in plain Python: `python tools/bench_filter.py [NAME...]`.

Prints microseconds per sample for each filter in `FILTERS`: the best of several runs, which take
turns, so that a busy moment hits all of them; and the ratio to the first.
"""

import argparse
import random
import time
from collections.abc import Callable, Sequence

from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import constant_gain_model
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.kernel_files import CONSTANT_GAIN, VELOCITY_AIDED, VELOCITY_AIDED_INTEGER
from h2nav.attitude.native import CompiledStep, compiled_step, native_kernels
from h2nav.attitude.samples import ImuSample
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.files import gain_files

RATE_HZ = 100


def _velocity_aided(compiled: CompiledStep | None = None) -> AttitudeFilter:
    name = "multirotor_100hz"
    return VelocityAidedFilter(velocity_aided_gains(gain_files.load(name), name), compiled)


def _velocity_aided_integer(compiled: CompiledStep | None = None) -> AttitudeFilter:
    name = "multirotor_100hz"
    return IntegerVelocityAidedFilter(
        velocity_aided_gains(gain_files.load(name), name), name, compiled
    )


def _constant_gain(compiled: CompiledStep | None = None) -> AttitudeFilter:
    name = "mpu9250_100hz"
    return ConstantGainFilter(constant_gain_model(gain_files.load(name), name), compiled)


# Add a filter here: name -> maker of a fresh one with shipped gains for 100 Hz.
FILTERS: dict[str, Callable[[], AttitudeFilter]] = {
    "velocity_aided": _velocity_aided,
    "velocity_aided, integers": _velocity_aided_integer,
    "constant_gain": _constant_gain,
}
COMPILED: dict[str, Callable[[], AttitudeFilter]] = {
    "velocity_aided, compiled": lambda: _velocity_aided(compiled_step(VELOCITY_AIDED)),
    "velocity_aided, integers, compiled": lambda: _velocity_aided_integer(
        compiled_step(VELOCITY_AIDED_INTEGER)
    ),
    "constant_gain, compiled": lambda: _constant_gain(compiled_step(CONSTANT_GAIN)),
}
if native_kernels() is not None:
    FILTERS |= COMPILED


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


def microseconds_per_sample(names: Sequence[str], runs: int, count: int) -> dict[str, float]:
    """Of each filter; the making of the filter does not count."""
    batch = samples(count)
    best = dict.fromkeys(names, float("inf"))
    for _ in range(runs):
        for name in names:
            update = FILTERS[name]().update
            started = time.thread_time()
            for sample in batch:
                update(sample)
            best[name] = min(best[name], (time.thread_time() - started) / count * 1e6)
    return best


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(FILTERS))
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--samples", type=int, default=5000)
    args = parser.parse_args()
    unknown = [name for name in args.names if name not in FILTERS]
    if unknown:
        parser.error(f"no filter {', '.join(unknown)}; have {', '.join(FILTERS)}")
    times = microseconds_per_sample(args.names or list(FILTERS), args.runs, args.samples)
    first = next(iter(times.values()))
    for name, us in times.items():
        print(f"{name:34} {us:7.2f} us {us / first:7.2f}")


if __name__ == "__main__":
    main()
