"""The autopilot's common messages as channels for viewers, such as ``/autopilot/ATTITUDE``.

Shared by `h2nav log decode` and the recorder (`log.decode_autopilot`).
"""

from typing import Any, NamedTuple

from h2nav.log.message_schema import message_format
from h2nav.log.schema import RecordFormat
from h2nav.wire.codec import decode
from h2nav.wire.deframer import Deframer
from h2nav.wire.dialect import LAYOUTS

# MAV_COMP_ID_AUTOPILOT1: cameras, gimbals and ground stations use the same messages.
AUTOPILOT_COMPONENT = 1
# Bounded, so that other vehicles on a link cannot fill the log with channels.
MAX_SYSTEMS = 4
PREFIX = "/autopilot"

COMMON = (
    "HEARTBEAT", "SYS_STATUS", "SYSTEM_TIME", "STATUSTEXT", "EXTENDED_SYS_STATE",
    "ATTITUDE", "ATTITUDE_QUATERNION", "ATTITUDE_TARGET", "AHRS", "AHRS2", "SIMSTATE",
    "EKF_STATUS_REPORT", "ESTIMATOR_STATUS", "VIBRATION", "WIND", "WIND_COV",
    "RAW_IMU", "SCALED_IMU", "SCALED_IMU2", "SCALED_IMU3", "HIGHRES_IMU",
    "SCALED_PRESSURE", "SCALED_PRESSURE2", "GPS_RAW_INT", "GPS2_RAW",
    "GLOBAL_POSITION_INT", "LOCAL_POSITION_NED", "POSITION_TARGET_GLOBAL_INT",
    "POSITION_TARGET_LOCAL_NED", "ALTITUDE", "HOME_POSITION", "ODOMETRY", "VFR_HUD",
    "NAV_CONTROLLER_OUTPUT", "MISSION_CURRENT", "DISTANCE_SENSOR", "RANGEFINDER", "OPTICAL_FLOW",
    "RC_CHANNELS", "SERVO_OUTPUT_RAW", "BATTERY_STATUS", "POWER_STATUS", "ESC_TELEMETRY_1_TO_4",
    "TERRAIN_REPORT", "PARAM_VALUE", "TIMESYNC",
)  # fmt: skip
_IDS = frozenset(msg_id for msg_id, layout in LAYOUTS.items() if layout.name in COMMON)


class Decoded(NamedTuple):
    """A message for a channel."""

    # ``/autopilot/<message>``; ``/autopilot_<system id>/<message>`` of every vehicle but the
    # first one received
    topic: str
    form: RecordFormat  # its encoding
    fields: Any  # of the message


class AutopilotDecoder:
    """Decodes the messages of the autopilots on one or more links."""

    def __init__(self) -> None:
        self._deframers: dict[str, Deframer] = {}
        self._prefixes: dict[int, str] = {}

    def feed(self, link: str, data: bytes) -> list[Decoded]:
        """Takes the next bytes of a link; returns the messages that they complete."""
        frames = self._deframers.setdefault(link, Deframer()).feed(data)
        found: list[Decoded] = []
        for frame in frames:
            if frame.msg_id not in _IDS or frame.compid != AUTOPILOT_COMPONENT:
                continue
            prefix = self._prefix(frame.sysid)
            if prefix:
                topic = f"{prefix}/{LAYOUTS[frame.msg_id].name}"
                found.append(Decoded(topic, message_format(frame.msg_id), decode(frame)))
        return found

    def _prefix(self, sysid: int) -> str:
        """Prefix of a vehicle's topics; empty beyond the limit of vehicles."""
        if sysid not in self._prefixes and len(self._prefixes) < MAX_SYSTEMS:
            self._prefixes[sysid] = f"{PREFIX}_{sysid}" if self._prefixes else PREFIX
        return self._prefixes.get(sysid, "")
