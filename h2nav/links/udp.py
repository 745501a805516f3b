"""A link over UDP datagrams."""

import contextlib
import socket
import struct
import time
from collections.abc import Callable
from typing import Any

from h2nav.links.back_off import BackOff
from h2nav.links.host_lookup import HostLookup, SocketAddress
from h2nav.links.link_errors import explained
from h2nav.links.link_statistics import LinkStatistics, LinkTally
from h2nav.links.link_urls import UdpUrl
from h2nav.links.received import Received
from h2nav.wire.deframer import begins_with_frame

PEER_SILENCE_NS = 1_500_000_000
"""After this silence another (address, port) may become the peer: longer than a heartbeat's period,
so that two senders never alternate, and short enough for an autopilot that reboots (about 1 s of
silence, then a new source port)."""

WAITED_NS = 20_000_000
"""A datagram that was queued for this long, behind others, shows that we are overloaded. The
costliest garbage takes a millisecond per datagram; checking whether one begins with a frame takes
ten microseconds."""

_RECEIVE_BUFFER_BYTES = 1 << 20  # requested; the kernel may grant less (net.core.rmem_max)
_DATAGRAM_BYTES = 65536
_BACKLOG_DATAGRAMS = 16
_DATAGRAMS_PER_READ = 64  # a flood must not starve the rest of the loop
# Linux (asm-generic/socket.h), which Python does not name: the kernel's time of arrival, UNIX time.
_SO_TIMESTAMPNS = 35
_TIMESPEC = struct.Struct("@ll")
_STAMP_SLACK_NS = 10_000_000
_ANCILLARY_BYTES = socket.CMSG_SPACE(_TIMESPEC.size)

AcceptsSender = Callable[[bytes], bool]


class UdpLink:
    """Listens for one peer, or sends first to a given one.

    A listening link (``udpin:``) takes the first sender that `accepts` accepts as its peer, and
    answers and receives from that peer alone until it has been silent for `PEER_SILENCE_NS`. A
    sending link (``udpout:``) knows its peer from the URL. Datagrams of other senders are counted
    and dropped.

    Args:
        accepts: whether a datagram makes its sender the peer; None accepts every sender.
    """

    has_backlog = False

    def __init__(self, url: str, target: UdpUrl, accepts: AcceptsSender | None = None) -> None:
        self.url = url
        self._target = target
        self._accepts = accepts
        self._lookup: HostLookup | None = None
        self._socket: socket.socket | None = None
        self._back_off = BackOff()
        self._tally = LinkTally()
        self._peer: tuple[Any, ...] | None = None
        self._peer_heard_ns = 0
        self._t_ns = 0
        self._drained_ns = 0  # when the kernel's queue was last empty
        self.has_more = False  # data may remain after the latest `read`
        self._datagram = bytearray(_DATAGRAM_BYTES)
        self._view = memoryview(self._datagram)

    @property
    def is_up(self) -> bool:
        """Whether the socket is open (regardless of a peer)."""
        return self._socket is not None

    @property
    def local_port(self) -> int | None:
        """The port that the socket is bound to; None while it is closed or unbound."""
        return None if self._socket is None else int(self._socket.getsockname()[1]) or None

    @property
    def statistics(self) -> LinkStatistics:
        """Counters since the link was made."""
        return self._tally.snapshot()

    @property
    def last_error(self) -> str:
        """Text of the latest error, "" if there was none."""
        return self._tally.last_error

    def fileno(self) -> int | None:
        """The descriptor to select on for reading, None while the link is down."""
        return None if self._socket is None else self._socket.fileno()

    def maintain(self, t_ns: int) -> None:
        """Opens a closed socket as the back-off allows; never raises.

        Args:
            t_ns: monotonic time, ns; called before `read`, at least every 100 ms. `read` takes it
                as the time of arrival.
        """
        self._t_ns = t_ns
        if self._socket is not None:
            return
        try:
            if self._lookup is None:
                if not self._back_off.is_due(t_ns):
                    return
                self._lookup = HostLookup(self._target.host, self._target.port)
            addresses = self._lookup.addresses()
            if addresses:
                self._open(addresses[0])
        except OSError as error:
            self.close()
            self._tally.error(explained(self.url, self._target, error))
            self._back_off.failed(t_ns)

    def read(self) -> list[Received]:
        """Returns the peer's datagrams since the last call, at most 64; never blocks or raises."""
        datagrams: list[Received] = []
        self.has_more = False
        if self._socket is None:
            return datagrams
        unix_offset_ns = time.time_ns() - time.monotonic_ns()
        for place in range(_DATAGRAMS_PER_READ):
            try:
                size, ancillary, _, sender = self._socket.recvmsg_into(
                    [self._datagram], _ANCILLARY_BYTES
                )
            except BlockingIOError:
                self._drained_ns = time.monotonic_ns()
                break
            except OSError as error:  # for example an ICMP answer to an earlier send
                self._fault(error)
                break
            data = bytes(self._view[:size])
            if not self._is_from_peer(sender, data):
                self._tally.add(foreign_datagrams=1)
                continue
            t_ns = self._arrival_ns(ancillary, unix_offset_ns)
            is_backlog = place >= _BACKLOG_DATAGRAMS and _has_waited(t_ns)
            if is_backlog and not begins_with_frame(data):
                self._tally.add(shed_datagrams=1)
                continue
            datagrams.append(Received(data, t_ns))
        else:
            self.has_more = True
        if datagrams:
            size = sum(len(datagram.data) for datagram in datagrams)
            self._tally.add(bytes_in=size, chunks_in=len(datagrams))
        return datagrams

    def write(self, data: bytes) -> bool:
        """Sends one datagram to the peer; never blocks, never raises.

        Args:
            data: one or more whole frames.

        Returns:
            False if it was dropped: link down, no peer yet, or rejected by the kernel.
        """
        if self._socket is not None and self._peer is not None:
            try:
                self._socket.sendto(data, self._peer)
            except BlockingIOError:
                pass
            except OSError as error:  # no route, network down: may work next time
                self._fault(error)
            else:
                self._tally.add(bytes_out=len(data), frames_out=1)
                return True
        self._tally.add(frames_dropped=1)
        return False

    def close(self) -> None:
        """Closes the socket; a later `maintain` reopens it."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None
        self._lookup = None
        self._peer = None

    def _open(self, local_or_remote: SocketAddress) -> None:
        self._socket = socket.socket(local_or_remote.family, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _RECEIVE_BUFFER_BYTES)
        with contextlib.suppress(OSError):  # other kernels number their options differently
            self._socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        if self._target.listens:
            self._socket.bind(local_or_remote.address)
        else:
            # Not connected: a connected socket would drop foreign datagrams without counting them.
            self._peer = local_or_remote.address
        self._back_off.succeeded()
        self._tally.add(opened=1)

    def _fault(self, error: OSError) -> None:
        self._tally.error(explained(self.url, self._target, error))

    def _is_from_peer(self, sender: tuple[Any, ...], data: bytes) -> bool:
        if self._peer is None or sender[:2] != self._peer[:2]:
            if not self._may_become_peer(data):
                return False
            self._tally.add(peer_changes=self._peer is not None)
            self._peer = sender
        self._peer_heard_ns = self._t_ns
        return True

    def _may_become_peer(self, data: bytes) -> bool:
        """Whether there is no active peer, and `accepts` accepts the datagram."""
        taken = self._peer is not None and self._t_ns - self._peer_heard_ns < PEER_SILENCE_NS
        if taken or not self._target.listens:
            return False
        return self._accepts is None or self._accepts(data)

    def _arrival_ns(
        self, ancillary: list[tuple[int, int, bytes]], unix_offset_ns: int
    ) -> int | None:
        """Returns the kernel's time of arrival on the monotonic clock, if plausible, or None.

        The stamp is in UNIX time, which may have been set since: a stamp from before the kernel's
        queue was last empty is wrong.
        """
        for level, kind, data in ancillary:
            is_stamp = level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS
            if is_stamp and len(data) == _TIMESPEC.size:
                seconds, nanoseconds = _TIMESPEC.unpack(data)
                t_ns = int(seconds * 1_000_000_000 + nanoseconds - unix_offset_ns)
                return t_ns if t_ns >= self._drained_ns - _STAMP_SLACK_NS else None
        return None


def _has_waited(t_ns: int | None) -> bool:
    return t_ns is not None and time.monotonic_ns() - t_ns > WAITED_NS
