"""Every message that the service reads, with its reader: the inbound boundary in one table."""

from collections.abc import Callable
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire import attitude, motion, position, questions, vehicle
from h2nav.wire.attitude import ReportedAttitude
from h2nav.wire.dialect import GNSS_INTEGRITY_ID, LAYOUTS
from h2nav.wire.imu import IMU_MESSAGES, RECORDED_IMU, ImuReading
from h2nav.wire.motion import PoseReading, WheelDistances
from h2nav.wire.position import (
    EstimatedVelocity,
    GnssLevels,
    GnssState,
    GnssTime,
    GpsFix,
    NoFix,
    NoOtherFix,
    Origin,
    OtherFix,
    Place,
)
from h2nav.wire.questions import Question
from h2nav.wire.vehicle import (
    Airspeed,
    CommandAck,
    Heartbeat,
    LandedState,
    ParameterValue,
    StatusText,
    SystemTime,
    TimeSyncMessage,
    Vibration,
)

Message = (
    ImuReading
    | GpsFix
    | OtherFix
    | GnssState
    | NoFix
    | NoOtherFix
    | GnssLevels
    | GnssTime
    | Place
    | Origin
    | EstimatedVelocity
    | Heartbeat
    | LandedState
    | ParameterValue
    | ReportedAttitude
    | StatusText
    | SystemTime
    | Airspeed
    | TimeSyncMessage
    | CommandAck
    | Vibration
    | PoseReading
    | WheelDistances
    | Question
)


class Envelope(NamedTuple):
    """Origin and times of a message."""

    t_ns: int  # host monotonic time of its arrival
    now_ns: int  # host monotonic time at which it is processed, never before `t_ns`
    sender: tuple[int, int]  # system and component id
    message_id: int  # of the message


Reader = Callable[[Any], Message]

MOTION_READERS: dict[int, Reader] = {
    mavlink.MAVLINK_MSG_ID_ODOMETRY: motion.odometry,
    mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: motion.vision_position_estimate,
    mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP: motion.att_pos_mocap,
    mavlink.MAVLINK_MSG_ID_WHEEL_DISTANCE: motion.wheel_distance,
}
"""Messages wanted only by motion estimators."""

READERS: dict[int, Reader] = {
    **{row.message_id: row.read for row in IMU_MESSAGES.values() if row.read is not None},
    mavlink.MAVLINK_MSG_ID_HEARTBEAT: vehicle.heartbeat,
    mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: vehicle.landed_state,
    mavlink.MAVLINK_MSG_ID_STATUSTEXT: vehicle.status_text,
    mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: vehicle.system_time,
    mavlink.MAVLINK_MSG_ID_AIRSPEED: vehicle.airspeed,
    mavlink.MAVLINK_MSG_ID_TIMESYNC: vehicle.time_sync,
    mavlink.MAVLINK_MSG_ID_VIBRATION: vehicle.vibration,
    mavlink.MAVLINK_MSG_ID_COMMAND_ACK: vehicle.command_ack,
    mavlink.MAVLINK_MSG_ID_ATTITUDE: attitude.attitude,
    mavlink.MAVLINK_MSG_ID_AHRS2: attitude.ahrs2,
    mavlink.MAVLINK_MSG_ID_GPS_RAW_INT: position.gps_raw_int,
    mavlink.MAVLINK_MSG_ID_GPS2_RAW: position.gps2_raw,
    GNSS_INTEGRITY_ID: position.gnss_integrity,
    mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: position.global_position,
    mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: position.origin,
    mavlink.MAVLINK_MSG_ID_HOME_POSITION: position.origin,
    mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: position.local_position,
    mavlink.MAVLINK_MSG_ID_COMMAND_LONG: questions.command,
    mavlink.MAVLINK_MSG_ID_COMMAND_INT: questions.command,
    mavlink.MAVLINK_MSG_ID_PARAM_VALUE: vehicle.param_value,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: questions.param_request_list,
    mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_READ: questions.param_request_read,
    mavlink.MAVLINK_MSG_ID_PARAM_SET: questions.param_set,
    **MOTION_READERS,
}
"""Message id -> reader: dialect fields to a typed record; raises `Refused`."""


def message_name(message_id: int) -> str:
    """The dialect's name, such as ``RAW_IMU``."""
    if message_id == RECORDED_IMU:
        return IMU_MESSAGES[RECORDED_IMU].name
    return LAYOUTS[message_id].name
