"""What we send of an estimate, and how often."""

from collections.abc import Callable, Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths import quaternion
from h2nav.service.settings import OutputSettings

UINT32_MASK = 0xFFFF_FFFF
MAX_RATE_HZ = 1000.0
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


class _Output:
    """One message, its rate and when it is due next, on the samples' clock."""

    def __init__(self, make: Callable[[AttitudeEstimate], Any], rate_hz: float) -> None:
        self.make = make
        self.rate_hz = rate_hz
        self.due_us: float | None = None

    def is_due(self, t_us: int) -> bool:
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
    """

    def __init__(self, settings: OutputSettings) -> None:
        self._outputs = {
            mavlink.MAVLINK_MSG_ID_ATTITUDE: _Output(attitude, settings.attitude_rate_hz),
            mavlink.MAVLINK_MSG_ID_ATTITUDE_QUATERNION: _Output(
                attitude_quaternion, settings.attitude_quaternion_rate_hz
            ),
        }
        self._latest: AttitudeEstimate | None = None
        self.sent = 0

    def due(self, estimate: AttitudeEstimate) -> Iterator[Any]:
        """The messages to send for this estimate."""
        self._latest = estimate
        for output in self._outputs.values():
            if output.is_due(estimate.t_us):
                self.sent += 1
                yield output.make(estimate)

    def latest(self, message_id: int) -> Any | None:
        """The message made from the latest estimate, for MAV_CMD_REQUEST_MESSAGE."""
        if self._latest is None or message_id not in self._outputs:
            return None
        return self._outputs[message_id].make(self._latest)

    def forget(self) -> None:
        """The latest estimate is stale: it must not be handed out any more."""
        self._latest = None

    def offers(self, message_id: int) -> bool:
        """Whether this message is one of ours."""
        return message_id in self._outputs

    def rate_hz(self, message_id: int) -> float:
        """The rate in force."""
        return self._outputs[message_id].rate_hz

    def set_rate(self, message_id: int, rate_hz: float) -> None:
        """Changes a rate, within 0 and `MAX_RATE_HZ`."""
        output = self._outputs[message_id]
        output.rate_hz = min(max(rate_hz, 0.0), MAX_RATE_HZ)
        output.due_us = None
