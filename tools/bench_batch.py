"""Speed of batches: our compiled kernels next to vqf's and imufusion's, in one run.

python tools/bench_batch.py [--json] [--samples N]
"""

import argparse
import importlib
import json
import sys
import time
from collections.abc import Callable

import numpy as np

from h2nav.attitude import batch
from h2nav.attitude.fixed import FixedFilter
from h2nav.attitude.fixed_gains import fixed_model
from h2nav.attitude.shaped import ShapedFilter
from h2nav.attitude.shaped_gains import shaped_gains
from h2nav.io import gain_files

RATE_HZ = 100.0
Arrays = tuple[np.ndarray, np.ndarray, np.ndarray]


def recording(n: int) -> Arrays:
    """A tumbling sensor."""
    rng = np.random.default_rng(1)
    t = np.arange(n) / RATE_HZ
    gyr = np.stack([0.5 * np.sin(0.7 * t), 0.4 * np.cos(0.5 * t), 0.3 * np.sin(0.2 * t)], axis=1)
    gyr += rng.normal(0.0, 0.01, (n, 3))
    acc = np.array([0.0, 0.0, -9.8]) + rng.normal(0.0, 0.5, (n, 3))
    mag = np.array([25.0, 0.0, 43.0]) + rng.normal(0.0, 1.0, (n, 3))
    return gyr, acc, mag


def ours(kind: str, data: Arrays) -> None:
    if kind == "fixed":
        file = gain_files.load("mpu9250_100hz")
        batch.filter_array(*data, 1.0 / RATE_HZ, FixedFilter(fixed_model(file, file.name)))
    else:
        file = gain_files.load("handheld_100hz")
        batch.filter_array(*data, 1.0 / RATE_HZ, ShapedFilter(shaped_gains(file, file.name)))


def vqf(data: Arrays) -> None:
    gyr, acc, mag = (np.ascontiguousarray(array) for array in data)
    importlib.import_module("vqf").VQF(1.0 / RATE_HZ).updateBatch(gyr, acc, mag)


def imufusion(data: Arrays) -> None:
    module = importlib.import_module("imufusion")
    ahrs = module.Ahrs()
    ahrs.set_sample_period(1.0 / RATE_HZ)
    gyr, acc, mag = np.degrees(data[0]), data[1] / 9.80665, data[2]
    for w, f, m in zip(gyr, acc, mag, strict=True):
        ahrs.update(w, f, m)


def ns_per_sample(run: Callable[[Arrays], None], data: Arrays) -> float | None:
    """The best of two runs; None when the peer is not installed."""
    best = float("inf")
    for _ in range(2):
        begin = time.perf_counter()
        try:
            run(data)
        except (ImportError, AttributeError, TypeError):
            return None
        best = min(best, time.perf_counter() - begin)
    return 1e9 * best / len(data[0])


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--json", action="store_true", help="machine-readable result")
    parser.add_argument("--samples", type=int, default=1_000_000, help="samples of the batches")
    args = parser.parse_args()
    data = recording(args.samples)
    few: Arrays = (data[0][:50_000], data[1][:50_000], data[2][:50_000])
    result = {
        "backend": batch.backend(),
        "ns_per_sample": {
            "h2nav default filter": ns_per_sample(lambda d: ours("shaped", d), data),
            "h2nav integers": ns_per_sample(lambda d: ours("fixed", d), data),
            "vqf updateBatch": ns_per_sample(vqf, data),
            "imufusion, loop over samples": ns_per_sample(imufusion, few),
        },
    }
    if args.json:
        print(json.dumps(result))
        return 0
    print(f"backend {result['backend']}")
    times = result["ns_per_sample"]
    assert isinstance(times, dict)
    for name, ns in times.items():
        print(f"{name:32}{'not installed' if ns is None else f'{ns:8.0f} ns/sample'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
