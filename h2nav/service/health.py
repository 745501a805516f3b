"""The one state that the whole service is in, with its reason; it sets the heartbeat's status."""

from enum import Enum
from typing import NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink


class State(Enum):
    """From the worst to the best; the value is its name in logs."""

    NO_LINK = "no_link"
    NO_AUTOPILOT = "no_autopilot"
    NO_IMU = "no_imu"
    ALIGNING = "aligning"
    DEGRADED = "degraded"
    ACTIVE = "active"


SYSTEM_STATUS = {
    State.NO_LINK: mavlink.MAV_STATE_BOOT,
    State.NO_AUTOPILOT: mavlink.MAV_STATE_BOOT,
    State.NO_IMU: mavlink.MAV_STATE_STANDBY,
    State.ALIGNING: mavlink.MAV_STATE_STANDBY,
    State.DEGRADED: mavlink.MAV_STATE_CRITICAL,
    State.ACTIVE: mavlink.MAV_STATE_ACTIVE,
}
# An estimate older than this is no estimate.
SILENT_IMU_NS = 500_000_000
LOW_RATE_SHARE = 0.5


class Signs(NamedTuple):
    """What the state is judged from.

    Attributes:
        link_is_up: bytes can come.
        autopilot_known: a heartbeat made the binding, and heartbeats still come.
        last_sample_ns: host time of the last sample that was used; None before the first.
        last_gap_ns: time between the last two samples that were used; None before the second.
        has_estimate: the filter is past its alignment.
        complaint: a lasting objection (wrong units); empty when there is none.
        rate_hz: measured rate of the IMU message in use; None until measured.
        granted_rate_hz: the rate that was settled on with the autopilot; None where none was.
    """

    link_is_up: bool
    autopilot_known: bool
    last_sample_ns: int | None
    last_gap_ns: int | None
    has_estimate: bool
    complaint: str
    rate_hz: float | None
    granted_rate_hz: float | None


def judge(signs: Signs, t_ns: int) -> tuple[State, str]:
    """The state at `t_ns` and its reason (empty when active)."""
    if not signs.link_is_up:
        return State.NO_LINK, "link is down"
    if not signs.autopilot_known:
        return State.NO_AUTOPILOT, "no autopilot heartbeat"
    if signs.last_sample_ns is None or t_ns - signs.last_sample_ns > SILENT_IMU_NS:
        return State.NO_IMU, "no IMU samples"
    if signs.last_gap_ns is not None and signs.last_gap_ns > SILENT_IMU_NS:
        # One sample ends no silence: a stream of 1 Hz would change the state twice a second.
        return State.NO_IMU, "no IMU samples"
    if not signs.has_estimate:
        return State.ALIGNING, "finding the first attitude"
    if signs.complaint:
        return State.DEGRADED, signs.complaint
    rate_hz, granted_hz = signs.rate_hz, signs.granted_rate_hz
    if rate_hz is not None and granted_hz is not None and rate_hz < LOW_RATE_SHARE * granted_hz:
        return State.DEGRADED, f"IMU rate {rate_hz:.0f} of {granted_hz:.0f} Hz"
    return State.ACTIVE, ""
