"""Frames that a link lost, by the numbers that every sender gives to its own.

A recording of some messages alone lacks numbers too. What a link loses is missing from every
stream, so that the steps of one stream's own time stamps bound the share.
"""

import numpy as np
from numpy.typing import NDArray

from h2nav.wire.frame_scan import FoundFrames

# A jump of more than this, of 256 numbers, is an older frame that came late, or another link.
_MAX_AT_ONCE = 128
_MIN_STEPS = 20


class LostFrames:
    """Counts while a recording is read; more than 128 frames lost at once are not seen."""

    def __init__(self) -> None:
        self._last: dict[int, int] = {}  # by sender
        self._came: dict[int, int] = {}
        self._lost: dict[int, int] = {}

    def add(self, found: FoundFrames) -> None:
        """Adds the next frames."""
        octets = np.frombuffer(found.data, dtype=np.uint8)
        numbers = octets[found.headers.at + np.where(found.headers.is_v2, 4, 2)].astype(np.int64)
        senders = found.senders()
        for sender in np.unique(senders).tolist():
            own = numbers[senders == sender]
            last = self._last.get(sender, int(own[0]) - 1)
            steps = (np.diff(own, prepend=last) - 1) & 0xFF
            lost = int(steps[steps < _MAX_AT_ONCE].sum())
            self._lost[sender] = self._lost.get(sender, 0) + lost
            self._came[sender] = self._came.get(sender, 0) + len(own)
            self._last[sender] = int(own[-1])

    def share(self, system: int, component: int) -> float | None:
        """Lost frames of all that a sender sent; None if none came."""
        sender = system << 8 | component
        if sender not in self._came:
            return None
        came, lost = self._came[sender], self._lost[sender]
        return lost / (came + lost)


def missing_share(stamps_ms: NDArray[np.int64]) -> float | None:
    """The share of a stream that is missing by the steps of its stamps; None if they are too few.

    Args:
        stamps_ms: (N,) of one stream in the order of arrival.
    """
    steps = np.diff(stamps_ms)
    steps = steps[steps > 0]
    if len(steps) < _MIN_STEPS:
        return None
    periods = np.rint(steps / np.median(steps))
    missing = float((periods[periods < _MAX_AT_ONCE] - 1.0).clip(min=0.0).sum())
    return missing / (missing + len(steps) + 1.0)
