"""A proxy that adds limits in front of a server that has none.

The Foxglove library accepts any number of connections, waits for a handshake for ever, and stops
listening once the process has run out of file descriptors. The guard limits connections, the time
to an answer, and what a client may send. It stops reading from a client that does not read, and the
server behind it drops what it cannot deliver.
"""

import asyncio
from typing import cast

from h2nav.errors import BadInput

MAX_CONNECTIONS = 32
WAITING = 32
# Time for the server's first answer; it answers every client that speaks the protocol.
PATIENCE_S = 5.0
# Clients subscribe and request parameters, which takes a few kilobytes.
MAX_SAID_BYTES = 256 * 1024
SAID_WITHIN_S = 10.0
BEHIND = "127.0.0.1"


class Guard:
    """Listens on behalf of a server that listens on this machine only.

    Args:
        port_behind: of that server, on the loopback.
    """

    def __init__(self, port_behind: int) -> None:
        self.port = 0  # the listening port; 0 before
        self.is_alone = False  # the server behind is gone
        self._port_behind = port_behind
        self._server: asyncio.Server | None = None
        self._clients: set[_Client] = set()
        self._tasks: set[asyncio.Task[None]] = set()

    async def listen(self, host: str, port: int) -> None:
        """Starts to listen; port 0 lets the kernel choose.

        Raises:
            BadInput: the address is not available.
        """
        loop = asyncio.get_running_loop()
        try:
            self._server = await loop.create_server(
                lambda: _Client(self), host, port, backlog=WAITING
            )
        except OSError as error:
            raise BadInput(
                f"live.foxglove_port: {host}:{port}: {error.strerror or error}; choose another, "
                "or 0 for none"
            ) from None
        self.port = self._server.sockets[0].getsockname()[1]

    def close(self) -> None:
        """Stops listening and disconnects all clients."""
        if self._server is not None:
            self._server.close()
        for client in tuple(self._clients):
            client.hang_up()

    def admits(self, client: "_Client") -> bool:
        """Whether there is room for one more client, which is then connected."""
        if len(self._clients) >= MAX_CONNECTIONS:
            return False
        self._clients.add(client)
        task = asyncio.get_running_loop().create_task(self._connect(client))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return True

    def forget(self, client: "_Client") -> None:
        """Removes a client that has disconnected."""
        self._clients.discard(client)

    async def _connect(self, client: "_Client") -> None:
        loop = asyncio.get_running_loop()
        try:
            await loop.create_connection(lambda: _Behind(client), BEHIND, self._port_behind)
        except OSError:
            self.is_alone = True
            client.hang_up()


class _Leg(asyncio.Protocol):
    """One of two connections; data received on it are sent on the other."""

    transport: asyncio.Transport  # of this connection
    other: "_Leg | None" = None  # the other connection, once it exists

    def data_received(self, data: bytes) -> None:
        if self.other is not None:
            self.other.transport.write(data)

    def pause_writing(self) -> None:
        if self.other is not None:
            self.other.transport.pause_reading()

    def resume_writing(self) -> None:
        if self.other is not None:
            self.other.transport.resume_reading()

    def connection_lost(self, _: Exception | None) -> None:
        if self.other is not None:
            self.other.hang_up()

    def hang_up(self) -> None:
        """Closes this connection and the other."""
        self.transport.abort()


class _Client(_Leg):
    """The connection of a client."""

    def __init__(self, guard: Guard) -> None:
        self._guard = guard
        self._said = 0
        self._timer: asyncio.TimerHandle | None = None
        self._is_answered = False

    def connect(self, behind: "_Leg") -> None:
        """The connection behind is open."""
        self.other = behind
        self.transport.resume_reading()

    def answered(self) -> None:
        """The server has answered it."""
        self._is_answered = True

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast(asyncio.Transport, transport)
        if not self._guard.admits(self):
            self.hang_up()
            return
        self.transport.pause_reading()  # until the connection behind is open
        self._look_in(PATIENCE_S)

    def data_received(self, data: bytes) -> None:
        self._said += len(data)
        if self._said > MAX_SAID_BYTES:
            self.hang_up()
        else:
            super().data_received(data)

    def connection_lost(self, error: Exception | None) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._guard.forget(self)
        super().connection_lost(error)

    def _look(self) -> None:
        if not self._is_answered:
            self.hang_up()
            return
        self._said = 0
        self._look_in(SAID_WITHIN_S)

    def _look_in(self, seconds: float) -> None:
        self._timer = asyncio.get_running_loop().call_later(seconds, self._look)


class _Behind(_Leg):
    """The connection to the server on behalf of a client."""

    def __init__(self, client: _Client) -> None:
        self._client = client

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport = cast(asyncio.Transport, transport)
        if self._client.transport.is_closing():
            self.hang_up()
            return
        self.other = self._client
        self._client.connect(self)

    def data_received(self, data: bytes) -> None:
        self._client.answered()
        super().data_received(data)
