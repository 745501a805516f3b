"""Fetches the autopilot's own log of a flight into the folder of the log, while it is disarmed."""

from collections.abc import Sequence
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import BITS_PER_SERIAL_BYTE, Configuration
from h2nav.apps.fetched_file import FetchedFile
from h2nav.apps.pipeline import Watcher
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.fetch.log_fetch import HEARD, FetchState, LogFetch
from h2nav.integrity.severity import Severity
from h2nav.links.link_urls import SerialUrl, parse_link_url
from h2nav.maths.units import SECOND_NS
from h2nav.service.autopilot import Identity
from h2nav.service.effects import Notice, Send
from h2nav.service.service import Service
from h2nav.wire import codec
from h2nav.wire.deframer import Frame
from h2nav.wire.outbound import OutMessage

HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
ARMED = mavlink.MAV_MODE_FLAG_SAFETY_ARMED
# A link without a baud rate counts as a serial line of this rate.
USUAL_BYTES_PER_S = 921_600 / BITS_PER_SERIAL_BYTE
# The autopilot closes its log some seconds after disarming.
CLOSED_NS = 10 * SECOND_NS
DONE_CAUSE = "log fetched"


class LogFetcher:
    """One log at a time; a watcher of the pipeline, before the one that was there.

    Args:
        configuration: of the daemon.
        watcher: is passed what it asks for.
    """

    def __init__(self, configuration: Configuration, watcher: Watcher) -> None:
        self._watcher = watcher
        self.message_ids = HEARD | {HEARTBEAT} | watcher.message_ids
        self._folder = Path(configuration.log.folder)
        self._ours = configuration.output.component_id
        self._rate = _capacity(configuration) * configuration.flights.fetch_share
        self.fetched_bytes = 0  # of all logs so far
        self._wanted: str | None = None  # name of the flight's file, without its ending
        self._not_before_ns = 0
        self._fetch: LogFetch | None = None
        self._file: FetchedFile | None = None
        self._autopilot: Identity | None = None
        self._is_armed = False
        self._is_stopped = True
        self._ending: list[OutMessage] = []  # what makes the autopilot stop

    def want(self, t_ns: int, stem: str) -> None:
        """Fetches the newest log, as that of the flight whose file has this stem.

        An unfinished one of a former flight is given up: the autopilot names logs by numbers that
        change, and the flight that has just ended is what is asked about.
        """
        self._drop()
        self._wanted, self._not_before_ns = stem, t_ns + CLOSED_NS

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Takes a frame of `message_ids`."""
        if frame.msg_id in self._watcher.message_ids:
            self._watcher.frame(t_ns, frame)
        autopilot, sender = self._autopilot, (frame.sysid, frame.compid)
        if autopilot is None or self._wanted is None:
            return
        if frame.msg_id == HEARTBEAT:
            # Its word alone suffices here; the service waits for a second one.
            if sender == autopilot.address:
                self._arms(bool(codec.decode(frame).base_mode & ARMED))
        elif self._fetch is not None and frame.msg_id in HEARD:
            self._fetch.take(t_ns, sender, frame.msg_id, codec.decode(frame))
            self._keep()

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        """Passes an estimate on."""
        self._watcher.estimate(t_ns, estimate, late_ns)

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        """Passes a notice on."""
        self._watcher.notice(t_ns, severity, text)

    def tend(self, t_ns: int, _: int, service: Service) -> Sequence[Notice | Send]:
        """Asks for what is due; returns messages and notices."""
        if service.identity is not None and service.identity != self._autopilot:
            self._autopilot = service.identity
            self._fetch = None
        if self._wanted is None or self._autopilot is None:
            return []
        system = service.system_id
        sent = [Send(message, system) for message in self._ending]
        self._ending.clear()
        if self._is_armed or service.is_armed or t_ns < self._not_before_ns:
            return sent
        if self._file is not None and self._file.trouble:
            return [*sent, self._give_up(f"log not fetched: {self._file.trouble}")]
        if self._file is not None and not self._file.has_room:
            return sent
        if self._file is not None and self._file.is_whole:
            return [*sent, self._done()]
        fetch = self._ready(system)
        sent += [Send(message, system) for message in fetch.due(t_ns)]
        self._keep()
        if fetch.state is FetchState.FAILED:
            return [*sent, self._give_up(f"log not fetched: {fetch.reason}")]
        if fetch.state is FetchState.DONE and self._file is not None:
            self._file.complete()
        return sent

    def close(self) -> None:
        """Ends a fetch that is not finished."""
        self._drop()

    def _arms(self, is_armed: bool) -> None:
        self._is_armed = is_armed
        if is_armed and not self._is_stopped and self._fetch is not None:
            self._is_stopped = True
            self._ending = self._fetch.stop()

    def _ready(self, system: int) -> LogFetch:
        """The fetch, begun or resumed."""
        assert self._autopilot is not None
        if self._fetch is None:
            is_ardupilot = self._autopilot.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
            self._fetch = LogFetch(
                self._autopilot.address,
                (system, self._ours),
                self._rate,
                has_files=is_ardupilot,
            )
        elif self._is_stopped:
            self._fetch.resume()
        self._is_stopped = False
        return self._fetch

    def _keep(self) -> None:
        """Passes what has arrived to the file."""
        fetch = self._fetch
        if fetch is None or not fetch.chunks:
            return
        if self._file is None:
            assert self._autopilot is not None
            is_px4 = self._autopilot.autopilot == mavlink.MAV_AUTOPILOT_PX4
            name = f"{self._wanted}{'.ulg' if is_px4 else '.bin'}"
            self._file = FetchedFile(self._folder / name, fetch.size)
        for offset, data in fetch.chunks:
            self._file.write(offset, data)
            self.fetched_bytes += len(data)
        fetch.chunks.clear()

    def _done(self) -> Notice:
        assert self._file is not None
        path, size = self._file.path, self._fetch.size if self._fetch is not None else 0
        self._file = self._fetch = self._wanted = None
        text = f"log fetched: {path.name}, {size / 1e6:.1f} MB"
        return Notice(Severity.INFO, text, DONE_CAUSE)

    def _give_up(self, text: str) -> Notice:
        self._drop()
        return Notice(Severity.WARNING, text, "log not fetched")

    def _drop(self) -> None:
        if self._file is not None:
            self._file.give_up()
        self._file = self._fetch = self._wanted = None
        self._is_stopped = True


def _capacity(configuration: Configuration) -> float:
    """Bytes a second that the link carries one way."""
    link = parse_link_url(configuration.link.url)
    return link.baud / BITS_PER_SERIAL_BYTE if isinstance(link, SerialUrl) else USUAL_BYTES_PER_S
