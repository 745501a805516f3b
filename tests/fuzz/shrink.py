"""Makes a failing input small, so that a person can read it."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from traceback import extract_tb


def signature(error: BaseException) -> str:
    """What two failures have in common: the kind, and the innermost place inside h2nav."""
    frames = [frame for frame in extract_tb(error.__traceback__) if "h2nav/" in frame.filename]
    words = "".join(letter for letter in str(error).split(":")[0] if not letter.isdigit())[:60]
    if type(error).__name__ == "InvariantBrokenError" or not frames:
        return f"{type(error).__name__} {words}"
    return f"{type(error).__name__} {Path(frames[-1].filename).name} {frames[-1].name}"


def shrunk(
    parts: Sequence[bytes], fails: Callable[[Sequence[bytes]], bool], budget_s: float
) -> list[bytes]:
    """As few of the parts as still fail, found by leaving out ever smaller stretches.

    Args:
        parts: of an input that fails.
        fails: whether an input of some of the parts still fails in the same way.
        budget_s: when to be content.
    """
    kept = list(parts)
    end_s = time.monotonic() + budget_s
    size = max(len(kept) // 2, 1)
    while True:
        at = 0
        while at < len(kept):
            shorter = kept[:at] + kept[at + size :]
            if time.monotonic() > end_s:
                return kept
            if shorter and fails(shorter):
                kept = shorter
            else:
                at += size
        if size == 1:
            return kept
        size //= 2
