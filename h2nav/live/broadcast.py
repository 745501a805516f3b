"""The page's stream of Server-Sent Events, encoded once for all viewers."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import orjson
from tornado.ioloop import PeriodicCallback
from tornado.locks import Condition

from h2nav.live import messages
from h2nav.live.state import LiveState

PERIOD_MS = 100
# Number of attitudes per overview.
ATTITUDES_PER_OVERVIEW = 5


class Broadcast:
    """Encodes each event once for all viewers, and none while there are no viewers.

    Attributes:
        viewers: their number.
        events: the newest of each name, as sent.
    """

    def __init__(self, state: LiveState) -> None:
        self._state = state
        self._condition = Condition()
        self._clock = PeriodicCallback(self._tick, PERIOD_MS)
        self._ticks = 0
        self._reported: tuple[object, ...] = ()
        self.viewers = 0
        self.events: dict[str, bytes] = {}

    @contextmanager
    def viewer(self) -> Iterator[None]:
        """Counts one more viewer, and shows it everything."""
        self.viewers += 1
        try:
            self.renew()
            yield
        finally:
            self.viewers -= 1

    def start(self) -> None:
        """Starts on the running event loop."""
        self._clock.start()

    def stop(self) -> None:
        """Stops."""
        self._clock.stop()

    async def next(self) -> None:
        """Waits for the next event."""
        await self._condition.wait()

    def renew(self) -> None:
        """Encodes every event anew, for a new viewer."""
        self._reported = ()
        self._overview()
        self._attitudes()

    def _tick(self) -> None:
        if not self.viewers:
            return
        self._ticks += 1
        if self._ticks % ATTITUDES_PER_OVERVIEW == 0:
            self._overview()
        self._attitudes()
        self._condition.notify_all()

    def _attitudes(self) -> None:
        self.events["attitudes"] = _event("attitudes", messages.attitudes(self._state))

    def _overview(self) -> None:
        reports = (self._state.findings, self._state.texts)
        if reports != self._reported:  # long, and rarely new
            self._reported = reports
            self.events["told"] = _event("told", messages.reports(self._state))
        self.events["overview"] = _event("overview", messages.overview(self._state))


def _event(name: str, content: dict[str, Any]) -> bytes:
    return b"event: %s\ndata: %s\n\n" % (name.encode(), orjson.dumps(content))
