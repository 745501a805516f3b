"""The page and its metrics over HTTP; read-only."""

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application

from h2nav.live.state import LiveState


class PageServer:
    """Serves what a state holds, on the running event loop.

    Args:
        state: what is shown.
        host: address to listen on.
        port: to listen on; 0 = one that the kernel chooses.

    Attributes:
        port: where it listens.

    Raises:
        OSError: the address cannot be listened on.
    """

    def __init__(self, state: LiveState, host: str, port: int) -> None:
        self._state = state
        self._server = HTTPServer(Application())
        sockets = bind_sockets(port, host)
        self._server.add_sockets(sockets)
        self.port: int = sockets[0].getsockname()[1]

    def close(self) -> None:
        """Listens no more."""
        self._server.stop()
