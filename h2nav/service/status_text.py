"""STATUSTEXT with manners: 50 characters, no repetition, at most one a second."""

from collections import deque
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service.effects import Severity

LIMIT = 50
PAUSE_NS = 1_000_000_000
REPEAT_NS = 30_000_000_000
WAITING = 8
PREFIX = "h2nav: "


class StatusText:
    """Holds texts back until they may be sent; drops the oldest when too many wait."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Severity, str]] = deque(maxlen=WAITING)
        self._sent_ns: int | None = None
        self._last_said_ns: dict[str, int] = {}

    def say(self, t_ns: int, severity: Severity, text: str) -> None:
        """Queues a text, unless the same one was queued shortly before."""
        last_ns = self._last_said_ns.get(text)
        if last_ns is not None and t_ns - last_ns < REPEAT_NS:
            return
        self._last_said_ns = {
            said: ns for said, ns in self._last_said_ns.items() if t_ns - ns < REPEAT_NS
        }
        self._last_said_ns[text] = t_ns
        self._waiting.append((severity, text))

    def due(self, t_ns: int) -> Any | None:
        """The next STATUSTEXT, if one may be sent now."""
        if not self._waiting:
            return None
        if self._sent_ns is not None and t_ns - self._sent_ns < PAUSE_NS:
            return None
        self._sent_ns = t_ns
        severity, text = self._waiting.popleft()
        return mavlink.MAVLink_statustext_message(int(severity), (PREFIX + text)[:LIMIT].encode())
