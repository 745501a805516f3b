"""The autopilot's parameters for people, those that affect the attitude first."""

import math
from collections.abc import Mapping

import numpy as np

# Parameters of sensors, estimators, mounting and frame, by prefix of their names.
# Sources: the parameter references of ArduPilot and PX4.
_OF_ATTITUDE = (
    # ArduPilot
    "AHRS_", "EK2_", "EK3_", "INS_", "COMPASS_", "GPS_", "GPS1_", "GPS2_", "FRAME_", "ARMING_CHECK",
    # PX4
    "EKF2_", "ATT_", "IMU_", "CAL_", "SENS_", "SYS_HAS_", "SYS_MC_EST",
)  # fmt: skip
# An autopilot has some 1,500; a damaged recording may name any number.
_MAX = 4000
# A damaged one may hold any number, and larger integers are not exact.
MAX_INTEGER = 2**53

Value = int | float | None


def matters_for_attitude(name: str) -> bool:
    """Whether sensors, estimators or their mounting depend on a parameter."""
    return name.startswith(_OF_ATTITUDE)


def in_order(parameters: Mapping[str, float]) -> dict[str, Value]:
    """Those that affect the attitude, then the others, both by name; at most some thousands."""
    names = sorted(parameters, key=lambda name: (not matters_for_attitude(name), name))
    return {name: _as_set(parameters[name]) for name in names[:_MAX]}


def _as_set(value: float) -> Value:
    """Autopilots hold integers and float32: shows no more digits than that. None if not finite."""
    if not math.isfinite(value):
        return None
    if value == int(value) and abs(value) < MAX_INTEGER:
        return int(value)
    with np.errstate(over="ignore"):
        shown = float(str(np.float32(value)))
    return shown if math.isfinite(shown) else None
