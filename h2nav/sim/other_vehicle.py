"""A second autopilot on the same link, at rest, nose 30 deg up, which must be ignored."""

import copy
import math
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import GRAVITY_M_S2

OTHER_SYSTEM_ID = 2
_PITCH = math.radians(30.0)
_YAW = 1.0


def of_other_vehicle(message: Any) -> Any | None:
    """What the second autopilot sends when the first sends `message`; None = nothing."""
    if isinstance(message, mavlink.MAVLink_heartbeat_message):
        return message
    other = copy.copy(message)
    if isinstance(message, mavlink.MAVLink_attitude_message):
        other.roll, other.pitch, other.yaw = 0.0, _PITCH, _YAW
        return other
    if isinstance(message, mavlink.MAVLink_simstate_message) or not hasattr(message, "xgyro"):
        return None
    is_si = isinstance(message, mavlink.MAVLink_highres_imu_message)
    unit, number = (GRAVITY_M_S2, float) if is_si else (1000.0, round)
    other.xacc, other.yacc = number(unit * math.sin(_PITCH)), number(0)
    other.zacc = number(-unit * math.cos(_PITCH))
    other.xgyro = other.ygyro = other.zgyro = number(0)
    return other
