"""A link over a byte stream that may drop and reconnect: serial port or TCP connection."""

import errno
from collections.abc import Callable
from typing import Protocol

from h2nav.links.back_off import BackOff
from h2nav.links.frame_queue import FrameQueue
from h2nav.links.link_statistics import LinkStatistics, LinkTally
from h2nav.links.received import Received

OPEN_TIMEOUT_NS = 3_000_000_000
"""An opening that takes longer has failed."""


class Transport(Protocol):
    """Opens, reads and writes for a `StreamLink`. Every method may raise OSError."""

    def start(self) -> None:
        """Begins to open; never blocks."""

    def is_ready(self) -> bool:
        """Continues the opening; returns True once it is complete."""

    def fileno(self) -> int:
        """The descriptor of the opened stream."""

    def receive(self) -> bytes:
        """Returns the available bytes, b"" if none; raises OSError when the stream has ended."""

    def send(self, data: bytes) -> int:
        """Accepts as many bytes as fit now; returns how many."""

    def close(self) -> None:
        """Closes whatever is open; never raises."""


class StreamLink:
    """Keeps one byte stream open, with back-off, and sends whole frames over it.

    Args:
        explain: turns an error of the transport into a message.
    """

    local_port = None

    def __init__(
        self, url: str, transport: Transport, explain: Callable[[OSError], str] = str
    ) -> None:
        self.url = url
        self._transport = transport
        self._explain = explain
        self._back_off = BackOff()
        self._queue = FrameQueue()
        self._tally = LinkTally()
        self._opening_since_ns: int | None = None
        self._t_ns = 0
        self.is_up = False  # the descriptor is open
        self.has_more = False  # data may remain after the latest `read`

    @property
    def statistics(self) -> LinkStatistics:
        """Counters since the link was made."""
        return self._tally.snapshot()

    @property
    def last_error(self) -> str:
        """Text of the latest error, "" if there was none."""
        return self._tally.last_error

    @property
    def has_backlog(self) -> bool:
        """Whether frames are queued: wake up when the descriptor is writable."""
        return self.is_up and bool(self._queue)

    def fileno(self) -> int | None:
        """The descriptor to select on for reading, None while the link is down."""
        return self._transport.fileno() if self.is_up else None

    def maintain(self, t_ns: int) -> None:
        """Opens a closed link as the back-off allows, and sends queued frames; never raises.

        Args:
            t_ns: monotonic time, ns; to be called at least every 100 ms.
        """
        self._t_ns = t_ns
        try:
            if self.is_up:
                self._send_queue()
            else:
                self._open(t_ns)
        except OSError as error:
            self._fail(error)

    def read(self) -> list[Received]:
        """Returns what has arrived since the last call; never blocks, never raises."""
        self.has_more = False
        if not self.is_up:
            return []
        try:
            chunk = self._transport.receive()
        except OSError as error:
            self._fail(error)
            return []
        if not chunk:
            return []
        self.has_more = True
        self._back_off.succeeded()
        self._tally.add(bytes_in=len(chunk), chunks_in=1)
        return [Received(chunk)]

    def write(self, data: bytes) -> bool:
        """Sends one whole frame or queues it; never blocks, never raises.

        Args:
            data: one frame.

        Returns:
            False if the frame was dropped. A full queue drops its oldest frames.
        """
        if not self.is_up:
            self._tally.add(frames_dropped=1)
            return False
        self._tally.add(frames_out=1, frames_dropped=self._queue.push(data))
        try:
            self._send_queue()
        except OSError as error:
            self._fail(error)
        return self.is_up

    def close(self) -> None:
        """Closes the descriptor; a later `maintain` reopens it."""
        self.is_up = False
        self._opening_since_ns = None
        self._tally.add(frames_dropped=self._queue.clear())
        self._transport.close()

    def _open(self, t_ns: int) -> None:
        if self._opening_since_ns is None:
            if not self._back_off.is_due(t_ns):
                return
            self._opening_since_ns = t_ns
            self._transport.start()
        if self._transport.is_ready():
            self._opening_since_ns = None
            self.is_up = True
            self._tally.add(opened=1)
        elif t_ns - self._opening_since_ns >= OPEN_TIMEOUT_NS:
            raise TimeoutError(errno.ETIMEDOUT, f"no answer within {OPEN_TIMEOUT_NS / 1e9:g} s")

    def _send_queue(self) -> None:
        self._tally.add(bytes_out=self._queue.send(self._transport.send))

    def _fail(self, error: OSError) -> None:
        self.close()
        self._tally.error(self._explain(error))
        self._back_off.failed(self._t_ns)
