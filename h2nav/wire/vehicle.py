"""Reports of an autopilot on itself and its vehicle: heartbeat, state, clocks, speed, replies."""

import math
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.wire.refused import Refused, need_within

# 2010 to 2100: an autopilot without a real-time clock counts from 1970 or 1980 until it has a fix.
EARLIEST_UNIX_S = 1_262_304_000.0
LATEST_UNIX_S = 4_102_444_800.0
FASTEST_AIRSPEED_M_S = 400.0
# Clocks in nanoseconds, half of what int64 holds, so that no difference of two overflows.
LATEST_CLOCK_NS = 1 << 62


class Heartbeat(NamedTuple):
    """HEARTBEAT."""

    autopilot: int  # MAV_AUTOPILOT
    vehicle_type: int  # MAV_TYPE
    is_armed: bool  # the motors may turn

    @property
    def is_of_autopilot(self) -> bool:
        """Whether the sender is an autopilot, and not a ground station, a camera or the like."""
        is_autopilot = self.autopilot != mavlink.MAV_AUTOPILOT_INVALID
        return is_autopilot and not self.is_of_ground_station

    @property
    def is_of_ground_station(self) -> bool:
        """Whether the sender is a ground station, which displays texts."""
        return bool(self.vehicle_type == mavlink.MAV_TYPE_GCS)


class LandedState(NamedTuple):
    """EXTENDED_SYS_STATE."""

    on_ground: bool | None  # None while unknown to the autopilot


class SystemTime(NamedTuple):
    """SYSTEM_TIME."""

    unix_s: float | None  # UNIX time, s; None while unknown to the autopilot


class Airspeed(NamedTuple):
    """AIRSPEED: of a sensor. That of VFR_HUD is the autopilot's own estimate, and is not read."""

    airspeed_m_s: float | None  # along the nose; None without a measurement
    is_true: bool = False  # corrected by the air's density, as in PX4's logs; else calibrated


class TimeSyncMessage(NamedTuple):
    """TIMESYNC: a request (`tc1_ns` 0) or a reply."""

    tc1_ns: int  # the replying clock; 0 in a request
    ts1_ns: int  # the requesting clock
    target: tuple[int, int]  # addressed system and component id; (0, 0) = all


class CommandAck(NamedTuple):
    """COMMAND_ACK."""

    command: int  # MAV_CMD
    result: int  # MAV_RESULT
    # system and component id of the requester; (0, 0) if the sender omits it
    target: tuple[int, int]


class ParameterValue(NamedTuple):
    """PARAM_VALUE."""

    name: str  # of the parameter
    # from ArduPilot any, from PX4 those that are floats; None for NaN and infinity
    value: float | None


class Firmware(NamedTuple):
    """AUTOPILOT_VERSION: the version of the flight software."""

    version: str  # such as ``4.5.7``
    stage: str  # ``dev``, ``alpha``, ``beta``, ``rc``, or empty for a release

    def __str__(self) -> str:
        return f"{self.version} {self.stage}".rstrip()


class StatusText(NamedTuple):
    """STATUSTEXT, a piece of at most 50 characters."""

    text: str


class Vibration(NamedTuple):
    """VIBRATION."""

    # of the three axes, m/s^2 from ArduPilot; PX4 sends other metrics. 0 for NaN and
    # infinity.
    levels: tuple[float, float, float]
    clips: tuple[int, int, int]  # clipped samples of each accelerometer since boot


def heartbeat(m: Any) -> Heartbeat:
    """HEARTBEAT; every value of its fields means something."""
    return Heartbeat(m.autopilot, m.type, bool(m.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED))


def landed_state(m: Any) -> LandedState:
    """EXTENDED_SYS_STATE."""
    if m.landed_state == mavlink.MAV_LANDED_STATE_UNDEFINED:
        return LandedState(None)
    return LandedState(m.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND)


def system_time(m: Any) -> SystemTime:
    """SYSTEM_TIME; rejects a date outside 2010 to 2100, such as one in nanoseconds."""
    if m.time_unix_usec == 0:
        return SystemTime(None)
    unix_s = m.time_unix_usec * 1e-6
    if not EARLIEST_UNIX_S <= unix_s < LATEST_UNIX_S:
        raise Refused("date_out_of_range")
    return SystemTime(unix_s)


def airspeed(m: Any) -> Airspeed:
    """AIRSPEED of the first sensor, unless it is unhealthy; rejects one beyond any aircraft's."""
    is_unhealthy = m.flags & mavlink.AIRSPEED_SENSOR_UNHEALTHY
    if m.id != 0 or is_unhealthy or math.isnan(m.airspeed):
        return Airspeed(None)
    need_within("airspeed_out_of_range", FASTEST_AIRSPEED_M_S, m.airspeed)
    return Airspeed(m.airspeed if m.airspeed > 0.0 else None)


def time_sync(m: Any) -> TimeSyncMessage:
    """TIMESYNC; rejects clocks that have run for a century."""
    need_within("clock_out_of_range", LATEST_CLOCK_NS, m.tc1, m.ts1)
    return TimeSyncMessage(m.tc1, m.ts1, (m.target_system, m.target_component))


def status_text(m: Any) -> StatusText:
    """STATUSTEXT; the codec has already made its bytes a text."""
    return StatusText(m.text)


def firmware(m: Any) -> Firmware:
    """AUTOPILOT_VERSION; every value of its fields means something."""
    packed = m.flight_sw_version
    stages = {0: "dev", 64: "alpha", 128: "beta", 192: "rc"}
    version = f"{packed >> 24 & 0xFF}.{packed >> 16 & 0xFF}.{packed >> 8 & 0xFF}"
    return Firmware(version, stages.get(packed & 0xFF, ""))


def param_value(m: Any) -> ParameterValue:
    """PARAM_VALUE; integers of PX4 are bit patterns, not numbers."""
    return ParameterValue(m.param_id, m.param_value if math.isfinite(m.param_value) else None)


def command_ack(m: Any) -> CommandAck:
    """COMMAND_ACK."""
    return CommandAck(m.command, m.result, (m.target_system, m.target_component))


def vibration(m: Any) -> Vibration:
    """VIBRATION; values that are not finite count as 0."""
    x, y, z = (
        level if math.isfinite(level) else 0.0
        for level in (m.vibration_x, m.vibration_y, m.vibration_z)
    )
    return Vibration((x, y, z), (m.clipping_0, m.clipping_1, m.clipping_2))
