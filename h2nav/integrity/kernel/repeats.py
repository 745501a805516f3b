"""Finds values that come again more often than an honest sensor would repeat them.

How often an honest sensor repeats its values depends on its noise, its resolution, its rate and its
vehicle, so it is learnt of each: the longest honest run of a channel, and among how many values. A
run that is r times as long as the longest one has at most the probability

    (dispersion / seen)^r

where a run is at least as likely to end after each value as it was before: of all the values seen
none began one that is longer than the longest (3 / seen would be the bound of 95 % for independent
values; neighbours are not). What must not happen once in 1e9 h at 100 Hz in any of ten channels has
the logarithm -36; `ENOUGH` is a little more.

The noise of a vehicle that stands still is another than that of one in motion. So values are judged
by the longest run at rest: where not even that was long, nothing else has to be known. A vehicle
that turns does not rest: there, runs count that came while it turned and the sensor changed as much
as just before this one. And what calms one sensor calms its neighbour, so the neighbour has to go
on moving as it did before. Where none of this decides, as with counts that are larger than all
noise, the sensor is not accused.
"""

import math

from .memory import Memory

AXES = 6
GYRO = 6
FORCE = 7
IMU = 8
COMPASS = 9
# The experience of a sensor is one at rest and four in motion, that of the compass one of each.
OF_SENSOR = 5
OF_COMPASS = 21
# The usual jump of a value, in counts, from which on the experience is another.
LIVELY_COUNTS = 0.5
LOUD_COUNTS = 2.0
WILD_COUNTS = 8.0
ENOUGH = 40.0
SENSOR_DISPERSION = 30.0
# What one axis does beside the others depends on the manoeuvre, and that lasts.
AXIS_DISPERSION = 100.0
# A vehicle changes: more experience than this is not worth more.
MOST_SEEN = 1e6
# No smaller ratio can be enough.
LEAST_RATIO = 5.0
# Of what the neighbour moved before.
ALIVE = 0.5
SENSOR_US = 80e3
# An axis at the end of its range stays there for as long as the motion is beyond it.
AXIS_US = 1e6


def repeats(s: Memory, channel: int, same: int, counts: float, around: float, moved: float) -> int:
    """Takes the values of a channel; 1 where they come again as honest ones do not.

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
        if s.seen[at] < MOST_SEEN:
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
    """A run that was honest is remembered; one of the whole IMU is one of each sensor."""
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
    """A run of one channel becomes experience of another, or of the same."""
    at = place(of, s.run_turning[channel], s.run_counts[channel])
    if s.run[channel] > s.longest[at]:
        s.longest[at] = s.run[channel]


def is_too_long(s: Memory, channel: int) -> int:
    """1: no honest run would be so long."""
    calmest = place(channel, 0.0, 0.0)
    if channel < AXES:
        if s.run_us[channel] < AXIS_US or moves_on(s, channel) == 0:
            return 0
        return is_rare(s, calmest, s.run[channel], AXIS_DISPERSION)
    if s.run_us[channel] < SENSOR_US:
        return 0
    if is_rare(s, calmest, s.run[channel], SENSOR_DISPERSION) == 1:
        return 1
    if s.run_turning[channel] <= 0.0 or moves_on(s, channel) == 0:
        return 0
    at = place(channel, 1.0, s.run_counts[channel])
    return is_rare(s, at, s.run[channel], SENSOR_DISPERSION)


def moves_on(s: Memory, channel: int) -> int:
    """1: the neighbour moves as it did before the run."""
    if s.run_moved[channel] < ALIVE * s.run[channel] * s.run_around[channel]:
        return 0
    return 1


def is_rare(s: Memory, at: int, run: float, dispersion: float) -> int:
    """1: by the experience that stands here no honest run would be so long."""
    ratio = run / (s.longest[at] + 1.0)
    if ratio < LEAST_RATIO or s.seen[at] <= dispersion:
        return 0
    if ratio * math.log(s.seen[at] / dispersion) < ENOUGH:
        return 0
    return 1


def place(channel: int, turning: float, counts: float) -> int:
    """Where the experience stands by which values are judged."""
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
