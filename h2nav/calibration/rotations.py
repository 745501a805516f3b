"""The numbered rotations of sensors in the autopilots.

Source: ArduPilot's AP_Math/rotations.h; PX4's lib/conversion/rotation.h has the same up to 37.
"""

import math

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]

# Roll, pitch, yaw, deg, applied in this order about fixed axes.
ANGLES_DEG: tuple[tuple[float, float, float], ...] = (
    *((0, 0, yaw) for yaw in range(0, 360, 45)),
    *((180, 0, yaw) for yaw in range(0, 180, 45)),
    (0, 180, 0),
    *((180, 0, yaw) for yaw in range(225, 360, 45)),
    *((90, 0, yaw) for yaw in range(0, 180, 45)),
    *((270, 0, yaw) for yaw in range(0, 180, 45)),
    (0, 90, 0),
    (0, 270, 0),
    (0, 180, 90),
    (0, 180, 270),
    (90, 90, 0),
    (180, 90, 0),
    (270, 90, 0),
    (90, 180, 0),
    (270, 180, 0),
    (90, 270, 0),
    (180, 270, 0),
    (270, 270, 0),
    (90, 180, 90),
    (90, 0, 270),
    (90, 68.8, 293.3),
    (0, 315, 0),
    (90, 315, 0),
    (0, 7, 0),
    (45, 0, 0),
    (315, 0, 0),
)
# PX4 ends here, or differs.
PX4_COUNT = 38


def name_of(number: int) -> str:
    """Such as ``roll 180, yaw 90``."""
    turns = zip(("roll", "pitch", "yaw"), ANGLES_DEG[number], strict=True)
    return ", ".join(f"{axis} {angle:g}" for axis, angle in turns if angle) or "none"


def matrix(number: int) -> Matrix:
    """(3, 3) rotation of vectors from the sensor's axes to the board's."""
    roll, pitch, yaw = (math.radians(angle) for angle in ANGLES_DEG[number])
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        (
            (cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy),
            (cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy),
            (-sp, sr * cp, cr * cp),
        )
    )


def is_known(number: float) -> bool:
    """Whether a parameter's value is one of these numbers."""
    return number in range(len(ANGLES_DEG))
