"""Finds an axis that repeats its value while the vehicle moves: a sensor that is stuck.

At rest an integer axis repeats its value rightly (ArduPilot's mrad/s read 0 for minutes), so an
axis is called stuck only when the other two axes of its sensor vary clearly meanwhile; and near
zero, where truncation makes a dead zone, only when they vary wildly.
"""

import math

from .memory import Memory

STUCK_US = 1e6
# How far the other two axes must have gone meanwhile, both together.
GYRO_SPAN_RAD_S = 0.3
FORCE_SPAN_M_S2 = 1.0
# Values below this may be the dead zone of truncated integers.
GYRO_ZERO_RAD_S = 0.02
FORCE_ZERO_M_S2 = 0.1
ZERO_FACTOR = 20.0


def stuck_axis(s: Memory, step_us: float, gyro: list[float], accel: list[float]) -> int:
    """Number of an axis that is stuck, from 1; those of the gyro go before; 0 for none."""
    force = stuck_of(s, 1, accel, step_us, FORCE_SPAN_M_S2, FORCE_ZERO_M_S2)
    rate = stuck_of(s, 0, gyro, step_us, GYRO_SPAN_RAD_S, GYRO_ZERO_RAD_S)
    if rate > 0:
        return rate
    return force


def stuck_of(
    s: Memory, sensor: int, values: list[float], step_us: float, span: float, zero: float
) -> int:
    """Number of an axis of one sensor that is stuck, from 1; 0 for none."""
    first = 3 * sensor
    found = 0
    for i in range(3):
        axis = first + i
        if values[i] != s.values[axis]:
            s.run_us[axis] = 0.0
        else:
            moved = 0.0
            for j in range(3):
                other = 3 * axis + j
                if s.run_us[axis] <= 0.0:
                    s.run_low[other] = s.values[first + j]
                    s.run_high[other] = s.values[first + j]
                if values[j] < s.run_low[other]:
                    s.run_low[other] = values[j]
                elif values[j] > s.run_high[other]:
                    s.run_high[other] = values[j]
                moved = moved + (s.run_high[other] - s.run_low[other])
            s.run_us[axis] = s.run_us[axis] + step_us
            least = span
            if math.fabs(values[i]) < zero:
                least = ZERO_FACTOR * span
            if moved > least and s.run_us[axis] >= STUCK_US:
                found = axis + 1
    return found
