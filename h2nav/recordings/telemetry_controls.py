"""Vehicle and control in telemetry: demands, outputs, height, supply, faults.

Sources: the MAVLink common and ardupilotmega message definitions.
"""

from collections.abc import Callable, Mapping

import numpy as np
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from h2nav.maths.units import DEG
from h2nav.recordings.context import (
    Array,
    Battery,
    Esc,
    Motors,
    ReportedFault,
    Series,
    VibrationTrack,
)
from h2nav.recordings.frame_tables import FrameTable
from h2nav.recordings.motor_outputs import (
    ardupilot_channels,
    ardupilot_range,
    motors_of,
    px4_channels,
)
from h2nav.recordings.rotations import are_units, roll_pitch_heading

HEARTBEAT = mavlink.MAVLINK_MSG_ID_HEARTBEAT
ESC_GROUPS = (
    mavlink.MAVLINK_MSG_ID_ESC_TELEMETRY_1_TO_4,
    mavlink.MAVLINK_MSG_ID_ESC_TELEMETRY_5_TO_8,
    mavlink.MAVLINK_MSG_ID_ESC_TELEMETRY_9_TO_12,
)
ESCS_TOGETHER = 4
MESSAGE_IDS = frozenset(
    {
        HEARTBEAT,
        mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET,
        mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT,
        mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW,
        mavlink.MAVLINK_MSG_ID_VFR_HUD,
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS,
        mavlink.MAVLINK_MSG_ID_BATTERY_STATUS,
        mavlink.MAVLINK_MSG_ID_POWER_STATUS,
        mavlink.MAVLINK_MSG_ID_VIBRATION,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE,
        *ESC_GROUPS,
    }
)
MILLI, CENTI = 1e-3, 1e-2
UNKNOWN_VOLTS = 65.535
# ATTITUDE_TARGET.type_mask: what is to be ignored.
NO_RATES, NO_ATTITUDE = 0b111, 0b1000_0000
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


def demand(find: Find) -> Series | None:
    """Demanded roll, pitch and heading."""
    found = find(mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET)
    if found is not None:
        table, t_s = found
        q = table.fields["q"].astype(np.float64)
        good = (table.fields["type_mask"] & NO_ATTITUDE) == 0
        good &= are_units(q)
        if good.any():
            return Series(t_s[good], roll_pitch_heading(q[good]))
    found = find(mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT)
    if found is None:
        return None
    table, t_s = found
    values = np.full((len(t_s), 3), np.nan)
    for column, name in enumerate(("nav_roll", "nav_pitch")):
        values[:, column] = table.fields[name] * DEG
    # An autopilot that does not fill the message sends zeros throughout.
    return Series(t_s, values) if np.nan_to_num(values).any() else None


def demanded_rates(find: Find) -> Series | None:
    """Demanded body rates."""
    found = find(mavlink.MAVLINK_MSG_ID_ATTITUDE_TARGET)
    if found is None:
        return None
    table, t_s = found
    good = (table.fields["type_mask"] & NO_RATES) == 0
    names = ("body_roll_rate", "body_pitch_rate", "body_yaw_rate")
    values = np.stack([table.fields[name].astype(np.float64) for name in names], axis=1)
    good &= np.isfinite(values).all(axis=1)
    return Series(t_s[good], values[good]) if good.any() else None


def motors(
    find: Find, parameters: Mapping[str, float], autopilot: int, vehicle_type: int
) -> Motors | None:
    """Outputs to the motors of a multirotor."""
    found = find(mavlink.MAVLINK_MSG_ID_SERVO_OUTPUT_RAW)
    if found is None:
        return None
    table, t_s = found
    first = table.fields["port"] == 0
    fields, t_s = table.fields[first], t_s[first]
    names = (name for name in fields.dtype.names or () if name.endswith("_raw"))
    outputs = np.stack([fields[name].astype(np.float64) for name in names], axis=1)
    if autopilot == mavlink.MAV_AUTOPILOT_PX4:
        return motors_of(px4_channels(parameters, vehicle_type), t_s, outputs, (1000.0, 2000.0))
    channels = ardupilot_channels(parameters, vehicle_type, outputs)
    return motors_of(channels, t_s, outputs, ardupilot_range(parameters))


def height(find: Find) -> Series | None:
    """Height above the start by the position, otherwise above mean sea level."""
    found = find(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
    if found is not None:
        return Series(found[1], found[0].fields["relative_alt"] * MILLI)
    found = find(mavlink.MAVLINK_MSG_ID_VFR_HUD)
    return (
        None
        if found is None
        else Series.finite(found[1], found[0].fields["alt"].astype(np.float64))
    )


def climb(find: Find) -> Series | None:
    """Positive up."""
    found = find(mavlink.MAVLINK_MSG_ID_VFR_HUD)
    return (
        None
        if found is None
        else Series.finite(found[1], found[0].fields["climb"].astype(np.float64))
    )


def batteries(find: Find) -> tuple[Battery, ...]:
    """The first battery, from the system status."""
    found = find(mavlink.MAVLINK_MSG_ID_SYS_STATUS)
    if found is None:
        return ()
    table, t_s = found
    volts = table.fields["voltage_battery"] * MILLI
    volts = np.where((volts > 0.0) & (volts < UNKNOWN_VOLTS), volts, np.nan)
    if not np.isfinite(volts).any():
        return ()
    current = table.fields["current_battery"] * CENTI
    remaining = table.fields["battery_remaining"] * CENTI
    columns = (np.where(values < 0.0, np.nan, values) for values in (current, remaining))
    return (Battery(0, t_s, volts, *columns),)


def board(find: Find) -> Series | None:
    """Supply of the autopilot."""
    found = find(mavlink.MAVLINK_MSG_ID_POWER_STATUS)
    if found is None or not found[0].fields["Vcc"].any():
        return None
    return Series(found[1], found[0].fields["Vcc"] * MILLI)


def vibrations(find: Find) -> tuple[VibrationTrack, ...]:
    """The vibration of one IMU, and the clips of three."""
    found = find(mavlink.MAVLINK_MSG_ID_VIBRATION)
    if found is None:
        return ()
    fields, t_s = found[0].fields, found[1]
    names = ("vibration_x", "vibration_y", "vibration_z")
    level = np.stack([fields[name].astype(np.float64) for name in names], axis=1)
    unknown = np.full_like(level, np.nan)
    return tuple(
        VibrationTrack(i, t_s, unknown if i else level, fields[f"clipping_{i}"].astype(float))
        for i in range(3)
    )


def escs(find: Find) -> tuple[Esc, ...]:
    """Telemetry of the motors' controllers."""
    found = []
    for group, message_id in enumerate(ESC_GROUPS):
        own = find(message_id)
        if own is None:
            continue
        fields, t_s = own[0].fields, own[1]
        for place in range(ESCS_TOGETHER):
            rpm = fields["rpm"][:, place].astype(np.float64)
            if rpm.any():
                current = fields["current"][:, place] * CENTI
                warmth = fields["temperature"][:, place].astype(np.float64)
                found.append(Esc(ESCS_TOGETHER * group + place + 1, t_s, rpm, current, warmth))
    return tuple(found)


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


def airborne(find: Find) -> Series | None:
    """1 while it is off the ground."""
    found = find(mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE)
    if found is None:
        return None
    states = found[0].fields["landed_state"]
    known = states != mavlink.MAV_LANDED_STATE_UNDEFINED
    if not known.any():
        return None
    flies = states[known] != mavlink.MAV_LANDED_STATE_ON_GROUND
    return Series(found[1][known], flies.astype(np.float64))
