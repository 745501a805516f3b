"""The fake autopilot and the whole pipeline on one manual clock, without sockets or threads.

Everything between the two is bytes: the autopilot's frames pass its faulty line, the deframer and
the codec; what the service sends is deframed and goes back to the autopilot.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from h2nav.apps.configuration import Configuration
from h2nav.apps.filters import FilterFactory
from h2nav.apps.pipeline import Beside, Outlets, Pipeline, Watcher
from h2nav.attitude.samples import AttitudeEstimate
from h2nav.files.earth_field import earth_field_at
from h2nav.integrity.findings import Severity
from h2nav.log.recorder import Recorder
from h2nav.recordings.reference import ErrorTable, Reference
from h2nav.service.aiding import EarthFieldAt
from h2nav.service.records import EstimateRecord, HealthRecord, estimate_record
from h2nav.service.service import Service, Surroundings
from h2nav.service.settings import AutopilotSettings
from h2nav.sim.autopilot import AutopilotOptions, FakeAutopilot
from h2nav.sim.delivery import Delivery
from h2nav.sim.faults import parse_fault
from h2nav.sim.imu_model import MPU_9250, ImuParameters
from h2nav.sim.personalities import ARDUPILOT, Personality
from h2nav.sim.scenarios import Scenario, scenario
from h2nav.sim.streams import Stream
from h2nav.wire import codec
from h2nav.wire.deframer import Deframer, Frame

START_NS = 1_000_000_000_000
STEP_NS = 1_000_000
BESIDE_NS = 10_000_000  # at most between two runs of what is beside the service
UNIX_S = 1_795_000_000.0
SIMULATED = Configuration(autopilot=AutopilotSettings(simulation_truth=True))


def _on_grid(t_ns: int) -> int:
    """The first step that is not earlier."""
    return -(-t_ns // STEP_NS) * STEP_NS


@dataclass
class Seen:
    """What came out of the service, in order, with its time in seconds."""

    estimates: list[tuple[float, EstimateRecord]] = field(default_factory=list)
    notices: list[tuple[float, Severity, str]] = field(default_factory=list)
    sent: list[tuple[float, Any]] = field(default_factory=list)
    states: list[tuple[float, str]] = field(default_factory=list)


class SimulatedFlight:
    """A flight that can be run on and looked at in between.

    Args:
        flown: a scenario, or the name of one of `h2nav.sim.scenarios`.
        faults: in the form of ``h2nav fake-autopilot --fault``.
        personality: of the autopilot.
        configuration: of the daemon.
        seed: of sensors and line.
        sensor: the kind of IMU on board.
        imus: how many of them.
        extra_streams: messages of other components that the autopilot forwards.
        field_at: the field model.
        line_bytes_per_s: capacity of the autopilot's serial line; None = anything.
        recorder: the log; its times are the manual clock's.
        parameters: of the autopilot, set before it is switched on.
        logs: of the autopilot's logger, the newest last.
        has_files: it serves them by MAVLink FTP too.
        watched_by: makes the pipeline's watcher, which passes on what it gets.

    Attributes:
        beside: what is run beside the service, in every step; none is longer than `BESIDE_NS` then.
    """

    def __init__(
        self,
        flown: str | Scenario = "hover",
        *,
        faults: tuple[str, ...] = (),
        personality: Personality = ARDUPILOT,
        configuration: Configuration = SIMULATED,
        seed: int = 1,
        sensor: ImuParameters = MPU_9250,
        imus: int = 1,
        extra_streams: tuple[Stream, ...] = (),
        field_at: EarthFieldAt = earth_field_at,
        line_bytes_per_s: float | None = None,
        recorder: Recorder | None = None,
        parameters: Mapping[str, float] | None = None,
        logs: tuple[bytes, ...] = (),
        has_files: bool = True,
        watched_by: Callable[[Watcher], Watcher] = lambda itself: itself,
    ) -> None:
        options = AutopilotOptions(
            scenario(flown) if isinstance(flown, str) else flown,
            personality,
            seed,
            tuple(parse_fault(text) for text in faults),
            sensor,
            imus,
            extra_streams,
            line_bytes_per_s=line_bytes_per_s,
            parameters=parameters or {},
            logs=logs,
            has_files=has_files,
        )
        self.autopilot = FakeAutopilot(options)
        self.seen = Seen()
        self.reference = Reference()
        self.message_ids = self.reference.message_ids
        self.t_ns = START_NS
        self.bytes_received = 0
        self.bytes_sent = 0
        self._encoders: dict[tuple[int, int], codec.Encoder] = {}
        self._line = Delivery(self.autopilot.schedule, seed, START_NS)
        self._back = Deframer()
        filters = FilterFactory.shipped(configuration.filter, configuration.autopilot.imu_rate_hz)
        service = Service(configuration.service, Surroundings(filters.filter_for, field_at, UNIX_S))
        self.beside: list[Beside] = []
        outlets = Outlets(lambda t_ns: t_ns, self._hears, recorder, watched_by(self))
        self.pipeline = Pipeline(service, configuration.output.component_id, outlets)
        self.pipeline.link(self.t_ns, True)

    @property
    def t_s(self) -> float:
        """Seconds since the start."""
        return (self.t_ns - START_NS) * 1e-9

    @property
    def health(self) -> HealthRecord:
        """The service's state now."""
        return self.pipeline.service.health

    @property
    def rejected(self) -> dict[str, int]:
        """Refused samples by reason."""
        return self.pipeline.service.rejected

    def run(self, until_s: float) -> "SimulatedFlight":
        """Lets time pass until `until_s` after the start."""
        end_ns = _on_grid(START_NS + round(until_s * 1e9))
        while self.t_ns < end_ns:
            self.t_ns = min(max(self._due_ns(), self.t_ns + STEP_NS), end_ns)
            for outgoing in self.autopilot.advance(self.t_ns):
                self._line.put(outgoing.t_ns, self._encoded(outgoing))
            for data in self._line.take(self.t_ns):
                self.bytes_received += len(data)
                self.pipeline.received(self.t_ns, data)
            self.pipeline.tick(self.t_ns)
            for work in self.beside:
                self.pipeline.tend(self.t_ns, "beside", work)
            state = self.pipeline.service.state.value
            if not self.seen.states or self.seen.states[-1][1] != state:
                self.seen.states.append((self.t_s, state))
        return self

    def _due_ns(self) -> int:
        """When something happens next: until then every step would find nothing to do."""
        if "clock-rate" in self.autopilot.schedule:
            return self.t_ns
        due_ns = min(self.autopilot.next_deadline_ns, self.pipeline.next_timer_ns)
        if self.beside:
            due_ns = min(due_ns, self.t_ns + BESIDE_NS)
        arrival_ns = self._line.next_deadline_ns
        return _on_grid(due_ns if arrival_ns is None else min(due_ns, arrival_ns))

    def miss(self, until_s: float) -> "SimulatedFlight":
        """Flies until `until_s` after the start; nothing of it is heard."""
        end_ns = START_NS + round(until_s * 1e9)
        while self.t_ns < end_ns:
            self.t_ns += STEP_NS
            self.autopilot.advance(self.t_ns)
        return self

    def hold_up(self, for_s: float, kept_s: float) -> "SimulatedFlight":
        """Nothing comes for a while; then comes what was sent first, and the rest is lost."""
        start_ns = self.t_ns
        kept = b""
        while self.t_ns < start_ns + round(for_s * 1e9):
            self.t_ns += STEP_NS
            for outgoing in self.autopilot.advance(self.t_ns):
                if self.t_ns < start_ns + round(kept_s * 1e9):
                    kept += self._encoded(outgoing)
            self.pipeline.tick(self.t_ns)
        self.pipeline.received(self.t_ns, kept)
        return self

    def inject(self, message: Any, sender: tuple[int, int] = (1, 1)) -> None:
        """A message that somebody puts on the link now."""
        frame = codec.Encoder(*sender).encode(message)
        self.pipeline.received(self.t_ns, frame)

    def errors(self) -> ErrorTable:
        """Against the simulator's truth, so far."""
        return self.reference.table()

    def first(self, text: str) -> float | None:
        """When a notice that contains `text` was first given."""
        return next((t_s for t_s, _, said in self.seen.notices if text in said), None)

    def estimates_between(self, start_s: float, end_s: float) -> list[EstimateRecord]:
        """The estimates of a stretch of time."""
        return [record for t_s, record in self.seen.estimates if start_s <= t_s < end_s]

    # --- the watcher's side -------------------------------------------------------------------

    def frame(self, t_ns: int, frame: Frame) -> None:
        self.reference.frame(t_ns, frame)

    def estimate(self, t_ns: int, estimate: AttitudeEstimate, late_ns: int) -> None:
        record = estimate_record(estimate, late_ns)
        self.reference.estimate(t_ns, estimate)
        self.seen.estimates.append((self.t_s, record))

    def notice(self, t_ns: int, severity: Severity, text: str) -> None:
        self.seen.notices.append((self.t_s, severity, text))

    # --- the autopilot's side -----------------------------------------------------------------

    def _encoded(self, outgoing: Any) -> bytes:
        if isinstance(outgoing.message, bytes):
            return outgoing.message
        sender = (outgoing.sysid, outgoing.compid)
        if sender not in self._encoders:
            self._encoders[sender] = codec.Encoder(*sender)
        return self._encoders[sender].encode(outgoing.message)

    def _hears(self, data: bytes) -> None:
        self.bytes_sent += len(data)
        for frame in self._back.feed(data):
            fields = codec.decode(frame)
            self.seen.sent.append((self.t_s, fields))
            self.autopilot.on_message(self.t_ns, frame.sysid, frame.compid, frame.msg_id, fields)
