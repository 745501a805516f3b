"""The live view beside the daemon: a process that is started, fed, watched and restarted.

Everything that clients can reach runs outside the daemon, niced and with limits of its own: a
failure there costs a display and no attitude (docs/design/005-live-view.md).
"""

import os
import socket
import subprocess
import time
from pathlib import Path

from h2nav.apps import extras
from h2nav.apps.configuration import Configuration
from h2nav.apps.own_process import start_module
from h2nav.apps.page_token import token_in
from h2nav.integrity.findings import Phase, Severity
from h2nav.links.back_off import BackOff
from h2nav.links.listen_address import parse_listen_address
from h2nav.links.live_feed import (
    FEED_TOPIC,
    STATUS_TOPIC,
    FeedRecord,
    Greeting,
    LiveFeed,
    Word,
    feed_sockets,
)
from h2nav.log.folder import MIB
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Notice
from h2nav.service.records import FINDING_TOPIC, finding_record
from h2nav.service.service import Service

LOOK_NS = 100_000_000
STATUS_NS = 200_000_000
FIRST_PAUSE_NS = SECOND_NS
LONGEST_PAUSE_NS = 60 * SECOND_NS
# A viewer that has run for this long works.
PROVED_NS = 60 * SECOND_NS
# Consecutive packets that it did not take, at five or more a second.
MAX_REFUSED = 150
END_WITHIN_S = 1.0
MEMORY = Path("/proc/self/statm")
PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")


def require_packages() -> None:
    """Checks for the packages of the viewer.

    Raises:
        BadInput: a package of the extra is missing.
    """
    extras.require_installed("live", "live.address", "foxglove", "prometheus_client", "tornado")


def start_viewer(end: socket.socket) -> "subprocess.Popen[bytes]":
    """Starts a viewer as a process, which ends with its feed."""
    return start_module(
        "h2nav.live",
        stdin=end.fileno(),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,  # clients could flood the journal
    )


class LiveView:
    """Keeps a viewer running.

    Args:
        configuration: of the daemon; its `live.address` is not empty.

    Raises:
        BadInput: a package of the extra is missing, or the address cannot be read.
    """

    def __init__(self, configuration: Configuration) -> None:
        require_packages()
        self._settings = configuration.live
        self._address = parse_listen_address(configuration.live.address)
        token_file = configuration.flights.token_file
        self._greeting = Greeting(
            *self._address,
            configuration.live.foxglove_port,
            configuration.as_mapping(),
            configuration.log.folder,
            token_in(Path(token_file)) if token_file else "",
            configuration.flights.upload_mb * MIB,
        )
        self.feed = LiveFeed()  # takes the records of the pipeline
        self._viewer: subprocess.Popen[bytes] | None = None
        self._is_lost = self._is_new = False
        self._back_off = BackOff(FIRST_PAUSE_NS, LONGEST_PAUSE_NS)
        self._started_ns = 0
        self._look_ns = self._status_ns = self._record_ns = 0
        self._shown_port = 0
        self.page_url = ""  # of the page; empty before it is served
        self._trouble = ""

    def tend(self, t_ns: int, unix_ns: int, service: Service) -> list[Notice]:
        """Does what is due; returns notices."""
        if t_ns < self._look_ns:
            return []
        self._look_ns = t_ns + LOOK_NS
        said = self._look_after(t_ns)
        if self._is_new:
            self._is_new = False
            for finding in service.open_findings:
                self.feed.record(FINDING_TOPIC, finding_record(Phase.UPDATE, finding), unix_ns)
        if t_ns >= self._status_ns:
            self._status_ns = t_ns + STATUS_NS
            self.feed.record(STATUS_TOPIC, service.status(t_ns), unix_ns)
        if t_ns >= self._record_ns:
            self._record_ns = t_ns + SECOND_NS
            self.feed.record(FEED_TOPIC, self._record(), unix_ns)
        return said

    def close(self) -> None:
        """Ends the viewer, gently first."""
        self.feed.end()
        if self._viewer is None:
            return
        try:
            self._viewer.wait(END_WITHIN_S)
        except subprocess.TimeoutExpired:
            self._viewer.kill()
            self._viewer.wait()

    def _look_after(self, t_ns: int) -> list[Notice]:
        if self._is_lost and self._viewer is not None and self._viewer.poll() is not None:
            self._viewer = None
        if self._viewer is None:
            return self._start(t_ns) if self._back_off.is_due(t_ns) else []
        if self._is_lost:
            return []
        if t_ns - self._started_ns > PROVED_NS:
            self._back_off.succeeded()
        said: list[Notice] = []
        try:
            for word in self.feed.words():
                said += self._heard(word)
        except ConnectionError as error:
            return [*said, self._lost(t_ns, str(error))]
        if self.feed.refused > MAX_REFUSED:
            return [*said, self._lost(t_ns, "it has stopped reading")]
        return said

    def _start(self, t_ns: int) -> list[Notice]:
        ours, theirs = feed_sockets()
        with theirs:
            try:
                self._viewer = start_viewer(theirs)
            except OSError as error:
                ours.close()
                self._back_off.failed(t_ns)
                text = f"live view cannot be started: {error.strerror or error}; tried again later"
                return [Notice(Severity.WARNING, text, "live view not started")]
        self._started_ns, self._is_lost, self._trouble = t_ns, False, ""
        self.feed.begin(ours, self._greeting)
        self._is_new = True
        return []

    def _lost(self, t_ns: int, reason: str) -> Notice:
        """Gives up a viewer; another one is started later."""
        assert self._viewer is not None
        self._is_lost, self._shown_port = True, 0
        self._viewer.kill()
        self.feed.end()
        self._back_off.failed(t_ns)
        text = f"live view lost: {self._trouble or reason}; it is started again"
        return Notice(Severity.WARNING, text, "live view lost")

    def _heard(self, word: Word) -> list[Notice]:
        self._trouble = word.trouble
        self.feed.want_all(word.wants_all)
        if word.port in (0, self._shown_port):
            return []
        self._shown_port = word.port
        page = self._address._replace(port=word.port)
        self.page_url = f"http://{page}/"
        text = f"live view at {self.page_url}"
        if self._settings.foxglove_port:
            text += f", Foxglove at ws://{page._replace(port=self._settings.foxglove_port)}"
        if page.is_loopback:
            return [Notice(Severity.INFO, text)]
        return [Notice(Severity.WARNING, f"{text}, open to all who can reach this address")]

    def _record(self) -> FeedRecord:
        feed = self.feed
        pages = int(MEMORY.read_text().split()[1])
        return FeedRecord(
            feed.packets, feed.dropped, feed.wants_all, time.process_time(), pages * PAGE_BYTES
        )
