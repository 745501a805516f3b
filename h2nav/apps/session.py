"""One run of the daemon: creates everything that a configuration asks for, and cleans up."""

import time
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from h2nav import __version__
from h2nav.apps.configuration import Configuration, left_out
from h2nav.apps.console import Console
from h2nav.apps.daemon import Daemon
from h2nav.apps.filters import FilterFactory
from h2nav.apps.link_signing import LinkSigning
from h2nav.apps.log_contents import attach_inputs, open_recorder
from h2nav.apps.panel import LogSight, Sight
from h2nav.apps.pipeline import Outlets, Pipeline, Watcher
from h2nav.attitude.native import backend
from h2nav.errors import BadInput
from h2nav.files.earth_field import earth_field_at
from h2nav.flights.records import FLIGHTS_TOPIC
from h2nav.host.host_clock import UnixClock
from h2nav.host.own_memory import give_back
from h2nav.host.service_manager import ServiceManager
from h2nav.host.stop_signals import StopSignals
from h2nav.integrity.severity import Severity
from h2nav.links.links import open_link
from h2nav.service.effects import Notice, Send
from h2nav.service.service import Service, Surroundings

if TYPE_CHECKING:
    from h2nav.apps.flight_keeper import FlightKeeper
    from h2nav.apps.live_view import LiveView
    from h2nav.apps.log_fetcher import LogFetcher
    from h2nav.links.event_socket import EventSocket
    from h2nav.log.recorder import Recorder

CLOSE_WITHIN_S = 1.5
LET_IN_NS = 100_000_000
FLIGHTS_NS = 1_000_000_000


class Session:
    """A context in which the daemon can run; leaving it closes link and log.

    Attributes:
        recorder: the log; None without one.
        service: the behaviour.
        link: to the autopilot.

    Args:
        watcher: observes frames and estimates; by default the console.
        own_socket: where events are published if the configuration names no socket, if possible.

    Raises:
        BadInput: a gain file or the signing key of the configuration is not usable, or a package
            of the live view is missing.
    """

    def __init__(
        self,
        configuration: Configuration,
        console: Console,
        watcher: Watcher | None = None,
        own_socket: Path | None = None,
    ) -> None:
        filters = FilterFactory.shipped(configuration.filter, configuration.autopilot.imu_rate_hz)
        filters.check()
        signing = configuration.signing
        self._signing = LinkSigning(signing) if signing.key_file else None
        self._live = _live_view(configuration)
        self._console = console
        self._events = _event_socket(configuration, console, own_socket)
        self._let_in_ns = 0
        self._flights_ns = 0
        self._clock = UnixClock()
        unix_s = time.time()
        self.recorder: Recorder | None = open_recorder(configuration.log, self._clock.offset_ns)
        if self.recorder is not None:
            attach_inputs(self.recorder, configuration, filters, unix_s)
        earth_field_at(0.0, 0.0, 0.0, unix_s)  # loaded now, so that it delays nothing in flight
        surroundings = Surroundings(
            filters.filter_for, earth_field_at, unix_s, self._clock.offset_ns
        )
        self._greeting = _greeting(configuration)
        self._about = {
            "version": __version__,
            "kernels": backend(),
            "link": configuration.link.url,
            "log": configuration.log.folder,
        }
        self.service = Service(configuration.service, surroundings)
        self.link = open_link(configuration.link.url, self._comes_from_vehicle)
        self._fetcher = _log_fetcher(configuration, watcher or console)
        outlets = Outlets(
            self._clock.unix_ns,
            self.link.write,
            self.recorder,
            self._fetcher or watcher or console,
            live=None if self._live is None else self._live.feed,
            finding=console.finding,
        )
        self._keeper = _flight_keeper(configuration, self.recorder, console, self._fetcher)
        self._pipeline = Pipeline(
            self.service, configuration.output.component_id, outlets, self._signing
        )

    def open(self) -> None:
        """Opens the link now, so that its port is known before `run`."""
        self.link.maintain(time.monotonic_ns())

    @property
    def page_url(self) -> str:
        """URL of the live view's page; empty without one."""
        return "" if self._live is None else self._live.page_url

    def run(self, stop: StopSignals, seconds: float | None = None) -> None:
        """Runs until a stop signal, or for a time."""
        give_back()
        daemon = Daemon(self.link, self._pipeline, self._clock, ServiceManager())
        until_ns = None if seconds is None else time.monotonic_ns() + round(seconds * 1e9)
        self._pipeline.note(time.monotonic_ns(), Notice(Severity.NOTICE, self._greeting))
        self._console.started(time.monotonic_ns(), self._about)
        for now_ns in daemon.turns(stop, until_ns):
            self._console.status(now_ns, self._sight)
            if self._live is not None:
                self._pipeline.tend(now_ns, "live view", self._live.tend)
            if self._events is not None:
                self._pipeline.tend(now_ns, "event socket", self._let_in)
            if self._keeper is not None:
                self._pipeline.tend(now_ns, "flight record", self._keep_flights)

    def _keep_flights(self, t_ns: int, unix_ns: int, service: Service) -> list[Notice | Send]:
        """Ends and reviews flights; shows the counts to the live view."""
        assert self._keeper is not None
        said = self._keeper.tend(t_ns, unix_ns, service)
        if self._live is not None and t_ns >= self._flights_ns:
            self._flights_ns = t_ns + FLIGHTS_NS
            self._live.feed.record(FLIGHTS_TOPIC, self._keeper.record, unix_ns)
        return said

    def _let_in(self, t_ns: int, _: int, service: Service) -> list[Notice]:
        """Accepts new clients of the event socket."""
        if self._events is not None and t_ns >= self._let_in_ns:
            self._let_in_ns = t_ns + LET_IN_NS
            self._events.tend(
                lambda: self._console.catch_up(t_ns, self._sight(t_ns), service.open_findings)
            )
        return []

    def _sight(self, t_ns: int) -> Sight:
        log = None
        if self.recorder is not None:
            recorder = self.recorder
            log = LogSight(recorder.path, recorder.trouble, recorder.statistics())
        return Sight(self.service.health, self.service.status(t_ns), log)

    def _comes_from_vehicle(self, data: bytes) -> bool:
        return self._pipeline.comes_from_vehicle(data)

    def __enter__(self) -> "Session":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.link.close()
        if self._keeper is not None:
            self._keeper.close()
        if self._live is not None:
            self._live.close()
        if self._signing is not None:
            self._signing.close()
        if self.recorder is not None:
            self.recorder.close(CLOSE_WITHIN_S)
            self._pipeline.report_recorder(time.monotonic_ns())
        log = None if self.recorder is None else self.recorder.path
        self._console.closing(time.monotonic_ns(), self.service.health, log)
        if self._events is not None:
            self._events.close()


def _live_view(configuration: Configuration) -> "LiveView | None":
    """The live view; None, and nothing is imported, if it is not configured."""
    if not configuration.live.address:
        return None
    from h2nav.apps.live_view import LiveView

    return LiveView(configuration)


def _event_socket(
    configuration: Configuration, console: Console, own: Path | None
) -> "EventSocket | None":
    """The event socket: the configured one, or else our own; None, and nothing imported, if none.

    Our own is only a convenience: another daemon may have it, or its folder may not be writable.
    """
    named = configuration.events.socket
    if not named and own is None:
        return None
    from h2nav.links.event_socket import EventSocket

    try:
        if not named and own is not None:
            own.parent.mkdir(mode=0o700, exist_ok=True)
        events = EventSocket(Path(named or own or ""))
    except (BadInput, OSError):
        if named:
            raise
        return None
    console.show_events(events.say)
    return events


def _log_fetcher(configuration: Configuration, watcher: Watcher) -> "LogFetcher | None":
    """Fetches the autopilot's logs; None, and nothing imported, if that is not wanted."""
    if not (configuration.flights.fetch_log and configuration.log.folder):
        return None
    from h2nav.apps.log_fetcher import LogFetcher

    return LogFetcher(configuration, watcher)


def _flight_keeper(
    configuration: Configuration,
    recorder: "Recorder | None",
    console: Console,
    fetcher: "LogFetcher | None",
) -> "FlightKeeper | None":
    """Keeps the record of flights; None, and nothing imported, without a log or if not wanted."""
    settings = configuration.flights
    if recorder is None or not (settings.review or settings.fetch_log):
        return None
    from h2nav.apps.flight_keeper import FlightKeeper

    return FlightKeeper(configuration, recorder, console.flight, fetcher)


def _greeting(configuration: Configuration) -> str:
    """Describes the run in one line."""
    chosen = configuration.filter
    arithmetic = "" if chosen.arithmetic == "float" else f" in {chosen.arithmetic} arithmetic"
    without = left_out(chosen)
    arithmetic += f" ({without})" if without else ""
    log = f"log in {configuration.log.folder}" if configuration.log.folder else "no log"
    slow = "" if backend() == "native" else " (no compiler at installation: slower)"
    runs = f"filter {chosen.name}{arithmetic}, {backend()} kernels{slow}"
    return f"h2nav {__version__} on {configuration.link.url}, {runs}, {log}"
