"""The record of flights over HTTP: the list, the reviews, the recordings.

What is served is found in the index by a flight's id; no address becomes a path.
"""

import asyncio
import contextlib
import hmac
import os
import secrets
import shutil
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, cast
from urllib.parse import quote

import orjson
from tornado.http1connection import HTTP1Connection
from tornado.iostream import StreamClosedError
from tornado.web import HTTPError, stream_request_body

from h2nav.errors import BadInput
from h2nav.files.path_text import readable
from h2nav.files.whole_file import sync_folder
from h2nav.flights.folder import UPLOADS, FlightFiles, flight_id
from h2nav.flights.index import Question
from h2nav.flights.uploads import EXPECTED, PROBE_BYTES, free_path, kind_of, safe_name
from h2nav.live.flights_site import FlightsSite
from h2nav.live.handlers import PageHandler
from h2nav.log.folder import MIB

FLIGHT = r"/flights/([A-Za-z0-9._-]{1,120})"
# Pages and recordings are large, and nothing in them becomes stale.
SEND_BUFFER_BYTES = 256 * 1024
BLOCK_BYTES = 64 * 1024
# Time for an upload, and space on the disk that it leaves.
UPLOAD_S = 1800.0
MIN_FREE_BYTES = 256 * MIB
# A review is a document of its own: its scripts are in it, and it can ask this server for nothing.
REVIEW_POLICY = (
    "sandbox allow-scripts allow-downloads allow-popups; default-src 'none'; "
    "script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
)


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

    @property
    def is_unlocked(self) -> bool:
        """Whether the client has named the token, and no other site has sent it."""
        token = self.site.rights.token
        named = self.request.headers.get("Authorization", "")
        if not token or not hmac.compare_digest(named.encode(), f"Bearer {token}".encode()):
            return False
        origin = self.request.headers.get("Origin")
        return origin is None or origin.rpartition("/")[2] == self.request.host

    def need_token(self) -> None:
        """Refuses clients that may change nothing."""
        if not self.site.rights.token:
            raise HTTPError(403, reason="read-only: no token is configured")
        if not self.is_unlocked:
            raise HTTPError(403, reason="the token is missing or wrong")

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
        rights = self.site.rights
        found["may_be_changed"] = bool(rights.token)
        found["is_unlocked"] = self.is_unlocked
        found["upload_bytes"] = rights.upload_bytes
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

    async def delete(self, flight: str) -> None:
        """Deletes the flight: recordings and review."""
        self.need_token()
        await self.row(flight)
        folder = self.site.folder
        with _disk_errors():
            found = (await asyncio.to_thread(folder.flights)).get(flight, FlightFiles(flight, ()))
            await asyncio.to_thread(folder.delete, found)
        await self.site.has_changed()
        self.set_status(204)


class FlightAgain(_OfFlights):
    """Has a flight reviewed again."""

    async def post(self, flight: str) -> None:
        """Removes its review."""
        self.need_token()
        await self.row(flight)
        with _disk_errors():
            await asyncio.to_thread(self.site.folder.forget_review, flight)
        await self.site.has_changed()
        self.set_status(204)


@stream_request_body
class FlightUpload(_OfFlights):
    """Takes a recording as the body of a request, one at a time."""

    _stream: BinaryIO | None = None
    _part: Path | None = None
    _left = 0

    def prepare(self) -> None:
        """Refuses what cannot be taken before it comes, and makes room for the rest."""
        super().prepare()
        self.need_token()
        site, most = self.site, self.site.rights.upload_bytes
        length = self.request.headers.get("Content-Length", "")
        if not length.isdecimal():
            raise HTTPError(411)
        self._left = int(length)
        if self._left > most:
            raise HTTPError(413, reason=f"larger than {most // MIB} MiB")
        if site.is_uploading:
            raise HTTPError(503, reason="another upload is not finished")
        folder = site.folder.root / UPLOADS
        with _disk_errors():
            folder.mkdir(parents=True, exist_ok=True)
            if shutil.disk_usage(folder).free - self._left < MIN_FREE_BYTES:
                raise HTTPError(507, reason="no room on the disk")
            for part in folder.glob(".*.part"):  # of a server that was killed
                if time.time() - part.stat().st_mtime > UPLOAD_S:
                    part.unlink(missing_ok=True)
            self._part = folder / f".{secrets.token_hex(8)}.part"
            self._stream = self._part.open("xb")
        site.begin_upload()
        connection = cast(HTTP1Connection, self.request.connection)
        connection.set_max_body_size(most)
        connection.set_body_timeout(UPLOAD_S)

    def data_received(self, chunk: bytes) -> None:
        """Writes a part of it."""
        if self._stream is None:
            raise HTTPError(400)
        with _disk_errors(507):
            self._stream.write(chunk)
        self._left -= len(chunk)

    async def post(self) -> None:
        """Gives it its name, if it is a recording."""
        if self._stream is None or self._part is None or self._left:
            raise HTTPError(400)
        with _disk_errors(507):
            with self._stream as stream:
                stream.flush()
                await asyncio.to_thread(os.fsync, stream.fileno())
            with self._part.open("rb") as stream:
                kind = kind_of(stream.read(PROBE_BYTES))
            if not kind:
                raise HTTPError(415, reason=f"not a recording; {EXPECTED}")
            name = safe_name(self.get_query_argument("name", ""), kind)
            path = free_path(self._part.parent, name)
            self._part.rename(path)
            sync_folder(path.parent)
        self._part = None
        await self.site.has_changed()
        said = {"id": flight_id(f"{UPLOADS}/{path.name}"), "name": path.name}
        self.set_status(201)
        self.set_header("Content-Type", "application/json")
        self.finish(orjson.dumps(said))

    def on_finish(self) -> None:
        """Cleans up."""
        self._clean_up()

    def on_connection_close(self) -> None:
        """Cleans up after a client that is gone."""
        self._clean_up()

    def _clean_up(self) -> None:
        if self._stream is None:
            return
        self._stream.close()
        self._stream = None
        if self._part is not None:
            self._part.unlink(missing_ok=True)
        self.site.end_upload()


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
        self.as_download(readable(path.name), "application/octet-stream")
        await self.send_file(path)


ROUTES: tuple[tuple[str, type[PageHandler]], ...] = (
    (r"/flights\.json", FlightList),
    (f"/flights/{UPLOADS}", FlightUpload),
    (FLIGHT, FlightReview),
    (FLIGHT + "/again", FlightAgain),
    (FLIGHT + r"/review\.json", FlightDocument),
    (FLIGHT + r"/files/([0-9]{1,2})", FlightRecording),
)


@contextlib.contextmanager
def _disk_errors(status: int = 500) -> Iterator[None]:
    """Answers what the disk refuses."""
    try:
        yield
    except OSError as error:
        raise HTTPError(status, reason=_printable(error.strerror or str(error))) from None


def _printable(text: str) -> str:
    return "".join(sign if " " <= sign <= "~" else "?" for sign in text)[:200]
