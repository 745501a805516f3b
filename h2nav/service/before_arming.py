"""The second opinion before arming: faults on the ground, findings and the state of the service.

It is given at once, and reported to people once a fault has lasted.
"""

from collections.abc import Callable, Iterable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.integrity.findings import Alarm, Kind, SensorKind, Severity
from h2nav.integrity.preflight import GroundFault, GroundVerdict, Item, Preflight
from h2nav.maths.units import SECOND_NS
from h2nav.service.effects import Effect
from h2nav.service.health import ServiceState, StateVerdict
from h2nav.service.notices import Report
from h2nav.wire import outbound
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.position import GpsFix
from h2nav.wire.vehicle import ParameterValue

# A fault of this duration is reported; the opinion does not wait.
LASTS_NS = 3 * SECOND_NS
# A vehicle that is never at rest, such as on a boat, is sound after this time without a reason.
UNDISTURBED_NS = 10 * SECOND_NS
# An authorization is valid for an arming that is imminent.
AUTHORIZED_S = 10
LOOK_NS = SECOND_NS // 4
NOTHING_KNOWN = "not judged yet: keep it still"


# ArduPilot's parameters that say whether a compass, by its number from 0, is used.
COMPASS_USES = {"COMPASS_USE": 0, "COMPASS_USE2": 1, "COMPASS_USE3": 2}
# What follows at rest from a sensor that is named already.
_OF_INERTIAL = {
    Kind.ATTITUDE_VELOCITY,
    Kind.ATTITUDE_GRAVITY,
    Kind.GYRO_FIELD,
    Kind.COMPASS_FIELD,
}
CONSEQUENCES = {
    "gyro": _OF_INERTIAL,
    "accelerometer": _OF_INERTIAL,
    "compass": {Kind.GYRO_FIELD, Kind.COMPASS_FIELD},
    "gps": {Kind.ATTITUDE_VELOCITY},
}


def parameters(autopilot: int) -> tuple[str, ...]:
    """The parameters to request from this make of autopilot (MAV_AUTOPILOT)."""
    is_ardupilot = autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    return tuple(COMPASS_USES) if is_ardupilot else ()


def reasons_in(
    state: StateVerdict, alarms: Iterable[Alarm], named: frozenset[str] = frozenset()
) -> tuple[str, ...]:
    """Reasons not to arm besides the faults on the ground, the worst first.

    Args:
        state: of the service; every state but active is a reason.
        alarms: those of level warning and above are reasons.
        named: sensors that faults on the ground name, such as ``gyro 1``; they, and what follows
            from them, are not named again.
    """
    wrong = [alarm for alarm in alarms if alarm.severity <= Severity.WARNING]
    told = [alarm for alarm in wrong if not _is_named(alarm, named)]
    found = [alarm.notice for alarm in sorted(told, key=lambda alarm: alarm.severity)]
    # A degraded state repeats the alarms that degrade it.
    is_named = state.state is ServiceState.DEGRADED and any(alarm.degrades for alarm in wrong)
    if state.state is not ServiceState.ACTIVE and not is_named:
        found.append(state.reason)
    return tuple(found)


def _is_named(alarm: Alarm, named: frozenset[str]) -> bool:
    """Whether an alarm is of a sensor that is named already, or follows from it."""
    words = [part.partition(" ")[0] for part in named]
    if any(alarm.kind in CONSEQUENCES.get(word, ()) for word in words):
        return True
    kind, numbers = alarm.sensor.kind, alarm.sensor.numbers
    # Of an IMU, the kind of the alarm tells the sensor.
    is_imu = kind is SensorKind.IMU
    names = [w for w in words if alarm.kind.value.startswith(w)] if is_imu else [kind.value]
    if not numbers:
        return any(name in named for name in names)
    return any(f"{name} {number}" in named for name in names for number in numbers)


class BeforeArming:
    """Checks the vehicle while it is disarmed; commands nothing.

    Args:
        report: reports a fault on the ground.
        others: the reasons besides those faults; it is told which sensors they name.
    """

    def __init__(
        self,
        report: Report,
        others: Callable[[frozenset[str]], tuple[str, ...]] = lambda _named: (),
    ) -> None:
        self._report = report
        self._others = others
        self._preflight = Preflight()
        self._since_ns: dict[tuple[Item, str], int] = {}
        self.due_ns = LOOK_NS  # of the next look, unless armed
        self._unused: dict[int, bool] = {}
        self.is_armed = False  # by the heartbeat: nothing is checked
        self._undisturbed_ns: int | None = None
        self.verdict = GroundVerdict()
        self._is_judged = False

    @property
    def faults(self) -> Sequence[GroundFault]:
        """Faults on the ground; none while armed."""
        return self.verdict.faults

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why not to arm, for people; none while armed."""
        if self.is_armed:
            return ()
        named = frozenset(fault.part for fault in self.faults if fault.part)
        return (*(fault.text for fault in self.faults), *self._others(named))

    def armed(self, is_armed: bool) -> None:
        """Takes the armed state from the heartbeat."""
        if is_armed != self.is_armed:
            self._look_anew()
        self.is_armed = is_armed

    def restart(self) -> None:
        """Forgets everything, for another autopilot or another epoch."""
        self._unused.clear()
        self._preflight.on_unused_compasses(frozenset())
        self._look_anew()

    def _look_anew(self) -> None:
        """Forgets what was seen on the ground; what the autopilot is told to use stays."""
        self._preflight.restart()
        self._since_ns.clear()
        self.verdict = GroundVerdict()
        self._undisturbed_ns, self._is_judged = None, False

    def on_sample(self, imu: int, sample: ImuSample, *, field_is_raw: bool) -> None:
        """Takes a sample of an IMU, by its number from 0; see `Preflight.on_sample`."""
        if not self.is_armed:
            self._preflight.on_sample(imu, sample, field_is_raw=field_is_raw)

    def on_earth(self, field: EarthField) -> None:
        """Takes the earth's field."""
        self._preflight.on_earth(field)

    def on_message(self, message: object) -> None:
        """Takes another message of the autopilot."""
        if isinstance(message, GpsFix) and message.v_n is not None:
            self._preflight.on_velocity(message.v_n)
        elif isinstance(message, ReportedAttitude) and not message.is_second:
            self._preflight.on_attitude(message.q_nb)
        elif isinstance(message, ParameterValue) and message.name in COMPASS_USES:
            self._unused[COMPASS_USES[message.name]] = message.value == 0.0
            unused = frozenset(imu for imu, is_unused in self._unused.items() if is_unused)
            self._preflight.on_unused_compasses(unused)

    @property
    def opinion(self) -> int:
        """1: nothing is wrong; 0: unknown or armed; -n: n things are wrong."""
        reasons = self.reasons
        return -len(reasons) if reasons else int(self._is_judged)

    @property
    def messages(self) -> list[OutMessage]:
        """The opinion for ArduPilot's applet, after what is wrong."""
        opinion, reasons = self.opinion, self.reasons or (NOTHING_KNOWN,)
        if opinion == 1 or self.is_armed:
            return [outbound.arming_opinion(opinion)]
        more = f" +{len(reasons) - 1}" if len(reasons) > 1 else ""
        text = reasons[0][: outbound.ARMING_REASON_SIZE - len(more)] + more
        return [outbound.arming_reason(text), outbound.arming_opinion(opinion)]

    def authorization(self, asker: Address) -> OutMessage:
        """The reply to a request for authorization."""
        result = {
            0: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
            1: mavlink.MAV_RESULT_ACCEPTED,
        }.get(self.opinion, mavlink.MAV_RESULT_DENIED)
        is_good = result == mavlink.MAV_RESULT_ACCEPTED
        return outbound.arm_authorization(result, AUTHORIZED_S if is_good else 0, asker)

    def look(self, t_ns: int) -> list[Effect]:
        """Called at each sample; reports faults that have begun to last."""
        if self.is_armed or t_ns < self.due_ns:
            return []
        self.due_ns = t_ns + LOOK_NS
        self.verdict = self._preflight.verdict
        if self.reasons:
            self._undisturbed_ns = None
        elif self._undisturbed_ns is None:
            self._undisturbed_ns = t_ns
        undisturbed_ns = self._undisturbed_ns
        # Once judged, a vehicle that is carried is not unknown.
        self._is_judged |= Item.ACCELEROMETER in self.verdict.judged
        self._is_judged |= undisturbed_ns is not None and t_ns - undisturbed_ns >= UNDISTURBED_NS
        return self._report_lasting(t_ns)

    def _report_lasting(self, t_ns: int) -> list[Effect]:
        now = {(fault.item, fault.sensor): fault for fault in self.faults}
        self._since_ns = {key: self._since_ns.get(key, t_ns) for key in now}
        effects: list[Effect] = []
        for (item, sensor), fault in now.items():
            if t_ns - self._since_ns[item, sensor] >= LASTS_NS:
                text, cause = f"before arming: {fault.text}", f"preflight {item} {sensor}"
                effects += self._report(t_ns, Severity.WARNING, text, cause)
        return effects
