"""The autopilot's replies to commands: streams, single messages, versions, reboot."""

import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import SECOND_NS
from h2nav.sim.personalities import Personality
from h2nav.sim.stream_schedule import StreamSchedule
from h2nav.sim.vehicle import Vehicle

ACCEPTED = mavlink.MAV_RESULT_ACCEPTED
_COMMANDS = (mavlink.MAVLINK_MSG_ID_COMMAND_LONG, mavlink.MAVLINK_MSG_ID_COMMAND_INT)
_TEXT_BYTES = 50
_INT32_END = (1 << 31) - 1
_CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2
    | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | mavlink.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
)


class CommandServer:
    """Obeys COMMAND_LONG, COMMAND_INT and REQUEST_DATA_STREAM.

    Args:
        asks_to_arm: as PX4 with COM_ARM_AUTH_REQ: the first request to arm asks for an
            authorization, and one during its validity is accepted; motors stay as they are.
    """

    def __init__(
        self,
        personality: Personality,
        streams: StreamSchedule,
        vehicle: Vehicle,
        *,
        asks_to_arm: bool,
    ) -> None:
        self._asks_to_arm = asks_to_arm
        self._authorized_until_ns = 0
        self._personality = personality
        self._streams = streams
        self._vehicle = vehicle
        self._wants_reboot = False

    def handle(self, t_ns: int, sender: tuple[int, int], msg_id: int, fields: Any) -> list[Any]:
        """Obeys one message and returns the replies; other messages give none.

        Args:
            sender: system and component id, to which the COMMAND_ACK is addressed.
        """
        if msg_id == mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM:
            self._data_stream(t_ns, fields)
        if msg_id == mavlink.MAVLINK_MSG_ID_COMMAND_ACK:
            self._authorized(t_ns, fields)
        if msg_id not in _COMMANDS:
            return []
        result, answers = self._obey(t_ns, fields)
        ack = mavlink.MAVLink_command_ack_message(fields.command, result, 0, 0, *sender)
        return [ack, *answers]

    def restart(self) -> None:
        """Forgets an authorization, as a reboot does."""
        self._authorized_until_ns = 0

    def take_reboot(self) -> bool:
        """Whether a reboot has been commanded since the last call."""
        wanted, self._wants_reboot = self._wants_reboot, False
        return wanted

    def override_rates(self, t_ns: int, rate_hz: float) -> None:
        """Gives every running stream another rate without notice."""
        for message_id in self._streams.running():
            self._streams.set_interval(t_ns, message_id, round(SECOND_NS / rate_hz))

    def _obey(self, t_ns: int, fields: Any) -> tuple[int, list[Any]]:
        command = fields.command
        if command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL:
            return self._set_interval(t_ns, fields.param1, fields.param2)
        if command == mavlink.MAV_CMD_GET_MESSAGE_INTERVAL:
            return self._get_interval(fields.param1)
        if command == mavlink.MAV_CMD_REQUEST_MESSAGE:
            return self._one_message(fields.param1)
        if command == mavlink.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
            return ACCEPTED, [self._version()]
        if command == mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN and fields.param1 == 1.0:
            self._wants_reboot = True
            return ACCEPTED, []
        if command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
            return self._arm(t_ns, fields.param1)
        return mavlink.MAV_RESULT_UNSUPPORTED, []

    def _arm(self, t_ns: int, wanted: float) -> tuple[int, list[Any]]:
        """Replies to an arm command; the scenario alone decides about the motors."""
        if not self._asks_to_arm or wanted != 1.0:
            return mavlink.MAV_RESULT_DENIED, []
        if t_ns < self._authorized_until_ns:
            return ACCEPTED, []
        question = mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST
        asks = mavlink.MAVLink_command_long_message(1, 0, question, 0, 0, 0, 0, 0, 0, 0, 0)
        return mavlink.MAV_RESULT_TEMPORARILY_REJECTED, [asks]

    def _authorized(self, t_ns: int, ack: Any) -> None:
        """Takes the reply to a request for authorization."""
        if ack.command == mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST and ack.result == ACCEPTED:
            self._authorized_until_ns = t_ns + ack.result_param2 * SECOND_NS

    def _set_interval(self, t_ns: int, number: float, interval_us: float) -> tuple[int, list[Any]]:
        message_id = _whole(number)
        stream = self._streams.stream(message_id)
        rules = self._personality
        if stream is None or self._vehicle.denies(stream.message.msgname):
            return rules.refusal, _texts(rules.unknown_text, message_id)
        if not interval_us > 0.0:
            default_hz = stream.default_hz if interval_us == 0.0 else 0.0
            interval_ns = round(SECOND_NS / default_hz) if default_hz else 0
            self._streams.set_interval(t_ns, message_id, interval_ns)
            return ACCEPTED, []
        if not math.isfinite(interval_us):
            return rules.refusal, []
        kept_ns = rules.interval_ns(round(interval_us * 1000.0))
        if kept_ns is None:
            return rules.refusal, _texts(rules.too_fast_text, message_id)
        self._streams.set_interval(t_ns, message_id, kept_ns)
        return ACCEPTED, []

    def _get_interval(self, number: float) -> tuple[int, list[Any]]:
        message_id = _whole(number)
        if self._streams.stream(message_id) is None:
            return self._personality.refusal, []
        interval_us = min(self._streams.interval_ns(message_id) // 1000, _INT32_END) or -1
        return ACCEPTED, [mavlink.MAVLink_message_interval_message(message_id, interval_us)]

    def _one_message(self, number: float) -> tuple[int, list[Any]]:
        message_id = _whole(number)
        if message_id == mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION:
            return ACCEPTED, [self._version()]
        stream = self._streams.stream(message_id)
        message = None if stream is None else stream.make(self._vehicle)
        if message is None:
            return self._personality.refusal, []
        return ACCEPTED, [message]

    def _version(self) -> Any:
        major, minor, patch, kind = self._personality.flight_sw_version
        version = major << 24 | minor << 16 | patch << 8 | kind
        return mavlink.MAVLink_autopilot_version_message(
            _CAPABILITIES, version, 0, 0, 0, bytes(8), bytes(8), bytes(8), 0, 0, 0x68326E6176
        )

    def _data_stream(self, t_ns: int, fields: Any) -> None:
        """Overrides the intervals of a group without acknowledgement, as ArduPilot does."""
        if not self._personality.takes_data_streams:
            return
        rate_hz = fields.req_message_rate if fields.start_stop else 0
        for message_id in self._streams.of_group(fields.req_stream_id):
            interval_ns = round(SECOND_NS / min(rate_hz, 50)) if rate_hz else 0
            self._streams.set_interval(t_ns, message_id, interval_ns)


def _texts(form: str, message_id: int) -> list[Any]:
    """STATUSTEXT in as many chunks as needed; none without a form."""
    text = form.format(message_id).encode()
    return [
        mavlink.MAVLink_statustext_message(
            mavlink.MAV_SEVERITY_INFO,
            text[start : start + _TEXT_BYTES],
            # A text of one chunk has the id 0, which means no id.
            message_id % 65535 + 1 if len(text) > _TEXT_BYTES else 0,
            start // _TEXT_BYTES,
        )
        for start in range(0, len(text), _TEXT_BYTES)
    ]


def _whole(number: float) -> int:
    """A message id sent as a float; -1 if it is not whole."""
    return int(number) if math.isfinite(number) and number == int(number) else -1
