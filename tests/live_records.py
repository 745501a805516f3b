"""Records as the daemon would give them to a viewer, and a server of the page in a thread."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from h2nav.flights.folder import FlightFolder
from h2nav.integrity.findings import Severity
from h2nav.integrity.ratios import InnovationRatios
from h2nav.links.link_statistics import LinkStatistics
from h2nav.links.live_feed import FeedRecord
from h2nav.live.flights_site import READ_ONLY, FlightsSite, SiteRights
from h2nav.live.server import PageServer
from h2nav.live.state import LiveState
from h2nav.log.recorder import RecorderRecord
from h2nav.maths import quaternion
from h2nav.maths.units import DEG
from h2nav.service.records import (
    AidingRecord,
    EstimateRecord,
    FindingRecord,
    HealthRecord,
    LaneRecord,
    RejectionRecord,
    StatusRecord,
)
from h2nav.wire.deframer import DeframerCounters

WAIT_S = 30.0
UNIX_NS = 1_795_000_000_000_000_000
HELD = 1 | 2 | 4 | 8 | 16 | 64  # aligned, converged, force, field, north, velocity


def estimate(roll_deg=0.0, pitch_deg=0.0, yaw_deg=0.0, trust=HELD):
    q_nb = quaternion.from_euler(roll_deg * DEG, pitch_deg * DEG, yaw_deg * DEG)
    none = (0.0,) * 3
    return EstimateRecord(
        1_000_000, *q_nb, roll_deg, pitch_deg, yaw_deg, *none, *none, *none, 0.3, trust, 2.0, 1.5
    )


def status(roll_deg=0.0, pitch_deg=0.0, yaw_deg=0.0, **changes):
    q_nb = quaternion.from_euler(roll_deg * DEG, pitch_deg * DEG, yaw_deg * DEG)
    made = StatusRecord(
        "active", "", "ArduPilot multirotor 1/1", 4.0, *q_nb, "autopilot", 0.0, 0.4, -1.25, 0.6,
        2.0, "undecided", "undecided", 0.2, float("nan"), 0.15, 0.1, "",
    )  # fmt: skip
    return made._replace(**changes)


def health(**changes):
    made = HealthRecord("active", "", "1/1", "RAW_IMU", 100.0, 2000, 3, 1000, True, True, 2.0)
    return made._replace(**changes)


def finding(**changes):
    made = FindingRecord(
        "attitude_velocity.gps.1", "begin", True, "attitude_velocity", "GPS", "gps", None, "error",
        40.0, 41.0, 20.0, "deg", "attitude contradicts velocity",
        "force and velocity differ by 5.0 m/s in 1 s", None,
    )  # fmt: skip
    return made._replace(**changes)


def lane(imu, *, sent):
    return LaneRecord(imu, "HIGHRES_IMU", 100.0, 0.2, 0.1, 0.05 * imu, -0.2, sent)


FLYING = (
    ("/health", health()),
    ("/status", status(10.0, -5.0, 80.0)),
    ("/estimate", estimate(10.4, -5.2, 81.0)),
    ("/ratios", InnovationRatios(velocity_1s=0.2)),
    ("/aiding", AidingRecord("velocity", 1.0, 2.0, 0.1, 0.3, True)),
    ("/rejected", RejectionRecord("duplicate", 3)),
    ("/lanes", lane(1, sent=True)),
    ("/lanes", lane(2, sent=False)),
    ("/link", LinkStatistics(bytes_in=100_000, bytes_out=40_000, opened=1)),
    ("/deframer", DeframerCounters(bytes_in=100_000, frames=4000, bad_crc=2)),
    ("/recorder", RecorderRecord(9000, 0, 0, 0, 1_250_000, 1)),
    ("/feed", FeedRecord(400, 1, False, 3.2, 61_000_000)),
)


class Clock:
    """Time that passes only where a test says so."""

    def __init__(self):
        self.now_ns = 5_000_000_000

    def __call__(self):
        return self.now_ns

    def pass_s(self, seconds):
        self.now_ns += round(seconds * 1e9)


def flying_state(clock=None):
    """A state that has been told everything once."""
    state = LiveState(clock or Clock())
    for topic, record in FLYING:
        state.take(topic, UNIX_NS, record)
    state.text(UNIX_NS, Severity.INFO, "active")
    return state


class Served:
    """A page server with its event loop in a thread.

    Args:
        state: what it shows.
        host: to listen on.
        flights: the folder of the record of flights, if any.

    Attributes:
        port: where it listens.
    """

    def __init__(
        self,
        state: LiveState | None,
        host: str = "127.0.0.1",
        flights: FlightFolder | None = None,
        rights: SiteRights = READ_ONLY,
    ) -> None:
        self._rights = rights
        self.state = state
        self._flights = flights
        self._site: FlightsSite | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever)
        self._thread.start()
        self._host = host
        self.port = 0
        self.open_server()

    def run(self, call, *arguments):
        """Calls something in the server's thread; what it returns."""

        async def called():
            return call(*arguments)

        return asyncio.run_coroutine_threadsafe(called(), self._loop).result(WAIT_S)

    def take(self, topic, record, unix_ns=UNIX_NS):
        """A record comes."""
        self.run(self.state.take, topic, unix_ns, record)

    def connect(self) -> socket.socket:
        """A connection to it."""
        return socket.create_connection(("127.0.0.1", self.port), WAIT_S)

    def open_server(self) -> None:
        """The page is served, on the same port as before."""
        self._site = (
            None if self._flights is None else self.run(FlightsSite, self._flights, self._rights)
        )
        self._server = self.run(PageServer, self.state, self._host, self.port, self._site)
        self.port = self._server.port

    def close_server(self) -> None:
        """The page is no longer served."""
        self.run(self._server.close)
        if self._site is not None:
            self.run(self._site.close)

    def end(self) -> None:
        """Nothing of it is left."""
        self.close_server()
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(WAIT_S)
        self._loop.close()


@contextmanager
def served(
    state: LiveState | None,
    host: str = "127.0.0.1",
    flights: FlightFolder | None = None,
    rights: SiteRights = READ_ONLY,
) -> Iterator[Served]:
    """A server that is gone after the block."""
    running = Served(state, host, flights, rights)
    try:
        yield running
    finally:
        running.end()
