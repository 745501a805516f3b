"""Vehicle and control in telemetry: demands, outputs, height, supply, faults.

Sources: the MAVLink common and ardupilotmega message definitions.
"""

from collections.abc import Callable, Mapping

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.recordings.context import (
    Array,
    ReportedFault,
)
from h2nav.recordings.frame_tables import FrameTable

HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
MESSAGE_IDS = frozenset({HEARTBEAT, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS})
CHARGES = {
    mavlink.MAV_BATTERY_CHARGE_STATE_LOW: "battery low",
    mavlink.MAV_BATTERY_CHARGE_STATE_CRITICAL: "battery critically low",
    mavlink.MAV_BATTERY_CHARGE_STATE_EMERGENCY: "battery empty",
    mavlink.MAV_BATTERY_CHARGE_STATE_FAILED: "battery failed",
    mavlink.MAV_BATTERY_CHARGE_STATE_UNHEALTHY: "battery unhealthy",
}
STATES = {
    mavlink.MAV_STATE_CRITICAL: "failsafe",
    mavlink.MAV_STATE_EMERGENCY: "emergency",
    mavlink.MAV_STATE_FLIGHT_TERMINATION: "flight termination",
}

Find = Callable[[int], tuple[FrameTable, Array] | None]
"""Message id -> its frames and their times since the beginning; None without any."""


def faults(find: Find) -> tuple[ReportedFault, ...]:
    """State of the system and of the battery, as they begin and end."""
    found = [
        *_states(find, HEARTBEAT, "system_status", "failsafe", STATES),
        *_states(find, mavlink.MAVLINK_MSG_ID_BATTERY_STATUS, "charge_state", "battery", CHARGES),
    ]
    return tuple(sorted(found, key=lambda fault: fault.t_s))


def _states(
    find: Find, message_id: int, column: str, subsystem: str, texts: Mapping[int, str]
) -> list[ReportedFault]:
    own = find(message_id)
    if own is None:
        return []
    table, t_s = own
    states = table.fields[column].astype(np.int64)
    if message_id != HEARTBEAT:  # of the first battery
        t_s, states = t_s[table.fields["id"] == 0], states[table.fields["id"] == 0]
    bad = np.where(np.isin(states, list(texts)), states, 0)
    return [
        ReportedFault(
            float(t_s[place]),
            subsystem,
            int(bad[place]),
            texts.get(int(bad[place]), f"{subsystem}: over"),
        )
        for place in np.flatnonzero(np.diff(bad, prepend=0))
    ]
