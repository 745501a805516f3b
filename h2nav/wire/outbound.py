"""Outgoing messages: each writer returns one message whose values fit its fields.

Times wrap as in MAVLink; every other value is clamped to the range of its field.
"""

import math
import struct

from pymavlink.dialects.v20 import ardupilotmega as mavlink
from pymavlink.dialects.v20.ardupilotmega import MAVLink_message as OutMessage

from h2nav.attitude.samples import AttitudeEstimate
from h2nav.maths import quaternion
from h2nav.motion.samples import OdometryRecord, PoseFrame

UINT32_MASK = 0xFFFF_FFFF
INT32_END = (1 << 31) - 1
INT64_END = (1 << 63) - 1
# Of an unknown angle: uniformly distributed.
UNKNOWN_ANGLE_VARIANCE = math.pi**2 / 3.0
# Euler angles have no finite covariance at their poles.
MIN_COSINE = 1e-3
LARGEST_FLOAT: float = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
STATUS_TEXT_SIZE = 50
# Longer texts are truncated: they are read next to a map.
STATUS_TEXT_CHUNKS = 4
# An authorization's text in ArduPilot has 41 characters, of which the applet needs 7.
ARMING_REASON_SIZE = 34
# Not registered: private types begin at 32768. "h2" on top of that.
ARMING_REASON_TYPE = 0xE832
TUNNEL_SIZE = 128
ELLIPSIS = "\u2026"
MAV_FRAMES = {
    PoseFrame.LOCAL_FRD: mavlink.MAV_FRAME_LOCAL_FRD,
    PoseFrame.LOCAL_NED: mavlink.MAV_FRAME_LOCAL_NED,
}
CAPABILITIES = (
    mavlink.MAV_PROTOCOL_CAPABILITY_MAVLINK2 | mavlink.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
)

Address = tuple[int, int]

__all__ = ["Address", "OutMessage"]


def heartbeat(system_status: int) -> OutMessage:
    """HEARTBEAT of an onboard controller with this MAV_STATE."""
    return mavlink.MAVLink_heartbeat_message(
        mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, system_status, 3
    )


def attitude(estimate: AttitudeEstimate) -> OutMessage:
    """ATTITUDE: Euler angles and bias-corrected body rates, at the sample's time."""
    return mavlink.MAVLink_attitude_message(
        estimate.t_us // 1000 & UINT32_MASK, *quaternion.to_euler(estimate.q_nb), *estimate.w_b
    )


def attitude_quaternion(estimate: AttitudeEstimate) -> OutMessage:
    """ATTITUDE_QUATERNION: scalar first, bias-corrected body rates, at the sample's time."""
    return mavlink.MAVLink_attitude_quaternion_message(
        estimate.t_us // 1000 & UINT32_MASK, *estimate.q_nb, *estimate.w_b
    )


def attitude_quaternion_cov(estimate: AttitudeEstimate) -> OutMessage:
    """ATTITUDE_QUATERNION_COV: ATTITUDE_QUATERNION with its covariance.

    The covariance is that of roll, pitch and yaw, rad^2; an unknown deviation is that of a
    uniformly distributed angle.
    """
    _, pitch, _ = quaternion.to_euler(estimate.q_nb)
    cosine = max(math.cos(pitch), MIN_COSINE)
    tangent = math.sin(pitch) / cosine
    # The deviation of the tilt is that of both horizontal axes together.
    horizontal = 0.5 * _variance(estimate.sigma_tilt_rad)
    roll_yaw = horizontal * tangent / cosine
    yaw = _variance(estimate.sigma_heading_rad) + horizontal * tangent * tangent
    covariance = (
        *(horizontal / (cosine * cosine), 0.0, roll_yaw),
        *(0.0, horizontal, 0.0),
        *(roll_yaw, 0.0, yaw),
    )
    return mavlink.MAVLink_attitude_quaternion_cov_message(
        estimate.t_us, estimate.q_nb, *estimate.w_b, covariance
    )


def estimator_status(t_us: int, flags: int, vel_ratio: float, mag_ratio: float) -> OutMessage:
    """ESTIMATOR_STATUS; ratios that are not estimated are 0, as from PX4.

    Args:
        flags: ESTIMATOR_STATUS_FLAGS.
        vel_ratio: innovation test ratio of the velocity; NaN = none.
        mag_ratio: of the field; NaN = none.
    """
    vel_ratio, mag_ratio = _known(vel_ratio), _known(mag_ratio)
    return mavlink.MAVLink_estimator_status_message(
        t_us, flags, vel_ratio, 0.0, 0.0, mag_ratio, 0.0, 0.0, 0.0, 0.0
    )


def named_value_float(t_us: int, name: str, value: float) -> OutMessage:
    """NAMED_VALUE_FLOAT; the name has at most 10 characters."""
    return mavlink.MAVLink_named_value_float_message(
        t_us // 1000 & UINT32_MASK, name.encode(), _float32(value)
    )


def odometry(record: OdometryRecord, estimator_type: int, quality: int) -> OutMessage:
    """ODOMETRY: pose in LOCAL_FRD (or LOCAL_NED), twist in BODY_FRD.

    Args:
        estimator_type: MAV_ESTIMATOR_TYPE.
        quality: 1 to 100 %; 0 = unknown.
    """
    return mavlink.MAVLink_odometry_message(
        record.t_us,
        MAV_FRAMES[record.frame],
        mavlink.MAV_FRAME_BODY_FRD,
        *map(_float32, record.p_m),
        record.q,
        *map(_float32, record.v_b_m_s),
        *map(_float32, record.w_b_rad_s),
        list(map(_float32, record.pose_covariance)),
        list(map(_float32, record.velocity_covariance)),
        record.reset_counter % 256,
        estimator_type,
        quality,
    )


def time_sync(tc1_ns: int, ts1_ns: int, target: Address) -> OutMessage:
    """TIMESYNC to one component; `tc1_ns` = 0 makes it a request."""
    return _TargetedTimesync(_clamped(tc1_ns, INT64_END), _clamped(ts1_ns, INT64_END), target)


def status_text(severity: int, text: str, text_id: int) -> list[OutMessage]:
    """STATUSTEXT, in as many chunks as the text needs, without splitting a character.

    Receivers take a chunk that is not full for the last one, so a chunk whose next character does
    not fit is padded with spaces.

    Args:
        severity: MAV_SEVERITY.
        text: truncated, with an ellipsis, to `STATUS_TEXT_CHUNKS`.
        text_id: 1 to 65535, different for each text.
    """
    chunks = _chunks(text)
    if len(chunks) > STATUS_TEXT_CHUNKS:
        room = STATUS_TEXT_CHUNKS * STATUS_TEXT_SIZE - 1 - len(ELLIPSIS.encode())
        while len(chunks := _chunks(text + ELLIPSIS)) > STATUS_TEXT_CHUNKS:
            text, room = _encoded(text)[:room].decode(errors="ignore"), room - 1
    if len(chunks) == 1:
        return [mavlink.MAVLink_statustext_message(severity, chunks[0])]
    return [
        mavlink.MAVLink_statustext_message(severity, chunk, id=text_id, chunk_seq=number)
        for number, chunk in enumerate(chunks)
    ]


def _encoded(text: str) -> bytes:
    """UTF-8 without NUL; undecodable bytes, as in a file name, become question marks."""
    return text.replace("\0", " ").encode(errors="replace")


def _chunks(text: str) -> list[bytes]:
    """Full chunks; where there are several, the last one is not full."""
    chunks = [b""]
    for character in _encoded(text).decode():
        octets = character.encode()
        if len(chunks[-1]) + len(octets) > STATUS_TEXT_SIZE:
            chunks[-1] = chunks[-1].ljust(STATUS_TEXT_SIZE)
            chunks.append(b"")
        chunks[-1] += octets
    if len(chunks) > 1 and len(chunks[-1]) == STATUS_TEXT_SIZE:
        chunks.append(b"")
    return chunks


def command_ack(command: int, result: int, asker: Address) -> OutMessage:
    """COMMAND_ACK to the sender of the command."""
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, *asker)


def arm_authorization(result: int, for_s: int, asker: Address) -> OutMessage:
    """COMMAND_ACK to MAV_CMD_ARM_AUTHORIZATION_REQUEST; PX4 reads the validity from param 2.

    Args:
        result: MAV_RESULT.
        for_s: validity of the answer, s.
        asker: system and component id of the autopilot.
    """
    command = mavlink.MAV_CMD_ARM_AUTHORIZATION_REQUEST
    return mavlink.MAVLink_command_ack_message(command, result, 0, for_s, *asker)


def arming_opinion(value: int) -> OutMessage:
    """NAMED_VALUE_INT `h2_arm`: 1 nothing is wrong, 0 unknown, -n: n things are wrong."""
    return mavlink.MAVLink_named_value_int_message(0, b"h2_arm", value)


def arming_reason(text: str) -> OutMessage:
    """TUNNEL to the autopilot's applet: why `h2_arm` is not 1, in `ARMING_REASON_SIZE` bytes."""
    data = _encoded(text)[:ARMING_REASON_SIZE]
    payload = [*data, *bytes(TUNNEL_SIZE - len(data))]
    return mavlink.MAVLink_tunnel_message(0, 0, ARMING_REASON_TYPE, len(data), payload)


def message_interval(message_id: int, rate_hz: float) -> OutMessage:
    """MESSAGE_INTERVAL; a rate of 0 is -1, disabled."""
    interval_us = min(round(min(1e6 / rate_hz, INT32_END)), INT32_END) if rate_hz > 0.0 else -1
    return mavlink.MAVLink_message_interval_message(message_id, interval_us)


def param_value(name: str, value: float, index: int, count: int) -> OutMessage:
    """PARAM_VALUE of a REAL32 parameter."""
    return mavlink.MAVLink_param_value_message(
        name.encode(), _float32(value), mavlink.MAV_PARAM_TYPE_REAL32, count, index
    )


def param_request_read(target: Address, name: str) -> OutMessage:
    """PARAM_REQUEST_READ of a parameter by name."""
    return mavlink.MAVLink_param_request_read_message(*target, name.encode(), -1)


def autopilot_version(major: int, minor: int, patch: int) -> OutMessage:
    """AUTOPILOT_VERSION of this component, MAVLink's message for a version."""
    version = major << 24 | minor << 16 | patch << 8 | mavlink.FIRMWARE_VERSION_TYPE_DEV
    nothing = [0] * 8
    return mavlink.MAVLink_autopilot_version_message(
        CAPABILITIES, version, 0, 0, 0, nothing, nothing, nothing, 0, 0, 0
    )


def set_message_interval(target: Address, message_id: int, rate_hz: float) -> OutMessage:
    """COMMAND_LONG with MAV_CMD_SET_MESSAGE_INTERVAL; a rate of 0 means the default."""
    nothing = (0.0,) * 5
    return mavlink.MAVLink_command_long_message(
        *target,
        mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
        0,
        float(message_id),
        1e6 / rate_hz if rate_hz > 0.0 else 0.0,
        *nothing,
    )


def request_message(target: Address, message_id: int) -> OutMessage:
    """COMMAND_LONG with MAV_CMD_REQUEST_MESSAGE: one message, now."""
    nothing = (0.0,) * 6
    return mavlink.MAVLink_command_long_message(
        *target, mavlink.MAV_CMD_REQUEST_MESSAGE, 0, float(message_id), *nothing
    )


def request_data_stream(target: Address, group: int, rate_hz: float) -> OutMessage:
    """REQUEST_DATA_STREAM for one MAV_DATA_STREAM."""
    return mavlink.MAVLink_request_data_stream_message(*target, group, max(1, round(rate_hz)), 1)


class _TargetedTimesync(mavlink.MAVLink_timesync_message):  # type: ignore[misc]
    """TIMESYNC with its extension fields, which pymavlink's dialect documents but lacks."""

    def __init__(self, tc1: int, ts1: int, target: Address) -> None:
        super().__init__(tc1, ts1)
        self._target = bytes(target)

    def pack(self, mav: mavlink.MAVLink, force_mavlink1: bool = False) -> bytes:
        """See `MAVLink_message`; MAVLink 1 has no extension fields."""
        payload = self.unpacker.pack(self.tc1, self.ts1)
        if not force_mavlink1:
            payload += self._target
        packed: bytes = self._pack(mav, self.crc_extra, payload, force_mavlink1=force_mavlink1)
        return packed


def _clamped(value: int, end: int) -> int:
    return min(max(value, -end), end)


def _float32(value: float) -> float:
    return min(max(value, -LARGEST_FLOAT), LARGEST_FLOAT)


def _known(ratio: float) -> float:
    return 0.0 if math.isnan(ratio) else _float32(ratio)


def _variance(sigma_rad: float) -> float:
    """Variance of an angle; NaN if it is unknown."""
    if math.isnan(sigma_rad):
        return UNKNOWN_ANGLE_VARIANCE
    return min(sigma_rad, math.pi) ** 2
