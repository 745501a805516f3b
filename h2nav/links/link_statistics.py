"""Counters of a link, for the log and the status line."""

from typing import NamedTuple


class LinkStatistics(NamedTuple):
    """Counters since the link was created; they survive reconnects.

    Attributes:
        bytes_in: received and passed on.
        bytes_out: given to the kernel.
        chunks_in: datagrams, or pieces of a byte stream, received and passed on.
        frames_out: accepted for sending; queued frames may still be dropped.
        frames_dropped: not sent: link down, no peer yet, queue full, or lost with the link
            while they waited.
        opened: how often the link came up; all but the first are reconnects.
        errors: failed openings, losses of the link, failed sends.
        foreign_datagrams: from senders other than the peer, not passed on.
        peer_changes: how often another (address, port) became the peer.
        shed_datagrams: delayed datagrams of the peer that do not begin with a frame: dropped, so
            that a flood of garbage does not delay frames.
    """

    bytes_in: int = 0
    bytes_out: int = 0
    chunks_in: int = 0
    frames_out: int = 0
    frames_dropped: int = 0
    opened: int = 0
    errors: int = 0
    foreign_datagrams: int = 0
    peer_changes: int = 0
    shed_datagrams: int = 0


class LinkTally:
    """The counting side of `LinkStatistics`, with the text of the latest error."""

    def __init__(self) -> None:
        self._counts = dict.fromkeys(LinkStatistics._fields, 0)
        self.last_error = ""

    def add(self, **amounts: int) -> None:
        """Adds to the counters named as in `LinkStatistics`."""
        for name, amount in amounts.items():
            self._counts[name] += amount

    def error(self, error: Exception | str) -> None:
        """Counts an error and keeps its text."""
        self._counts["errors"] += 1
        self.last_error = str(error)

    def snapshot(self) -> LinkStatistics:
        """The counters now."""
        return LinkStatistics(**self._counts)
