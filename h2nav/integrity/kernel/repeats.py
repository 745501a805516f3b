"""Detects values repeated more often than a healthy sensor repeats them.

How often a healthy sensor repeats its values depends on its noise, its resolution, its rate and its
vehicle, so it is learnt for each: the longest healthy run of a channel, and among how many values.
A run r times as long as the longest one has at most the probability

    (dispersion / seen)^r

if a run is at least as likely to end after each value as before: of all the values seen none began
a run longer than the longest (3 / seen would be the bound of 95 % for independent values;
neighbours are not). On the same condition a run of n values has at most the probability

    (dispersion (1 + runs) / seen)^n

as so many of them began a run at all; the smaller bound applies. A false alarm in 1e9 h at 100 Hz
in any of ten channels has the logarithm -36; `ENOUGH` is a little more. A longest run out of
proportion to the others refutes the condition, so fewer than five times as many are never enough.

Noise at rest is not noise in motion, so a run is compared with the longest one at rest: if it is
far longer than that, nothing else has to be known. While the vehicle turns, only runs count that
came while it turned and the sensor changed as much as just before this one. Whatever calms a sensor
calms its neighbour, so the neighbour has to move as it did before. If none of this decides, as with
counts larger than all noise, the sensor is not accused. Nor is an axis while the others change by
hardly a count, as those of a vehicle at rest do whose values are near the border of two counts.
"""

import math

from .memory import Memory

FORCE_AXES = 3
AXES = 6
GYRO = 6
FORCE = 7
IMU = 8
COMPASS = 9
CHANNELS = 10
# The experience of a sensor: one at rest and four in motion; of the compass: one of each.
OF_SENSOR = 5
OF_COMPASS = 21
# Bounds between experiences: usual jump of a value, in counts.
LIVELY_COUNTS = 0.5
LOUD_COUNTS = 2.0
WILD_COUNTS = 8.0
ENOUGH = 40.0
SENSOR_DISPERSION = 30.0
# How one axis moves relative to the others depends on the manoeuvre, which lasts.
AXIS_DISPERSION = 100.0
# A vehicle changes: the number of values, and of runs among them, counts no further.
MAX_SEEN = 1e6
# Of a run to the longest one.
MIN_RATIO = 5.0
# Of what the neighbour moved before.
ALIVE = 0.5
SENSOR_US = 80e3
# An axis at the end of its range stays there for as long as the motion is beyond it.
AXIS_US = 1e6


def repeats(s: Memory, channel: int, same: int, counts: float, around: float, moved: float) -> int:
    """Takes the values of a channel; returns 1 if they repeat as healthy ones do not.

    Args:
        s: changed; its `turning` and `step_us` are those of this sample.
        channel: an axis, or one of the sensors above.
        same: 1 where the values are those of the sample before.
        counts: by how many counts they usually change.
        around: by how much the neighbour usually moves from one sample to the next.
        moved: by how much it has moved now.
    """
    turning = s.turning
    if channel < AXES:
        turning = 0.0
    if same == 0:
        end_run(s, channel)
        at = place(channel, turning, counts)
        if s.seen[at] < MAX_SEEN:
            s.seen[at] = s.seen[at] + 1.0
        return 0
    if s.accused[channel] > 0.0:
        return 1
    if s.run[channel] > 0.0 and s.run_turning[channel] < turning:
        end_run(s, channel)
    if s.run[channel] <= 0.0:
        s.run_turning[channel] = turning
        s.run_counts[channel] = counts
        s.run_around[channel] = around
    elif s.run_turning[channel] > turning:
        return 0
    s.run[channel] = s.run[channel] + 1.0
    s.run_us[channel] = s.run_us[channel] + s.step_us
    s.run_moved[channel] = s.run_moved[channel] + moved
    if is_too_long(s, channel) == 1:
        s.accused[channel] = 1.0
        return 1
    return 0


def end_run(s: Memory, channel: int) -> None:
    """Remembers a healthy run; a run of the whole IMU counts for each sensor."""
    if s.run[channel] <= 0.0:
        return
    if s.accused[channel] <= 0.0:
        remember(s, channel, channel)
        if channel == IMU:
            remember(s, IMU, GYRO)
            remember(s, IMU, FORCE)
    s.run[channel] = 0.0
    s.run_us[channel] = 0.0
    s.run_moved[channel] = 0.0
    s.accused[channel] = 0.0


def remember(s: Memory, channel: int, of: int) -> None:
    """Adds a run of one channel to the experience of another, or of the same."""
    at = place(of, s.run_turning[channel], s.run_counts[channel])
    if s.seen[at] < MAX_SEEN:
        s.runs[at] = s.runs[at] + 1.0
    if s.run[channel] > s.longest[at]:
        s.longest[at] = s.run[channel]


def forget_runs(s: Memory) -> None:
    """Forgets repetitions before a gap in the samples, but for those of a sensor accused."""
    for channel in range(CHANNELS):
        if s.accused[channel] <= 0.0:
            s.run[channel] = 0.0
            s.run_us[channel] = 0.0
            s.run_moved[channel] = 0.0
    if s.accused[GYRO] + s.accused[IMU] <= 0.0:
        s.still_us[0] = 0.0
    if s.accused[FORCE] + s.accused[IMU] <= 0.0:
        s.still_us[1] = 0.0


def is_too_long(s: Memory, channel: int) -> int:
    """Returns 1 if no healthy run would be so long."""
    least_us = SENSOR_US
    if channel < AXES:
        least_us = AXIS_US
    if s.run_us[channel] < least_us or evidence(s, channel) < ENOUGH:
        return 0
    return 1


def evidence(s: Memory, channel: int) -> float:
    """Logarithm of the odds against a healthy run as long as the present one; 0: unknown."""
    calmest = place(channel, 0.0, 0.0)
    if channel < AXES:
        if moves_on(s, channel) == 0:
            return 0.0
        return evidence_by(s, calmest, s.run[channel], AXIS_DISPERSION)
    at_rest = evidence_by(s, calmest, s.run[channel], SENSOR_DISPERSION)
    if s.run_turning[channel] <= 0.0 or moves_on(s, channel) == 0:
        return at_rest
    at = place(channel, 1.0, s.run_counts[channel])
    in_motion = evidence_by(s, at, s.run[channel], SENSOR_DISPERSION)
    if in_motion > at_rest:
        return in_motion
    return at_rest


def moves_on(s: Memory, channel: int) -> int:
    """Returns 1 if the neighbour moves as it did before the run, by more than it dithers."""
    least = ALIVE * s.run_around[channel]
    if channel < AXES:
        count = s.count[0]
        if channel >= FORCE_AXES:
            count = s.count[1]
        if least < LOUD_COUNTS * count:
            least = LOUD_COUNTS * count
    if s.run_moved[channel] < least * s.run[channel]:
        return 0
    return 1


def evidence_by(s: Memory, at: int, run: float, dispersion: float) -> float:
    """The evidence by the experience at this index."""
    if s.seen[at] <= dispersion:
        return 0.0
    seen = s.seen[at] / dispersion
    longer = s.longest[at] + 1.0
    of_longer = math.log(seen)
    by_values = longer * math.log(seen / (1.0 + s.runs[at]))
    if by_values > of_longer:
        of_longer = by_values
    if of_longer > ENOUGH / MIN_RATIO:
        of_longer = ENOUGH / MIN_RATIO
    return of_longer * run / longer


def place(channel: int, turning: float, counts: float) -> int:
    """Index of the experience that applies."""
    if channel < AXES:
        return channel
    if channel == COMPASS:
        if turning > 0.0:
            return OF_COMPASS + 1
        return OF_COMPASS
    first = AXES + OF_SENSOR * (channel - GYRO)
    if turning <= 0.0:
        return first
    if counts < LIVELY_COUNTS:
        return first + 1
    if counts < LOUD_COUNTS:
        return first + 2
    if counts < WILD_COUNTS:
        return first + 3
    return first + 4
