"""The flights of a folder for the page's server: the list, brought up to date while it answers."""

import asyncio
import contextlib
import time
from typing import Any, NamedTuple

from h2nav.flights.folder import FlightFolder
from h2nav.flights.index import FlightIndex, Question

# How old the list may be; looking at the folder costs a call per file.
LOOK_S = 2.0


class SiteRights(NamedTuple):
    """What clients may change."""

    token: str = ""  # that they have to name; empty = nothing may be changed
    upload_bytes: int = 0  # the largest upload; 0 = none


READ_ONLY = SiteRights()


class FlightsSite:
    """The flights of a folder, on the running event loop.

    Args:
        folder: that is shown.
        rights: to change it.
    """

    def __init__(self, folder: FlightFolder, rights: SiteRights = READ_ONLY) -> None:
        self.folder = folder
        self.rights = rights
        self.changed = asyncio.Event()  # set when a client has changed the folder
        self.is_uploading = False  # one at a time
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

    async def has_changed(self) -> None:
        """Makes the next answer hold what a client has changed in the folder."""
        self.changed.set()
        await self._look()

    def begin_upload(self) -> None:
        """Lets no other upload begin."""
        self.is_uploading = True

    def end_upload(self) -> None:
        """Lets the next upload begin."""
        self.is_uploading = False

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
