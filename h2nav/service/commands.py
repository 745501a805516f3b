"""Carries out commands, and acknowledges every one addressed to this component."""

import math
from collections.abc import Callable

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav import __version__
from h2nav.service.outputs import Outputs
from h2nav.wire import outbound
from h2nav.wire.outbound import Address, OutMessage
from h2nav.wire.questions import Command

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
DENIED = mavlink.MAV_RESULT_DENIED
UNSUPPORTED = mavlink.MAV_RESULT_UNSUPPORTED
DEFAULT_INTERVAL_US = 0.0
OFF_INTERVAL_US = -1.0

Answer = tuple[int, list[OutMessage]]


class Commands:
    """Carries out COMMAND_LONG and COMMAND_INT.

    Args:
        may_change: obey SET_MESSAGE_INTERVAL; otherwise the command is DENIED.
    """

    def __init__(self, outputs: Outputs, may_change: bool) -> None:
        self._outputs = outputs
        self._may_change = may_change
        self._known: dict[int, Callable[[Command], Answer]] = {
            mavlink.MAV_CMD_REQUEST_MESSAGE: self._request_message,
            mavlink.MAV_CMD_SET_MESSAGE_INTERVAL: self._set_interval,
            mavlink.MAV_CMD_GET_MESSAGE_INTERVAL: self._get_interval,
            mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES: self._request_version,
        }

    def answer(self, command: Command, asker: Address) -> list[OutMessage]:
        """Returns everything to send for a command: its COMMAND_ACK, then the requested message.

        A broadcast command gets no reply except the message that it requests: arming or take-off
        is for other components to acknowledge.

        Args:
            command: addressed to this component or broadcast.
            asker: system and component id of the sender.
        """
        is_for_all = command.target[1] == 0
        if is_for_all and command.command != mavlink.MAV_CMD_REQUEST_MESSAGE:
            return []
        carry_out = self._known.get(command.command)
        result, messages = carry_out(command) if carry_out else (UNSUPPORTED, [])
        if is_for_all and not messages:
            return []
        return [outbound.command_ack(command.command, result, asker), *messages]

    def _request_message(self, command: Command) -> Answer:
        if command.param1 == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return ACCEPTED, [_version()]
        wanted = self._offered(command)
        if wanted is None:
            return UNSUPPORTED, []
        latest = list(self._outputs.latest(wanted))
        return ACCEPTED if latest else mavlink.MAV_RESULT_TEMPORARILY_REJECTED, latest

    def _request_version(self, command: Command) -> Answer:
        return (ACCEPTED, [_version()]) if command.param1 == 1 else (DENIED, [])

    def _set_interval(self, command: Command) -> Answer:
        wanted, interval_us = self._offered(command), command.param2
        if wanted is None:
            return UNSUPPORTED, []
        if not self._may_change or not OFF_INTERVAL_US <= interval_us < math.inf:
            return DENIED, []
        if interval_us == DEFAULT_INTERVAL_US:
            rate_hz = self._outputs.default_hz(wanted)
        else:
            rate_hz = 0.0 if interval_us < 0.0 else 1e6 / interval_us
        self._outputs.set_rate(wanted, rate_hz)
        return ACCEPTED, []

    def _get_interval(self, command: Command) -> Answer:
        wanted = self._offered(command)
        if wanted is None:
            return UNSUPPORTED, []
        return ACCEPTED, [outbound.message_interval(wanted, self._outputs.rate_hz(wanted))]

    def _offered(self, command: Command) -> int | None:
        """The message that the command is about, if it is one of ours."""
        wanted = command.param1
        return int(wanted) if math.isfinite(wanted) and self._outputs.offers(int(wanted)) else None


def _version() -> OutMessage:
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    return outbound.autopilot_version(major, minor, patch)
