"""Many arrivals of a recording at once: one piece of memory, and where each of them lies in it."""

from collections.abc import Iterable, Iterator
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
BATCH_BYTES = 1 << 21


class Arrivals(NamedTuple):
    """What arrived one after the other: arrival i is `data[starts[i] : ends[i]]`.

    Attributes:
        data: the bytes; between the arrivals there may be others, those of the container.
        starts: (N,) where each begins.
        ends: (N,) where each ends, not behind the beginning of the next one.
        t_ns: (N,) host monotonic time of each, never decreasing.
        framed: the container gives out one frame, or a damaged stretch, at a time; else the
            arrivals lie side by side, and frames may go across.
    """

    data: bytes
    starts: Integers
    ends: Integers
    t_ns: Integers
    framed: bool

    def pauses(self, length_ns: int) -> list[int]:
        """Numbers of the arrivals that came later than so long after the one before."""
        pauses: list[int] = (np.flatnonzero(np.diff(self.t_ns) > length_ns) + 1).tolist()
        return pauses

    def piece(self, number: int) -> bytes:
        """The bytes of one."""
        return self.data[self.starts[number] : self.ends[number]]

    def pieces(self) -> Iterator[tuple[int, bytes]]:
        """Time (ns) and bytes of one after the other."""
        places = zip(self.t_ns.tolist(), self.starts.tolist(), self.ends.tolist(), strict=True)
        return ((t_ns, self.data[start:end]) for t_ns, start, end in places)


def gathered(pieces: Iterable[tuple[int, bytes]]) -> Iterator[Arrivals]:
    """Pieces side by side, some `BATCH_BYTES` at a time."""
    times: list[int] = []
    parts: list[bytes] = []
    size = 0
    for t_ns, data in pieces:
        times.append(t_ns)
        parts.append(data)
        size += len(data)
        if size >= BATCH_BYTES:
            yield _side_by_side(times, parts)
            times, parts, size = [], [], 0
    if parts:
        yield _side_by_side(times, parts)


def _side_by_side(times: list[int], parts: list[bytes]) -> Arrivals:
    edges = np.array(list(accumulate(map(len, parts), initial=0)), dtype=np.int64)
    return Arrivals(b"".join(parts), edges[:-1], edges[1:], np.array(times, dtype=np.int64), False)
