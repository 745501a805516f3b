"""A TCP connection as the transport of a `StreamLink`."""

import errno
import os
import select
import socket

from h2nav.links.host_lookup import HostLookup
from h2nav.links.link_urls import TcpUrl

_READ_BYTES = 65536
_PEER_TIMEOUT_MS = 5000  # bytes unacknowledged for this long: the peer has lost power


class TcpTransport:
    """Connects to a server; each attempt uses the next address of the host."""

    def __init__(self, url: TcpUrl) -> None:
        self._url = url
        self._lookup: HostLookup | None = None
        self._socket: socket.socket | None = None
        self._attempts = 0

    def start(self) -> None:
        """Begins with the host lookup; a lookup that outlasts an attempt serves the next."""
        if self._lookup is None or not self._lookup.is_under_way:
            self._lookup = HostLookup(self._url.host, self._url.port)

    def is_ready(self) -> bool:
        """Proceeds from lookup to connection; raises OSError when either has failed."""
        if self._socket is None:
            addresses = self._lookup.addresses() if self._lookup else None
            if not addresses:
                return False
            target = addresses[self._attempts % len(addresses)]
            self._attempts += 1
            self._socket = _connecting(target.family)
            status = self._socket.connect_ex(target.address)
            if status not in (0, errno.EINPROGRESS):
                raise OSError(status, os.strerror(status))
        poll = select.poll()
        poll.register(self._socket, select.POLLOUT)
        if not poll.poll(0):
            return False
        status = self._socket.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
        if status:
            raise OSError(status, os.strerror(status))
        return True

    def fileno(self) -> int:
        """The descriptor of the socket."""
        return self._socket.fileno() if self._socket else -1

    def receive(self) -> bytes:
        """Returns the available bytes; raises OSError when the connection has ended."""
        assert self._socket is not None
        try:
            data = self._socket.recv(_READ_BYTES)
        except BlockingIOError:
            return b""
        if not data:
            raise ConnectionResetError(f"{self._url.host}:{self._url.port} closed the connection")
        return data

    def send(self, data: bytes) -> int:
        """Writes what fits into the socket's buffer."""
        assert self._socket is not None
        try:
            return self._socket.send(data)
        except BlockingIOError:
            return 0

    def close(self) -> None:
        """Closes the socket."""
        if self._socket is not None:
            self._socket.close()
        self._socket = None


def _connecting(family: socket.AddressFamily) -> socket.socket:
    """A non-blocking socket that sends each frame at once and detects a dead peer."""
    connection = socket.socket(family, socket.SOCK_STREAM)
    connection.setblocking(False)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    # Attitudes that wait in a deep buffer are stale when they leave.
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16384)
    if hasattr(socket, "TCP_USER_TIMEOUT"):
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _PEER_TIMEOUT_MS)
    return connection
