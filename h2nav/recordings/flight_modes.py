"""The names of flight modes.

They are pymavlink's, whose module of them takes as long to load as a tenth of a short review: it
brings another dialect, a parser of XML and a terminal. A test holds both to each other.
"""

from pymavlink.dialects.v20 import ardupilotmega as mavlink

# ArduPilot's, by number.
COPTER = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    5: "LOITER",
    6: "RTL",
    7: "CIRCLE",
    8: "POSITION",
    9: "LAND",
    10: "OF_LOITER",
    11: "DRIFT",
    13: "SPORT",
    14: "FLIP",
    15: "AUTOTUNE",
    16: "POSHOLD",
    17: "BRAKE",
    18: "THROW",
    19: "AVOID_ADSB",
    20: "GUIDED_NOGPS",
    21: "SMART_RTL",
    22: "FLOWHOLD",
    23: "FOLLOW",
    24: "ZIGZAG",
    25: "SYSTEMID",
    26: "AUTOROTATE",
    27: "AUTO_RTL",
    28: "TURTLE",
    29: "RATE_ACRO",
}
PLANE = {
    0: "MANUAL",
    1: "CIRCLE",
    2: "STABILIZE",
    3: "TRAINING",
    4: "ACRO",
    5: "FBWA",
    6: "FBWB",
    7: "CRUISE",
    8: "AUTOTUNE",
    10: "AUTO",
    11: "RTL",
    12: "LOITER",
    13: "TAKEOFF",
    14: "AVOID_ADSB",
    15: "GUIDED",
    16: "INITIALISING",
    17: "QSTABILIZE",
    18: "QHOVER",
    19: "QLOITER",
    20: "QLAND",
    21: "QRTL",
    22: "QAUTOTUNE",
    23: "QACRO",
    24: "THERMAL",
    25: "LOITERALTQLAND",
    26: "AUTOLAND",
}
ROVER = {
    0: "MANUAL",
    1: "ACRO",
    2: "LEARNING",
    3: "STEERING",
    4: "HOLD",
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    10: "AUTO",
    11: "RTL",
    12: "SMART_RTL",
    15: "GUIDED",
    16: "INITIALISING",
}
SUB = {
    0: "STABILIZE",
    1: "ACRO",
    2: "ALT_HOLD",
    3: "AUTO",
    4: "GUIDED",
    7: "CIRCLE",
    9: "SURFACE",
    16: "POSHOLD",
    19: "MANUAL",
}
TRACKER = {
    0: "MANUAL",
    1: "STOP",
    2: "SCAN",
    4: "GUIDED",
    10: "AUTO",
    16: "INITIALISING",
}
BLIMP = {
    0: "LAND",
    1: "MANUAL",
    2: "VELOCITY",
    3: "LOITER",
    4: "RTL",
    5: "AUTO",
    6: "HOLD",
}
_OF_TYPES = {
    mavlink.MAV_TYPE_HELICOPTER: COPTER,
    mavlink.MAV_TYPE_TRICOPTER: COPTER,
    mavlink.MAV_TYPE_QUADROTOR: COPTER,
    mavlink.MAV_TYPE_HEXAROTOR: COPTER,
    mavlink.MAV_TYPE_OCTOROTOR: COPTER,
    mavlink.MAV_TYPE_DECAROTOR: COPTER,
    mavlink.MAV_TYPE_DODECAROTOR: COPTER,
    mavlink.MAV_TYPE_COAXIAL: COPTER,
    mavlink.MAV_TYPE_FIXED_WING: PLANE,
    mavlink.MAV_TYPE_VTOL_TILTROTOR: PLANE,
    mavlink.MAV_TYPE_VTOL_DUOROTOR: PLANE,
    mavlink.MAV_TYPE_VTOL_QUADROTOR: PLANE,
    mavlink.MAV_TYPE_GROUND_ROVER: ROVER,
    mavlink.MAV_TYPE_SURFACE_BOAT: ROVER,
    mavlink.MAV_TYPE_SUBMARINE: SUB,
    mavlink.MAV_TYPE_ANTENNA_TRACKER: TRACKER,
    mavlink.MAV_TYPE_AIRSHIP: BLIMP,
}
# PX4's, by the main mode; of the main mode 4 by the sub-mode.
_PX4 = {
    1: "MANUAL",
    2: "ALTCTL",
    3: "POSCTL",
    5: "ACRO",
    6: "OFFBOARD",
    7: "STABILIZED",
    8: "RATTITUDE",
}
_PX4_AUTO = 4
_PX4_SUB = {
    2: "TAKEOFF",
    3: "LOITER",
    4: "MISSION",
    5: "RTL",
    6: "LAND",
    7: "RTGS",
    8: "FOLLOWME",
}


def of_vehicle(vehicle_type: int) -> dict[int, str]:
    """ArduPilot's modes of a MAV_TYPE; none if it is unknown."""
    return _OF_TYPES.get(vehicle_type, {})


def px4_mode(_base: int, custom: int) -> str:
    """The name of PX4's mode, by the fields of a heartbeat."""
    main, sub = custom >> 16 & 0xFF, custom >> 24 & 0xFF
    if main == _PX4_AUTO:
        return _PX4_SUB.get(sub, "UNKNOWN")
    return _PX4.get(main, "UNKNOWN")
