"""Many arrivals of a recording at once: one buffer, and where each arrival lies in it."""

from collections.abc import Iterable, Iterator
from itertools import accumulate
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]
BATCH_BYTES = 1 << 21


class Arrivals(NamedTuple):
    """Consecutive arrivals: arrival i is `data[starts[i] : ends[i]]`."""

    data: bytes  # the bytes; bytes of the container may lie between arrivals
    starts: Integers  # (N,) beginning of each
    ends: Integers  # (N,) end of each, at most the beginning of the next
    t_ns: Integers  # (N,) host monotonic time of each, never decreasing
    # each arrival is one frame or one damaged stretch; otherwise arrivals are contiguous and
    # frames may span them
    framed: bool

    def pauses(self, length_ns: int) -> list[int]:
        """Numbers of the arrivals that came later than `length_ns` after the previous one."""
        pauses: list[int] = (np.flatnonzero(np.diff(self.t_ns) > length_ns) + 1).tolist()
        return pauses

    def piece(self, number: int) -> bytes:
        """The bytes of one arrival."""
        return self.data[self.starts[number] : self.ends[number]]

    def pieces(self) -> Iterator[tuple[int, bytes]]:
        """Yields time (ns) and bytes of each arrival."""
        places = zip(self.t_ns.tolist(), self.starts.tolist(), self.ends.tolist(), strict=True)
        return ((t_ns, self.data[start:end]) for t_ns, start, end in places)


def gathered(pieces: Iterable[tuple[int, bytes]]) -> Iterator[Arrivals]:
    """Joins pieces into batches of about `BATCH_BYTES`."""
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
