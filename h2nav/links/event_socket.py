"""Events for other programs on a Unix socket: one JSON document a line, to whoever connects.

It is read-only, and nobody who connects can hold the daemon up: what a client does not read in time
ends its connection, and what it writes is not read.
"""

import contextlib
import os
import socket
import stat
from collections.abc import Callable, Iterable
from pathlib import Path

from h2nav.errors import BadInput

MOST_CLIENTS = 8
# What may wait for a client; minutes of events.
MOST_WAITING_BYTES = 256 * 1024
# Its owner and group; the folder says who else gets there.
MODE = 0o660


class _Client:
    """One connection.

    Attributes:
        is_gone: it has hung up, or reads too slowly.
    """

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._waiting = b""
        self.is_gone = False

    def send(self, data: bytes) -> None:
        """Sends what there is room for; keeps the rest."""
        data = self._waiting + data
        try:
            sent = self._end.send(data) if data else 0
        except BlockingIOError:
            sent = 0
        except OSError:
            self.is_gone = True
            return
        self._waiting = data[sent:]
        self.is_gone = len(self._waiting) > MOST_WAITING_BYTES

    def close(self) -> None:
        self._end.close()


class EventSocket:
    """The server.

    Args:
        path: of the socket; its folder exists.

    Raises:
        BadInput: it cannot be made there, or another program listens there.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._clients: list[_Client] = []
        self._server = _listening(path)

    @property
    def count(self) -> int:
        """How many clients there are."""
        return len(self._clients)

    def tend(self, greeting: Callable[[], Iterable[str]]) -> None:
        """Lets in who has come, and lets go who is gone.

        Args:
            greeting: lines that somebody who comes late has missed, with their line breaks.
        """
        while True:
            try:
                end, _ = self._server.accept()
            except OSError:  # nobody, or no descriptor left
                break
            if len(self._clients) == MOST_CLIENTS:
                end.close()
                continue
            client = _Client(end)
            client.send("".join(greeting()).encode())
            self._clients.append(client)
        for client in self._clients:
            client.send(b"")
        self._let_go()

    def say(self, line: str) -> None:
        """Sends a line, with its line break, to all of them."""
        data = line.encode()
        for client in self._clients:
            client.send(data)
        self._let_go()

    def close(self) -> None:
        """Hangs up and takes the socket away."""
        for client in self._clients:
            client.close()
        self._clients.clear()
        self._server.close()
        with contextlib.suppress(OSError):
            self._path.unlink()

    def _let_go(self) -> None:
        for client in [client for client in self._clients if client.is_gone]:
            client.close()
            self._clients.remove(client)


def _listening(path: Path) -> socket.socket:
    server = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        _remove_dead(path)
        server.bind(os.fspath(path))
        path.chmod(MODE)
        server.listen(MOST_CLIENTS)
    except OSError as error:
        server.close()
        reason = error.strerror or error
        raise BadInput(
            f"events.socket: {path}: {reason}; name a path in a folder that can be written"
        ) from error
    server.setblocking(False)
    return server


def _remove_dead(path: Path) -> None:
    """A daemon that was killed has left its socket behind."""
    try:
        is_socket = stat.S_ISSOCK(path.lstat().st_mode)
    except FileNotFoundError:
        return
    if not is_socket:
        raise BadInput(f"events.socket: {path} is there and is no socket; name another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink()
            return
    raise BadInput(f"events.socket: another program listens at {path}; name another path")
