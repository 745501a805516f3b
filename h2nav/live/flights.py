"""The record of flights over HTTP: the list, the reviews, the recordings.

What is served is found in the index by a flight's id; no address becomes a path.
"""

import asyncio
import contextlib
import os
import socket
import time
from pathlib import Path
from typing import Any, cast
from urllib.parse import quote

import orjson
from tornado.http1connection import HTTP1Connection
from tornado.iostream import StreamClosedError
from tornado.web import HTTPError

from h2nav.errors import BadInput
from h2nav.flights.folder import FlightFolder
from h2nav.flights.index import FlightIndex, Question
from h2nav.live.handlers import PageHandler

# How old the list may be; looking at the folder costs a call per file.
LOOK_S = 2.0
FLIGHT = r"/flights/([A-Za-z0-9._-]{1,120})"
# Pages and recordings are large, and nothing in them becomes stale.
SEND_BUFFER_BYTES = 256 * 1024
BLOCK_BYTES = 64 * 1024
# A review is a document of its own: its scripts are in it, and it can ask this server for nothing.
REVIEW_POLICY = (
    "sandbox allow-scripts allow-downloads allow-popups; default-src 'none'; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


class FlightsSite:
    """The flights of a folder, on the running event loop.

    Args:
        folder: that is shown.
    """

    def __init__(self, folder: FlightFolder) -> None:
        self.folder = folder
        self._index: FlightIndex | None = None
        self._lock = asyncio.Lock()
        self._looked_s: float | None = None
        self._looking: asyncio.Task[None] | None = None

    async def page(self, asked: Question) -> dict[str, Any]:
        """The rows of the list; see `FlightIndex.page`."""
        index = await self._fresh()
        async with self._lock:
            return await asyncio.to_thread(index.page, asked)

    async def flight(self, flight: str) -> dict[str, Any] | None:
        """The row of a flight; None if there is none of this id."""
        index = await self._fresh()
        async with self._lock:
            return await asyncio.to_thread(index.flight, flight)

    async def look_again(self) -> None:
        """Makes the next answer hold what has changed in the folder."""
        await self._look()

    def close(self) -> None:
        """Closes the index."""
        if self._looking is not None:
            self._looking.cancel()
        if self._index is not None:
            self._index.close()

    async def _fresh(self) -> FlightIndex:
        """The index; an older one is brought up to date while it answers."""
        if self._index is None:
            await self._look()
        elif self._is_old and (self._looking is None or self._looking.done()):
            self._looking = asyncio.get_running_loop().create_task(self._look())
        assert self._index is not None
        return self._index

    @property
    def _is_old(self) -> bool:
        return self._looked_s is not None and time.monotonic() - self._looked_s > LOOK_S

    async def _look(self) -> None:
        if self._index is None:
            async with self._lock:
                if self._index is None:
                    self._index = await asyncio.to_thread(FlightIndex, self.folder)
        index = self._index
        with contextlib.suppress(OSError):  # the folder comes with the first log
            found = await asyncio.to_thread(index.look)
            async with self._lock:
                await asyncio.to_thread(index.take, found)
        self._looked_s = time.monotonic()


class _OfFlights(PageHandler):
    """What the handlers share."""

    @property
    def site(self) -> FlightsSite:
        """The flights; 404 where none are kept."""
        if self.shared.flights is None:
            raise HTTPError(404)
        return self.shared.flights

    async def row(self, flight: str) -> dict[str, Any]:
        """The row of a flight; 404 if there is none."""
        found = await self.site.flight(flight)
        if found is None:
            raise HTTPError(404)
        return found

    async def send_file(self, path: Path) -> None:
        """Sends a file in blocks, no faster than it is read."""
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except OSError:
            raise HTTPError(404) from None
        with open(descriptor, "rb") as stream:
            left = os.fstat(stream.fileno()).st_size
            self.set_header("Content-Length", left)
            connection = cast(HTTP1Connection, self.request.connection).stream
            with contextlib.suppress(OSError, AttributeError):
                connection.socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
            with contextlib.suppress(StreamClosedError):
                while left and (block := stream.read(min(BLOCK_BYTES, left))):
                    left -= len(block)
                    self.write(block)
                    await self.sent(self.flush())
                if left:  # it has become shorter: no whole answer is pretended
                    connection.close()
                    return
                await self.sent(self.finish())

    def as_download(self, name: str, kind: str) -> None:
        """Declares a file that is saved under its name."""
        self.set_header("Content-Type", kind)
        self.set_header("Content-Disposition", f"attachment; filename*=UTF-8''{quote(name)}")


class FlightList(_OfFlights):
    """Rows of the list as JSON."""

    async def get(self) -> None:
        """Answers."""
        asked = Question(
            sort=self._word("sort") or "date",
            descending=self._word("order") != "up",
            search=self._word("search"),
            kind=self._word("kind"),
            severity=self._word("severity"),
            state=self._word("state"),
            offset=self._number("offset", 0),
            limit=self._number("limit", 100),
        )
        found = await self.site.page(asked)
        found["has_live_page"] = self.shared.state is not None
        self.set_header("Content-Type", "application/json")
        with contextlib.suppress(StreamClosedError):
            await self.sent(self.finish(orjson.dumps(found)))

    def _word(self, name: str) -> str:
        return self.get_query_argument(name, "")

    def _number(self, name: str, default: int) -> int:
        text = self.get_query_argument(name, "")
        return int(text) if text.isdecimal() and len(text) < 9 else default


class FlightReview(_OfFlights):
    """The page of one review."""

    async def get(self, flight: str) -> None:
        """Answers."""
        row = await self.row(flight)
        if not row["page"]:
            raise HTTPError(404, reason=_printable(row["error"]) or "not reviewed yet")
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.set_header("Content-Security-Policy", REVIEW_POLICY)
        await self.send_file(self.site.folder.reviews / row["page"])


class FlightDocument(_OfFlights):
    """The JSON document of one review."""

    async def get(self, flight: str) -> None:
        """Answers."""
        row = await self.row(flight)
        if not row["document"]:
            raise HTTPError(404)
        self.as_download(f"{flight}.json", "application/json")
        await self.send_file(self.site.folder.reviews / row["document"])


class FlightRecording(_OfFlights):
    """One recording of a flight, by its place in the row's `files`."""

    async def get(self, flight: str, number: str) -> None:
        """Answers."""
        await self.row(flight)
        found = (await asyncio.to_thread(self.site.folder.flights)).get(flight)
        if found is None or int(number) >= len(found.recordings):
            raise HTTPError(404)
        name = found.recordings[int(number)].name
        try:
            path = self.site.folder.path_of(name)
        except BadInput:
            raise HTTPError(404) from None
        readable = path.name.encode(errors="surrogateescape").decode(errors="replace")
        self.as_download(readable, "application/octet-stream")
        await self.send_file(path)


ROUTES: tuple[tuple[str, type[PageHandler]], ...] = (
    (r"/flights\.json", FlightList),
    (FLIGHT, FlightReview),
    (FLIGHT + r"/review\.json", FlightDocument),
    (FLIGHT + r"/files/([0-9]{1,2})", FlightRecording),
)


def _printable(text: str) -> str:
    return "".join(sign if " " <= sign <= "~" else "?" for sign in text)[:200]
