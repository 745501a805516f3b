"""Serves the page, the metrics and the flights over HTTP to every client that reaches the port.

Everything is limited: connections, viewers, the size of a request, the time for its arrival and for
reading its answer. A viewer that reads slowly receives less, never late.
"""

import contextlib
import socket
from importlib import resources
from pathlib import Path
from typing import Any

from prometheus_client import CONTENT_TYPE_LATEST
from tornado.httpserver import HTTPServer
from tornado.iostream import IOStream, StreamClosedError
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError

from h2nav import __version__
from h2nav.live import flights as flight_pages
from h2nav.live.broadcast import Broadcast
from h2nav.live.flights_site import FlightsSite
from h2nav.live.handlers import PATIENCE_S, PageHandler, Shared, is_loopback
from h2nav.live.metrics import metrics_text
from h2nav.live.state import LiveState

MAX_CONNECTIONS = 64
MAX_VIEWERS = 16
MAX_HEADER_BYTES = 8192
MAX_BODY_BYTES = 1024
# Events queued for a slow viewer become stale: the queue is short.
SEND_BUFFER_BYTES = 4096
WAITING = 32
AGAIN_MS = 1000
REGISTRATION = {
    "name": "h2nav",
    "description": "Independent attitude beside the autopilot's, and what is wrong with either",
    "icon": "mdi-airplane",
    "company": "h2nav",
    "version": __version__,
    "webpage": "",
    "api": "",
}
PAGE, FLIGHTS_PAGE = "page.html", "flights.html"
KINDS = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
}


class PageServer:
    """Serves on the running event loop.

    Args:
        state: of the daemon; None without one.
        port: to listen on; 0 = chosen by the kernel.
        flights: the record of flights; the only page where there is no state.

    Raises:
        OSError: the address is not available.
    """

    def __init__(
        self, state: LiveState | None, host: str, port: int, flights: FlightsSite | None = None
    ) -> None:
        sockets = bind_sockets(port, host, backlog=WAITING)
        for each in sockets:
            each.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
        self.port: int = sockets[0].getsockname()[1]  # the listening port
        self._broadcast = None if state is None else Broadcast(state)
        is_private = all(is_loopback(each.getsockname()[0]) for each in sockets)
        home = PAGE if state is not None else FLIGHTS_PAGE
        shared = {"shared": Shared(state, self._broadcast, flights, _assets(), home, is_private)}
        application = Application(
            [
                ("/events", _Events, shared),
                ("/metrics", _Metrics, shared),
                ("/register_service", _Registration, shared),
                *((path, handler, shared) for path, handler in flight_pages.ROUTES),
                ("/(.*)", _Asset, shared),
            ],
            log_function=lambda handler: None,  # a line per request would be a flood
        )
        self._server = _LimitedServer(
            application,
            max_header_size=MAX_HEADER_BYTES,
            max_body_size=MAX_BODY_BYTES,
            max_buffer_size=MAX_HEADER_BYTES + MAX_BODY_BYTES,
            chunk_size=MAX_HEADER_BYTES,
            idle_connection_timeout=PATIENCE_S,
            body_timeout=PATIENCE_S,
        )
        self._server.add_sockets(sockets)
        if self._broadcast is not None:
            self._broadcast.start()

    def close(self) -> None:
        """Stops listening and disconnects all clients."""
        if self._broadcast is not None:
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
        if len(self._streams) >= MAX_CONNECTIONS:
            stream.close()
            return
        self._streams.add(stream)
        super().handle_stream(stream, address)

    def hang_up(self) -> None:
        for stream in self._streams:
            stream.close()


class _Asset(PageHandler):
    """The page and its files."""

    async def get(self, name: str) -> None:
        name = {"": self.shared.home, "flights": FLIGHTS_PAGE}.get(name, name)
        content = self.shared.assets.get(name)
        if content is None:
            raise HTTPError(404)
        self.set_header("Content-Type", KINDS[Path(name).suffix])
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(content))

    head = get


class _Metrics(PageHandler):
    """The Prometheus endpoint."""

    async def get(self) -> None:
        state, broadcast = self.shared.state, self.shared.broadcast
        if state is None or broadcast is None:
            raise HTTPError(404)
        self.set_header("Content-Type", CONTENT_TYPE_LATEST)
        text = metrics_text(state, broadcast.viewers)
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(text))


class _Registration(PageHandler):
    """The document that BlueOS requests from every port, to list the page among its services."""

    async def get(self) -> None:
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(REGISTRATION))


class _Events(PageHandler):
    """The page's stream: Server-Sent Events, which are one-way."""

    async def get(self) -> None:
        broadcast = self.shared.broadcast
        if broadcast is None:
            raise HTTPError(404)
        if broadcast.viewers >= MAX_VIEWERS:
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
