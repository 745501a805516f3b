"""The service: the daemon's behaviour as a function of events, without I/O.

Events come in: a message at a time, a timer at a time, the link going up or down. Each returns
effects (send, record, report) in order. Time enters only with the events. Estimates depend on
messages and their arrival times alone, never on timers, so that a recording of the received bytes
reproduces them exactly.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import ImuSample
from h2nav.integrity.findings import Finding, Severity
from h2nav.integrity.preflight import GroundVerdict
from h2nav.maths.units import SECOND_NS
from h2nav.service import records
from h2nav.service.aiding import Aiding, EarthFieldAt, FieldOfTheEarth
from h2nav.service.autopilot import Autopilot, Heard, Identity, Sender
from h2nav.service.before_arming import BeforeArming, reasons_in
from h2nav.service.clocks import Clocks
from h2nav.service.comparing import Comparing
from h2nav.service.conversation import Conversation
from h2nav.service.effects import Effect, Notice, Record, Send, Used
from h2nav.service.estimation import Estimation, SentSample
from h2nav.service.ground_stations import GroundStations
from h2nav.service.health import Objection, ServiceState, Signs
from h2nav.service.judgement import Judgement
from h2nav.service.lane import FilterFor
from h2nav.service.motion import motion_for, odometry_rate_hz
from h2nav.service.notices import Notices
from h2nav.service.outputs import Assessment, Outputs
from h2nav.service.pulse import Pulse
from h2nav.service.routing import Routing
from h2nav.service.sample_clock import TimeVerdict
from h2nav.service.settings import ServiceSettings
from h2nav.service.standing import Standing
from h2nav.service.status import status_record
from h2nav.service.units_check import UnitsCheck
from h2nav.service.wanted import Wanted
from h2nav.wire import outbound
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.imu import IMU_MESSAGES, ImuReading
from h2nav.wire.motion import PoseReading, WheelDistances
from h2nav.wire.outbound import OutMessage
from h2nav.wire.position import (
    EstimatedVelocity,
    GnssLevels,
    GnssState,
    GnssTime,
    GpsFix,
    NoFix,
    Origin,
    OtherFix,
    Place,
)
from h2nav.wire.questions import (
    Command,
    ParameterList,
    ParameterRead,
    ParameterWrite,
    Question,
)
from h2nav.wire.readers import MOTION_READERS, READERS, Envelope, Message
from h2nav.wire.vehicle import (
    Airspeed,
    CommandAck,
    Heartbeat,
    LandedState,
    ParameterValue,
    StatusText,
    SystemTime,
    TimeSyncMessage,
    Vibration,
)

TIMER_NS = SECOND_NS // 10
TIMESYNC_EAGER_NS = SECOND_NS // 5
FALLBACK_SYSTEM_ID = 1
MOTION_MESSAGES = (PoseReading, WheelDistances)
QUESTIONS = (Command, ParameterList, ParameterRead, ParameterWrite)
# MAV_STATE of our heartbeat.
SYSTEM_STATUS = {
    ServiceState.NO_LINK: mavlink.MAV_STATE_BOOT,
    ServiceState.NO_AUTOPILOT: mavlink.MAV_STATE_BOOT,
    ServiceState.NO_IMU: mavlink.MAV_STATE_STANDBY,
    ServiceState.ALIGNING: mavlink.MAV_STATE_STANDBY,
    ServiceState.DEGRADED: mavlink.MAV_STATE_CRITICAL,
    ServiceState.ACTIVE: mavlink.MAV_STATE_ACTIVE,
}
SILENT_IMU = Objection("silent", "no IMU messages arrive")
DENIED_IMU = Objection("denied", "the autopilot denies every IMU message")


class Surroundings(NamedTuple):
    """What the service needs from outside."""

    filter_for: FilterFor  # creates the filter of a vehicle
    # the earth field at (latitude deg, longitude deg, altitude m, UNIX seconds)
    field_at: EarthFieldAt
    unix_s: float  # today's date, for the field model, until the autopilot sends the time
    unix_offset_ns: int = 0  # host UNIX minus host monotonic time, one constant for the run
    has_listener: bool = True  # outgoing messages are sent; not so in a replay


@dataclass(slots=True)
class Job:
    """Periodic work."""

    run: Callable[[int], list[Effect]]  # does it; returns its effects
    pause_ns: Callable[[], int]  # until the next time
    due_ns: int = 0  # the next time

    def effects(self, t_ns: int) -> list[Effect]:
        """Does it, when it is due."""
        self.due_ns = t_ns + self.pause_ns()
        return self.run(t_ns)


class Service:
    """Processes events and returns effects."""

    def __init__(self, settings: ServiceSettings, surroundings: Surroundings) -> None:
        self._settings = settings
        self._autopilot = Autopilot(settings.autopilot, settings.output.component_id)
        self._notices = Notices(settings.output.status_text)
        self._before_arming = BeforeArming(self._notices.report, self._reasons_not_to_arm)
        self._told_opinion = 0
        self._estimation = Estimation(
            surroundings.filter_for, settings.autopilot, self._before_arming
        )
        self._outputs = Outputs(
            settings.output,
            odometry_rate_hz(settings),
            assess=self._assessment,
            has_listener=surroundings.has_listener,
        )
        self._comparing = Comparing()
        self._aiding = Aiding(
            settings.aiding,
            FieldOfTheEarth(settings.north, surroundings.field_at, surroundings.unix_s),
            self._autopilot,
            self._estimation,
            self._comparing.witness,
        )
        self._judgement = Judgement(
            self._notices.report, self._estimation, self._comparing.witness, self._aiding
        )
        self.motion = motion_for(
            settings,
            self._autopilot,
            self._outputs,
            self._notices.report,
            surroundings.unix_offset_ns,
        )
        self._clocks = Clocks()
        self._lateness, self.time_sync = self._clocks.lateness, self._clocks.time_sync
        self._conversation = Conversation(settings.output, self._outputs, self.time_sync)
        self._wanted = Wanted(settings, self.motion.wanted_streams)
        self._routing = Routing(
            self._autopilot, self._wanted, self._estimation, self._comparing, self._aiding
        )
        # For every message: counts it, and tells whether it has to be read.
        self.on_arrival = self._routing.on_arrival
        self._units = UnitsCheck()
        self._link_error: str | None = ""
        self._bytes_are_junk = False
        self._link_trouble = ""
        self._dependence_is_reported = False
        self._pulse = Pulse()
        self._standing = Standing(self._notices)
        self._stations = GroundStations()
        self._refused: Counter[str] = Counter()  # messages other than samples, and our own faults
        self._jobs = (
            Job(self._heartbeat, lambda: SECOND_NS),
            Job(self._ask_time, lambda: TIMESYNC_EAGER_NS),
            Job(self._ask_streams, lambda: TIMER_NS),
            Job(self._ask_parameter, lambda: SECOND_NS),
            Job(self._report, lambda: SECOND_NS),
        )

    @property
    def message_ids(self) -> frozenset[int]:
        """The messages that the service uses; others need not be decoded."""
        heard = set(READERS.keys() - MOTION_READERS.keys()) | self.motion.message_ids
        if not self._settings.aiding.autopilot_velocity:
            heard.remove(mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED)
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
    def bound_to(self) -> str:
        """The autopilot for people; empty before there is one."""
        identity = self._autopilot.identity
        return identity.description if identity is not None else ""

    @property
    def identity(self) -> Identity | None:
        """The bound autopilot; None before there is one."""
        return self._autopilot.identity

    @property
    def is_armed(self) -> bool:
        """Whether the autopilot says armed; False before there is one."""
        return self._autopilot.is_armed

    @property
    def state(self) -> ServiceState:
        """How it judges itself, alone; the record of its health costs more."""
        return self._standing.verdict.state

    @property
    def health(self) -> records.HealthRecord:
        """The state as logged and displayed."""
        row = self._estimation.imu_message
        difference = self._comparing.witness.latest
        return records.HealthRecord(
            state=self.state.value,
            reason=self._standing.verdict.reason,
            cause=self._standing.verdict.cause,
            autopilot=str(self._autopilot.identity or ""),
            imu_message=row.name if row else "",
            imu_rate_hz=self._imu_rate_hz() or 0.0,
            samples_used=self._estimation.used,
            samples_rejected=sum(self._estimation.rejected.values()),
            estimates_sent=self._outputs.sent,
            armed=self._autopilot.is_armed,
            independent=self._estimation.is_independent,
            late_ms=self._lateness.late_ns * 1e-6,
            autopilot_tilt_deg=difference and math.degrees(difference.tilt_rad),
            autopilot_heading_deg=difference and math.degrees(difference.heading_rad),
        )

    def status(self, t_ns: int) -> records.StatusRecord:
        """The present status for displays."""
        return status_record(
            t_ns,
            self._standing.verdict,
            self.bound_to,
            self._pulse.sample_ns,
            self._comparing.latest(t_ns),
            self._assessment(),
        )._replace(open_findings=" ".join(finding.id for finding in self._judgement.open))

    @property
    def before_arming(self) -> GroundVerdict:
        """Faults on the ground, and the checks made; nothing while armed."""
        return self._before_arming.verdict

    @property
    def reasons_not_to_arm(self) -> tuple[str, ...]:
        """The whole opinion before arming, for people; nothing while armed."""
        return self._before_arming.reasons

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings so far."""
        return self._judgement.findings

    @property
    def open_findings(self) -> tuple[Finding, ...]:
        """The open findings."""
        return self._judgement.open

    @property
    def state_s(self) -> dict[str, float]:
        """How long each state has lasted so far, s."""
        return {name: lasted_ns * 1e-9 for name, lasted_ns in self._standing.lasted_ns.items()}

    @property
    def rejected(self) -> dict[str, int]:
        """Rejected samples and messages, by reason."""
        counts = self._estimation.rejected + self.motion.rejected + self._conversation.rejected
        return dict(counts + self._refused)

    def is_progressing(self, t_ns: int) -> bool:
        """False when the program seems to hang."""
        return self._link_error is not None or self._pulse.is_progressing(t_ns)

    # --- events -------------------------------------------------------------------------------

    def on_link(self, t_ns: int, is_up: bool, error: str = "") -> list[Effect]:
        """Takes the state of the link.

        Args:
            is_up: bytes can arrive.
            error: the latest error of the link; empty before the first.
        """
        link_error = None if is_up else error
        effects: list[Effect] = []
        if is_up and self._link_error is None and error != self._link_trouble:
            effects += self._notices.report(t_ns, Severity.WARNING, error)
        self._link_trouble = error
        if link_error == self._link_error:
            return effects
        came_up = is_up and self._link_error is not None
        self._link_error = link_error
        if came_up:
            self._wanted.on_link_up()
        return effects + self._judge(t_ns)

    def speaks_for_vehicle(self, envelope: Envelope, message: Message | None) -> bool:
        """Whether a message proves that its sender is, or may become, the bound autopilot.

        Args:
            message: its content, if it was decoded.
        """
        if self._autopilot.owns(envelope.sender):
            return True
        is_autopilot = isinstance(message, Heartbeat) and message.is_of_autopilot
        may_bind = self._autopilot.may_be_replaced(envelope.t_ns)
        return is_autopilot and may_bind and self._autopilot.accepts(envelope.sender)

    def on_message(self, envelope: Envelope, message: Message) -> list[Effect]:
        """Takes a message for which `on_arrival` has just returned True."""
        if isinstance(message, ImuReading):
            return self.on_imu(envelope, message)
        if isinstance(message, Heartbeat):
            return self._on_heartbeat(envelope, message)
        if isinstance(message, MOTION_MESSAGES):
            return self.motion.on_message(envelope, message)
        if isinstance(message, QUESTIONS):
            if self._asks_about_arming(envelope.sender, message):
                return [self._send(self._before_arming.authorization(envelope.sender))]
            return self._send_all(self._conversation.on_question(envelope, message, self._ours))
        owned = self._autopilot.owns(envelope.sender)
        if isinstance(message, TimeSyncMessage):
            return self._on_time_sync(envelope, message, owned)
        if owned:
            self._before_arming.on_message(message)
        if not owned:
            return []
        if isinstance(message, ReportedAttitude):
            by_compass_rad = self._estimation.error_by_compass_rad
            return self._comparing.on_report(envelope.t_ns, message, by_compass_rad)
        return self._on_vehicle_message(envelope.t_ns, message)

    def _asks_about_arming(self, sender: Sender, question: Question) -> bool:
        """Whether the bound autopilot requests an authorization, and the user enabled it."""
        if not self._settings.output.arming_opinion or not isinstance(question, Command):
            return False
        if question.command != mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST:
            return False
        system, component = self._ours
        is_for_us = question.target[0] in (0, system) and question.target[1] in (0, component)
        return is_for_us and self._autopilot.owns(sender)

    def on_refusal(self, envelope: Envelope, reason: str) -> list[Effect]:
        """Takes the rejection of a needed message at the wire boundary."""
        if envelope.message_id in self.motion.message_ids:
            return self.motion.on_refusal(envelope, reason)
        if self._autopilot.owns(envelope.sender):
            if envelope.message_id in IMU_MESSAGES:
                self._estimation.refuse(envelope.t_ns, envelope.message_id, reason)
            else:
                self._refused[reason] += 1
        return []

    def on_note(self, t_ns: int, said: Notice) -> list[Effect]:
        """Takes an event from outside the service, such as trouble with the log."""
        return self._notices.report(t_ns, said.severity, said.text, said.cause)

    def on_fault(self, t_ns: int, where: str, what: str) -> list[Effect]:
        """Counts and reports an exception of a handler; the daemon continues.

        Args:
            where: the message, or ``timer`` or ``link``.
            what: the error, in one line.
        """
        reason = f"handler_error:{where}"
        self._refused[reason] += 1
        text = f"fault in h2nav at {where}: {what}; please report it"
        return self._notices.report(t_ns, Severity.ERROR, text, reason)

    def on_stall(self, t_ns: int, length_ns: int) -> list[Effect]:
        """Notes a stall of the program: silence meanwhile says nothing about others."""
        self._pulse.stalled(t_ns, length_ns)
        return self._judge(t_ns)

    def on_bytes(self, t_ns: int, are_junk: bool) -> list[Effect]:
        """Notes that bytes arrive without MAVLink, or with MAVLink again."""
        self._bytes_are_junk = are_junk
        return self._judge(t_ns)

    def on_timer(self, t_ns: int) -> list[Effect]:
        """Does what is due: heartbeats, requests, reports. Called at `next_timer_ns`."""
        effects = self._judge(t_ns)
        for job in self._jobs:
            if t_ns >= job.due_ns:
                effects += job.effects(t_ns)
        if self._link_error is None:
            effects += [self._send(text) for text in self._notices.status_texts(t_ns)]
        return effects

    def next_timer_ns(self, t_ns: int) -> int:
        """The latest time for the next call of `on_timer`."""
        return min([t_ns + TIMER_NS, *[job.due_ns for job in self._jobs]])

    # --- what the autopilot says --------------------------------------------------------------

    def _on_heartbeat(self, envelope: Envelope, message: Heartbeat) -> list[Effect]:
        t_ns, now_ns, sender, _ = envelope
        effects: list[Effect] = []
        heard = self._autopilot.take_heartbeat(t_ns, sender, message)
        if self._autopilot.owns(sender):
            self._pulse.heartbeat(now_ns)
            self._before_arming.armed(self._autopilot.is_armed)
        if heard is Heard.BOUND:
            effects += self._on_binding(t_ns)
        elif heard is Heard.RIVAL:
            text = f"another autopilot {sender[0]}/{sender[1]} on this link"
            effects += self._notices.report(t_ns, Severity.WARNING, text, "rival")
        if self._autopilot.owns(sender):
            self._wanted.on_heartbeat(t_ns)
        if message.is_of_ground_station and self._stations.is_newcomer(t_ns, sender):
            self._notices.remind(self._what_is_wrong())
        return effects + self._aiding.pass_vehicle(t_ns)

    def _what_is_wrong(self) -> list[tuple[Severity, str]]:
        """For a new ground station: the state, and the worst of the rest."""
        rest = [alarm for alarm in self._judgement.alarms if not alarm.degrades]
        texts = [(alarm.severity, alarm.notice) for alarm in sorted(rest, key=lambda a: a.severity)]
        return [*self._standing.complaint, *texts]

    def _on_binding(self, t_ns: int) -> list[Effect]:
        identity = self._autopilot.identity
        assert identity is not None
        self._pulse.bound(t_ns)
        self._estimation.begin(identity)
        self._start_over()
        self._units = UnitsCheck()
        self._wanted.on_binding(identity, self._estimation.timing.parameter)
        self._routing.on_binding(identity)
        # What was found of the former one ends now: this one's messages may never come.
        ended = self._judgement.look(t_ns, at_once=True) if self._judgement.alarms else []
        bound = self._notices.report(t_ns, Severity.INFO, f"bound to {identity.description}")
        return [*ended, *bound, self._delays_record()]

    def on_imu(self, envelope: Envelope, reading: ImuReading) -> list[Effect]:
        """Takes an IMU message for which `on_arrival` has just returned True."""
        t_ns, now_ns, _, message_id = envelope
        sent = self._estimation.take(t_ns, message_id, reading)
        _, _, _, event, switched, is_accused = sent
        effects: list[Effect] = []
        if is_accused or t_ns >= self._judgement.due_ns:
            effects += self._judgement.look(t_ns, at_once=is_accused)
        if t_ns >= self._before_arming.due_ns and not self._before_arming.is_armed:
            effects += self._before_arming.look(t_ns)
        if self._settings.output.arming_opinion:
            effects += self._tell_opinion(only_if_new=True)
        if event is not None:
            effects += self._on_new_epoch(t_ns, event)
        if switched:
            effects += self._notices.report(t_ns, Severity.WARNING, switched)
        if is_accused:
            effects += self._judge(now_ns)
        if sent.sample is not None:
            self._on_sent(t_ns, now_ns, sent, sent.sample, effects)
        return effects

    def _on_sent(
        self, t_ns: int, now_ns: int, sent: SentSample, sample: ImuSample, effects: list[Effect]
    ) -> None:
        """Adds the effects of a sample of the lane that is sent."""
        estimate, lateness = sent.estimate, self._lateness
        lateness.seen(t_ns, now_ns, sample.t_us)
        is_late = lateness.is_late
        if is_late is not self._outputs.are_held:
            self._outputs.hold(is_late)
        self._pulse.sample(now_ns, is_fresh=not is_late)
        # The attitude leaves before anything is logged.
        if estimate is not None:
            for message in self._outputs.due(estimate):
                effects.append(self._send(message))
        # Rates and forces are late, and computations with them need the attitude of their time.
        if self.motion.is_estimated:
            effects += self.motion.on_sample(t_ns, sample, sent.filtered)
        effects.append(tuple.__new__(Used, (sample, estimate, lateness.late_ns)))
        effects += self._comparing.on_sample(sample, estimate)
        if not self._units.is_over:
            effects += self._check_units(t_ns, sample)
        if not self._standing.is_active:
            effects += self._judge(now_ns)

    def _assessment(self) -> Assessment:
        return Assessment(
            self._estimation.ratios,
            self._judgement.alarms,
            self._comparing.witness.latest,
            self._before_arming.verdict,
        )

    def _check_units(self, t_ns: int, sample: ImuSample) -> list[Effect]:
        """Checks at rest on the ground; a complaint is followed up in any place."""
        effects: list[Effect] = []
        complained = bool(self._units.complaints)
        if (self._autopilot.on_ground or complained) and self._units.add(sample):
            for quantity, text in self._units.complaints:
                effects += self._notices.report(t_ns, Severity.ERROR, text, f"units {quantity}")
        return effects

    def _on_new_epoch(self, t_ns: int, event: TimeVerdict) -> list[Effect]:
        self._start_over()
        self._wanted.on_new_epoch()
        rebooted = event is TimeVerdict.REBOOT
        text = "autopilot rebooted" if rebooted else "autopilot clock changed"
        return self._notices.report(t_ns, Severity.WARNING, text)

    def _start_over(self) -> None:
        """Forgets what refers to the clock of another autopilot, or to this one's former clock."""
        self._before_arming.restart()
        self._clocks.restart()
        self.motion.restart()
        self._comparing.witness.restart()
        self._aiding.gnss.restart()
        self._outputs.forget()

    def _on_vehicle_message(self, t_ns: int, message: Message) -> list[Effect]:
        """Takes a report of the bound autopilot on itself and its vehicle."""
        aiding = self._aiding
        match message:
            case GpsFix() | NoFix() | OtherFix() | GnssState() | GnssLevels() | GnssTime():
                return aiding.on_receiver(t_ns, message)
            case Place():
                return aiding.on_place(t_ns, message)
            case Origin():
                return aiding.on_origin(t_ns, message)
            case Airspeed():
                return aiding.on_airspeed(t_ns, message)
            case LandedState():
                return aiding.on_landed_state(t_ns, message)
            case SystemTime():
                return aiding.on_system_time(message)
            case EstimatedVelocity():
                return aiding.on_autopilot_velocity(t_ns, message)
            case CommandAck():
                self._wanted.on_ack(t_ns, message, self._ours)
            case StatusText():
                self._wanted.on_text(message)
            case ParameterValue():
                return self._on_parameter(t_ns, message)
            case Vibration():
                self._estimation.use_vibration(t_ns, message)
        return []

    def _on_parameter(self, t_ns: int, parameter: ParameterValue) -> list[Effect]:
        self._wanted.on_parameter(parameter)
        self._before_arming.on_message(parameter)
        if not self._estimation.take_parameter(parameter):
            return []
        late_ms = 1e3 * (self._estimation.timing.ages().rates_s or 0.0)
        text = f"{parameter.name} {parameter.value:g} Hz: rates {late_ms:.1f} ms late"
        reported = self._notices.report(t_ns, Severity.INFO, text, parameter.name)
        return [*reported, self._delays_record()]

    def _delays_record(self) -> Record:
        rates_s, field_s = self._estimation.timing.ages()
        record = records.AidingRecord("delays", gyro_delay_s=rates_s, field_delay_s=field_s)
        return Record("/aiding", record)

    def _on_time_sync(
        self, envelope: Envelope, message: TimeSyncMessage, owned: bool
    ) -> list[Effect]:
        if message.target not in (self._ours, (0, 0)):
            return []
        if message.tc1_ns == 0:
            answer = self._conversation.on_time_question(envelope, message)
            return [] if answer is None else [self._send(answer)]
        if not owned:
            return []
        return self._clocks.on_answer(envelope.t_ns, message)

    # --- what happens by the clock ------------------------------------------------------------

    def _heartbeat(self, _t_ns: int) -> list[Effect]:
        if self._link_error is not None:
            return []
        messages = [outbound.heartbeat(SYSTEM_STATUS[self.state])]
        return [*self._send_all(messages), *self._tell_opinion()]

    def _tell_opinion(self, *, only_if_new: bool = False) -> list[Effect]:
        """The opinion on arming for ArduPilot: every second, and at once when it changes."""
        if not self._settings.output.arming_opinion:
            return []
        opinion = self._before_arming.opinion
        if only_if_new and opinion == self._told_opinion:
            return []
        self._told_opinion = opinion
        return self._send_all(self._before_arming.messages)

    def _reasons_not_to_arm(self, named: frozenset[str]) -> tuple[str, ...]:
        found = reasons_in(self._standing.verdict, self._judgement.alarms, named)
        return (*found, *self._estimation.lost_imus(self._wanted.may_come))

    def _ask_time(self, t_ns: int) -> list[Effect]:
        identity = self._autopilot.identity
        if identity is None or self._link_error is not None or not self._pulse.is_heard(t_ns):
            return []
        question = self._clocks.next_question(t_ns, identity.address)
        return [] if question is None else [self._send(question)]

    def _ask_streams(self, t_ns: int) -> list[Effect]:
        identity = self._autopilot.identity
        if identity is None or self._link_error is not None:
            return []
        useless = self._estimation.useless_streams()
        request = self._wanted.next_stream(t_ns, identity.address, useless)
        return [] if request is None else [self._send(request)]

    def _ask_parameter(self, t_ns: int) -> list[Effect]:
        identity = self._autopilot.identity
        if identity is None or self._link_error is not None:
            return []
        if not (self._autopilot.is_confirmed and self._pulse.is_heard(t_ns)):
            return []
        request = self._wanted.next_parameter(t_ns, identity.address)
        return [] if request is None else [self._send(request)]

    def _report(self, t_ns: int) -> list[Effect]:
        effects: list[Effect] = [
            Record("/health", self.health),
            Record("/ratios", self._estimation.ratios),
        ]
        effects += [Record("/lanes", record) for record in self._estimation.lane_records()]
        for reason, count in self.rejected.items():
            effects.append(Record("/rejected", records.RejectionRecord(reason, count)))
        for notice in self._wanted.notices():
            effects += self._notices.report(t_ns, notice.severity, notice.text)
        return effects + self._report_dependence(t_ns)

    # --- the rest -----------------------------------------------------------------------------

    @property
    def _ours(self) -> Sender:
        return self.system_id, self._settings.output.component_id

    def _imu_rate_hz(self) -> float | None:
        row = self._estimation.imu_message
        return self._wanted.measured_hz(row.message_id) if row else None

    def _granted_rate_hz(self) -> float | None:
        row = self._estimation.imu_message
        return self._wanted.granted_hz(row.message_id) if row else None

    def _why_no_imu(self, t_ns: int) -> Objection:
        found = self._estimation.why_no_samples(t_ns)
        if found is not None:
            return found
        return DENIED_IMU if self._wanted.imu_is_denied else SILENT_IMU

    def _signs(self, t_ns: int) -> Signs:
        units = [Objection(f"units {what}", text) for what, text in self._units.complaints]
        return Signs(
            link_error=self._link_error,
            stall_ns=self._pulse.stall_ns(t_ns),
            bytes_are_junk=self._bytes_are_junk,
            autopilot_known=self._pulse.is_heard(t_ns),
            last_sample_ns=self._pulse.sample_ns,
            last_gap_ns=self._pulse.sample_gap_ns,
            no_imu=lambda: self._why_no_imu(t_ns),
            has_estimate=self._estimation.has_estimate,
            late_ns=self._lateness.late_ns if self._lateness.is_lasting(t_ns) else 0,
            objections=(
                *units,
                *self._estimation.objections(t_ns),
                *self._judgement.objections,
            ),
            rate_hz=self._imu_rate_hz(),
            granted_rate_hz=self._granted_rate_hz(),
        )

    def _judge(self, t_ns: int) -> list[Effect]:
        """Judges the state; a change of it, or of its cause, is logged and reported."""
        has_changed = self._standing.judge(t_ns, self._signs(t_ns))
        reported = self._standing.report(t_ns, is_starting=self._pulse.is_starting(t_ns))
        if not has_changed:
            return reported
        if self.state not in (ServiceState.ACTIVE, ServiceState.DEGRADED):
            self._outputs.forget()
        return [*reported, Record("/health", self.health)]

    def _report_dependence(self, t_ns: int) -> list[Effect]:
        if self._dependence_is_reported or self._estimation.is_independent:
            return []
        self._dependence_is_reported = True
        source = self._estimation.dependent_source
        text = f"not independent: {source} holds the autopilot's own estimate"
        return self._notices.report(t_ns, Severity.NOTICE, text)

    def _send(self, message: OutMessage) -> Send:
        return Send(message, self.system_id)

    def _send_all(self, messages: Iterable[OutMessage]) -> list[Effect]:
        return [self._send(message) for message in messages]
