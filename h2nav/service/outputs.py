"""What we send of an estimate, and how often."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths import quaternion
from h2nav.motion.samples import OdometryRecord, PoseFrame
from h2nav.service.settings import OutputSettings

UINT32_MASK = 0xFFFF_FFFF
MAX_RATE_HZ = 1000.0
MAV_FRAMES = {
    PoseFrame.LOCAL_FRD: mavlink.MAV_FRAME_LOCAL_FRD,
    PoseFrame.LOCAL_NED: mavlink.MAV_FRAME_LOCAL_NED,
}
# A sample that is due within this share of its period is sent now, not a whole sample later.
EARLY = 0.25


def attitude(estimate: AttitudeEstimate) -> Any:
    """ATTITUDE: Euler angles and bias-corrected body rates, at the sample's time."""
    return mavlink.MAVLink_attitude_message(
        estimate.t_us // 1000 & UINT32_MASK, *quaternion.to_euler(estimate.q_nb), *estimate.w_b
    )


def attitude_quaternion(estimate: AttitudeEstimate) -> Any:
    """ATTITUDE_QUATERNION: scalar first, bias-corrected body rates, at the sample's time."""
    return mavlink.MAVLink_attitude_quaternion_message(
        estimate.t_us // 1000 & UINT32_MASK, *estimate.q_nb, *estimate.w_b
    )


class Motion(NamedTuple):
    """An estimate of motion with what ODOMETRY says of it.

    Attributes:
        record: pose, twist, covariances.
        estimator_type: MAV_ESTIMATOR_TYPE.
        quality: 1 to 100 %; 0 = unknown.
    """

    record: OdometryRecord
    estimator_type: int
    quality: int

    @property
    def t_us(self) -> int:
        """Time of validity."""
        return self.record.t_us


def odometry(motion: Motion) -> Any:
    """ODOMETRY: pose in LOCAL_FRD (or LOCAL_NED), twist in BODY_FRD."""
    record = motion.record
    return mavlink.MAVLink_odometry_message(
        record.t_us,
        MAV_FRAMES[record.frame],
        mavlink.MAV_FRAME_BODY_FRD,
        *record.p_m,
        record.q,
        *record.v_b_m_s,
        *record.w_b_rad_s,
        record.pose_covariance,
        record.velocity_covariance,
        record.reset_counter % 256,
        motion.estimator_type,
        motion.quality,
    )


class _Output:
    """One message, its rate and when it is due next, on the samples' clock."""

    def __init__(self, make: Callable[[Any], Any], rate_hz: float) -> None:
        self.make = make
        self.default_hz: float = rate_hz
        self.rate_hz: float = rate_hz
        self.due_us: float | None = None
        self.latest: Any | None = None

    def take(self, estimate: Any) -> Any | None:
        """The message made of it, where it is due."""
        self.latest = estimate
        return self.make(estimate) if self._is_due(estimate.t_us) else None

    def _is_due(self, t_us: int) -> bool:
        if self.rate_hz <= 0.0:
            return False
        period_us = 1e6 / self.rate_hz
        if self.due_us is None or abs(t_us - self.due_us) > 2.0 * period_us + 1e5:
            self.due_us = t_us + period_us
            return True
        if t_us < self.due_us - EARLY * period_us:
            return False
        self.due_us += period_us
        return True


class Outputs:
    """Chooses which messages go out for an estimate. A new output is a new entry of the table.

    Args:
        settings: the rates; 0 switches a message off.
        odometry_rate_hz: of ODOMETRY; None = motion is not estimated.
    """

    def __init__(self, settings: OutputSettings, odometry_rate_hz: float | None = None) -> None:
        self._of_attitude = {
            mavlink.MAVLINK_MSG_ID_ATTITUDE: _Output(attitude, settings.attitude_rate_hz),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _Output(
                attitude_quaternion, settings.attitude_quaternion_rate_hz
            ),
        }
        self._odometry = _Output(odometry, odometry_rate_hz or 0.0)
        self._outputs: dict[int, _Output] = dict(self._of_attitude)
        if odometry_rate_hz is not None:
            self._outputs[mavlink.MAVLINK_MSG_ID_ODOMETRY] = self._odometry
        self.sent = 0

    def due(self, estimate: AttitudeEstimate) -> Iterator[Any]:
        """The messages to send for this attitude."""
        for output in self._of_attitude.values():
            message = output.take(estimate)
            if message is not None:
                self.sent += 1
                yield message

    def due_odometry(self, motion: Motion) -> Any | None:
        """ODOMETRY of this estimate, where it is due."""
        return self._odometry.take(motion)

    def latest(self, message_id: int) -> Any | None:
        """The message made from the latest estimate, for MAV_CMD_REQUEST_MESSAGE."""
        output = self._outputs.get(message_id)
        if output is None or output.latest is None:
            return None
        return output.make(output.latest)

    def forget(self) -> None:
        """The latest estimates are stale: they must not be handed out any more."""
        for output in self._outputs.values():
            output.latest = None

    def forget_odometry(self) -> None:
        """The same for ODOMETRY alone."""
        self._odometry.latest = None

    def offers(self, message_id: int) -> bool:
        """Whether this message is one of ours."""
        return message_id in self._outputs

    def rate_hz(self, message_id: int) -> float:
        """The rate in force."""
        return self._outputs[message_id].rate_hz

    def default_hz(self, message_id: int) -> float:
        """The rate that the configuration asks for."""
        return self._outputs[message_id].default_hz

    def set_rate(self, message_id: int, rate_hz: float) -> None:
        """Changes a rate, within 0 and `MAX_RATE_HZ`."""
        output = self._outputs[message_id]
        output.rate_hz = min(max(rate_hz, 0.0), MAX_RATE_HZ)
        output.due_us = None
