"""Answers every command that is addressed to us: what we can do, we do; the rest is UNSUPPORTED."""

import math
import struct
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav import __version__
from h2nav.service.outputs import Outputs

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
)
DEFAULT_INTERVAL_US = 0.0
OFF_INTERVAL_US = -1.0

Answer = tuple[int, list[Any]]


def autopilot_version() -> Any:
    """AUTOPILOT_VERSION of this component, which is where MAVLink asks for a version."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    software = struct.unpack(">I", bytes((major, minor, patch, mavlink.FIRMWARE_VERSION_TYPE_DEV)))
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES, software[0], 0, 0, 0, nothing, nothing, nothing, 0, 0, 0
    )


class Commands:
    """Carries out COMMAND_LONG and COMMAND_INT.

    Args:
        outputs: our own messages, which may be requested or re-timed.
        may_change: obey SET_MESSAGE_INTERVAL; without it the command is DENIED.
    """

    def __init__(self, outputs: Outputs, may_change: bool) -> None:
        self._outputs = outputs
        self._may_change = may_change
        self._known: dict[int, Callable[[Any], Answer]] = {
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_version,
        }

    def answer(self, message: Any, asker: tuple[int, int]) -> list[Any]:
        """Everything to send for a command: first its COMMAND_ACK, then what it asked for.

        Args:
            message: COMMAND_LONG or COMMAND_INT (their first parameters have the same names).
            asker: system and component id of the sender.
        """
        carry_out = self._known.get(message.command)
        result, messages = carry_out(message) if carry_out else (UNSUPPORTED, [])
        ack = mavlink.MAVLink_command_ack_message(message.command, result, 0, 0, *asker)
        return [ack, *messages]

    def _request_message(self, message: Any) -> Answer:
        wanted = message.param1
        if wanted == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return ACCEPTED, [autopilot_version()]
        if not self._offers(wanted):
            return UNSUPPORTED, []
        latest = self._outputs.latest(int(wanted))
        return (ACCEPTED, [latest]) if latest else (mavlink.MAV_RESULT_TEMPORARILY_REJECTED, [])

    def _request_version(self, message: Any) -> Answer:
        return (ACCEPTED, [autopilot_version()]) if message.param1 == 1 else (DENIED, [])

    def _set_interval(self, message: Any) -> Answer:
        wanted, interval_us = message.param1, message.param2
        if not self._offers(wanted):
            return UNSUPPORTED, []
        if not self._may_change or not interval_us >= OFF_INTERVAL_US:
            return DENIED, []
        if interval_us == DEFAULT_INTERVAL_US:
            rate_hz = self._outputs.default_hz(int(wanted))
        else:
            rate_hz = 0.0 if interval_us < 0.0 else 1e6 / interval_us
        self._outputs.set_rate(int(wanted), rate_hz)
        return ACCEPTED, []

    def _get_interval(self, message: Any) -> Answer:
        wanted = message.param1
        if not self._offers(wanted):
            return UNSUPPORTED, []
        rate_hz = self._outputs.rate_hz(int(wanted))
        interval_us = round(1e6 / rate_hz) if rate_hz > 0.0 else -1
        return ACCEPTED, [mavlink.MAVLink_message_interval_message(int(wanted), interval_us)]

    def _offers(self, wanted: float) -> bool:
        return math.isfinite(wanted) and self._outputs.offers(int(wanted))
