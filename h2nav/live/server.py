"""Serves the page and the metrics over HTTP, read-only, to every client that reaches the port.

Everything is limited: connections, viewers, the size of a request, the time for its arrival and for
reading its answer. A viewer that reads slowly receives less, never late.
"""

import asyncio
import contextlib
import ipaddress
import socket
from datetime import timedelta
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple, cast

from prometheus_client import CONTENT_TYPE_LATEST
from tornado.gen import with_timeout
from tornado.http1connection import HTTP1Connection
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream, StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler

from h2nav import __version__
from h2nav.live.broadcast import Broadcast
from h2nav.live.metrics import metrics_text
from h2nav.live.state import LiveState

MOST_CONNECTIONS = 64
MOST_VIEWERS = 16
MOST_HEADER_BYTES = 8192
MOST_BODY_BYTES = 1024
# Time for a request to arrive, and for an answer to be read.
PATIENCE_S = 15.0
# Events queued for a slow viewer become stale: the queue is short.
SEND_BUFFER_BYTES = 4096
WAITING = 32
AGAIN_MS = 1000
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'"
)
REGISTRATION = {
    "name": "h2nav",
    "description": "Independent attitude beside the autopilot's, and what is wrong with either",
    "icon": "mdi-airplane",
    "company": "h2nav",
    "version": __version__,
    "webpage": "",
    "api": "",
}
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


class PageServer:
    """Serves a state on the running event loop.

    Args:
        port: to listen on; 0 = chosen by the kernel.

    Raises:
        OSError: the address is not available.
    """

    def __init__(self, state: LiveState, host: str, port: int) -> None:
        sockets = bind_sockets(port, host, backlog=WAITING)
        for each in sockets:
            each.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self.port: int = sockets[0].getsockname()[1]  # the listening port
        self._broadcast = Broadcast(state)
        is_private = all(_is_loopback(each.getsockname()[0]) for each in sockets)
        shared = {"shared": _Shared(state, self._broadcast, _assets(), is_private)}
        application = Application(
            [
                ("/events", _Events, shared),
                ("/metrics", _Metrics, shared),
                ("/register_service", _Registration, shared),
                ("/(.*)", _Asset, shared),
            ],
            log_function=lambda handler: None,  # a line per request would be a flood
        )
        self._server = _LimitedServer(
            application,
            max_header_size=MOST_HEADER_BYTES,
            max_body_size=MOST_BODY_BYTES,
            max_buffer_size=MOST_HEADER_BYTES + MOST_BODY_BYTES,
            chunk_size=MOST_HEADER_BYTES,
            idle_connection_timeout=PATIENCE_S,
            body_timeout=PATIENCE_S,
        )
        self._server.add_sockets(sockets)
        self._broadcast.start()

    def close(self) -> None:
        """Stops listening and disconnects all clients."""
        self._broadcast.stop()
        self._server.stop()
        self._server.hang_up()


class _LimitedServer(HTTPServer):
    """Closes connections beyond the limit."""

    def initialize(self, *args: Any, **settings: Any) -> None:
        super().initialize(*args, **settings)
        self._streams: set[IOStream] = set()

    def handle_stream(self, stream: IOStream, address: tuple[Any, ...]) -> None:
        self._streams = {each for each in self._streams if not each.closed()}
        if len(self._streams) >= MOST_CONNECTIONS:
            stream.close()
            return
        self._streams.add(stream)
        super().handle_stream(stream, address)

    def hang_up(self) -> None:
        for stream in self._streams:
            stream.close()


class _Shared(NamedTuple):
    """What the handlers share."""

    state: LiveState  # the source
    broadcast: Broadcast  # of its events
    assets: dict[str, bytes]  # the files of the page by name
    is_private: bool  # the port is reachable from this computer only


class _Handler(RequestHandler):
    """Headers and limits of every answer."""

    def initialize(self, shared: _Shared) -> None:
        self.shared = shared

    def set_default_headers(self) -> None:
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-cache")

    def prepare(self) -> None:
        # A foreign web page may resolve its own name to this address; the Host header shows it.
        if self.shared.is_private and not _is_loopback(self.request.host_name):
            raise HTTPError(403)

    def write_error(self, status_code: int, **_: Any) -> None:
        self.set_header("Content-Type", "text/plain; charset=utf-8")
        self.finish(f"{status_code} {self._reason}\n")

    async def sent(self, written: "asyncio.Future[None]") -> None:
        """Waits until an answer is read; closes the connection of a client that does not read."""
        try:
            await with_timeout(
                timedelta(seconds=PATIENCE_S), written, quiet_exceptions=StreamClosedError
            )
        except TimeoutError:
            cast(HTTP1Connection, self.request.connection).stream.close()
            raise StreamClosedError from None


class _Asset(_Handler):
    """The page and its files."""

    async def get(self, name: str) -> None:
        content = self.shared.assets.get(name or "page.html")
        if content is None:
            raise HTTPError(404)
        self.set_header("Content-Type", KINDS[Path(name or "page.html").suffix])
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(content))

    head = get


class _Metrics(_Handler):
    """The Prometheus endpoint."""

    async def get(self) -> None:
        self.set_header("Content-Type", CONTENT_TYPE_LATEST)
        text = metrics_text(self.shared.state, self.shared.broadcast.viewers)
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(text))


class _Registration(_Handler):
    """The document that BlueOS requests from every port, to list the page among its services."""

    async def get(self) -> None:
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(REGISTRATION))


class _Events(_Handler):
    """The page's stream: Server-Sent Events, which are one-way."""

    async def get(self) -> None:
        broadcast = self.shared.broadcast
        if broadcast.viewers >= MOST_VIEWERS:
            raise HTTPError(503)
        self.set_header("Content-Type", "text/event-stream")
        self.set_header("X-Accel-Buffering", "no")
        with contextlib.suppress(StreamClosedError), broadcast.viewer():
            await self._stream(broadcast)

    async def _stream(self, broadcast: Broadcast) -> None:
        self.write(f"retry: {AGAIN_MS}\n\n")
        seen: dict[str, bytes] = {}
        while True:
            for name, event in broadcast.events.items():
                if seen.get(name) is not event:
                    seen[name] = event
                    self.write(event)
            await self.sent(self.flush())
            await broadcast.next()


def _assets() -> dict[str, bytes]:
    """The files of the page by name."""
    folder = resources.files("h2nav.live").joinpath("assets")
    return {file.name: file.read_bytes() for file in folder.iterdir()}


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
