"""Publishes events on a Unix socket: one JSON document per line, to every connected client.

The socket is read-only, and no client can block the daemon: a client that reads too slowly is
disconnected, and what a client writes is ignored.
"""

import contextlib
import os
import socket
import stat
from collections.abc import Callable, Iterable
from pathlib import Path

from h2nav.errors import BadInput

MAX_CLIENTS = 8
# Queued per client; minutes of events.
MAX_WAITING_BYTES = 256 * 1024
# Owner and group; the permissions of the folder decide who else has access.
MODE = 0o660


class _Client:
    """One connection."""

    def __init__(self, end: socket.socket) -> None:
        end.setblocking(False)
        self._end = end
        self._waiting = b""
        self.is_gone = False  # the client has disconnected or reads too slowly

    def send(self, data: bytes) -> None:
        """Sends as much as the socket accepts; queues the rest."""
        data = self._waiting + data
        try:
            sent = self._end.send(data) if data else 0
        except BlockingIOError:
            sent = 0
        except OSError:
            self.is_gone = True
            return
        self._waiting = data[sent:]
        self.is_gone = len(self._waiting) > MAX_WAITING_BYTES

    def close(self) -> None:
        self._end.close()


class EventSocket:
    """Accepts clients and sends every event to each of them.

    Args:
        path: of the socket, in an existing folder.

    Raises:
        BadInput: the socket cannot be created, or another program listens on it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._clients: list[_Client] = []
        self._server = _listening(path)

    @property
    def count(self) -> int:
        """Number of connected clients."""
        return len(self._clients)

    def tend(self, greeting: Callable[[], Iterable[str]]) -> None:
        """Accepts new clients and drops those that have disconnected.

        Args:
            greeting: lines sent to each new client before any event, with their line breaks.
        """
        for _ in range(MAX_CLIENTS):
            try:
                end, _ = self._server.accept()
            except OSError:  # no client waits, or no descriptor is left
                break
            if len(self._clients) == MAX_CLIENTS:
                end.close()
                continue
            client = _Client(end)
            client.send("".join(greeting()).encode())
            self._clients.append(client)
        for client in self._clients:
            client.send(b"")
        self._let_go()

    def say(self, line: str) -> None:
        """Sends a line, with its line break, to every client."""
        data = line.encode()
        for client in self._clients:
            client.send(data)
        self._let_go()

    def close(self) -> None:
        """Disconnects all clients and removes the socket."""
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
        server.listen(MAX_CLIENTS)
    except OSError as error:
        server.close()
        reason = error.strerror or error
        raise BadInput(
            f"events.socket: {path}: {reason}; name a path in a folder that can be written"
        ) from error
    server.setblocking(False)
    return server


def _remove_dead(path: Path) -> None:
    """Removes the socket that a killed daemon left behind."""
    try:
        is_socket = stat.S_ISSOCK(path.lstat().st_mode)
    except FileNotFoundError:
        return
    if not is_socket:
        raise BadInput(f"events.socket: {path} exists and is not a socket; name another path")
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.setblocking(False)
        try:
            probe.connect(os.fspath(path))
        except ConnectionRefusedError:
            path.unlink()
            return
        except BlockingIOError:  # so many wait there that there is no room for one more
            pass
    raise BadInput(f"events.socket: another program listens on {path}; name another path")
