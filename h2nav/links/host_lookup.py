"""Resolves host names to socket addresses without blocking the caller."""

import socket
import threading
from typing import Any, NamedTuple


class SocketAddress(NamedTuple):
    """An address family and an address tuple for sockets of that family."""

    family: socket.AddressFamily
    address: tuple[Any, ...]


class HostLookup:
    """Looks up a host: literal addresses at once, names on a separate thread.

    Args:
        host: a name or a literal IPv4 or IPv6 address, in ASCII.
        port: copied into the addresses.
    """

    def __init__(self, host: str, port: int) -> None:
        self._host = host
        self._port = port
        self._outcome: list[SocketAddress] | OSError | None = None
        try:
            self._outcome = self._resolve(socket.AI_NUMERICHOST)
        except OSError:
            self._start_thread()

    @property
    def is_under_way(self) -> bool:
        """Whether the lookup is still running."""
        return self._outcome is None

    def addresses(self) -> list[SocketAddress] | None:
        """Returns the addresses, IPv4 first; None while the lookup is running.

        Raises:
            OSError: the name cannot be resolved.
        """
        if isinstance(self._outcome, OSError):
            raise self._outcome
        return self._outcome

    def _start_thread(self) -> None:
        try:
            threading.Thread(target=self._run, name="host lookup", daemon=True).start()
        except RuntimeError as error:  # the process cannot start another thread
            self._outcome = OSError(f"host {self._host!r} cannot be looked up: {error}")

    def _run(self) -> None:
        try:
            self._outcome = self._resolve(0)
        except OSError as error:
            self._outcome = OSError(f"host {self._host!r} cannot be resolved: {error}")

    def _resolve(self, flags: int) -> list[SocketAddress]:
        # Bytes, because a str would import the IDNA codec, which may fail (EMFILE).
        host = self._host.encode("ascii")
        found = socket.getaddrinfo(host, self._port, type=socket.SOCK_STREAM, flags=flags)
        # Autopilots and simulators mostly listen on IPv4, whatever localhost resolves to.
        found.sort(key=lambda entry: entry[0] != socket.AF_INET)
        return [SocketAddress(entry[0], entry[4]) for entry in found]
