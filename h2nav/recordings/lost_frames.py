"""Frames that a link lost, by the numbers that every sender gives to its own."""

import numpy as np

from h2nav.wire.frame_scan import FoundFrames

# A jump of more than this, of 256 numbers, is an older frame that came late, or another link.
_MAX_AT_ONCE = 128


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
        came, lost = self._came.get(sender, 0), self._lost.get(sender, 0)
        return lost / (came + lost) if came else None
