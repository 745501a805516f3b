"""Reviews worn variants of logs: never a traceback, nor a refusal of what others read.

    python tools/fuzz_reviews.py [LOG...] [--count N] [--first SEED] [--seconds S]

LOG: recordings to wear out (.bin, .log, .ulg, .tlog); without any, the small ones of the tests.
What breaks is kept in out/fuzz/reviews/ and named with its seed.
"""

import argparse
import resource
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path
from typing import NoReturn

REPOSITORY = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(REPOSITORY / "tests"))

from fuzz.review_target import case, reviewed, seeds  # noqa: E402
from fuzz.worn_logs import log_of  # noqa: E402

FOUND = REPOSITORY / "out" / "fuzz" / "reviews"
# For a log that a sound review needs seconds and half a gigabyte for.
LONGEST_S, MAX_BYTES = 120, 6 << 30
# One in so many is smoothed as well, which costs as much as the rest.
SMOOTHED = 4


def main() -> int:
    """See the module."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("logs", nargs="*", type=Path, metavar="LOG")
    parser.add_argument("--count", type=int, default=20, help="variants of each log")
    parser.add_argument("--first", type=int, default=0, metavar="SEED")
    parser.add_argument("--seconds", type=float, default=float("inf"), help="end earlier")
    args = parser.parse_args()
    logs = {path.name: log_of(path.name, path.read_bytes()) for path in args.logs} or seeds()
    resource.setrlimit(resource.RLIMIT_AS, (MAX_BYTES, MAX_BYTES))
    signal.signal(signal.SIGALRM, _late)
    began, done, refused, broken = time.monotonic(), 0, 0, 0
    slowest: tuple[float, str] = (0.0, "")
    for seed in range(args.first, args.first + args.count):
        for name, log in logs.items():
            if time.monotonic() - began > args.seconds:
                break
            data, changes = case(log, seed)
            started = time.process_time()
            signal.alarm(LONGEST_S)
            try:
                with tempfile.TemporaryDirectory() as folder:
                    is_smoothed = seed % SMOOTHED == 0
                    refused += not reviewed(data, log.ending, Path(folder), smooths=is_smoothed)
            except Exception:
                broken += 1
                FOUND.mkdir(parents=True, exist_ok=True)
                kept = FOUND / f"{Path(name).stem}-{seed}{log.ending}"
                kept.write_bytes(data)
                print(f"{name}, seed {seed} ({changes}): {kept}\n{traceback.format_exc()}")
            finally:
                signal.alarm(0)
            done += 1
            slowest = max(slowest, (time.process_time() - started, f"{name} {seed}"))
    print(
        f"{done} worn logs: {broken} broken, {refused} refused in words; slowest "
        f"{slowest[0]:.1f} s ({slowest[1]})"
    )
    return 1 if broken else 0


def _late(*_: object) -> NoReturn:
    raise TimeoutError(f"longer than {LONGEST_S} s")


if __name__ == "__main__":
    sys.exit(main())
