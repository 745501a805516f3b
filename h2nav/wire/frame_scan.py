"""Scans a recording for frames, many at a time, with the same result as a `Deframer`.

Where good frames are contiguous, all of them are found at once. Everything else goes through a
`Deframer`, arrival by arrival, until it reaches the beginning of contiguous frames again. Frames,
counters and times of arrival are the same.
"""

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from h2nav.wire.arrivals import Arrivals, Integers
from h2nav.wire.byte_views import is_marker, marker_places, values_at
from h2nav.wire.deframer import SIGNATURE_SIZE, Deframer, Frame, PlacedFrame
from h2nav.wire.frame_checks import (
    SHORTEST_2,
    Headers,
    have_right_checksums,
    headers_at,
    is_plain_end,
)


class WantedFrames(NamedTuple):
    """Frames of some ids."""

    arrivals: list[int]  # number of the arrival that completed each frame
    placed: list[PlacedFrame]  # place and origin of each frame, of the same length
    rows: Integers  # (M,) their numbers among all frames found


class FoundFrames(NamedTuple):
    """The frames completed by some arrivals, in order."""

    data: bytes  # the buffer that holds them
    t_ns: Integers  # (N,) time of each arrival
    arrivals: Integers  # (M,) number of the arrival that completed each frame, never decreasing
    headers: Headers  # of the M frames

    def wanted(self, ids: Collection[int]) -> WantedFrames:
        """The frames with these message ids."""
        chosen = np.isin(self.headers.msg_ids, list(ids))
        headers, arrivals = self.headers.those(chosen), self.arrivals[chosen]
        keys = self.senders()[chosen].tolist()
        addresses = {key: (key >> 8, key & 0xFF) for key in set(keys)}
        placed = zip(
            self.t_ns[arrivals].tolist(),
            headers.msg_ids.tolist(),
            map(addresses.__getitem__, keys),
            headers.at.tolist(),
            headers.payload_at.tolist(),
            (headers.payload_at + headers.lengths).tolist(),
            strict=True,
        )
        return WantedFrames(arrivals.tolist(), list(placed), np.flatnonzero(chosen))

    def senders(self) -> Integers:
        """(M,) system id times 256 plus component id."""
        octets = np.frombuffer(self.data, dtype=np.uint8)
        at = self.headers.at + np.where(self.headers.is_v2, 5, 3)
        return octets[at].astype(np.int64) << 8 | octets[at + 1]


class FrameScan:
    """Finds the frames of one recording.

    Args:
        whole_frames: no frame spans two arrivals; an incomplete frame at an arrival's end is
            damage.
    """

    def __init__(self, *, whole_frames: bool = False) -> None:
        self.deframer = Deframer()  # holds the counters
        self._whole_frames = whole_frames

    def frames_of(self, arrivals: Arrivals) -> FoundFrames:
        """Returns the frames that the next arrivals complete."""
        clean = _CleanFrames(arrivals, self._whole_frames)
        found = _Found(arrivals)
        number, at = 0, 0  # the next byte is at `at`, in this arrival
        while number < len(arrivals.starts):
            at = max(at, int(arrivals.starts[number]))
            run = self._run(clean, at)
            if run is not None:
                found.add_run(clean, run)
                at = int(clean.headers.ends[run.stop - 1])
                number = int(np.searchsorted(arrivals.ends, at, "right"))
            else:
                end = int(arrivals.ends[number])
                found.add_frames(number, self._fed(arrivals.data[at:end]))
                at, number = end, number + 1
        return found.frames()

    def _fed(self, data: bytes) -> list[Frame]:
        frames = self.deframer.feed(data)
        return frames + self.deframer.flush() if self._whole_frames else frames

    def _run(self, clean: "_CleanFrames", at: int) -> slice | None:
        """Counts and returns the clean frames that begin at `at` or at the undecided bytes."""
        undecided = self.deframer.undecided_bytes
        if undecided is None or undecided > (0 if clean.arrivals.framed else at):
            return None
        run = clean.run(at - undecided)
        if run.stop == run.start:
            return None
        self.deframer.give_back()
        headers = clean.headers
        self.deframer.pass_over(
            size=int((headers.ends[run] - headers.at[run]).sum()),
            frames=run.stop - run.start,
            frames_v1=int((~headers.is_v2[run]).sum()),
            signed=int(headers.signed[run].sum()),
            longer=int(headers.are_longer[run].sum()),
        )
        return run


class _CleanFrames:
    """Good frames that a `Deframer` would return without keeping any bytes."""

    def __init__(self, arrivals: Arrivals, whole_frames: bool) -> None:
        data, starts, ends = arrivals.data, arrivals.starts, arrivals.ends
        if arrivals.framed:
            headers = headers_at(data, starts)
            headers = headers.those(ends[np.searchsorted(starts, headers.at)] == headers.ends)
        else:
            headers = headers_at(data, marker_places(np.frombuffer(data, dtype=np.uint8)))
        self.arrivals = arrivals  # that contain them
        # of all good frames
        self.headers = headers = headers.those(have_right_checksums(data, headers))
        # (N,) number of the arrival with the last byte of each
        self.completed_by = np.searchsorted(ends, headers.ends - 1, "right")
        begun_by = np.searchsorted(ends, headers.at, "right")
        followed = self._followed(begun_by)
        goes_across = begun_by != self.completed_by
        if not whole_frames:
            # A good frame inside the first part of another one would be returned instead of it.
            goes_across &= (
                np.searchsorted(headers.at, headers.ends) > np.arange(len(headers.at)) + 1
            )
        self._unclean = np.flatnonzero(goes_across | self._may_hold_marker(followed))
        self._last = np.flatnonzero(~followed)

    def _followed(self, begun_by: Integers) -> NDArray[np.bool_]:
        """(N,) whether the next good frame follows immediately."""
        headers = self.headers
        if self.arrivals.framed:
            side_by_side = begun_by[1:] == begun_by[:-1] + 1
        else:
            side_by_side = headers.at[1:] == headers.ends[:-1]
        return np.append(side_by_side, np.zeros(min(len(headers.at), 1), dtype=bool))

    def _may_hold_marker(self, followed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """(N,) whether the last bytes of each frame must be searched for a start marker.

        The checksum covers no signature, and a last byte may equal the next frame's start marker.
        """
        headers, data = self.headers, self.arrivals.data
        held = is_marker(np.frombuffer(data, dtype=np.uint8)[headers.ends - 1])
        rows = np.flatnonzero(held & followed)
        held[rows] = ~is_plain_end(data, headers.ends[rows], headers.at[rows + 1])
        signed = np.flatnonzero(headers.signed)
        signatures = values_at(data, headers.ends[signed] - SIGNATURE_SIZE, f"V{SIGNATURE_SIZE}")
        octets = signatures.view(np.uint8).reshape(len(signed), SIGNATURE_SIZE)
        held[signed] = is_marker(octets).any(axis=1)
        return held

    def run(self, at: int) -> slice:
        """The contiguous clean frames from `at` on."""
        first = int(np.searchsorted(self.headers.at, at))
        if first == len(self.headers.at) or self.headers.at[first] != at:
            return slice(0, 0)
        stop = int(self._last[np.searchsorted(self._last, first)]) + 1
        unclean = int(np.searchsorted(self._unclean, first))
        if unclean < len(self._unclean):
            stop = min(stop, int(self._unclean[unclean]))
        return slice(first, stop)


class _Found:
    """Collects runs and single frames in order."""

    def __init__(self, arrivals: Arrivals) -> None:
        self._arrivals = arrivals
        self._at = [np.empty(0, dtype=np.int64)]
        self._numbers = [np.empty(0, dtype=np.int64)]
        self._others: list[bytes] = []  # frames that may have begun before these arrivals
        self._size = len(arrivals.data)

    def add_run(self, clean: _CleanFrames, run: slice) -> None:
        self._at.append(clean.headers.at[run])
        self._numbers.append(clean.completed_by[run])

    def add_frames(self, number: int, frames: list[Frame]) -> None:
        for frame in frames:
            self._at.append(np.array([self._size]))
            self._numbers.append(np.array([number]))
            self._others.append(frame.raw)
            self._size += len(frame.raw)

    def frames(self) -> FoundFrames:
        data = self._arrivals.data
        if self._others:
            data = b"".join((data, *self._others, bytes(SHORTEST_2)))
        headers = headers_at(data, np.concatenate(self._at))
        return FoundFrames(data, self._arrivals.t_ns, np.concatenate(self._numbers), headers)
