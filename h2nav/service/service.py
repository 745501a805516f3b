"""The service: what the daemon does, as a function of events, without any I/O.

Three events come in: a message at a time, a timer at a time, the link going up or down. Each
returns effects (send, record, tell) in order. Time enters only with the events. Estimates depend
on messages and their arrival times alone, never on timers, so a recording of what was received
reproduces them exactly.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.service import health, records
from h2nav.service.aiding import Aiding, EarthFieldAt, FieldOfTheEarth
from h2nav.service.autopilot import Autopilot
from h2nav.service.commands import Commands
from h2nav.service.effects import Effect, Notice, Record, Send, Severity, Used
from h2nav.service.estimation import Estimation, FilterFor
from h2nav.service.health import Signs, State
from h2nav.service.imu_messages import IMU_MESSAGES, preference
from h2nav.service.motion import motion_for, odometry_rate_hz
from h2nav.service.outputs import Outputs
from h2nav.service.parameters import Parameters
from h2nav.service.sample_clock import Verdict
from h2nav.service.settings import ServiceSettings
from h2nav.service.status_text import StatusText
from h2nav.service.stream_requests import StreamRequests
from h2nav.service.time_sync import TimeSync
from h2nav.service.units_check import UnitsCheck
from h2nav.service.wished_stream import Wish

SECOND_NS = 1_000_000_000
TIMER_NS = 100_000_000
TIMESYNC_EAGER_NS = 200_000_000
TIMESYNC_CALM_NS = 5 * SECOND_NS
FALLBACK_SYSTEM_ID = 1


class Surroundings(NamedTuple):
    """What the service needs from outside itself.

    Attributes:
        filter_for: makes the filter of a vehicle.
        field_at: the earth field at (latitude deg, longitude deg, altitude m, UNIX seconds).
        unix_s: today's date, for the field model, until the autopilot tells the time.
        unix_offset_ns: host UNIX minus host monotonic time, one constant for the run.
    """

    filter_for: FilterFor
    field_at: EarthFieldAt
    unix_s: float
    unix_offset_ns: int = 0


class Service:
    """Events in, effects out.

    Args:
        settings: what the user chose.
        surroundings: what comes from outside.
    """

    def __init__(self, settings: ServiceSettings, surroundings: Surroundings) -> None:
        self._settings = settings
        self._autopilot = Autopilot(settings.autopilot)
        self._estimation = Estimation(surroundings.filter_for, settings.autopilot.imu_message)
        self._outputs = Outputs(settings.output, odometry_rate_hz(settings))
        changeable = settings.output.allow_remote_changes
        self._commands = Commands(self._outputs, changeable)
        self._parameters = Parameters(self._outputs, changeable)
        self._aiding = Aiding(
            settings.aiding,
            FieldOfTheEarth(settings.north, surroundings.field_at, surroundings.unix_s),
            self._autopilot,
            self._estimation,
        )
        self.motion = motion_for(
            settings, self._autopilot, self._outputs, self._tell, surroundings.unix_offset_ns
        )
        self.time_sync = TimeSync()
        self._streams: StreamRequests | None = None
        self._units = UnitsCheck()
        self._status_text = StatusText()
        self._link_is_up = False
        self._state = State.NO_LINK
        self._reason = ""
        self._rivals: set[tuple[int, int]] = set()
        self._next_ns: dict[Callable[[int], list[Effect]], int] = {
            self._heartbeat: 0,
            self._ask_time: 0,
            self._ask_streams: 0,
            self._report: 0,
        }
        self._handlers: dict[int, Callable[[int, Any], list[Effect]]] = {
            **self._aiding.handlers,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_time_sync,
            mavlink.MAVLINK_MSG_ID_COMMAND_ACK: self._on_ack,
            mavlink.MAVLINK_MSG_ID_STATUSTEXT: self._on_text,
        }
        self._questions: dict[int, Callable[[Any, tuple[int, int]], list[Any]]] = {
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG: self._commands.answer,
            mavlink.MAVLINK_MSG_ID_COMMAND_INT: self._commands.answer,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: lambda _m, _a: list(
                self._parameters.every_value()
            ),
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: lambda m, _a: [self._parameters.read(m)],
            mavlink.MAVLINK_MSG_ID_PARAM_SET: lambda m, _a: [self._parameters.write(m)],
        }

    @property
    def message_ids(self) -> frozenset[int]:
        """The messages that the service understands; others need not be decoded."""
        heard = {mavlink.MAVLINK_MSG_ID_HEARTBEAT, *IMU_MESSAGES, *self._handlers}
        heard |= {*self._questions, *self.motion.message_ids}
        if self._settings.autopilot.simulation_truth:
            heard.add(mavlink.MAVLINK_MSG_ID_SIMSTATE)  # its rate is measured like any other
        return frozenset(heard)

    @property
    def system_id(self) -> int:
        """Our system id: the vehicle's."""
        identity = self._autopilot.identity
        if identity is not None:
            return identity.system_id
        return self._settings.autopilot.system_id or FALLBACK_SYSTEM_ID

    @property
    def health(self) -> records.HealthRecord:
        """The state as it is logged and shown."""
        row = self._estimation.imu_message
        return records.HealthRecord(
            state=self._state.value,
            reason=self._reason,
            autopilot=str(self._autopilot.identity or ""),
            imu_message=row.name if row else "",
            imu_rate_hz=self._imu_rate_hz() or 0.0,
            samples_used=self._estimation.used,
            samples_rejected=sum(self._estimation.rejected.values()),
            estimates_sent=self._outputs.sent,
            armed=self._autopilot.is_armed,
            independent=self._estimation.is_independent,
        )

    @property
    def rejected(self) -> dict[str, int]:
        """Samples and messages that were refused, by reason."""
        return dict(self._estimation.rejected + self.motion.rejected)

    # --- events -------------------------------------------------------------------------------

    def on_link(self, t_ns: int, is_up: bool) -> list[Effect]:
        """The link went up or down."""
        if is_up == self._link_is_up:
            return []
        self._link_is_up = is_up
        if is_up and self._streams is not None:
            self._streams.restart()
        return self._judge(t_ns)

    def on_message(
        self, t_ns: int, sender: tuple[int, int], message_id: int, fields: Any
    ) -> list[Effect]:
        """A message arrived.

        Args:
            t_ns: host monotonic time of its arrival.
            sender: system and component id.
            message_id: of the message; those outside `message_ids` are ignored.
            fields: its fields under the dialect's names.
        """
        if message_id == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            return self._on_heartbeat(t_ns, sender, fields)
        question = self._questions.get(message_id)
        if question is not None:
            return self._on_question(question, fields, sender)
        owned = self._autopilot.owns(*sender)
        if owned and self._streams is not None:
            self._streams.arrived(message_id)
        if message_id in self.motion.message_ids:
            return self.motion.on_message(t_ns, sender, message_id, fields)
        if not owned:
            if message_id in IMU_MESSAGES:
                bound = self._autopilot.identity is not None
                self._estimation.rejected["other_sender" if bound else "before_binding"] += 1
            return []
        if message_id in IMU_MESSAGES:
            return self._on_imu(t_ns, message_id, fields)
        handler = self._handlers.get(message_id)
        return handler(t_ns, fields) if handler else []

    def on_timer(self, t_ns: int) -> list[Effect]:
        """Time passed: heartbeats, requests, reports that are due. Call it at `next_timer_ns`."""
        effects = self._judge(t_ns)
        for job, due_ns in self._next_ns.items():
            if t_ns >= due_ns:
                effects += job(t_ns)
        text = self._status_text.due(t_ns) if self._link_is_up else None
        if text is not None:
            effects.append(self._send(text))
        return effects

    def next_timer_ns(self, t_ns: int) -> int:
        """When to call `on_timer` next, at the latest."""
        return min(t_ns + TIMER_NS, *self._next_ns.values())

    # --- what the autopilot says --------------------------------------------------------------

    def _on_heartbeat(self, t_ns: int, sender: tuple[int, int], fields: Any) -> list[Effect]:
        effects: list[Effect] = []
        if self._autopilot.hears_heartbeat(t_ns, *sender, fields):
            identity = self._autopilot.identity
            assert identity is not None
            self._estimation.begin(identity)
            self.motion.restart()
            self._streams = StreamRequests(
                self._wishes(identity.autopilot),
                identity.autopilot,
                self._settings.autopilot.request_streams,
            )
            effects += self._tell(t_ns, Severity.INFO, f"bound to {identity.description}")
        if self._streams is not None and self._autopilot.owns(*sender):
            self._streams.heard(t_ns)
        for rival in self._autopilot.rivals - self._rivals:
            self._rivals.add(rival)
            text = f"another autopilot {rival[0]}/{rival[1]} on this link"
            effects += self._tell(t_ns, Severity.WARNING, text)
        return effects + self._aiding.tell_vehicle(t_ns)

    def _on_imu(self, t_ns: int, message_id: int, fields: Any) -> list[Effect]:
        outcome = self._estimation.take(t_ns, message_id, fields)
        effects: list[Effect] = []
        if outcome.event is not None:
            effects += self._on_new_epoch(t_ns, outcome.event)
        sample, estimate = outcome.sample, outcome.estimate
        if sample is None:
            return effects
        # The attitude leaves before anything is written down.
        if estimate is not None:
            effects += [self._send(message) for message in self._outputs.due(estimate)]
        effects += self.motion.on_sample(t_ns, sample, estimate)
        effects.append(Used(sample, estimate))
        if self._autopilot.on_ground and self._units.add(sample):
            for complaint in self._units.report.complaints:
                effects += self._tell(t_ns, Severity.ERROR, complaint)
        if self._state is not State.ACTIVE:
            effects += self._judge(t_ns)
        return effects

    def _on_new_epoch(self, t_ns: int, event: Verdict) -> list[Effect]:
        self.time_sync.restart()
        self.motion.restart()
        self._outputs.forget()
        if self._streams is not None:
            self._streams.restart()
        rebooted = event is Verdict.REBOOT
        text = "autopilot rebooted" if rebooted else "autopilot clock changed"
        return self._tell(t_ns, Severity.WARNING, text)

    def _on_time_sync(self, t_ns: int, fields: Any) -> list[Effect]:
        if fields.tc1 == 0:
            if not self.time_sync.is_locked:
                return []
            return [self._send(mavlink.MAVLink_timesync_message(t_ns, fields.ts1))]
        exchange = self.time_sync.answer(t_ns, fields.tc1, fields.ts1)
        if exchange is None:
            return []
        record = records.TimeSyncRecord(
            offset_us=exchange.offset_ns * 1e-3,
            skew_ppm=self.time_sync.skew * 1e6,
            round_trip_us=exchange.round_trip_ns * 1e-3,
            host_us=exchange.host_ns // 1000,
        )
        return [Record("/time_sync", record)]

    def _on_ack(self, t_ns: int, fields: Any) -> list[Effect]:
        ours = (self.system_id, self._settings.output.component_id)
        addressed = (fields.target_system, fields.target_component)
        is_interval = fields.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        if self._streams is not None and is_interval and addressed in (ours, (0, 0)):
            self._streams.acknowledged(t_ns, fields.result)
        return []

    def _on_text(self, _t_ns: int, fields: Any) -> list[Effect]:
        if self._streams is not None:
            self._streams.said(fields.text)
        return []

    def _on_question(
        self,
        question: Callable[[Any, tuple[int, int]], list[Any]],
        fields: Any,
        sender: tuple[int, int],
    ) -> list[Effect]:
        ours = (self.system_id, self._settings.output.component_id)
        if (fields.target_system, fields.target_component) != ours:
            return []
        return [self._send(message) for message in question(fields, sender) if message is not None]

    # --- what happens by the clock ------------------------------------------------------------

    def _heartbeat(self, t_ns: int) -> list[Effect]:
        self._next_ns[self._heartbeat] = t_ns + SECOND_NS
        if not self._link_is_up:
            return []
        message = mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
            mavlink.MAV_AUTOPILOT_INVALID,
            0,
            0,
            health.SYSTEM_STATUS[self._state],
            3,
        )
        return [self._send(message)]

    def _ask_time(self, t_ns: int) -> list[Effect]:
        pause_ns = TIMESYNC_CALM_NS if self.time_sync.is_locked else TIMESYNC_EAGER_NS
        self._next_ns[self._ask_time] = t_ns + pause_ns
        if self._autopilot.identity is None or not self._link_is_up:
            return []
        return [self._send(mavlink.MAVLink_timesync_message(0, self.time_sync.request(t_ns)))]

    def _ask_streams(self, t_ns: int) -> list[Effect]:
        self._next_ns[self._ask_streams] = t_ns + TIMER_NS
        identity = self._autopilot.identity
        if identity is None or self._streams is None or not self._link_is_up:
            return []
        self._streams.measure(t_ns)
        if not self._settings.autopilot.request_streams:
            return []
        request = self._streams.next_request(t_ns, (identity.system_id, identity.component_id))
        return [] if request is None else [self._send(request)]

    def _report(self, t_ns: int) -> list[Effect]:
        self._next_ns[self._report] = t_ns + SECOND_NS
        effects: list[Effect] = [Record("/health", self.health)]
        for reason, count in self.rejected.items():
            effects.append(Record("/rejected", records.RejectionRecord(reason, count)))
        for notice in self._streams.notices() if self._streams else ():
            effects += self._tell(t_ns, notice.severity, notice.text)
        return effects

    # --- the rest -----------------------------------------------------------------------------

    def _wishes(self, autopilot: int) -> tuple[Wish, ...]:
        """The streams to ask this autopilot for, the most important first."""
        wanted = self._settings
        first, *others = preference(autopilot, wanted.autopilot.imu_message)
        wishes = [Wish(first, wanted.autopilot.imu_rate_hz, tuple(others))]
        if wanted.aiding.gps_velocity or wanted.north.declination != "none":
            wishes.append(Wish(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT, 5.0))
        wishes.append(Wish(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE, 1.0))
        wishes.append(Wish(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, 1.0))
        if wanted.aiding.airspeed:
            wishes.append(Wish(mavlink.MAVLINK_MSG_ID_VFR_HUD, 4.0))
        if wanted.autopilot.simulation_truth:
            truth = mavlink.MAVLINK_MSG_ID_SIMSTATE
            wishes.append(Wish(truth, wanted.autopilot.imu_rate_hz))
        if wanted.aiding.autopilot_velocity:
            wishes.append(Wish(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, 10.0))
        return (*wishes, *self.motion.wishes)

    def _imu_rate_hz(self) -> float | None:
        row = self._estimation.imu_message
        return self._streams.measured_hz(row.message_id) if row and self._streams else None

    def _granted_rate_hz(self) -> float | None:
        row = self._estimation.imu_message
        return self._streams.granted_hz(row.message_id) if row and self._streams else None

    def _judge(self, t_ns: int) -> list[Effect]:
        """Looks at the state; a change is told once."""
        signs = Signs(
            link_is_up=self._link_is_up,
            autopilot_known=self._autopilot.identity is not None
            and not self._autopilot.is_lost(t_ns),
            last_sample_ns=self._estimation.last_used_ns,
            last_gap_ns=self._estimation.last_gap_ns,
            has_estimate=self._estimation.has_estimate,
            complaint="; ".join((*self._units.report.complaints, *self._estimation.complaints)),
            rate_hz=self._imu_rate_hz(),
            granted_rate_hz=self._granted_rate_hz(),
        )
        state, reason = health.judge(signs, t_ns)
        if (state, reason) == (self._state, self._reason):
            return []
        changed, self._state, self._reason = state is not self._state, state, reason
        if not changed:
            return []
        if state not in (State.ACTIVE, State.DEGRADED):
            self._outputs.forget()
        good = state in (State.ACTIVE, State.ALIGNING)
        text = f"{state.value}: {reason}" if reason else state.value
        told = self._tell(t_ns, Severity.INFO if good else Severity.WARNING, text)
        return [*told, Record("/health", self.health)]

    def _tell(self, t_ns: int, severity: Severity, text: str) -> list[Effect]:
        if self._settings.output.status_text:
            self._status_text.say(t_ns, severity, text)
        return [Notice(severity, text)]

    def _send(self, message: Any) -> Send:
        return Send(message, self.system_id)
