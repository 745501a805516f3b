"""The viewer's process: passes the daemon's feed to the page and to Foxglove."""

import asyncio
import contextlib
import resource
import signal
import socket
import traceback
from pathlib import Path

from h2nav.errors import BadInput
from h2nav.flights.folder import FlightFolder
from h2nav.host.yielding import yield_to_others
from h2nav.links.live_feed import FeedLine, FeedReader, Greeting, Word
from h2nav.live.flights_site import FlightsSite, SiteRights
from h2nav.live.foxglove_server import FoxgloveServer
from h2nav.live.server import PageServer
from h2nav.live.state import LiveState

NICER = 10  # than the daemon
# Clients can make the servers hold connections and frames; only this process may suffer from it.
MAX_FILES = 512
MAX_MEMORY_BYTES = 256 * 1024 * 1024


def view(end: socket.socket) -> int:
    """Runs until the daemon closes its end.

    Args:
        end: the viewer's of `h2nav.links.live_feed.feed_sockets`.

    Returns:
        The exit status: 0 at the daemon's end, 1 for an error, which was reported to the daemon.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the daemon handles it, then closes its end
    yield_to_others(
        NICER, {resource.RLIMIT_NOFILE: MAX_FILES, resource.RLIMIT_DATA: MAX_MEMORY_BYTES}
    )
    feed = FeedReader(end)
    try:
        asyncio.run(_show(feed, feed.greeting()))
    except ConnectionError:
        return 0
    except BadInput as error:
        feed.say(Word(trouble=str(error)))
    except Exception as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        feed.say(Word(trouble=f"{type(error).__name__}: {error} at {where}"))
    return 1


async def _show(feed: FeedReader, greeting: Greeting) -> None:
    """Serves until the feed ends, which raises ConnectionError."""
    state = LiveState()
    host, port, foxglove_port, configuration, flights_folder, token, upload_bytes = greeting
    with contextlib.ExitStack() as servers:
        flights: FlightsSite | None = None
        if flights_folder:
            flights = FlightsSite(
                FlightFolder(Path(flights_folder)), SiteRights(token, upload_bytes)
            )
            servers.callback(flights.close)
        page = servers.enter_context(contextlib.closing(_listening(state, host, port, flights)))
        foxglove: FoxgloveServer | None = None
        if foxglove_port:
            foxglove = FoxgloveServer(configuration)
            servers.callback(foxglove.close)
            await foxglove.listen(host, foxglove_port)
        feed.say(Word(page.port))
        await _pass_on(feed, state, foxglove, page.port)


def _listening(state: LiveState, host: str, port: int, flights: FlightsSite | None) -> PageServer:
    try:
        return PageServer(state, host, port, flights)
    except OSError as error:
        reason = error.strerror or str(error)
        raise BadInput(f"live.address: {host}:{port}: {reason}; choose another") from None


async def _pass_on(
    feed: FeedReader, state: LiveState, foxglove: FoxgloveServer | None, port: int
) -> None:
    """Passes the feed to the servers, and tells the daemon which records they need."""
    arrived = asyncio.Event()
    asyncio.get_running_loop().add_reader(feed.fileno(), arrived.set)
    wants_all = False
    while True:
        await arrived.wait()
        arrived.clear()
        for topic, unix_ns, _, record in feed.entries():
            if isinstance(record, FeedLine):
                state.text(unix_ns, record.severity, record.text)
            else:
                state.take(topic, unix_ns, record)
            if foxglove is not None:
                foxglove.show(topic, unix_ns, record)
        if foxglove is not None and foxglove.wants_all != wants_all:
            wants_all = not wants_all
            feed.say(Word(port, wants_all))
