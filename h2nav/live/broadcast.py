"""The stream that the page lives on, as Server-Sent Events, made once for all who look at it."""

from typing import Any

import orjson
from tornado.ioloop import PeriodicCallback
from tornado.locks import Condition

from h2nav.live import messages
from h2nav.live.state import LiveState

PERIOD_MS = 100
# So many attitudes are sent for each overview.
ATTITUDES_PER_OVERVIEW = 5


class Broadcast:
    """What all viewers are sent is made once, and not at all where there are none.

    Args:
        state: what is told.

    Attributes:
        viewers: how many there are.
        moment: the newest attitudes, as an event of the stream.
        overview: the newest overview, likewise.
        number: of that overview.
    """

    def __init__(self, state: LiveState) -> None:
        self._state = state
        self._condition = Condition()
        self._clock = PeriodicCallback(self._tick, PERIOD_MS)
        self._ticks = 0
        self.viewers = 0
        self.moment = self.overview = b""
        self.number = 0

    def start(self) -> None:
        """Begins, on the running event loop."""
        self._clock.start()

    def stop(self) -> None:
        """Makes nothing any more."""
        self._clock.stop()

    async def next(self) -> None:
        """Waits until there is something new."""
        await self._condition.wait()

    def renew(self) -> None:
        """Makes an overview now."""
        self.number += 1
        self.overview = _event("overview", messages.overview(self._state))

    def _tick(self) -> None:
        if not self.viewers:
            return
        self.moment = _event("attitudes", messages.attitudes(self._state))
        self._ticks += 1
        if self._ticks % ATTITUDES_PER_OVERVIEW == 0:
            self.renew()
        self._condition.notify_all()


def _event(name: str, content: dict[str, Any]) -> bytes:
    return b"event: %s\ndata: %s\n\n" % (name.encode(), orjson.dumps(content))
