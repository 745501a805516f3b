"""Meaning of the numbers in ArduPilot's ERR messages.

Source: `LogErrorSubsystem` and `LogErrorCode` of AP_Logger.h, the same since 2013.
"""

SUBSYSTEMS = {
    2: "radio",
    3: "compass",
    4: "optical flow",
    5: "radio failsafe",
    6: "battery failsafe",
    7: "GPS failsafe",
    8: "ground station failsafe",
    9: "fence",
    10: "flight mode",
    11: "GPS",
    12: "crash check",
    13: "flip",
    15: "parachute",
    16: "EKF check",
    17: "EKF failsafe",
    18: "barometer",
    19: "CPU",
    20: "ADSB failsafe",
    21: "terrain",
    22: "navigation",
    23: "terrain failsafe",
    24: "EKF primary changed",
    25: "thrust loss check",
    26: "sensor failsafe",
    27: "leak failsafe",
    28: "pilot's input",
    29: "vibration failsafe",
    30: "internal error",
    31: "dead reckoning failsafe",
}
# Numbers with a well-known meaning of their own in their subsystem.
SAYINGS = {
    (2, 2): "radio frame late",
    (3, 1): "compass failed to start",
    (3, 4): "compass unhealthy",
    (11, 2): "GPS glitch",
    (11, 4): "GPS unhealthy",
    (12, 1): "crash detected",
    (12, 2): "loss of control",
    (13, 2): "flip abandoned",
    (16, 2): "EKF variance",
    (18, 2): "barometer glitch",
    (18, 4): "barometer unhealthy",
}
# Values of `h2nav.recordings.context.SUBSYSTEMS`.
CONCERNED = {
    2: "radio",
    3: "compass",
    5: "radio",
    6: "battery",
    7: "gps",
    8: "ground_station",
    9: "fence",
    10: "flight_mode",
    11: "gps",
    12: "crash_check",
    16: "ekf",
    17: "ekf",
    18: "barometer",
    21: "terrain",
    23: "terrain",
    24: "ekf",
    25: "thrust_loss",
    26: "failsafe",
    29: "vibration",
    31: "gps",
}
RESOLVED = 0
# The code is a flight mode, or the number of a core.
NUMBERED = (10, 24)


def said_of_error(subsystem: int, code: int) -> str:
    """One line; empty if it is no error."""
    name = SUBSYSTEMS.get(subsystem)
    if name is None:
        return ""
    if subsystem in NUMBERED:
        return f"{name}: {code}"
    if code == RESOLVED:
        return f"{name}: over"
    return SAYINGS.get((subsystem, code), f"{name}: {code}" if code > 1 else name)


def subsystem_of(subsystem: int) -> str:
    """The subsystem of a number."""
    return CONCERNED.get(subsystem, "other")
