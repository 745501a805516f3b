"""Speed of batches: our compiled kernels next to vqf's and imufusion's, in one run.

python tools/bench_batch.py [--json] [--samples N] [--repetitions N]

Times are wall time from arrays to arrays, so ours hold the checks and conversions in numpy too.
The ratios are how many times as long the peer takes.
"""

import argparse
import importlib
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable

import numpy as np

from h2nav.attitude import batch, native
from h2nav.attitude.constant_gain.filter import ConstantGainFilter
from h2nav.attitude.constant_gain.gains import constant_gain_model
from h2nav.attitude.filter import AttitudeFilter
from h2nav.attitude.velocity_aided.filter import VelocityAidedFilter
from h2nav.attitude.velocity_aided.gains import velocity_aided_gains
from h2nav.attitude.velocity_aided.integer.filter import IntegerVelocityAidedFilter
from h2nav.files import gain_files

RATE_HZ = 100.0
LOOPED = 50_000  # samples for what is called one by one
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]
Runner = Callable[[Arrays], float]


def recording(n: int) -> Arrays:
    """A tumbling sensor."""
    rng = np.random.default_rng(1)
    t = np.arange(n) / RATE_HZ
    gyr = np.stack([0.5 * np.sin(0.7 * t), 0.4 * np.cos(0.5 * t), 0.3 * np.sin(0.2 * t)], axis=1)
    gyr += rng.normal(0.0, 0.01, (n, 3))
    acc = np.array([0.0, 0.0, -9.8]) + rng.normal(0.0, 0.5, (n, 3))
    mag = np.array([25.0, 0.0, 43.0]) + rng.normal(0.0, 1.0, (n, 3))
    return gyr, acc, mag


def velocity_aided_filter() -> AttitudeFilter:
    file = gain_files.load("handheld_100hz")
    return VelocityAidedFilter(velocity_aided_gains(file, file.name))


def velocity_aided_integer_filter() -> AttitudeFilter:
    file = gain_files.load("handheld_100hz")
    return IntegerVelocityAidedFilter(velocity_aided_gains(file, file.name), file.name)


def constant_gain_filter() -> AttitudeFilter:
    file = gain_files.load("mpu9250_100hz")
    return ConstantGainFilter(constant_gain_model(file, file.name))


def ours(make: Callable[[], AttitudeFilter]) -> Runner:
    """A whole batch, arrays in and attitudes out; gains are loaded beforehand."""
    fresh = make()
    start = fresh.state()

    def run(data: Arrays) -> float:
        fresh.restore(start)
        begin = time.perf_counter()
        batch.filter_array(*data, 1.0 / RATE_HZ, fresh)
        return time.perf_counter() - begin

    return run


def vqf(data: Arrays) -> float:
    gyr, acc, mag = (np.ascontiguousarray(array) for array in data)
    fresh = importlib.import_module("vqf").VQF(1.0 / RATE_HZ)
    begin = time.perf_counter()
    fresh.updateBatch(gyr, acc, mag)
    return time.perf_counter() - begin


def imufusion(data: Arrays) -> float:
    """It has no batch: one call per sample, and one for its result, as its users write it."""
    ahrs = importlib.import_module("imufusion").Ahrs()
    ahrs.set_sample_period(1.0 / RATE_HZ)
    gyr, acc, mag = np.degrees(data[0]), data[1] / 9.80665, data[2]
    out = np.empty((len(gyr), 4))
    begin = time.perf_counter()
    for k, (w, f, m) in enumerate(zip(gyr, acc, mag, strict=True)):
        ahrs.update(w, f, m)
        out[k] = ahrs.get_quaternion()
    return time.perf_counter() - begin


def runners() -> dict[str, Runner]:
    found = {
        "h2nav constant gain, integers": ours(constant_gain_filter),
        "h2nav velocity-aided, integers": ours(velocity_aided_integer_filter),
        "h2nav velocity-aided": ours(velocity_aided_filter),
    }
    peers = {"vqf updateBatch": ("vqf", vqf), "imufusion, loop": ("imufusion", imufusion)}
    for name, (package, run) in peers.items():
        if importlib.util.find_spec(package) is not None:
            found[name] = run
    return found


def ns_per_sample(repetitions: int, data: Arrays) -> dict[str, float]:
    """The best of the repetitions; all run in turn, so that a busy moment hits all of them."""
    few: Arrays = (data[0][:LOOPED], data[1][:LOOPED], data[2][:LOOPED])
    found = runners()
    best = dict.fromkeys(found, float("inf"))
    for _ in range(repetitions):
        for name, run in found.items():
            taken = few if run is imufusion else data
            best[name] = min(best[name], 1e9 * run(taken) / len(taken[0]))
    return best


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    parser.add_argument("--samples", type=int, default=1_000_000, help="samples of the batches")
    parser.add_argument("--repetitions", type=int, default=5)
    args = parser.parse_args()
    if native.backend() == "python":
        args.samples = min(args.samples, LOOPED)
    times = ns_per_sample(args.repetitions, recording(args.samples))
    if args.json:
        print(json.dumps({"backend": native.backend(), "ns_per_sample": times}))
        return 0
    print(f"backend {native.backend()}, {args.samples} samples, load {os.getloadavg()[0]:.1f}")
    peers = [name for name in times if not name.startswith("h2nav")]
    for name, ns in times.items():
        ratios = "".join(f"   {times[peer] / ns:5.2f} x {peer}" for peer in peers if peer != name)
        total = f"{ns * args.samples * 1e-9:7.2f} s"
        print(f"{name:31}{ns:7.0f} ns/sample{total}{ratios if name not in peers else ''}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
