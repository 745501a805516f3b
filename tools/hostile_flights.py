"""Reviews hostile recordings as uploads are reviewed: each has to end as a review or an error line.

    python tools/hostile_flights.py --count 200 recordings/*.tlog recordings/*.bin

Recordings that are given are cut, and their bytes flipped; others are made: random bytes behind the
start of each format, bombs of Zstandard in MCAP, sparse files of 2 GiB.
"""

import argparse
import random
import resource
import struct
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import zstandard

from h2nav.apps.review_process import ReviewProcess
from h2nav.apps.reviewer import ReviewJob

STARTS = {
    ".mcap": b"\x89MCAP0\r\n",
    ".ulg": b"ULog\x01\x12\x35\x01" + bytes(8),
    ".bin": b"\xa3\x95\x80\x80\x59FMT\0BBnNZ\0",
    ".log": b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n",
    ".tlog": bytes(8) + b"\xfd\x09\0\0\0\1\1\0\0\0",
}
GIB = 1 << 30


def main() -> int:
    """Prints how they ended; 1 if one ended otherwise, or took too much memory."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="*")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--memory-mb", type=int, default=512)
    args = parser.parse_args()
    dice = random.Random(args.seed)
    makers: list[Callable[[Path], Path]] = [
        lambda folder: _random(folder, dice),
        lambda folder: _sparse(folder, dice),
        lambda folder: _bomb(folder, dice),
    ]
    for recording in args.recordings:
        content = recording.read_bytes()
        makers.append(lambda folder, c=content, r=recording: _cut(folder, dice, c, r.suffix))
        makers.append(lambda folder, c=content, r=recording: _flipped(folder, dice, c, r.suffix))
    ends: Counter[str] = Counter()
    bad = 0
    for number in range(args.count):
        with tempfile.TemporaryDirectory() as name:
            file = makers[number % len(makers)](Path(name))
            ended = _ended(Path(name), args.memory_mb)
        ends[ended] += 1
        if ended.startswith("trouble"):
            bad += 1
            print(f"{number} {file.name}: {ended}", file=sys.stderr)
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
    for ended, count in ends.most_common():
        print(f"{count:6d}  {ended}")
    print(f"largest process: {peak_mb:.0f} MiB")
    return 1 if bad else 0


def _ended(root: Path, memory_mb: int) -> str:
    """How its review ended; the processes that die are followed by the next attempt."""
    process = ReviewProcess(ReviewJob(str(root), str(root / "reviews"), memory_mb, 5))
    for _ in range(5):
        process.start()
        while (outcome := process.outcome()) is None:
            time.sleep(0.05)
        if outcome.flight:
            line = "reviewed" if not outcome.error else f"error: {outcome.error[:90]}"
            return line if "\n" not in line else "trouble: more than a line"
        if "ended with" not in outcome.trouble:
            break
    return f"trouble: {outcome.trouble or 'nothing was reviewed'}"


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


def _bomb(folder: Path, dice: random.Random) -> Path:
    """A chunk of MCAP that is a thousand times larger than it looks."""
    size = dice.choice((1, 4)) * GIB // 4
    packed = zstandard.ZstdCompressor(level=1).compress(bytes(size))
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
    path.write_bytes(content[: dice.randrange(1, min(len(content), 2_000_000))])
    return path


def _flipped(folder: Path, dice: random.Random, content: bytes, suffix: str) -> Path:
    changed = bytearray(content[:1_000_000])
    for _ in range(dice.choice((1, 100, 20_000))):
        changed[dice.randrange(len(changed))] = dice.randrange(256)
    path = folder / f"flipped{suffix}"
    path.write_bytes(bytes(changed))
    return path


if __name__ == "__main__":
    sys.exit(main())
