"""Schedules the outgoing messages of an estimate."""

import math
from collections.abc import Callable, Sequence
from typing import Generic, NamedTuple, Protocol, TypeVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate, Trust
from h2nav.integrity.findings import Alarm, Kind, SensorKind
from h2nav.integrity.preflight import GroundVerdict, Item
from h2nav.integrity.ratios import InnovationRatios
from h2nav.integrity.witness import Comparison
from h2nav.motion.samples import OdometryRecord
from h2nav.service.settings import OutputSettings
from h2nav.wire import outbound
from h2nav.wire.outbound import OutMessage

MAX_RATE_HZ = 1000.0
CONVERGED = Trust.ALIGNED | Trust.CONVERGED
FORCE_ITEMS = {Item.ACCELEROMETER, Item.ACCELEROMETERS_APART, Item.VIBRATION}
FORCE_ALARMS = {Kind.ACCELEROMETER_FROZEN, Kind.IMU_FROZEN, Kind.ATTITUDE_GRAVITY}
# A sample that is due within this share of its period is sent now, not a whole sample later.
EARLY = 0.25


Messages = tuple[OutMessage, ...]


class Assessment(NamedTuple):
    """The assessment of the estimates."""

    # innovation test ratios of the attitude that is sent
    ratios: InnovationRatios = InnovationRatios()
    alarms: tuple[Alarm, ...] = ()  # all present alarms
    # the autopilot's attitude against ours; None without a fresh one
    difference: Comparison | None = None
    on_ground: GroundVerdict = GroundVerdict()  # faults before arming


class SentMotion(NamedTuple):
    """A motion estimate in the form of ODOMETRY."""

    record: OdometryRecord  # pose, twist, covariances
    estimator_type: int  # MAV_ESTIMATOR_TYPE
    quality: int  # 1 to 100 %; 0 = unknown

    @property
    def t_us(self) -> int:
        """Time of validity."""
        return self.record.t_us

    @property
    def message(self) -> OutMessage:
        """ODOMETRY."""
        return outbound.odometry(*self)


class _Timed(Protocol):
    """An estimate with its time."""

    @property
    def t_us(self) -> int:
        """Time of validity."""


E = TypeVar("E", bound=_Timed)


class _Output(Generic[E]):
    """One kind of message with its rate and due time, on the samples' clock.

    Attributes:
        make: creates the messages of an estimate.
        default_hz: the configured rate.
        rate_hz: the rate in force.
        is_attitude: it is one of those that are counted.
        after_us: nothing is due between this time and `before_us`.
        before_us: see `after_us`.
    """

    def __init__(
        self, make: Callable[[E], Messages], rate_hz: float, *, is_attitude: bool = False
    ) -> None:
        self.make = make
        self.is_attitude = is_attitude
        self.default_hz: float = rate_hz
        self.set_rate(rate_hz)

    def take(self, estimate: E) -> Messages:
        """Returns the messages of an estimate, if due."""
        return self.make(estimate) if self.is_due(estimate.t_us) else ()

    def set_rate(self, rate_hz: float) -> None:
        """Sets the rate from the next estimate on."""
        self.rate_hz: float = rate_hz
        self._due_us: float | None = None
        self.after_us = self.before_us = 0.0

    def is_due(self, t_us: int) -> bool:
        """Whether one is due at this time; if so, it counts as sent."""
        if self.after_us < t_us < self.before_us:
            return False
        if self.rate_hz <= 0.0:
            self.after_us, self.before_us = -math.inf, math.inf
            return False
        period_us = 1e6 / self.rate_hz
        is_due = True
        if self._due_us is None or abs(t_us - self._due_us) > 2.0 * period_us + 1e5:
            self._due_us = t_us + period_us
        elif t_us < self._due_us - EARLY * period_us:
            is_due = False
        else:
            self._due_us += period_us
        self.after_us = self._due_us - 2.0 * period_us - 1e5
        self.before_us = self._due_us - EARLY * period_us
        return is_due


class Outputs:
    """Selects the messages to send for an estimate. A new output is a new entry of the table.

    Args:
        settings: the rates; 0 switches a message off.
        odometry_rate_hz: of ODOMETRY; None = motion is not estimated.
        assess: assesses the newest estimate; called if that is to be sent.
        has_listener: the messages are sent; otherwise those of attitudes are only counted.
    """

    def __init__(
        self,
        settings: OutputSettings,
        odometry_rate_hz: float | None = None,
        *,
        assess: Callable[[], Assessment] = Assessment,
        has_listener: bool = True,
    ) -> None:
        self._has_listener = has_listener
        self._attitudes: dict[int, _Output[AttitudeEstimate]] = {
            mavlink.MAVLINK_MSG_ID_ATTITUDE: _Output(
                lambda estimate: (outbound.attitude(estimate),),
                settings.attitude_rate_hz,
                is_attitude=True,
            ),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _Output(
                lambda estimate: (outbound.attitude_quaternion(estimate),),
                settings.attitude_quaternion_rate_hz,
                is_attitude=True,
            ),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION_COV: _Output(
                lambda estimate: (outbound.attitude_quaternion_cov(estimate),),
                settings.attitude_covariance_rate_hz,
                is_attitude=True,
            ),
        }
        self._assessments: dict[int, _Output[AttitudeEstimate]] = {
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: _Output(
                lambda estimate: _status(estimate, assess()),
                settings.estimator_status_rate_hz,
            ),
            mavlink.MAVLINK_MSG_ID_NAMED_VALUE_FLOAT: _Output(
                lambda _: _differences(assess().difference),
                settings.difference_rate_hz,
            ),
        }
        self._odometry: _Output[SentMotion] = _Output(
            lambda motion: (motion.message,), odometry_rate_hz or 0.0
        )
        self._outputs: dict[int, _Output[AttitudeEstimate] | _Output[SentMotion]] = {
            **self._attitudes,
            **self._assessments,
        }
        if odometry_rate_hz is not None:
            self._outputs[mavlink.MAVLINK_MSG_ID_ODOMETRY] = self._odometry
        self._scheduled = (*self._attitudes.values(), *self._assessments.values())
        self._latest: AttitudeEstimate | None = None
        self._latest_motion: SentMotion | None = None
        # Nothing is due between these: two comparisons decide for most estimates.
        self._after_us = self._before_us = 0.0
        self.sent = 0  # number of attitude messages since start
        self.are_held = False  # nothing is due, because the estimates are late

    def due(self, estimate: AttitudeEstimate) -> Sequence[OutMessage]:
        """Returns the messages to send for this attitude."""
        self._latest, t_us = estimate, estimate.t_us
        if self._after_us < t_us < self._before_us:
            return ()
        now: list[_Output[AttitudeEstimate]] = []
        after_us, before_us = -math.inf, math.inf
        for output in self._scheduled:
            if not output.after_us < t_us < output.before_us and output.is_due(t_us):
                now.append(output)
            after_us = max(after_us, output.after_us)
            before_us = min(before_us, output.before_us)
        self._after_us, self._before_us = after_us, before_us
        if self.are_held or not now:
            return ()
        self.sent += len([output for output in now if output.is_attitude])
        if not self._has_listener:
            return ()
        return [message for output in now for message in output.make(estimate)]

    def due_odometry(self, motion: SentMotion) -> Messages:
        """Returns ODOMETRY of this estimate, if due."""
        self._latest_motion = motion
        return self._odometry.take(motion)

    def latest(self, message_id: int) -> Messages:
        """Returns the message of the latest estimate, for MAV_CMD_REQUEST_MESSAGE."""
        if self.are_held or not self.offers(message_id):
            return ()
        if message_id == mavlink.MAVLINK_MSG_ID_ODOMETRY:
            motion = self._latest_motion
            return () if motion is None else self._odometry.make(motion)
        output = self._attitudes.get(message_id) or self._assessments[message_id]
        return () if self._latest is None else output.make(self._latest)

    def hold(self, are_late: bool) -> None:
        """Holds messages back while the estimates are late."""
        self.are_held = are_late

    def forget(self) -> None:
        """Drops the latest estimates, which are stale and must not be sent again."""
        self._latest = self._latest_motion = None

    def forget_odometry(self) -> None:
        """Drops ODOMETRY alone."""
        self._latest_motion = None

    def offers(self, message_id: int) -> bool:
        """Whether this message is one of ours."""
        return message_id in self._outputs

    def rate_hz(self, message_id: int) -> float:
        """The rate in force."""
        return self._outputs[message_id].rate_hz

    def default_hz(self, message_id: int) -> float:
        """The configured rate."""
        return self._outputs[message_id].default_hz

    def set_rate(self, message_id: int, rate_hz: float) -> None:
        """Sets a rate, within 0 and `MAX_RATE_HZ`."""
        self._outputs[message_id].set_rate(min(max(rate_hz, 0.0), MAX_RATE_HZ))
        self._after_us = self._before_us = 0.0


def _status(estimate: AttitudeEstimate, assessment: Assessment) -> Messages:
    """ESTIMATOR_STATUS."""
    ratios, alarms, _, (faults, _) = assessment
    wrong = {fault.item for fault in faults}
    flags = 0
    if CONVERGED in estimate.trust and not (wrong or any(alarm.degrades for alarm in alarms)):
        flags |= mavlink.ESTIMATOR_ATTITUDE
    if Trust.VELOCITY_USED in estimate.trust:
        flags |= mavlink.ESTIMATOR_VELOCITY_HORIZ
    if Item.GPS in wrong or any(alarm.sensor.kind is SensorKind.GPS for alarm in alarms):
        flags |= mavlink.ESTIMATOR_GPS_GLITCH
    if FORCE_ITEMS & wrong or any(alarm.kind in FORCE_ALARMS for alarm in alarms):
        flags |= mavlink.ESTIMATOR_ACCEL_ERROR
    return (outbound.estimator_status(estimate.t_us, flags, ratios.of_velocity, ratios.of_field),)


def _differences(found: Comparison | None) -> Messages:
    """NAMED_VALUE_FLOAT of tilt and heading, in degrees."""
    if found is None:
        return ()
    return (
        outbound.named_value_float(found.t_us, "h2_tiltdif", math.degrees(found.tilt_rad)),
        outbound.named_value_float(found.t_us, "h2_yaw_dif", math.degrees(found.heading_rad)),
    )
