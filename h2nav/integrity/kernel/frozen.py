"""Finds a whole sensor that repeats its values: it is frozen.

A sensor of three axes that gives the same three values again and again is frozen, where its message
has the resolution to show its noise. Floats do in motion: in eight flights no triple came twice; at
rest a gyro's own counts may hide its noise. Integers of 1 mrad/s and 1 mg do not: gyros gave the
same triple for 43 s on the ground, accelerometers for 1.65 s in the air. So integers count as
frozen only beside a sign of motion.
"""

import math

from .memory import Memory

FROZEN_US = 300e3
# Of floats away from rest, which never repeat: so that a fast turn does not go on for long.
FROZEN_FINE_US = 80e3
FINE_REPEATS = 4.0
# Of integers, where only the flight itself is the sign of motion: 1.65 s were seen in a calm hover
# of a simulator.
FROZEN_IN_FLIGHT_US = 3e6
FROZEN_FINE_IN_FLIGHT_US = 1e6
COMPASS_FROZEN_US = 1e6
# Rates below this may be the dead zone of truncated integers.
DEAD_ZONE_RAD_S = 0.02
GYRO_COUNT_RAD_S = 1e-3
FORCE_COUNT_M_S2 = 9.80665e-3
# How far a vehicle has turned, by the gyro, that cannot have kept one force, or one field.
TURNED_FORCE_RAD = 0.1
TURNED_FIELD_RAD = 0.5
MOVED_M_S2 = 1.0
# Added to a number of counts and taken away again, it leaves the nearest whole number.
ROUNDER = 6755399441055744.0


def take_values(
    s: Memory,
    sensor: int,
    values: list[float],
    step_us: float,
    turn: float,
    force: float,
    fly: float,
) -> None:
    """Takes one sensor's values: for how long they have come again, and what happened meanwhile.

    Args:
        s: changed.
        sensor: its number.
        values: of its axes.
        step_us: since the sample before.
        turn: by which the vehicle has turned since then, rad.
        force: size of the specific force, m/s^2.
        fly: 1 where the autopilot says that the vehicle flies.
    """
    first = 3 * sensor
    goes_on = fly * s.flew
    if (
        values[0] == s.values[first]
        and values[1] == s.values[first + 1]
        and values[2] == s.values[first + 2]
    ):
        s.repeats[sensor] = s.repeats[sensor] + 1.0
        s.still_us[sensor] = s.still_us[sensor] + step_us
        s.turned_rad[sensor] = s.turned_rad[sensor] + turn
    else:
        for i in range(3):
            s.values[first + i] = values[i]
        s.repeats[sensor] = 0.0
        s.still_us[sensor] = 0.0
        s.turned_rad[sensor] = turn
        goes_on = 0.0
    if goes_on <= 0.0:
        s.flown_us[sensor] = 0.0
        s.low[sensor] = force
        s.high[sensor] = force
        return
    s.flown_us[sensor] = s.flown_us[sensor] + step_us
    if force < s.low[sensor]:
        s.low[sensor] = force
    if force > s.high[sensor]:
        s.high[sensor] = force


def repeats_fine(s: Memory, sensor: int, count: float) -> int:
    """1: values that show every noise have come some times."""
    if s.repeats[sensor] < FINE_REPEATS or s.still_us[sensor] < FROZEN_FINE_US:
        return 0
    return is_fine(s, sensor, count)


def is_fine(s: Memory, sensor: int, count: float) -> int:
    """1: the values are no whole numbers of counts, so that their message shows every noise."""
    for i in range(3):
        counts = s.values[3 * sensor + i] / count
        if math.fabs(counts - ((counts + ROUNDER) - ROUNDER)) > 1e-3:
            return 1
    return 0


def gyro_is_frozen(s: Memory) -> int:
    """1: the gyro is."""
    if s.repeats[0] <= 0.0:
        return 0  # values that have just come cannot be
    largest = 0.0
    for i in range(3):
        if math.fabs(s.values[i]) > largest:
            largest = math.fabs(s.values[i])
    if largest > DEAD_ZONE_RAD_S:
        if s.still_us[0] >= FROZEN_US:
            return 1
        return repeats_fine(s, 0, GYRO_COUNT_RAD_S)
    if s.high[0] - s.low[0] <= MOVED_M_S2:
        return 0
    # At rest a gyro's own counts may be larger than its noise.
    least_us = FROZEN_IN_FLIGHT_US
    if is_fine(s, 0, GYRO_COUNT_RAD_S) == 1:
        least_us = FROZEN_FINE_IN_FLIGHT_US
    if s.flown_us[0] >= least_us:
        return 1
    return 0


def force_is_frozen(s: Memory) -> int:
    """1: the accelerometer is."""
    if s.repeats[1] <= 0.0:
        return 0
    if s.still_us[1] < FROZEN_US:
        return repeats_fine(s, 1, FORCE_COUNT_M_S2)
    if s.turned_rad[1] > TURNED_FORCE_RAD or s.flown_us[1] >= FROZEN_IN_FLIGHT_US:
        return 1
    return is_fine(s, 1, FORCE_COUNT_M_S2)


def field_is_frozen(s: Memory, field: list[float], has_field: float, step_us: float) -> int:
    """1: the compass is. Turns are counted by the caller."""
    s.field_still_us = s.field_still_us + step_us
    if has_field <= 0.0:
        return 0
    if field[0] != s.field[0] or field[1] != s.field[1] or field[2] != s.field[2]:
        for i in range(3):
            s.field[i] = field[i]
        s.field_still_us = 0.0
        s.field_turned_rad = 0.0
        return 0
    if s.field_still_us > COMPASS_FROZEN_US and s.field_turned_rad > TURNED_FIELD_RAD:
        return 1
    return 0
