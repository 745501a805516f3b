"""What recording costs and what a kill loses.

    python tools/bench_recording.py [--messages N] [--kills N] [--json]

Prints the CPU time per message of each encoding (the whole process: caller, writer thread,
compression), how many inertial samples per second one core records with everything that a replay
writes for each, and, with --kills, how much a SIGKILL at a random moment loses.
"""

import argparse
import json
import os
import random
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from h2nav.apps.configuration import LogSettings
from h2nav.apps.log_contents import log_limits
from h2nav.log.folder import our_logs
from h2nav.log.recorder import Recorder
from h2nav.recordings.recording import open_recording
from h2nav.service.records import EstimateRecord, ImuRecord

START_NS = 1_795_260_679_845_863_513
SEED = 20_261_121
Call = Callable[[Recorder, int], None]

WRITER = """
import mmap, struct, sys, time
from h2nav.apps.configuration import LogSettings
from h2nav.apps.log_contents import log_limits
from h2nav.log.recorder import Recorder
with open(sys.argv[2], "w+b") as mark:
    mark.write(bytes(16)); mark.flush()
    shared = mmap.mmap(mark.fileno(), 16)
    recorder = Recorder(sys.argv[1], log_limits(LogSettings(min_free_mb=0)))
    number = 0
    while True:
        now = time.monotonic_ns()
        recorder.raw("a", now, b"%d" % number)
        shared[8:] = struct.pack("<q", now)
        if number == 0:
            shared[:8] = struct.pack("<q", now)
            while recorder.path is None:
                time.sleep(0.001)
            print("running", flush=True)
        number += 1
        time.sleep(0.001)
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--messages", type=int, default=20_000)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = costs(Path(folder), args.messages)
        if args.kills:
            result |= kills(Path(folder), args.kills)
    if args.json:
        print(json.dumps(result))
    else:
        for name, value in result.items():
            print(f"{name:36} {value:12.3f}")


def costs(folder: Path, count: int) -> dict[str, float]:
    numbers = random.Random(SEED)
    frames = [numbers.randbytes(41) for _ in range(997)]
    samples = [
        ImuRecord(n, *(numbers.gauss(0, 1) for _ in range(6)), None, None, None, False)
        for n in range(997)
    ]
    estimates = [
        EstimateRecord(n, *(numbers.gauss(0, 1) for _ in range(17)), 3) for n in range(997)
    ]
    attitudes = [tuple(numbers.gauss(0, 0.5) for _ in range(4)) for _ in range(997)]

    def raw(recorder: Recorder, n: int) -> None:
        recorder.raw("udp", START_NS + n * 1000, frames[n % 997])

    def sample(recorder: Recorder, n: int) -> None:
        recorder.record("/imu", samples[n % 997], START_NS + n * 1000)

    def estimate(recorder: Recorder, n: int) -> None:
        recorder.record("/estimate", estimates[n % 997], START_NS + n * 1000)

    def attitude(recorder: Recorder, n: int) -> None:
        recorder.transform(START_NS + n * 1000, attitudes[n % 997])

    def everything(recorder: Recorder, n: int) -> None:
        raw(recorder, n)
        sample(recorder, n)
        estimate(recorder, n)
        attitude(recorder, n)

    calls: dict[str, Call] = {
        "raw_us": raw,
        "imu_json_11_fields_us": sample,
        "estimate_json_19_fields_us": estimate,
        "transform_and_pose_protobuf_us": attitude,
        "all_of_one_sample_us": everything,
    }
    result = {name: timed(folder / f"{name}.mcap", call, count) for name, call in calls.items()}
    size = (folder / "all_of_one_sample_us.mcap").stat().st_size
    result["samples_per_s_on_one_core"] = 1e6 / result["all_of_one_sample_us"]
    result["x_realtime_at_100_hz"] = result["samples_per_s_on_one_core"] / 100.0
    result["bytes_per_sample_on_disk"] = size / count
    result["caller_us_per_sample"] = caller_time(folder / "caller.mcap", everything, count)
    return result


def timed(path: Path, call: Call, count: int) -> float:
    """CPU microseconds of the process per call, everything written and closed."""
    recorder = Recorder.to_file(path)
    begin = time.process_time()
    for number in range(count):
        call(recorder, number)
    recorder.close()
    return (time.process_time() - begin) / count * 1e6


def caller_time(path: Path, call: Call, count: int) -> float:
    """Median CPU microseconds of the calling thread per call."""
    spent = []
    with Recorder.to_file(path) as recorder:
        for number in range(count):
            begin = time.thread_time_ns()
            call(recorder, number)
            spent.append(time.thread_time_ns() - begin)
    return statistics.median(spent) / 1e3


def kills(folder: Path, count: int) -> dict[str, float]:
    """Kills a writer at random moments; what was handed over but is not in the log, in ms."""
    numbers = random.Random(SEED)
    lost_ms = []
    for trial in range(count):
        logs, mark = folder / f"kill{trial}", folder / f"kill{trial}.mark"
        command = [sys.executable, "-c", WRITER, os.fspath(logs), os.fspath(mark)]
        with subprocess.Popen(command, stdout=subprocess.PIPE) as writer:
            assert writer.stdout is not None
            writer.stdout.readline()
            time.sleep(numbers.uniform(0.05, 2.0))
            writer.send_signal(signal.SIGKILL)
        first_ns, last_ns = struct.unpack("<qq", mark.read_bytes())
        stored = [t_ns for t_ns, _ in open_recording(our_logs(logs)[0]).received()]
        lost_ms.append((last_ns - (stored[-1] if stored else first_ns)) / 1e6)
        with Recorder(logs, log_limits(LogSettings(min_free_mb=0))) as recorder:
            recorder.wait_for_repair()
        repaired = [t_ns for t_ns, _ in open_recording(our_logs(logs)[0]).received()]
        assert repaired == stored
        assert our_logs(logs)[0].suffix == ".mcap"
    return {
        "kills": float(count),
        "lost_median_ms": statistics.median(lost_ms),
        "lost_most_ms": max(lost_ms),
    }


if __name__ == "__main__":
    main()
