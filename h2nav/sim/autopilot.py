"""The fake autopilot: a vehicle on a scenario that speaks MAVLink like ArduPilot or PX4.

It does no I/O and has no clock: it takes messages and host times and returns messages with their
times. Equal options and equal input at equal times give equal output.
"""

import math
import sys
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.sim.calibrations import SOUND, Miscalibration
from h2nav.sim.commands import CommandServer
from h2nav.sim.faults import Fault, FaultSchedule
from h2nav.sim.imu_model import MPU_9250, ImuParameters
from h2nav.sim.log_server import LOG_MESSAGES, LogServer
from h2nav.sim.other_vehicle import OTHER_SYSTEM_ID, of_other_vehicle
from h2nav.sim.own_time import OwnTime
from h2nav.sim.parameters import ParameterServer
from h2nav.sim.personalities import ARDUPILOT, Personality
from h2nav.sim.scenarios import Scenario
from h2nav.sim.stream_schedule import StreamSchedule
from h2nav.sim.streams import AUTOPILOT_COMPONENT, Stream
from h2nav.sim.vehicle import Vehicle
from h2nav.sim.wheel_streams import wheel_stream

SYSTEM_ID = 1
IDENTITY = (SYSTEM_ID, AUTOPILOT_COMPONENT)
REBOOT_SILENCE_NS = SECOND_NS
# Faults with an effect at the moment they begin.
MOMENTOUS = ("reboot", "rate", "power-off")
TIMESYNC_EVERY = 10
_FRAME_OVERHEAD = 12


@dataclass(frozen=True, slots=True)
class AutopilotOptions:
    """Options of a fake autopilot."""

    scenario: Scenario  # the flight
    personality: Personality = ARDUPILOT  # ArduPilot or PX4
    seed: int = 0  # of all random numbers
    faults: tuple[Fault, ...] = ()  # the scheduled faults
    sensor: ImuParameters = MPU_9250  # the kind of IMU on board
    imus: int = 1  # number of IMUs, each with a compass
    extra_streams: tuple[Stream, ...] = ()  # forwarded messages of other components
    boot_text: bool = False  # send the text of a serial port at power-on
    line_bytes_per_s: float | None = None  # capacity of a serial line; None = no limit
    wrong: Miscalibration = SOUND  # calibration of the first IMU and its compass
    parameters: Mapping[str, float] = field(default_factory=dict)  # set before it is switched on
    asks_to_arm: bool = False  # requests an authorization before it arms
    logs: tuple[bytes, ...] = ()  # of its logger, the newest last
    has_files: bool = True  # serves them by MAVLink FTP too


class Outgoing(NamedTuple):
    """A message for the link."""

    t_ns: int  # host time of sending
    sysid: int  # system id of the sender
    compid: int  # component id of the sender
    message: Any  # a message of pymavlink's dialect, or bytes that are not a frame


class FakeAutopilot:
    """One autopilot on one link."""

    def __init__(self, options: AutopilotOptions) -> None:
        self.options = options
        self.schedule = FaultSchedule(options.faults)
        self._time = OwnTime(self.schedule)
        self._parameters = ParameterServer(
            options.personality.parameters | dict(options.parameters)
        )
        self.vehicle = Vehicle(
            options.scenario,
            (options.sensor,) * options.imus,
            self.schedule,
            options.seed,
            options.personality.stamp_jitter_us,
            options.personality.ages,
        )
        self.vehicle.miscalibrate(options.wrong, self._parameters.values)
        self.streams = StreamSchedule(_streams_of(options), options.line_bytes_per_s)
        self._commands = CommandServer(
            options.personality, self.streams, self.vehicle, asks_to_arm=options.asks_to_arm
        )
        path_of = options.personality.log_path if options.has_files else None
        self.logs = LogServer(options.logs, options.line_bytes_per_s, path_of)
        self._replies: dict[int, Callable[[Any], list[Any]]] = {
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._answer_timesync,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._parameters.every_value,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: self._parameters.read,
            mavlink.MAVLINK_MSG_ID_PARAM_SET: self._parameters.write,
        }
        self._outbox: list[Outgoing] = []
        self._now_ns = 0
        self._is_on = False
        self._silent_until_ns: int | None = None
        self._is_unpowered = False
        self._heartbeat_ns = 0
        self._heartbeats = 0
        self._was_armed = False
        self._plan: deque[tuple[int, Fault]] = deque()
        self.reboots = 0

    @property
    def next_deadline_ns(self) -> int:
        """When `advance` returns the next message."""
        return self._time.host_ns(self._now_ns if self._outbox else self._next_event_ns())

    @property
    def is_unpowered(self) -> bool:
        """Whether its power is off."""
        return self._is_unpowered

    def advance(self, t_ns: int) -> list[Outgoing]:
        """Returns everything sent until `t_ns`, in order; the first call switches the power on.

        Args:
            t_ns: host time, never earlier than in the call before.
        """
        self._run_until(t_ns)
        sent, self._outbox = self._outbox, []
        return [one._replace(t_ns=self._time.host_ns(one.t_ns)) for one in sent]

    def seconds_at(self, t_ns: int) -> float:
        """Seconds of its own time since the simulator started, the time of faults.

        Args:
            t_ns: host time, never earlier than in the call before.
        """
        self._run_until(t_ns)
        return self.vehicle.t_s

    def begin(self, t_ns: int, fault: Fault) -> None:
        """Begins a fault now.

        Args:
            t_ns: host time, never earlier than in the call before.
            fault: one that starts at the vehicle's `t_s` of this time.
        """
        self._run_until(t_ns)
        self.schedule.begin(fault)
        self._befall(fault)

    def end(self, t_ns: int, faults: Iterable[Fault]) -> None:
        """Ends active faults now.

        Args:
            t_ns: host time, never earlier than in the call before.
        """
        self._run_until(t_ns)
        ended = list(faults)
        self.schedule.end(self.vehicle.t_s, ended)
        if self._is_unpowered and any(fault.name == "power-off" for fault in ended):
            self._silent_until_ns = self._now_ns
            self._run_until(t_ns)

    def fly(self, t_ns: int, scenario: Scenario) -> None:
        """Reboots at the start of another scenario, which begins when the autopilot is back.

        Args:
            t_ns: host time, never earlier than in the call before.
        """
        self._run_until(t_ns)
        self.options = replace(self.options, scenario=scenario)
        self._reboot()
        self.streams.offer(_streams_of(self.options))
        self.vehicle.depart(self._now_ns + REBOOT_SILENCE_NS, scenario)

    def skip_to(self, t_ns: int) -> None:
        """Skips what was due before `t_ns`, for a process that was stopped."""
        own_ns = self._time.at(t_ns)
        self.streams.skip_to(own_ns)
        self._heartbeat_ns = max(self._heartbeat_ns, own_ns)

    def on_message(self, t_ns: int, sysid: int, compid: int, msg_id: int, fields: Any) -> None:
        """Takes a message that arrived at host time `t_ns`; `advance` returns the answers.

        Args:
            t_ns: never earlier than in the call before.
            sysid: of the sender; a sender with this autopilot's id is ignored.
            fields: its fields as attributes.
        """
        self._run_until(t_ns)
        if self._silent_until_ns is not None or (sysid, compid) == IDENTITY:
            return
        if not _concerns_us(fields):
            return
        if msg_id in LOG_MESSAGES:
            replies = self.logs.handle(
                self._now_ns,
                (sysid, compid),
                msg_id,
                fields,
                is_armed=self.vehicle.is_armed,
                is_taken=self.vehicle.has_fault("other-fetch"),
            )
        elif msg_id in self._replies:
            replies = self._replies[msg_id](fields)
        else:
            replies = self._commands.handle(self._now_ns, (sysid, compid), msg_id, fields)
        for message in replies:
            self._send(message)
        if self._commands.take_reboot():
            self._reboot()

    def _run_until(self, host_ns: int) -> None:
        t_ns = self._time.at(host_ns)
        if not self._is_on:
            self._is_on = True
            self._now_ns = t_ns
            self._plan.extend(
                sorted(
                    (t_ns + round(fault.start_s * SECOND_NS), fault)
                    for name in MOMENTOUS
                    for fault in self.schedule.starts(name)
                )
            )
            self.vehicle.switch_on(t_ns)
            self._boot()
        while (due_ns := self._next_event_ns()) <= t_ns:
            self._now_ns = max(self._now_ns, due_ns)
            self._work()
        self._now_ns = max(self._now_ns, t_ns)
        self.vehicle.go_to(self._now_ns)

    def _next_event_ns(self) -> int:
        if self._silent_until_ns is not None:
            return self._silent_until_ns
        due_ns = self._heartbeat_ns
        if self._plan:
            due_ns = min(due_ns, self._plan[0][0])
        others = (self.streams.next_deadline_ns, self.logs.next_deadline_ns)
        return min((due_ns, *(each for each in others if each is not None)))

    def _work(self) -> None:
        """Does what is due now."""
        now_ns = self._now_ns
        self.vehicle.go_to(now_ns)
        if self._silent_until_ns is not None:
            self._silent_until_ns = None
            if self._is_unpowered:
                self._is_unpowered = False
                self.vehicle.switch_on(now_ns)
            self._boot()
            return
        if self._plan and self._plan[0][0] <= now_ns:
            self._befall(self._plan.popleft()[1])
            if self._silent_until_ns is not None:
                return
        if self._heartbeat_ns <= now_ns:
            self._heartbeat_ns = now_ns + SECOND_NS
            self._every_second()
        self._tell_arming()
        for message in self.logs.due(
            now_ns,
            is_armed=self.vehicle.is_armed,
            is_taken=self.vehicle.has_fault("other-fetch"),
            has_room=self.streams.has_room(now_ns),
        ):
            self._send(message)
        while (due_ns := self.streams.next_deadline_ns) is not None and due_ns <= now_ns:
            stream = self.streams.pop_due(now_ns)
            message = stream.make(self.vehicle) if stream is not None else None
            if stream is not None and message is not None:
                self._send(message, stream.compid)
                self._send_other(message)

    def _befall(self, fault: Fault) -> None:
        """Applies the immediate effect of a fault; most act only from then on."""
        if fault.name == "reboot":
            self._reboot()
        elif fault.name == "power-off":
            self._lose_power(fault.length_s)
        elif fault.name == "rate":
            self._commands.override_rates(self._now_ns, float(fault.argument))

    def _boot(self) -> None:
        """Sends the power-on messages."""
        text = self.options.personality.boot_text if self.options.boot_text else ()
        for piece in text:
            self._outbox.append(Outgoing(self._now_ns, *IDENTITY, piece))
            self._send(heartbeat(self.options.personality, self.vehicle))
        self._heartbeats = 0
        self._heartbeat_ns = self._now_ns
        self.streams.start_defaults(self._now_ns)

    def _reboot(self) -> None:
        self.reboots += 1
        self.streams.stop_all()
        self.logs.restart()
        self._commands.restart()
        self.vehicle.switch_on(self._now_ns)
        self._silent_until_ns = self._now_ns + REBOOT_SILENCE_NS

    def _lose_power(self, length_s: float) -> None:
        self._reboot()
        self._is_unpowered = True
        is_for_good = math.isinf(length_s)
        back_ns = sys.maxsize if is_for_good else self._now_ns + round(length_s * SECOND_NS)
        self._silent_until_ns = back_ns

    def _every_second(self) -> None:
        vehicle = self.vehicle
        self._send(message := heartbeat(self.options.personality, vehicle))
        self._send_other(message)
        if self._heartbeats % TIMESYNC_EVERY == 0:
            self._send(mavlink.MAVLink_timesync_message(0, vehicle.boot_us * 1000 + 1))
        self._heartbeats += 1

    def _tell_arming(self) -> None:
        """Says at once that it is armed; the heartbeat says so when it is due."""
        if self.vehicle.is_armed and not self._was_armed:
            self._send(
                mavlink.MAVLink_statustext_message(mavlink.MAV_SEVERITY_INFO, b"Arming motors")
            )
        self._was_armed = self.vehicle.is_armed

    def _send(self, message: Any, compid: int = AUTOPILOT_COMPONENT) -> None:
        self.streams.occupy(self._now_ns, _FRAME_OVERHEAD + message.unpacker.size)
        self._outbox.append(Outgoing(self._now_ns, SYSTEM_ID, compid, message))

    def _send_other(self, message: Any) -> None:
        if self.vehicle.has_fault("second-autopilot"):
            other = of_other_vehicle(message)
            if other is not None:
                self._outbox.append(
                    Outgoing(self._now_ns, OTHER_SYSTEM_ID, AUTOPILOT_COMPONENT, other)
                )

    def _answer_timesync(self, fields: Any) -> list[Any]:
        # A saturated link leaves TIMESYNC unanswered.
        if fields.tc1 != 0 or not self.streams.has_room(self._now_ns):
            return []
        return [mavlink.MAVLink_timesync_message(self.vehicle.boot_us * 1000 + 1, fields.ts1)]


def _streams_of(options: AutopilotOptions) -> tuple[Stream, ...]:
    """All available streams."""
    streams = (*options.personality.streams, *options.extra_streams)
    if options.scenario.wheels_at is None:
        return streams
    return (*streams, wheel_stream(options.scenario.wheels_at, options.seed))


def heartbeat(personality: Personality, vehicle: Vehicle) -> Any:
    """The HEARTBEAT of the vehicle's current state."""
    armed = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if vehicle.is_armed else 0
    return mavlink.MAVLink_heartbeat_message(
        vehicle.scenario.mav_type if personality.mav_type is None else personality.mav_type,
        personality.autopilot,
        personality.base_mode | armed,
        personality.custom_modes[vehicle.is_airborne],
        mavlink.MAV_STATE_ACTIVE if vehicle.is_airborne else mavlink.MAV_STATE_STANDBY,
        3,
    )


def _concerns_us(fields: Any) -> bool:
    """Whether a message is addressed to all or to this autopilot."""
    system = getattr(fields, "target_system", 0)
    component = getattr(fields, "target_component", 0)
    return system in (0, SYSTEM_ID) and component in (0, AUTOPILOT_COMPONENT)
