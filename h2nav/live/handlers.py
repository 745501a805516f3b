"""What the answers of the page's server share: their headers, their limits, their sources."""

import asyncio
import ipaddress
from datetime import timedelta
from typing import Any, NamedTuple, cast

from tornado.gen import with_timeout
from tornado.http1connection import HTTP1Connection
from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, RequestHandler

from h2nav.live.broadcast import Broadcast
from h2nav.live.flights_site import FlightsSite
from h2nav.live.state import LiveState

# Time for a request to arrive, and for an answer to be read.
PATIENCE_S = 15.0
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'"
)


class Shared(NamedTuple):
    """What the handlers share."""

    state: LiveState | None  # of the daemon; None without a vehicle
    broadcast: Broadcast | None  # of its events
    flights: FlightsSite | None  # the record of flights; None if none is kept
    assets: dict[str, bytes]  # the files of the pages by name
    home: str  # name of the page at the root
    is_private: bool  # the port is reachable from this computer only


class PageHandler(RequestHandler):
    """Headers and limits of every answer."""

    def initialize(self, shared: Shared) -> None:
        """Takes what the handlers share."""
        self.shared = shared

    def set_default_headers(self) -> None:
        """Sets the headers of every answer."""
        self.clear_header("Server")
        self.set_header("Content-Security-Policy", POLICY)
        self.set_header("X-Content-Type-Options", "nosniff")
        self.set_header("Referrer-Policy", "no-referrer")
        self.set_header("Cross-Origin-Resource-Policy", "same-origin")
        self.set_header("Cache-Control", "no-cache")

    def prepare(self) -> None:
        """Refuses a request that another site made."""
        # A foreign web page may resolve its own name to this address; the Host header shows it.
        if self.shared.is_private and not is_loopback(self.request.host_name):
            raise HTTPError(403)

    def log_exception(self, kind: Any, error: Any, trace: Any) -> None:
        """Leaves out what clients do wrong, which they could flood a terminal with."""
        if not isinstance(error, HTTPError):
            super().log_exception(kind, error, trace)

    def write_error(self, status_code: int, **_: Any) -> None:
        """Answers in one line."""
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


def is_loopback(host: str) -> bool:
    """Whether a host is this computer."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False
