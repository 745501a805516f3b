"""Reviews hostile recordings as uploads are reviewed: each has to end as a review or an error line.

    python tools/hostile_flights.py --count 10000 --pieces-kb 200 recordings/*.tlog recordings/*.bin

Recordings that are given are cut, and their bytes flipped; others are made: random bytes behind the
start of each format, bombs of Zstandard in MCAP, sparse files of 2 GiB. Each is reviewed by the
process that reviews uploads, under its limits; it is forked from this one, whose modules it has, as
starting Python takes longer than most reviews of such files.
"""

import argparse
import functools
import os
import random
import struct
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import orjson
import zstandard

from h2nav.apps import reviewer, reviewing
from h2nav.apps.review_process import ReviewOutcome, ReviewProcess
from h2nav.apps.reviewer import ReviewJob

STARTS = {
    ".mcap": b"\x89MCAP0\r\n",
    ".ulg": b"ULog\x01\x12\x35\x01" + bytes(8),
    ".bin": b"\xa3\x95\x80\x80\x59FMT\0BBnNZ\0",
    ".log": b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
    ".tlog": bytes(8) + b"\xfd\x09\0\0\0\1\1\0\0\0",
}
GIB = 1 << 30


MAX_ATTEMPTS = 5
REPORT_EVERY = 500


class Child:
    """A forked process with what `ReviewProcess` needs of one."""

    def __init__(self, job: ReviewJob) -> None:
        ours, its = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            try:
                os.close(ours)
                os.dup2(its, 1)
                os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
                # It would yield to all others: on a busy computer that takes days.
                vars(reviewer).update(run_when_idle=int, NICEST=0)
                sys.argv = ["reviewer", orjson.dumps(job._asdict()).decode()]
                os._exit(reviewer.main())
            finally:
                os._exit(70)
        os.close(its)
        with open(ours, "rb") as stream:
            self.said = stream.read()
        _, status, used = os.wait4(self.pid, 0)
        self.status = os.waitstatus_to_exitcode(status)
        self.peak_mb = used.ru_maxrss / 1024.0
        self.seconds = used.ru_utime + used.ru_stime

    def outcome(self, job: ReviewJob) -> ReviewOutcome:
        """What came of it."""
        process = ReviewProcess(job)
        process._said = self.said
        return process._made(self.status)


def main() -> int:
    """Prints how they ended; 1 if one ended otherwise, or took too much memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="*")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--memory-mb", type=int, default=512, help="limit of the process")
    parser.add_argument("--most-mb", type=float, default=300.0, help="more memory is a failure")
    parser.add_argument("--pieces-kb", type=int, default=1000, help="of a recording, at most")
    args = parser.parse_args()
    assert reviewing  # loaded here, once
    dice = random.Random(args.seed)
    makers: list[Callable[[Path], Path]] = [
        lambda folder: _random(folder, dice),
        lambda folder: _sparse(folder, dice),
        lambda folder: _bomb(folder, dice),
    ]
    for recording in args.recordings:
        with recording.open("rb") as stream:
            content = stream.read(args.pieces_kb * 1000)
        for made in (_cut, _flipped):
            makers.append(
                functools.partial(made, dice=dice, content=content, suffix=recording.suffix)
            )
    ends: Counter[str] = Counter()
    bad, peak_mb, slowest_s = 0, 0.0, 0.0
    for number in range(args.count):
        with tempfile.TemporaryDirectory() as name:
            file = makers[number % len(makers)](Path(name))
            ended, used_mb, seconds = _ended(Path(name), args.memory_mb)
        ends[" ".join(ended.split()[:6])] += 1
        peak_mb, slowest_s = max(peak_mb, used_mb), max(slowest_s, seconds)
        if ended.startswith("trouble") or "fault of the review" in ended or used_mb > args.most_mb:
            bad += 1
            print(f"{number} {file.name}: {used_mb:.0f} MiB, {ended}", file=sys.stderr, flush=True)
        if (number + 1) % REPORT_EVERY == 0:
            print(f"{number + 1}, {bad} bad, {peak_mb:.0f} MiB", file=sys.stderr, flush=True)
    for ended, count in ends.most_common():
        print(f"{count:6d}  {ended}")
    print(f"largest process: {peak_mb:.0f} MiB, longest: {slowest_s:.1f} s of processor time")
    return 1 if bad else 0


def _ended(root: Path, memory_mb: int) -> tuple[str, float, float]:
    """How its review ended, with its memory (MiB) and time; of a process that dies, the next."""
    job = ReviewJob(str(root), str(root / "reviews"), memory_mb, 5)
    peak_mb = seconds = 0.0
    for _ in range(MAX_ATTEMPTS):
        child = Child(job)
        outcome = child.outcome(job)
        peak_mb, seconds = max(peak_mb, child.peak_mb), max(seconds, child.seconds)
        if outcome.flight:
            line = "reviewed" if not outcome.error else f"error: {outcome.error}"
            line = line if "\n" not in line else "trouble: more than a line"
            return line, peak_mb, seconds
        if "ended with" not in outcome.trouble:
            break
    return f"trouble: {outcome.trouble or 'nothing was reviewed'}", peak_mb, seconds


def _random(folder: Path, dice: random.Random) -> Path:
    suffix = dice.choice(sorted(STARTS))
    path = folder / f"{dice.choice(('a', '<b>', 'ä' * 60))}{suffix}"
    path.write_bytes(STARTS[suffix] + dice.randbytes(dice.randrange(200_000)))
    return path


def _sparse(folder: Path, dice: random.Random) -> Path:
    suffix = dice.choice(sorted(STARTS))
    path = folder / f"sparse{suffix}"
    with path.open("wb") as stream:
        stream.write(STARTS[suffix])
        stream.truncate(2 * GIB)
    return path


@functools.cache
def _zeros(size: int) -> bytes:
    # In pieces: what this process once had counts against the limit of those that it forks.
    packer = zstandard.ZstdCompressor(level=1).compressobj(size=size)
    piece = bytes(1 << 20)
    return b"".join(packer.compress(piece) for _ in range(size >> 20)) + packer.flush()


def _bomb(folder: Path, dice: random.Random) -> Path:
    """A chunk of MCAP that is a thousand times larger than it looks."""
    size = dice.choice((1, 4)) * GIB // 4
    packed = _zeros(size)
    body = struct.pack("<QQQI", 0, 1, size, 0) + struct.pack("<I", 4) + b"zstd"
    body += struct.pack("<Q", len(packed)) + packed
    header = struct.pack("<I", 0) + struct.pack("<I", 5) + b"h2nav"
    path = folder / "bomb.mcap"
    path.write_bytes(
        STARTS[".mcap"]
        + b"\x01"
        + struct.pack("<Q", len(header))
        + header
        + b"\x06"
        + struct.pack("<Q", len(body))
        + body
    )
    return path


def _cut(folder: Path, dice: random.Random, content: bytes, suffix: str) -> Path:
    path = folder / f"cut{suffix}"
    path.write_bytes(content[: dice.randrange(1, len(content))])
    return path


def _flipped(folder: Path, dice: random.Random, content: bytes, suffix: str) -> Path:
    changed = bytearray(content)
    for _ in range(dice.choice((1, 100, 20_000))):
        changed[dice.randrange(len(changed))] = dice.randrange(256)
    path = folder / f"flipped{suffix}"
    path.write_bytes(bytes(changed))
    return path


if __name__ == "__main__":
    sys.exit(main())
