"""A recording as received bytes with their times; the kinds without an index: tlog, raw bytes."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from h2nav.maths.units import SECOND_NS
from h2nav.wire.arrivals import BATCH_BYTES, Arrivals
from h2nav.wire.tlog import TlogReader

if TYPE_CHECKING:  # loaded for our own logs only
    from h2nav.log.file import Attachment

SYNTHETIC_BYTES_S = 11_520  # a serial line at 115,200 baud, the usual source of raw captures
SYNTHETIC_CHUNK = 64


class Recording:
    """A recording that can be read any number of times, each time front to back.

    Attributes:
        path: the file.
        kind: ``tlog``, ``bytes`` or ``mcap``.
        unix_offset_ns: UNIX time minus the `t_ns` of `received`.
        times_are_synthetic: the file holds no arrival times; they follow from the byte count.
        attachments: name -> attachment (MCAP).
        metadata: name -> texts (MCAP).
        notes: what was damaged or skipped so far in this pass: reason -> count.
        progress: bytes read in this pass, and bytes of the file.
    """

    kind = ""
    times_are_synthetic = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self.unix_offset_ns = 0
        self.attachments: dict[str, Attachment] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.notes: dict[str, int] = {}
        self.progress = (0, path.stat().st_size)

    @property
    def unix_start_ns(self) -> int:
        """UNIX time of the first arrival; 0 without arrivals or times."""
        if self.times_are_synthetic:
            return 0
        # A separate pass, so that progress and notes of a running one are not disturbed.
        first = next(type(self)(self.path).received(), None)
        return first[0] + self.unix_offset_ns if first else 0

    def batches(self) -> Iterator[Arrivals]:
        """Yields all arrivals of all links in order, many at a time."""
        raise NotImplementedError

    def received(self) -> Iterator[tuple[int, bytes]]:
        """Yields single arrivals: host monotonic time (ns, never decreasing) and bytes."""
        for batch in self.batches():
            yield from batch.pieces()

    def records(self, topic: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Yields the JSON records of a topic (MCAP): (unix_ns, fields); none for other kinds."""
        return iter(())


class TlogRecording(Recording):
    """Time stamps and frames; the frames may come from several senders."""

    kind = "tlog"

    def batches(self) -> Iterator[Arrivals]:
        """One arrival per frame; `t_ns` is the recorder's UNIX time."""
        with self.path.open("rb") as stream:
            reader = TlogReader(stream)
            for batch in reader.batches():
                self.progress = (reader.position, self.progress[1])
                yield batch
            self.notes = nonzero(
                damaged_bytes=reader.damaged_bytes,
                corrected_times=reader.corrected_times,
                clock_steps_back=reader.clock_steps_back,
                clock_steps_forward=reader.clock_steps_forward,
            )


class BytesRecording(Recording):
    """The bytes of a link and nothing else, such as a capture of a serial line.

    They are returned in pieces of `SYNTHETIC_CHUNK` at `SYNTHETIC_BYTES_S`, from time 0 on. Only
    the autopilot's time stamps inside the messages are real.
    """

    kind = "bytes"
    times_are_synthetic = True

    def batches(self) -> Iterator[Arrivals]:
        """Yields pieces of equal size at a constant rate."""
        position = 0
        with self.path.open("rb") as stream:
            while data := stream.read(BATCH_BYTES):
                starts = np.arange(0, len(data), SYNTHETIC_CHUNK)
                ends = np.minimum(starts + SYNTHETIC_CHUNK, len(data))
                t_ns = (position + ends) * SECOND_NS // SYNTHETIC_BYTES_S
                position += len(data)
                self.progress = (position, self.progress[1])
                yield Arrivals(data, starts, ends, t_ns, framed=False)


def nonzero(**counts: int) -> dict[str, int]:
    """Of some counts those that are not zero."""
    return {reason: count for reason, count in counts.items() if count}
