"""The current state of the daemon, as seen by the viewer.

Ages count from arrival in this process, on a monotonic clock: the host's UNIX clock jumps where a
computer without a battery-backed clock learns the date from the network.
"""

import time
from collections import deque
from collections.abc import Callable, Collection, Iterator
from typing import Any, NamedTuple

from h2nav.attitude.samples import Trust
from h2nav.integrity.severity import Severity
from h2nav.live.track import LiveTrack
from h2nav.service.records import EstimateRecord, FindingRecord, StatusRecord

Record = tuple[Any, ...]

MAX_FINDINGS = 50
MAX_TEXTS = 50
# Topics with several current records, and the field that distinguishes them.
KEYS = {"/comparison": "source", "/lanes": "imu", "/rejected": "reason", "/aiding": "kind"}
# The service limits what an autopilot can cause; this bounds errors of the program itself.
MAX_CURRENT = 256
COUNTING = ("/health", "/link", "/feed", "/recorder")
COUNTED_OVER_NS = 800_000_000
S_PER_NS = 1e-9


class Seen(NamedTuple):
    """A record and its time of arrival."""

    heard_ns: int  # on the clock of the state
    record: Any  # a NamedTuple


class LiveReport(NamedTuple):
    """A finding and its beginning."""

    began_ns: int  # on the clock of the state
    finding: FindingRecord  # its latest record


class LiveText(NamedTuple):
    """A line of the program's output and its time of arrival."""

    heard_ns: int  # on the clock of the state
    severity: Severity  # of the line
    text: str  # the line


class _Counters:
    """Two records of counters, about a second apart."""

    def __init__(self) -> None:
        self._before: tuple[int, Any] | None = None
        self._now: tuple[int, Any] | None = None

    def take(self, unix_ns: int, record: Record) -> None:
        if self._now is None or abs(unix_ns - self._now[0]) >= COUNTED_OVER_NS:
            self._before, self._now = self._now, (unix_ns, record)

    def per_s(self, name: str) -> float | None:
        """Rate of a counter; None until it is known."""
        if self._before is None or self._now is None or self._now[0] <= self._before[0]:
            return None
        grown: float = getattr(self._now[1], name) - getattr(self._before[1], name)
        return grown / ((self._now[0] - self._before[0]) * S_PER_NS)


class LiveState:
    """The newest records from the daemon.

    Args:
        clock: monotonic time, ns.

    Attributes:
        findings_begun: number of findings so far.
        track: attitudes of h2nav.
    """

    def __init__(self, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self._clock = clock
        self._heard_ns = clock()
        self._current: dict[tuple[str, Any], Seen] = {}
        self._counters = {topic: _Counters() for topic in COUNTING}
        self._trusted_ns: dict[Trust, int] = {}
        self._findings: deque[LiveReport] = deque(maxlen=MAX_FINDINGS)
        self._texts: deque[LiveText] = deque(maxlen=MAX_TEXTS)
        self.findings_begun = 0
        self.track = LiveTrack()

    def take(self, topic: str, unix_ns: int, record: Record) -> None:
        """Adds a record of the log, or of a live topic.

        Args:
            topic: such as ``/estimate``.
            record: a NamedTuple of flat scalars.
        """
        now_ns = self._heard_ns = self._clock()
        if isinstance(record, FindingRecord):
            self._take_finding(now_ns, record)
            return
        key = (topic, getattr(record, KEYS[topic]) if topic in KEYS else None)
        if key in self._current or len(self._current) < MAX_CURRENT:
            self._current[key] = Seen(now_ns, record)
        if topic in self._counters:
            self._counters[topic].take(unix_ns, record)
        elif isinstance(record, EstimateRecord):
            self._take_estimate(now_ns, record)
        elif isinstance(record, StatusRecord):
            self._end_all_but(record.open_findings.split())

    def text(self, unix_ns: int, severity: Severity, text: str) -> None:
        """Adds a line of the program's output."""
        self._heard_ns = self._clock()
        # A path in it may hold bytes that are not text.
        readable = text.encode(errors="replace").decode()
        self._texts.append(LiveText(self._heard_ns, severity, readable))

    @property
    def silent_s(self) -> float:
        """Time since the last packet."""
        return self.age_s(self._heard_ns)

    @property
    def preflight(self) -> tuple[str, ...]:
        """Failed pre-flight checks, for people."""
        status = self.newest("/status")
        return () if status is None else tuple(status.record.preflight.splitlines())

    @property
    def alarms(self) -> tuple[str, ...]:
        """Active alarms, for people."""
        status = self.newest("/status")
        return () if status is None else tuple(status.record.alarms.splitlines())

    @property
    def findings(self) -> tuple[LiveReport, ...]:
        """The latest findings, sorted by their first record."""
        return tuple(self._findings)

    @property
    def texts(self) -> tuple[LiveText, ...]:
        """The latest lines, in order of arrival."""
        return tuple(self._texts)

    def age_s(self, heard_ns: int) -> float:
        """Time since `heard_ns`."""
        return (self._clock() - heard_ns) * S_PER_NS

    def newest(self, topic: str, key: Any = None) -> Seen | None:
        """Returns the newest record of a topic.

        Args:
            topic: such as ``/estimate``.
            key: selects one of several, as in `KEYS`.
        """
        return self._current.get((topic, key))

    def all_of(self, topic: str) -> Iterator[Seen]:
        """The newest record of each kind, for a topic of `KEYS`."""
        return (seen for (name, _), seen in self._current.items() if name == topic)

    def per_s(self, topic: str, name: str) -> float | None:
        """Rate of a counter in a record of `COUNTING`; None until it is known."""
        return self._counters[topic].per_s(name)

    def trusted_s(self) -> dict[Trust, float]:
        """Time since each source of aiding was last seen."""
        return {flag: self.age_s(heard_ns) for flag, heard_ns in self._trusted_ns.items()}

    def _take_estimate(self, now_ns: int, ours: EstimateRecord) -> None:
        self.track.add(now_ns, (ours.q_w, ours.q_x, ours.q_y, ours.q_z))
        for flag in Trust(ours.trust):
            self._trusted_ns[flag] = now_ns

    def _end_all_but(self, going_on: Collection[str]) -> None:
        """Takes which findings go on: the record of an end may have been dropped on the way."""
        for place, (began_ns, finding) in enumerate(self._findings):
            if finding.is_open and finding.id not in going_on:
                self._findings[place] = LiveReport(began_ns, finding._replace(is_open=False))

    def _take_finding(self, now_ns: int, finding: FindingRecord) -> None:
        for place, entry in enumerate(self._findings):
            if entry.finding.id == finding.id:
                self._findings[place] = entry._replace(finding=finding)
                return
        began_ns = now_ns - round((finding.to_s - finding.from_s) / S_PER_NS)
        self._findings.append(LiveReport(began_ns, finding))
        self.findings_begun += 1
