"""Fleets of copies and cuts of recordings: equal tables, speed, memory, a kill in the middle.

    python tools/fleet_table.py RECORDINGS --flights 200

makes a folder of recordings (copies and cuts, most of them in the middle of a message, and every
twentieth garbage), reviews them with one and with two workers of our own and on a `dask
scheduler` with two `dask worker` that are started beside it, kills one run with SIGKILL in the
middle and starts it again, and prints a table.
"""

import argparse
import contextlib
import hashlib
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ENDINGS = (".tlog", ".bytes", ".bin", ".ulg")
TABLES = ("flights.parquet", "findings.parquet", "index.html")
DASK = [sys.executable, "-m", "dask.__main__"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("recordings", type=Path)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--share", type=float, default=1.0, help="of a recording, at most")
    parser.add_argument("--kill-after", type=int, default=5, help="flights, before the SIGKILL")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="fleet-table-") as name:
        folder = Path(name)
        make(args.recordings, folder / "logs", args.flights, args.share)
        rows = {"1 worker": run(folder, "one", "--workers", "1")}
        rows["2 workers"] = run(folder, "two", "--workers", "2")
        with cluster(folder, 2) as address:
            rows["a cluster with 2 workers"] = run(folder, "cluster", "--scheduler", address)
        kill(folder, args.kill_after)
        done = results(folder / "killed")
        rows["killed, started again"] = run(folder, "killed", "--workers", "2")
        again = {path: stamp for path, stamp in results(folder / "killed").items() if path in done}
        print("| run | elapsed s | CPU s | flight-hours per core-hour | MiB | tables |")
        print("|---|---|---|---|---|---|")
        for title, row in rows.items():
            print(f"| {title} | {row['elapsed_s']:.0f} | {row['cpu_s']:.0f} | "
                  f"{row['speed']:.0f} | {row['peak_worker_mib']} | {row['tables']} |")  # fmt: skip
        row = rows["killed, started again"]
        anew = sum(done[path] != stamp for path, stamp in again.items())
        print(f"{row['flights']} flights, {row['flight_hours']:.2f} h, {row['failed']} failed")
        print(f"killed with {len(done)} results: {row['done_before']} taken over, {anew} made anew")


def make(recordings: Path, folder: Path, flights: int, share: float) -> None:
    """Writes the same recordings every time."""
    folder.mkdir()
    sources = sorted(path for path in recordings.rglob("*") if path.suffix in ENDINGS)
    dice = random.Random(1)
    for number in range(flights):
        source = sources[number % len(sources)]
        data = source.read_bytes()
        if number % 20 == 19:
            data = dice.randbytes(dice.randrange(20_000))
        elif share < 1.0 or number >= len(sources):
            # Somewhere, so mostly inside a message.
            data = data[: int(len(data) * share * dice.uniform(0.5, 1.0))]
        (folder / f"{number:04}_{source.name}").write_bytes(data)


def run(folder: Path, name: str, *words: str) -> dict[str, Any]:
    """One run of the command; its document with what we add."""
    command = [sys.executable, "-m", "h2nav.cli", "fleet", str(folder / "logs"), "-o",
               str(folder / name), *words, "--json"]  # fmt: skip
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    document: dict[str, Any] = json.loads(told)
    is_whole = document["done_before"] == 0
    document["speed"] = 3600.0 * document["flight_hours"] / document["cpu_s"] if is_whole else 0.0
    digest = hashlib.sha256()
    for table in TABLES:
        digest.update((folder / name / table).read_bytes())
    document["tables"] = digest.hexdigest()[:12]
    return document


def kill(folder: Path, after: int) -> None:
    """Kills a run when some flights have results."""
    command = [sys.executable, "-m", "h2nav.cli", "fleet", str(folder / "logs"), "-o",
               str(folder / "killed"), "--workers", "2"]  # fmt: skip
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process:
        while len(results(folder / "killed")) < after and process.poll() is None:
            time.sleep(0.1)
        process.send_signal(signal.SIGKILL)


def results(output: Path) -> dict[str, int]:
    """The results so far, and when each was written."""
    return {path.name: path.stat().st_mtime_ns for path in (output / "results").glob("*.json")}


@contextlib.contextmanager
def cluster(folder: Path, workers: int) -> Iterator[str]:
    """A scheduler and workers as one starts them by hand; gives the address."""
    file = folder / "scheduler.json"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    scheduler = [*DASK, "scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard",
                 "--scheduler-file", str(file)]  # fmt: skip
    worker = [*DASK, "worker", "--scheduler-file", str(file), "--nworkers", str(workers),
              "--nthreads", "1", "--memory-limit", "0", "--no-dashboard",
              "--local-directory", str(folder / "scratch")]  # fmt: skip
    processes = [subprocess.Popen(scheduler, **quiet)]
    try:
        while not file.exists() or not re.search(r'"address": ', file.read_text()):
            time.sleep(0.1)
        processes.append(subprocess.Popen(worker, env=environment, **quiet))
        yield json.loads(file.read_text())["address"]
    finally:
        for process in reversed(processes):
            process.send_signal(signal.SIGINT)
            process.wait()
        shutil.rmtree(folder / "scratch", ignore_errors=True)


if __name__ == "__main__":
    main()
