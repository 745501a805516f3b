"""Keeps the record of flights beside the daemon: ends the log of a flight and has it reviewed.

Everything that takes time happens in the recorder's thread or in the process that reviews
(docs/design/006-flight-record.md); here are only decisions, at most ten times a second.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from h2nav.apps.configuration import Configuration
from h2nav.apps.log_fetcher import LogFetcher
from h2nav.apps.review_process import ReviewOutcome, ReviewProcess
from h2nav.apps.reviewer import ReviewJob
from h2nav.flights.folder import REVIEWS, UPLOADS, flight_id
from h2nav.flights.records import FlightsRecord
from h2nav.integrity.severity import Severity
from h2nav.log.folder import our_logs
from h2nav.log.recorder import Recorder
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Notice, Send
from h2nav.service.service import Service

LOOK_NS = SECOND_NS // 10
# The log of a flight ends this long after disarming: the last texts and findings belong to it.
SETTLED_NS = 3 * SECOND_NS
# How often the folder is looked at for recordings that came otherwise.
FOLDER_NS = 10 * SECOND_NS
# A disk that cannot begin the next log may still read.
LONGEST_ROLL_NS = 10 * SECOND_NS
# After trouble that is not a recording's, or while another process reviews.
PAUSE_NS = 60 * SECOND_NS

Tell = Callable[[int, dict[str, Any]], object]


class FlightKeeper:
    """Watches flights begin and end.

    Args:
        configuration: of the daemon; its `log.folder` is not empty.
        recorder: of the log.
        tell: passes on an event about a reviewed flight.
        fetcher: of the autopilot's own logs; None = they are not fetched.
    """

    def __init__(
        self,
        configuration: Configuration,
        recorder: Recorder,
        tell: Tell,
        fetcher: LogFetcher | None = None,
    ) -> None:
        self._folder = Path(configuration.log.folder)
        self._recorder = recorder
        self._tell = tell
        self._fetcher = fetcher
        settings = configuration.flights
        self._reviews = settings.review
        self._process = ReviewProcess(
            ReviewJob(
                str(self._folder),
                str(self._folder / REVIEWS),
                settings.review_memory_mb,
                settings.review_minutes,
                round(settings.max_gb * 1e9),
                settings.max_days,
                settings.review_priority == "idle",
            )
        )
        self.record = FlightsRecord()  # counts so far
        self._look_ns = 0
        self._is_armed = False
        self._disarmed_ns: int | None = None  # of a flight whose log has not been ended
        # ids of the logs of the last flight, whose reviews the ground station is told of
        self._parts: set[str] = set()
        self._rolled: Path | None = None  # a log that is being ended
        self._rolled_ns = 0
        self._not_before_ns = 0
        self._folder_ns = 0
        # Flights may be left from former runs, or have come without the daemon.
        self._is_due = _has_recordings(self._folder)
        self._seen = self._changes()

    def tend(self, t_ns: int, unix_ns: int, service: Service) -> list[Notice | Send]:
        """Does what is due; returns notices, and messages to send."""
        fetching = [] if self._fetcher is None else self._fetcher.tend(t_ns, unix_ns, service)
        if t_ns < self._look_ns:
            return list(fetching)
        return [*fetching, *self._looked(t_ns, service)]

    def _looked(self, t_ns: int, service: Service) -> list[Notice]:
        self._look_ns = t_ns + LOOK_NS
        self._follow(t_ns, service.is_armed)
        outcome = self._process.outcome()
        said = [] if outcome is None else self._take(t_ns, outcome)
        if not self._is_armed and not self._process.is_running and self._disarmed_ns is None:
            self._begin_review(t_ns)
        fetched = 0 if self._fetcher is None else self._fetcher.fetched_bytes
        self.record = self.record._replace(
            is_reviewing=self._process.is_running, fetched_bytes=fetched
        )
        return said

    def close(self) -> None:
        """Ends a review that is running; the next start takes it up again."""
        self._process.stop()
        if self._fetcher is not None:
            self._fetcher.close()

    def _follow(self, t_ns: int, is_armed: bool) -> None:
        """Notices the beginning and the end of a flight."""
        path = self._recorder.path
        if is_armed:
            if self._process.is_running:
                self._process.stop()
                self._is_due = True
                self.record = self.record._replace(interrupted=self.record.interrupted + 1)
            if not self._is_armed and self._disarmed_ns is None:
                self._parts.clear()
            self._disarmed_ns = None
            if path is not None:
                self._parts.add(flight_id(path.stem))
        elif self._is_armed:
            self._disarmed_ns = t_ns
        self._is_armed = is_armed
        if self._disarmed_ns is not None and t_ns - self._disarmed_ns >= SETTLED_NS:
            self._disarmed_ns = None
            self._rolled, self._rolled_ns = path, t_ns
            self._recorder.roll()
            if self._fetcher is not None and path is not None:
                self._fetcher.want(t_ns, path.stem)
            self.record = self.record._replace(flown=self.record.flown + 1)
        has_ended = self._rolled != path or t_ns - self._rolled_ns > LONGEST_ROLL_NS
        if self._rolled is not None and has_ended:
            self._rolled = None
            self._is_due = True

    def _begin_review(self, t_ns: int) -> None:
        """Starts a review if one may be waiting."""
        if not self._reviews or t_ns < self._not_before_ns or self._rolled is not None:
            return
        if t_ns >= self._folder_ns:
            self._folder_ns = t_ns + FOLDER_NS
            before, self._seen = self._seen, self._changes()
            self._is_due |= before != self._seen
        if not self._is_due:
            return
        self._is_due = False
        try:
            self._process.start()
        except OSError:
            self._is_due = True
            self._not_before_ns = t_ns + PAUSE_NS

    def _changes(self) -> tuple[int, int]:
        """Differs when a recording has come or gone."""
        return _changed_ns(self._folder), _changed_ns(self._folder / UPLOADS)

    def _take(self, t_ns: int, outcome: ReviewOutcome) -> list[Notice]:
        """Passes on how a review ended."""
        if outcome.did_nothing:
            if outcome.is_busy:  # such as `h2nav serve`, which may end before all are reviewed
                self._is_due, self._not_before_ns = True, t_ns + PAUSE_NS
            return []
        self._is_due = True  # another one may be waiting
        if outcome.trouble:
            self._not_before_ns = t_ns + PAUSE_NS
            text = f"flights not reviewed: {outcome.trouble}"
            return [Notice(Severity.WARNING, text, "flights not reviewed")]
        count = self.record
        about = outcome._asdict()
        about["id"] = about.pop("flight")
        del about["trouble"], about["is_busy"]
        self._tell(t_ns, about)
        if outcome.error:
            self.record = count._replace(failed=count.failed + 1)
        else:
            has_errors = outcome.summary.get("errors", 0) > 0
            self.record = count._replace(
                reviewed=count.reviewed + 1, with_errors=count.with_errors + has_errors
            )
        if outcome.flight not in self._parts:
            return []
        self._parts.discard(outcome.flight)
        severity = Severity.of(outcome.severity) or Severity.WARNING
        text = outcome.text or f"flight not reviewed: {outcome.error}"
        return [Notice(severity, text, f"flight {outcome.flight}")]


def _has_recordings(folder: Path) -> bool:
    try:
        return bool(our_logs(folder)) or (folder / UPLOADS).is_dir()
    except OSError:
        return False


def _changed_ns(folder: Path) -> int:
    try:
        return folder.stat().st_mtime_ns
    except OSError:
        return 0
