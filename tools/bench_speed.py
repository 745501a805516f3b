"""What commands cost in processor time, in turns with another release and with other readers.

Each row is a command on a recording. In every round this tree, the other release and the reader of
the autopilot's makers run one after another; what is printed are the medians of the times and of
the ratios within a round, so that a machine which grows slower meanwhile does not matter. The
daemon hears a telemetry log in real time over UDP.

Run: python tools/bench_speed.py FLIGHT... [--against COMMIT|WHEEL] [--rounds N] [--daemon SECONDS]
"""

import argparse
import contextlib
import os
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from h2nav.recordings.recording import open_recording

REPOSITORY = Path(__file__).resolve().parent.parent
MAIN = "import sys; from h2nav.cli import main; sys.exit(main())"
RECV_MATCH = """
import sys
from pymavlink import mavutil
log = mavutil.mavlink_connection(sys.argv[1])
while log.recv_match() is not None:
    pass
"""
PYULOG = "import sys, pyulog; pyulog.ULog(sys.argv[1])"
# The reader that everybody has, by the ending of a recording.
READERS = {
    ".tlog": ("recv_match", RECV_MATCH),
    ".bin": ("DFReader", RECV_MATCH),
    ".ulg": ("pyulog", PYULOG),
}


class Release(NamedTuple):
    """Something with an `h2nav` that can be run."""

    name: str
    python: str
    folder: Path | None = None  # of a tree; None: installed

    def run(self, code: str, *words: str) -> float:
        """Processor time of a process, user and system, s."""
        environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        if self.folder is not None:
            environment["PYTHONPATH"] = str(self.folder)
        process = subprocess.Popen(
            [self.python, "-c", code, *words],
            cwd=self.folder or tempfile.gettempdir(),
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return cost_of(process)


def cost_of(process: "subprocess.Popen[bytes]") -> float:
    """Waits for a process; its processor time, s."""
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return usage.ru_utime + usage.ru_stime


@contextlib.contextmanager
def release(what: str | None) -> Iterator[Release | None]:
    """The release to compare with: a wheel, or a commit of this repository."""
    if what is None:
        yield None
        return
    folder = Path(tempfile.mkdtemp(prefix="h2nav-release-"))
    try:
        if what.endswith(".whl"):
            yield _installed(what, folder)
        else:
            yield _checked_out(what, folder)
    finally:
        git = ["git", "-C", str(REPOSITORY), "worktree", "remove", "--force", str(folder)]
        if not what.endswith(".whl"):
            subprocess.run(git, check=False, capture_output=True)
        shutil.rmtree(folder, ignore_errors=True)


def _installed(wheel: str, folder: Path) -> Release:
    """A wheel in an environment of its own, with the packages of this one."""
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True)
    python = str(folder / "bin" / "python")
    packages = next(path for path in sys.path if path.endswith("site-packages"))
    (site,) = folder.glob("lib/python*/site-packages")
    pip = [python, "-m", "pip", "install", "-q", "--no-deps", wheel]
    subprocess.run(pip, check=True)
    (site / "others.pth").write_text(f"{packages}\n")
    return Release(Path(wheel).name, python)


def _checked_out(commit: str, folder: Path) -> Release:
    """A commit with its kernels compiled."""
    git = ["git", "-C", str(REPOSITORY), "worktree", "add", "--detach", str(folder), commit]
    subprocess.run(git, check=True, capture_output=True)
    build = [sys.executable, "setup.py", "build_ext", "--inplace"]
    subprocess.run(build, cwd=folder, check=True, capture_output=True)
    return Release(commit, sys.executable, folder)


def commands(flight: Path, pages: str) -> dict[str, tuple[str, ...]]:
    """The commands to time on a recording, by what a row calls them."""
    found = {"review": ("review", str(flight), "-o", pages)}
    if flight.suffix.lower() == ".tlog":
        found["replay"] = ("replay", "--no-log", str(flight))
    return found


def daemon(which: Release, flight: Path, seconds: float) -> float:
    """Share of a core that the daemon takes while a telemetry log arrives in real time."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    environment = dict(os.environ)
    if which.folder is not None:
        environment["PYTHONPATH"] = str(which.folder)
    process = subprocess.Popen(
        [which.python, "-c", MAIN, "run", "--connect", f"udpin:127.0.0.1:{port}"],
        cwd=which.folder or tempfile.gettempdir(),
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    time.sleep(2.0)  # it starts, which is not what is measured
    started_s = _so_far(process.pid)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        first_ns, begun_ns = None, time.monotonic_ns()
        for t_ns, data in open_recording(flight).received():
            first_ns = t_ns if first_ns is None else first_ns
            if t_ns - first_ns > seconds * 1e9:
                break
            ahead_s = (t_ns - first_ns - time.monotonic_ns() + begun_ns) * 1e-9
            if ahead_s > 0.0:
                time.sleep(ahead_s)
            link.sendto(data, ("127.0.0.1", port))
    used_s = _so_far(process.pid) - started_s
    process.send_signal(signal.SIGTERM)
    cost_of(process)
    return used_s / seconds


def _so_far(pid: int) -> float:
    """Processor time of a running process, s."""
    fields = Path(f"/proc/{pid}/stat").read_text("ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def show(name: str, rows: dict[str, list[float]], unit: str) -> None:
    """Prints the medians of a row, and the ratios of the first column to the others."""
    ours, *others = rows
    scale = 100.0 if unit == "%" else 1.0
    cells = [
        f"{key} {scale * statistics.median(values):.2f} {unit}" for key, values in rows.items()
    ]
    for other in others:
        ratios = [a / b for a, b in zip(rows[ours], rows[other], strict=True)]
        spread = f"({min(ratios):.2f} - {max(ratios):.2f})"
        cells.append(f"/ {other}: {statistics.median(ratios):.2f} {spread}")
    print(f"{name:36}{'   '.join(cells)}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="+", type=Path, metavar="FLIGHT")
    parser.add_argument("--against", metavar="COMMIT|WHEEL", help="another release")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument(
        "--daemon", type=float, default=0.0, metavar="SECONDS", help="also the daemon, so long"
    )
    args = parser.parse_args()
    here = Release("here", sys.executable, REPOSITORY)
    with release(args.against) as other, tempfile.TemporaryDirectory() as pages:
        releases = [here] if other is None else [here, other]
        for flight in map(Path.resolve, args.flights):
            reader = READERS.get(flight.suffix.lower())
            for name, words in commands(flight, pages).items():
                rows: dict[str, list[float]] = {}
                for number in range(args.rounds + 1):
                    costs = {each.name: each.run(MAIN, *words) for each in releases}
                    if reader is not None:
                        costs[reader[0]] = here.run(reader[1], str(flight))
                    # The first round writes bytecode and fills the disk's cache.
                    for key, cost in costs.items() if number else ():
                        rows.setdefault(key, []).append(cost)
                show(f"{name} {flight.name}", rows, "s")
            if args.daemon and flight.suffix.lower() == ".tlog":
                shares = {each.name: [daemon(each, flight, args.daemon)] for each in releases}
                show(f"daemon {flight.name}", shares, "%")


if __name__ == "__main__":
    main()
