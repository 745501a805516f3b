"""Detects frozen sensors: an IMU, a gyro, an accelerometer, an axis, a compass.

Each is judged against its neighbours: an axis against the other two, a gyro against the
accelerometer and vice versa. An IMU that repeats all its values has none.
"""

import math

from .memory import FORCE_FROZEN, GYRO_FROZEN, STUCK_AXIS, UNSEEN_TURN, Memory, Sample
from .repeats import (
    COMPASS,
    FORCE,
    GYRO,
    IMU,
    OF_COMPASS,
    SENSOR_DISPERSION,
    evidence,
    repeats,
)

# Less may be the bias of a gyro at rest.
TURNING_RAD_S = 0.05
# Over which a usual change is taken.
USUAL_US = 1e6
LARGEST_SHARE = 0.2
COMPASS_US = 1e6
# Evidence from which repeated rates may be false: odds of 1000 to 1.
SUSPICIOUS = 7.0
# The turn after which a field must have changed.
TURNED_FIELD_RAD = 0.5
# A sensor whose values have never changed has no experience. Its noise is at least its own
# resolution, but may be below that of a message of integers.
NEVER_US = 3e6
COMPASS_NEVER_US = 10e6
GYRO_COUNT_RAD_S = 1e-3
FORCE_COUNT_M_S2 = 9.80665e-3
# Added to a number of counts and subtracted again, it rounds to the nearest whole number.
ROUNDER = 6755399441055744.0


def standstill(s: Memory, sample: Sample) -> int:
    """Takes the values of a sample; returns bits."""
    s.turning = 0.0
    for i in range(3):
        s.change[i] = math.fabs(sample.gyro[i] - s.values[i])
        s.change[3 + i] = math.fabs(sample.accel[i] - s.values[3 + i])
        s.values[i] = sample.gyro[i]
        s.values[3 + i] = sample.accel[i]
        if math.fabs(sample.gyro[i]) >= TURNING_RAD_S:
            s.turning = 1.0
    if s.has_begun <= 0.0:
        return 0
    learn_count(s, 0)
    learn_count(s, 1)
    gyro = sum_of(s.change, 0)
    force = sum_of(s.change, 3)
    bits = judge_sensors(s, gyro, force) | never_changed(s)
    if gyro <= 0.0 and bits & GYRO_FROZEN == 0:
        bits = bits | unseen_turn(s, force)
    # If a whole sensor repeats its values, no axis of it is reported.
    if gyro > 0.0:
        bits = bits | STUCK_AXIS * stuck_axis(s, 0)
    if force > 0.0 and bits < STUCK_AXIS:
        bits = bits | STUCK_AXIS * stuck_axis(s, 3)
    share = s.step_us / USUAL_US
    if share > LARGEST_SHARE:
        share = LARGEST_SHARE
    for i in range(6):
        s.usual[i] = s.usual[i] + share * (s.change[i] - s.usual[i])
    return bits


def learn_count(s: Memory, sensor: int) -> None:
    """Learns the resolution of a sensor: the smallest difference of its values so far."""
    for i in range(3):
        change = s.change[3 * sensor + i]
        if change > 0.0 and (s.count[sensor] <= 0.0 or change < s.count[sensor]):
            s.count[sensor] = change


def judge_sensors(s: Memory, gyro: float, force: float) -> int:
    """Judges the IMU, its gyro and its accelerometer by the sums of their changes; returns bits."""
    usual_gyro = sum_of(s.usual, 0)
    usual_force = sum_of(s.usual, 3)
    gyro_counts = counts_of(s, 0, usual_gyro)
    force_counts = counts_of(s, 1, usual_force)
    gyro_same = 0
    force_same = 0
    if gyro <= 0.0:
        gyro_same = 1
        s.still_us[0] = s.still_us[0] + s.step_us
    else:
        s.still_us[0] = 0.0
        s.jump = gyro
    if force <= 0.0:
        force_same = 1
        s.still_us[1] = s.still_us[1] + s.step_us
    else:
        s.still_us[1] = 0.0
    both_same = gyro_same * force_same
    bits = (GYRO_FROZEN | FORCE_FROZEN) * repeats(s, IMU, both_same, gyro_counts, 0.0, 0.0)
    if both_same == 1:
        # Neither is evidence on the other meanwhile: earlier verdicts stand.
        bits = bits | GYRO_FROZEN * is_accused(s, GYRO)
        return bits | FORCE_FROZEN * is_accused(s, FORCE)
    bits = GYRO_FROZEN * repeats(s, GYRO, gyro_same, gyro_counts, usual_force, force)
    return bits | FORCE_FROZEN * repeats(s, FORCE, force_same, force_counts, usual_gyro, gyro)


def unseen_turn(s: Memory, force: float) -> int:
    """Computes the turn that a gyro has missed if the rates that it repeats are false; its bit.

    The vehicle may turn on as before the jump to these rates.
    """
    channel = GYRO
    if force <= 0.0:
        channel = IMU
    if evidence(s, channel) < SUSPICIOUS:
        return 0
    s.unseen_rad = 1e-6 * s.still_us[0] * s.jump
    return UNSEEN_TURN


def never_changed(s: Memory) -> int:
    """Bits of a sensor whose values have never changed, although its message resolves its noise."""
    if s.count[0] <= 0.0 and s.still_us[0] > NEVER_US and is_fine(s, 3, FORCE_COUNT_M_S2) == 1:
        return GYRO_FROZEN
    if s.count[1] <= 0.0 and s.still_us[1] > NEVER_US and is_fine(s, 0, GYRO_COUNT_RAD_S) == 1:
        return FORCE_FROZEN
    return 0


def is_fine(s: Memory, first: int, count: float) -> int:
    """Returns 1 if the values are not whole counts, so that their message resolves any noise."""
    for i in range(3):
        counts = s.values[first + i] / count
        if math.fabs(counts - ((counts + ROUNDER) - ROUNDER)) > 1e-3:
            return 1
    return 0


def is_accused(s: Memory, channel: int) -> int:
    """Returns 1 if the values of a channel have repeated too often."""
    if s.accused[channel] > 0.0:
        return 1
    return 0


def counts_of(s: Memory, sensor: int, usual: float) -> float:
    """A change in counts of the sensor's resolution; 0 while that is unknown."""
    if s.count[sensor] <= 0.0:
        return 0.0
    return usual / s.count[sensor]


def stuck_axis(s: Memory, first: int) -> int:
    """Number of the stuck axis, from 1, of the sensor whose axes begin here; 0 for none."""
    usual = sum_of(s.usual, first)
    moved = sum_of(s.change, first)
    found = 0
    for i in range(3):
        axis = first + i
        same = 0
        if s.change[axis] <= 0.0:
            same = 1
        if repeats(s, axis, same, 0.0, usual - s.usual[axis], moved - s.change[axis]) == 1:
            found = axis + 1
    return found


def field_is_frozen(s: Memory, field: list[float], has_field: float) -> int:
    """Returns 1 if the compass is frozen, by its latest field; the caller counts the turns."""
    s.field_still_us = s.field_still_us + s.step_us
    if has_field <= 0.0:
        if s.field_frozen > 0.0:
            return 1
        return 0
    same = 1
    for i in range(3):
        if field[i] != s.field[i]:
            same = 0
        s.field[i] = field[i]
    if same == 0:
        s.field_still_us = 0.0
        s.field_turned_rad = 0.0
    too_long = repeats(s, COMPASS, same, 0.0, 0.0, 0.0)
    if s.field_turned_rad <= TURNED_FIELD_RAD:
        return 0
    if s.seen[OF_COMPASS] + s.seen[OF_COMPASS + 1] <= SENSOR_DISPERSION:
        if s.field_still_us > COMPASS_NEVER_US:
            return 1
        return 0
    if s.field_still_us > COMPASS_US:
        return too_long
    return 0


def sum_of(values: list[float], first: int) -> float:
    """Sum of three numbers."""
    return values[first] + values[first + 1] + values[first + 2]
