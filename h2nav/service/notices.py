"""Notices for people: one per cause and minute, a few STATUSTEXTs.

At most one text a second leaves as STATUSTEXT, in chunks where it is long, and the oldest are
dropped when too many wait.
"""

from collections import OrderedDict, deque
from collections.abc import Iterable
from typing import Protocol

from h2nav.integrity.findings import Severity
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Effect, Notice
from h2nav.service.limits import RateLimit
from h2nav.wire import outbound
from h2nav.wire.outbound import OutMessage

REPEAT_NS = 60 * SECOND_NS
MAX_CAUSES = 64
WAITING = 8
MAX_REMINDERS = 4
PAUSE_NS = SECOND_NS
LAST_TEXT_ID = 0xFFFF
PREFIX = "h2nav: "
# Bounded, however many causes there are.
NOTICES_PER_S = 0.3
NOTICES_AT_ONCE = 15


class Report(Protocol):
    """Reports notices, as `Notices.report` does."""

    def __call__(self, t_ns: int, severity: Severity, text: str, cause: str = "") -> list[Effect]:
        """See there."""


class Notices:
    """Reports each cause at most once a minute.

    Args:
        as_status_text: also send notices to the ground station.
    """

    def __init__(self, as_status_text: bool) -> None:
        self._as_status_text = as_status_text
        self._reported: OrderedDict[str, tuple[int, Severity]] = OrderedDict()
        self._limit = RateLimit(NOTICES_PER_S, NOTICES_AT_ONCE)
        self._waiting: deque[tuple[Severity, str]] = deque(maxlen=WAITING)
        self._sent_ns: int | None = None
        self._text_id = 0

    def may_report(self, t_ns: int, cause: str, severity: Severity = Severity.INFO) -> bool:
        """Whether this cause may be reported again: after a while, or because it is worse."""
        known = self._reported.get(cause)
        return known is None or t_ns - known[0] >= REPEAT_NS or severity < known[1]

    def report(self, t_ns: int, severity: Severity, text: str, cause: str = "") -> list[Effect]:
        """Returns the notice, unless its cause has been reported, as severe, in the last minute.

        Args:
            cause: identifies the notice if the text holds changing figures; default: the text.
        """
        cause = cause or text
        if not self.may_report(t_ns, cause, severity) or not self._limit.allows(t_ns):
            return []
        self._reported[cause] = t_ns, severity
        self._reported.move_to_end(cause)
        if len(self._reported) > MAX_CAUSES:
            self._reported.popitem(last=False)
        if self._as_status_text:
            self._waiting.append((severity, text))
        return [Notice(severity, text)]

    def forget(self, cause: str) -> None:
        """Lets this cause be reported again at once."""
        self._reported.pop(cause, None)

    def remind(self, texts: Iterable[tuple[Severity, str]]) -> None:
        """Sends texts to the ground station again, for a station that has just come."""
        if self._as_status_text:
            self._waiting.extend(list(texts)[:MAX_REMINDERS])

    def status_texts(self, t_ns: int) -> list[OutMessage]:
        """Returns the chunks of the next STATUSTEXT, if one may be sent now."""
        if not self._waiting or (self._sent_ns is not None and t_ns - self._sent_ns < PAUSE_NS):
            return []
        self._sent_ns = t_ns
        severity, text = self._waiting.popleft()
        self._text_id = self._text_id % LAST_TEXT_ID + 1
        return outbound.status_text(int(severity), PREFIX + text, self._text_id)
