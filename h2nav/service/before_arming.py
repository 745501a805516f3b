"""The second opinion before arming: lasting faults on the ground, each reported once."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import EarthField, ImuSample
from h2nav.integrity.findings import Severity
from h2nav.integrity.preflight import GroundFault, GroundVerdict, Item, Preflight
from h2nav.service.effects import Effect
from h2nav.service.limits import SECOND_NS
from h2nav.service.notices import Report
from h2nav.wire import outbound
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.position import GpsFix

LASTS_NS = 3 * SECOND_NS
# An authorization is valid for an arming that is imminent.
AUTHORIZED_S = 10
LOOK_NS = SECOND_NS


class BeforeArming:
    """Checks the vehicle while it is disarmed; commands nothing."""

    def __init__(self, report: Report) -> None:
        self._report = report
        self._preflight = Preflight()
        self._since_ns: dict[tuple[Item, str], int] = {}
        self._looked_ns = 0
        self._is_armed = False
        self.verdict = GroundVerdict()
        self._sound_ns: int | None = None
        self._is_sound = False

    @property
    def faults(self) -> Sequence[GroundFault]:
        """Faults that have lasted some seconds; none while armed."""
        return self.verdict.faults

    def armed(self, is_armed: bool) -> None:
        """Takes the armed state from the heartbeat."""
        if is_armed != self._is_armed:
            self.restart()
        self._is_armed = is_armed

    def restart(self) -> None:
        """Forgets everything, for another autopilot or another epoch."""
        self._preflight.restart()
        self._since_ns.clear()
        self.verdict = GroundVerdict()
        self._sound_ns, self._is_sound = None, False

    def on_sample(self, imu: int, t_ns: int, sample: ImuSample) -> None:
        """Takes a sample of an IMU, by its number from 0."""
        if not self._is_armed:
            t_us = t_ns // 1000
            self._preflight.on_sample(imu, t_us, sample.w_b, sample.f_b, sample.m_b_ut)

    def on_earth(self, field: EarthField) -> None:
        """Takes the earth's field."""
        self._preflight.on_earth(field)

    def on_message(self, message: object) -> None:
        """Takes another message of the autopilot."""
        if isinstance(message, GpsFix) and message.v_n is not None:
            self._preflight.on_velocity(message.v_n)
        elif isinstance(message, ReportedAttitude) and not message.is_second:
            self._preflight.on_attitude(message.q_nb)

    @property
    def opinion(self) -> int:
        """1: nothing is wrong; 0: unknown or armed; -n: n things are wrong."""
        return -len(self.faults) if self.faults else int(self._is_sound)

    def authorization(self, asker: Address) -> OutMessage:
        """The reply to a request for authorization."""
        result = {
            0: mavlink.MAV_RESULT_TEMPORARILY_REJECTED,
            1: mavlink.MAV_RESULT_ACCEPTED,
        }.get(self.opinion, mavlink.MAV_RESULT_DENIED)
        is_good = result == mavlink.MAV_RESULT_ACCEPTED
        return outbound.arm_authorization(result, AUTHORIZED_S if is_good else 0, asker)

    def look(self, t_ns: int) -> list[Effect]:
        """Called once a second; reports faults that have begun to last."""
        if self._is_armed or t_ns - self._looked_ns < LOOK_NS:
            return []
        self._looked_ns = t_ns
        faults, judged = self._preflight.verdict
        now = {(fault.item, fault.sensor): fault for fault in faults}
        self._since_ns = {key: self._since_ns.get(key, t_ns) for key in now}
        lasting = [f for key, f in now.items() if t_ns - self._since_ns[key] >= LASTS_NS]
        self.verdict = GroundVerdict(tuple(lasting), judged)
        # A fault that has just begun counts neither as a fault nor as sound.
        if now or Item.ACCELEROMETER not in judged:
            self._sound_ns = None
        elif self._sound_ns is None:
            self._sound_ns = t_ns
        self._is_sound = self._sound_ns is not None and t_ns - self._sound_ns >= LASTS_NS
        effects: list[Effect] = []
        for fault in lasting:
            cause = f"preflight {fault.item} {fault.sensor}"
            effects += self._report(t_ns, Severity.WARNING, f"before arming: {fault.text}", cause)
        return effects
