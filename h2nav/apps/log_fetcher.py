"""Fetches the autopilot's own log of a flight into the folder of the log, while it is disarmed."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.apps.configuration import BITS_PER_SERIAL_BYTE, Configuration
from h2nav.apps.fetched_file import MAX_UNFINISHED, FetchedFile, remove_unfinished, unfinished
from h2nav.apps.pipeline import Watcher
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.fetch.log_fetch import (
    ARDUPILOT_LOGS,
    HEARD,
    PX4_LOGS,
    FetchState,
    LogFetch,
    PartOfLog,
)
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
# An autopilot says at once that it is armed, and with a heartbeat within a second.
ARMING_TEXTS = ("Arming motors", "Throttle armed", "Armed by")
ARMING_NS = 2 * SECOND_NS
CLOSE_WITHIN_S = 1.0


class WantedLog(NamedTuple):
    """A log to be fetched."""

    path: Path  # the name that it will get
    begun: PartOfLog | None  # what there is of it; None = the newest log of the autopilot


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
        # The first one is being fetched; the others were begun before, newest first.
        self._wanted = [WantedLog(*each) for each in unfinished(self._folder)]
        self._flight: str | None = None  # that has ended: the newest log is to be its own
        self._not_before_ns = 0
        self._fetch: LogFetch | None = None
        self._file: FetchedFile | None = None
        self._autopilot: Identity | None = None
        self._is_armed = False
        self._is_stopped = True
        self._ending: list[OutMessage] = []  # what makes the autopilot stop

    def want(self, t_ns: int, stem: str) -> None:
        """Fetches the newest log, as that of the flight whose file has this stem.

        An unfinished one of a former flight is set aside and gone on with after it.
        """
        self._set_aside()
        self._flight, self._not_before_ns = stem, t_ns + CLOSED_NS

    def frame(self, t_ns: int, frame: Frame) -> None:
        """Takes a frame of `message_ids`."""
        if frame.msg_id in self._watcher.message_ids:
            self._watcher.frame(t_ns, frame)
        autopilot, sender = self._autopilot, (frame.sysid, frame.compid)
        if autopilot is None or not (self._wanted or self._flight):
            return
        if frame.msg_id == HEARTBEAT:
            # Its word alone suffices here; the service waits for a second one.
            if sender == autopilot.address:
                self._arms(bool(codec.decode(frame).base_mode & ARMED))
        elif self._fetch is not None and frame.msg_id in HEARD:
            said = codec.decode(frame)
            is_text = frame.msg_id == mavlink.MAVLINK_MSG_ID_STATUSTEXT
            if is_text and sender == autopilot.address and said.text.startswith(ARMING_TEXTS):
                self._not_before_ns = max(self._not_before_ns, t_ns + ARMING_NS)
                self._stop()
            self._fetch.take(t_ns, sender, frame.msg_id, said)
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
            self._set_aside()
            self._autopilot = service.identity
        if self._autopilot is None:
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
        if fetch is None:
            return sent
        sent += [Send(message, system) for message in fetch.due(t_ns)]
        if fetch.state is FetchState.FAILED:
            return [*sent, self._give_up(f"log not fetched: {fetch.reason}")]
        if fetch.state is FetchState.DONE and self._file is not None:
            self._file.complete()
        return sent

    def close(self) -> None:
        """Ends a fetch; the next start goes on with it."""
        file = self._file
        self._set_aside()
        if file is not None:
            file.wait(CLOSE_WITHIN_S)

    def _arms(self, is_armed: bool) -> None:
        self._is_armed = is_armed
        if is_armed:
            self._stop()

    def _stop(self) -> None:
        if not self._is_stopped and self._fetch is not None:
            self._is_stopped = True
            self._ending = self._fetch.stop()

    def _ready(self, system: int) -> LogFetch | None:
        """The fetch, begun or resumed; None while nothing is wanted of this autopilot."""
        assert self._autopilot is not None
        is_px4 = self._autopilot.autopilot == mavlink.MAV_AUTOPILOT_PX4
        suffix = ".ulg" if is_px4 else ".bin"
        if self._flight is not None:
            self._wanted.insert(0, WantedLog(self._folder / f"{self._flight}{suffix}", None))
            self._flight = None
        if self._fetch is None:
            ours = [each for each in self._wanted if each.path.suffix == suffix]
            if not ours:
                return None
            self._wanted.remove(ours[0])
            self._wanted.insert(0, ours[0])
            is_ardupilot = self._autopilot.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
            self._fetch = LogFetch(
                self._autopilot.address,
                (system, self._ours),
                self._rate,
                PX4_LOGS if is_px4 else ARDUPILOT_LOGS if is_ardupilot else None,
                ours[0].begun,
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
            begun = self._wanted[0].begun or PartOfLog(
                fetch.size, fetch.log.time_utc if fetch.log is not None else 0, ((0, fetch.size),)
            )
            self._file = FetchedFile(self._wanted[0].path, begun)
        for offset, data in fetch.chunks:
            self._file.write(offset, data)
            self.fetched_bytes += len(data)
        fetch.chunks.clear()
        if self._file.wants_note and fetch.part is not None:
            self._file.note(fetch.part)

    def _done(self) -> Notice:
        assert self._file is not None
        path, size = self._file.path, self._fetch.size if self._fetch is not None else 0
        self._file = self._fetch = None
        del self._wanted[0]
        text = f"log fetched: {path.name}, {size / 1e6:.1f} MB"
        return Notice(Severity.INFO, text, DONE_CAUSE)

    def _give_up(self, text: str) -> Notice:
        if self._file is not None:
            self._file.give_up()
        remove_unfinished(self._wanted[0].path)
        self._file = self._fetch = None
        del self._wanted[0]
        return Notice(Severity.WARNING, text, "log not fetched")

    def _set_aside(self) -> None:
        """Ends the fetch; what has come of a log stays, and is gone on with later."""
        file, part = self._file, None if self._fetch is None else self._fetch.part
        if self._fetch is not None:
            if file is not None and part is not None and not part.gaps:
                file.complete()  # all of it has come
                del self._wanted[0]
            elif file is not None and part is not None:
                file.set_aside(part)
                self._wanted[0] = self._wanted[0]._replace(begun=part)
            elif self._wanted[0].begun is None:  # nothing says which log it would be
                del self._wanted[0]
        for beyond in self._wanted[MAX_UNFINISHED:]:
            remove_unfinished(beyond.path)
        del self._wanted[MAX_UNFINISHED:]
        self._file = self._fetch = None
        self._is_stopped = True


def _capacity(configuration: Configuration) -> float:
    """Bytes a second that the link carries one way."""
    link = parse_link_url(configuration.link.url)
    return link.baud / BITS_PER_SERIAL_BYTE if isinstance(link, SerialUrl) else USUAL_BYTES_PER_S
