"""The autopilot's end of a stream link: a pseudo-terminal, or a TCP port that listens.

Both are transports of a `StreamLink` that are always ready: without a peer, sent bytes are lost, as
on an unconnected wire.
"""

import contextlib
import fcntl
import os
import socket
import struct
import tty

from h2nav.errors import BadInput
from h2nav.links.link_urls import parse_link_url
from h2nav.links.links import Link, open_link
from h2nav.links.stream_link import StreamLink

FORMS = "pty:/PATH/OF/LINK (make a serial port there), tcpin:HOST:PORT (listen)"
"""The forms accepted besides those of `link_urls`, for help texts."""

_READ_BYTES = 65536
# Linux ioctl numbers (asm-generic/ioctls.h: TIOCSPTLCK, TIOCGPTN), which Python does not name.
_UNLOCK_PTY = 0x40045431
_GET_PTY_NUMBER = 0x80045430


def open_server_link(url: str) -> Link:
    """Creates the link of a connection URL, or of one of `FORMS`.

    Raises:
        BadInput: the URL is not valid.
    """
    kind, _, rest = url.partition(":")
    if kind == "pty":
        if not rest.startswith("/"):
            raise BadInput(f"connection URL {url!r}: expected pty:/ABSOLUTE/PATH of a new link")
        return StreamLink(url, PtyTransport(rest))
    if kind == "tcpin":
        target = parse_link_url(f"udpin:{rest}")
        return StreamLink(url, TcpServerTransport(target[0], target[1]))
    return open_link(url)


class PtyTransport:
    """A pseudo-terminal with a symbolic link to its far end.

    When the program at the far end closes it, a new terminal replaces it behind the same link, as
    when a USB adapter is plugged in again.

    Args:
        path: of the symbolic link; an existing symbolic link is replaced.
    """

    def __init__(self, path: str) -> None:
        self._path = path
        self._descriptor = -1

    def start(self) -> None:
        """Creates the terminal and the link; raises OSError."""
        # openpty would also open the far end, and closing that would look like a hang-up.
        self._descriptor = os.open("/dev/ptmx", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        fcntl.ioctl(self._descriptor, _UNLOCK_PTY, struct.pack("i", 0))
        answer = fcntl.ioctl(self._descriptor, _GET_PTY_NUMBER, struct.pack("i", 0))
        tty.setraw(self._descriptor)
        self._remove_link()
        os.symlink(f"/dev/pts/{struct.unpack('i', answer)[0]}", self._path)

    def is_ready(self) -> bool:
        """Returns True: a terminal opens at once."""
        return True

    def fileno(self) -> int:
        """The descriptor of the near end."""
        return self._descriptor

    def receive(self) -> bytes:
        """Returns the available bytes; replaces a far end that was closed."""
        try:
            return os.read(self._descriptor, _READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:  # EIO: the far end was closed
            # The old terminal is closed after the new one is open, so that their names differ.
            old = self._descriptor
            self.start()
            os.close(old)
            return b""

    def send(self, data: bytes) -> int:
        """Writes what fits; without a reader it is lost."""
        try:
            return os.write(self._descriptor, data)
        except BlockingIOError:
            return 0
        except OSError:
            return len(data)

    def close(self) -> None:
        """Closes the near end and removes the link."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1
            self._remove_link()

    def _remove_link(self) -> None:
        """Removes the symbolic link; a file of another kind stays, and `os.symlink` reports it."""
        if os.path.islink(self._path):
            with contextlib.suppress(FileNotFoundError):
                os.unlink(self._path)


class TcpServerTransport:
    """A TCP port that serves one client at a time; the next one waits in the backlog.

    Args:
        port: 0 lets the kernel choose.
    """

    def __init__(self, host: str, port: int) -> None:
        self._address = (host, port)
        self._listener: socket.socket | None = None
        self._client: socket.socket | None = None

    def start(self) -> None:
        """Listens; raises OSError."""
        self._listener = socket.create_server(self._address)
        self._listener.setblocking(False)

    def is_ready(self) -> bool:
        """Returns True: a port listens at once."""
        return True

    def fileno(self) -> int:
        """The descriptor that becomes readable on a new client or new bytes."""
        if self._client is not None:
            return self._client.fileno()
        return self._listener.fileno() if self._listener is not None else -1

    def receive(self) -> bytes:
        """Returns bytes of the client; accepts the next client when there is none."""
        if self._client is None:
            self._accept()
            return b""
        try:
            data = self._client.recv(_READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop_client()
        return data

    def send(self, data: bytes) -> int:
        """Writes what fits; without a client it is lost."""
        if self._client is None:
            return len(data)
        try:
            return self._client.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            self._drop_client()
            return len(data)

    def close(self) -> None:
        """Closes the client and the port."""
        self._drop_client()
        if self._listener is not None:
            self._listener.close()
            self._listener = None

    def _accept(self) -> None:
        assert self._listener is not None
        with contextlib.suppress(BlockingIOError, ConnectionError):
            self._client, _ = self._listener.accept()
            self._client.setblocking(False)
            self._client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _drop_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None
